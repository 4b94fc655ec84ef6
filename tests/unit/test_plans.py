"""The plan of every denoiser against golden files, so that a change of wiring shows in review.

``make references`` writes the files anew.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from config import Asvgf, Config, Display, Firefly, Svgf, Taa, load
from gl.pipelines import DENOISERS, FrameTraits, build
from gl.plan import Plan, check_no_feedback

PLANS = Path(__file__).parent.parent / "plans"


def svgf(**changes: object) -> Config:
    return Config(svgf=replace(Svgf(), **changes))  # type: ignore[arg-type]


def asvgf(**changes: object) -> Config:
    return Config(asvgf=replace(Asvgf(), **changes))  # type: ignore[arg-type]


GLOSSY = FrameTraits(specular=True)

CASES: dict[str, tuple[Config, str, FrameTraits]] = {
    "none": (Config(), "none", FrameTraits()),
    "reference": (Config(), "reference", FrameTraits()),
    "accumulate": (Config(), "accumulate", FrameTraits()),
    "svgf": (Config(), "svgf", FrameTraits()),
    "svgf_paper": (load(None, ("svgf.preset=paper",)), "svgf", FrameTraits()),
    "svgf_reference": (load(None, ("svgf.preset=reference",)), "svgf", FrameTraits()),
    "svgf_color_clamp": (svgf(color_clamp=True), "svgf", FrameTraits()),
    "firefly_clamp": (Config(firefly=Firefly(mode="clamp")), "none", FrameTraits()),
    "firefly_variance": (Config(firefly=Firefly(mode="variance")), "accumulate", FrameTraits()),
    "svgf_joint": (svgf(separate=False), "svgf", FrameTraits()),
    "svgf_without_temporal": (svgf(temporal=False), "svgf", FrameTraits()),
    "svgf_without_variance": (svgf(variance_guided=False), "svgf", FrameTraits()),
    "svgf_without_either": (svgf(temporal=False, variance_guided=False), "svgf", FrameTraits()),
    "svgf_without_demodulation": (svgf(demodulate=False), "svgf", FrameTraits()),
    "svgf_joint_without_demodulation": (svgf(demodulate=False, separate=False), "svgf", FrameTraits()),
    "svgf_0_iterations": (svgf(iterations=0), "svgf", FrameTraits()),
    "svgf_unfiltered_feedback": (svgf(feedback_level=-1), "svgf", FrameTraits()),
    "svgf_late_feedback": (svgf(feedback_level=2), "svgf", FrameTraits()),
    "svgf_without_taa": (replace(Config(), taa=Taa(enabled=False)), "svgf", FrameTraits()),
    "asvgf": (Config(), "asvgf", FrameTraits()),
    "asvgf_paper": (load(None, ("asvgf.preset=paper",)), "asvgf", FrameTraits()),
    "asvgf_reference": (load(None, ("asvgf.preset=reference",)), "asvgf", FrameTraits()),
    "asvgf_moving": (Config(), "asvgf", FrameTraits(moving=True)),
    "asvgf_unguided": (asvgf(gradient_guided=False, cut="power", color_clamp=True), "asvgf", FrameTraits()),
    "asvgf_without_temporal": (asvgf(temporal=False), "asvgf", FrameTraits()),
    "bmfr": (Config(), "bmfr", FrameTraits()),
    "bmfr_paper": (load(None, ("bmfr.preset=paper",)), "bmfr", FrameTraits()),
    "bmfr_reference": (load(None, ("bmfr.preset=reference",)), "bmfr", FrameTraits()),
    "bmfr_albedo": (load(None, ('bmfr.features="1,albedo,w"',)), "bmfr", FrameTraits()),
    "bmfr_adaptive": (load(None, ("bmfr.adaptive=true",)), "bmfr", FrameTraits()),
    "bmfr_fast_clamp": (load(None, ("bmfr.fast_clamp=true",)), "bmfr", FrameTraits()),
    "svgf_fast_clamp": (svgf(fast_clamp=True), "svgf", FrameTraits()),
    "bmfr_without_temporal": (load(None, ("bmfr.temporal=false",)), "bmfr", FrameTraits()),
    "bmfr_without_fit": (load(None, ("bmfr.fit=false",)), "bmfr", FrameTraits()),
    "bmfr_without_either": (load(None, ("bmfr.temporal=false", "bmfr.fit=false")), "bmfr", FrameTraits()),
    "bmfr_without_demodulation": (load(None, ("bmfr.demodulate=false",)), "bmfr", FrameTraits()),
    "bmfr_moving": (Config(), "bmfr", FrameTraits(moving=True)),
    "bmfr_paper_moving": (load(None, ("bmfr.preset=paper",)), "bmfr", FrameTraits(moving=True)),
    "bmfr_on_hardware": (Config(), "bmfr", FrameTraits(software=False)),
    "none_glossy": (Config(), "none", GLOSSY),
    "accumulate_glossy": (Config(), "accumulate", GLOSSY),
    "svgf_glossy": (Config(), "svgf", GLOSSY),
    "svgf_glossy_joint": (svgf(separate=False), "svgf", GLOSSY),
    "svgf_glossy_without_demodulation": (svgf(demodulate=False), "svgf", GLOSSY),
    "svgf_glossy_joint_without_demodulation": (svgf(demodulate=False, separate=False), "svgf", GLOSSY),
    "asvgf_glossy": (Config(), "asvgf", GLOSSY),
    "asvgf_glossy_joint": (load(None, ("asvgf.separate=false",)), "asvgf", GLOSSY),
    "joint_glossy": (Config(), "joint", GLOSSY),
    "bmfr_glossy": (load(None, ('bmfr.features="1,n,w,roughness"',)), "bmfr", GLOSSY),
    "bmfr_adaptive_glossy": (load(None, ("bmfr.adaptive=true",)), "bmfr", GLOSSY),
    "bmfr_adaptive_glossy_apart": (load(None, ("bmfr.adaptive=true", "bmfr.separate=true")), "bmfr", GLOSSY),
    "bmfr_glossy_apart": (load(None, ("bmfr.separate=true",)), "bmfr", GLOSSY),
    "bmfr_glossy_without_demodulation": (load(None, ("bmfr.demodulate=false",)), "bmfr", GLOSSY),
    "svgf_moving": (Config(), "svgf", FrameTraits(moving=True)),
    "svgf_growing": (svgf(normal_history=128), "svgf", FrameTraits()),
    "svgf_welford": (svgf(variance="welford"), "svgf", FrameTraits()),
    "svgf_welford_mean": (svgf(variance="welford-mean"), "svgf", FrameTraits()),
    "svgf_variance_in_space": (svgf(variance="spatial", separate=False), "svgf", FrameTraits()),
    "svgf_variance_in_space_clamped": (svgf(variance="spatial", color_clamp=True), "svgf", FrameTraits()),
    "svgf_variance_in_both": (svgf(variance="spatial-temporal", separate=False), "svgf", FrameTraits()),
    "svgf_exaggerated": (svgf(variance="exaggerated", separate=False), "svgf", FrameTraits()),
    "gaussian": (Config(), "gaussian", FrameTraits()),
    "gaussian_whole": (load(None, ("gaussian.separable=false",)), "gaussian", FrameTraits()),
    "bilateral": (Config(), "bilateral", FrameTraits()),
    "joint": (Config(), "joint", FrameTraits()),
    "joint_blend_first": (load(None, ("spatial.order=blend-first",)), "joint", FrameTraits()),
    "joint_separable": (Config(), "joint-separable", FrameTraits()),
    "joint_without_temporal": (load(None, ("spatial.temporal=false",)), "joint", FrameTraits()),
    "joint_without_demodulation": (load(None, ("spatial.demodulate=false",)), "joint", FrameTraits()),
    "atrous": (Config(), "atrous", FrameTraits()),
    "atrous_jitter": (Config(), "atrous-jitter", FrameTraits()),
    "guided": (Config(), "guided", FrameTraits()),
    "accumulate_auto_exposure": (Config(display=Display(auto_exposure=True)), "accumulate", FrameTraits()),
    "accumulate_mark_bad": (Config(display=Display(mark_bad="on")), "accumulate", FrameTraits()),
    "accumulate_split": (Config(), "accumulate", FrameTraits()),
    "svgf_split": (Config(display=Display(auto_exposure=True, mark_bad="on")), "svgf", FrameTraits()),
}


def plan_of(case: str) -> Plan:
    config, denoiser, traits = CASES[case]
    return build(config, denoiser, traits, split=case.endswith("_split")).compile()


@pytest.mark.parametrize("case", CASES)
def test_the_plan_is_that_of_the_golden_file(case: str, regenerate: bool) -> None:
    path = PLANS / f"{case}.txt"
    text = plan_of(case).text()
    if regenerate:
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == text


def test_there_is_no_golden_file_without_a_case(regenerate: bool) -> None:
    found = {path.stem for path in PLANS.iterdir()}
    if regenerate:
        for stale in found - CASES.keys():
            (PLANS / f"{stale}.txt").unlink()
    assert {path.name for path in PLANS.iterdir()} == {f"{case}.txt" for case in CASES}


def test_every_denoiser_has_a_case() -> None:
    assert {denoiser for _, denoiser, _ in CASES.values()} == set(DENOISERS)


@pytest.mark.parametrize("case", CASES)
def test_no_pass_writes_what_it_reads(case: str) -> None:
    """Not by handle, and not by the texture object that two handles may share; histories have two halves."""
    plan = plan_of(case)
    check_no_feedback(plan.passes, plan.slot_of)
    for node in plan.passes:
        assert not set(node.reads.values()) & set(node.writes.values())
        read = {plan.slot_of[tex] for tex in node.reads.values() if tex in plan.slot_of}
        written = [plan.slot_of[tex] for tex in node.writes.values() if tex in plan.slot_of]
        assert not read & set(written)
        assert len(set(written)) == len(written)
        imported = {tex.name for tex in plan.imports}
        assert not {tex.name for tex in node.writes.values()} & imported
    feeders = [history.name for history in plan.feeds.values()]
    assert len(set(feeders)) == len(feeders)


@pytest.mark.parametrize("case", CASES)
def test_nothing_is_read_before_it_is_written_or_after_it_is_gone(case: str) -> None:
    """Each slot holds, at each read, what the handle's own pass wrote into it."""
    plan = plan_of(case)
    holds: dict[int, str] = {}
    for node in plan.passes:
        for tex in node.reads.values():
            if tex in plan.slot_of:
                assert holds[plan.slot_of[tex]] == tex.name
        holds |= {plan.slot_of[tex]: tex.name for tex in node.writes.values() if tex in plan.slot_of}
    for tex in plan.outputs.values():
        if tex in plan.slot_of:
            assert holds[plan.slot_of[tex]] == tex.name


def names(case: str) -> list[str]:
    return [node.name for node in plan_of(case).passes]


def test_a_stage_that_is_off_costs_nothing() -> None:
    paper = names("svgf")
    assert sum("atrous" in name for name in paper) == 6
    assert not [name for name in names("svgf_0_iterations") if "atrous" in name]
    assert not [name for name in names("svgf_without_variance") if "variance" in name]
    assert not [name for name in names("svgf_without_temporal") if "accumulate" in name or "reproject" in name]
    assert set(paper) - set(names("svgf_without_taa")) == {"taa"}
    assert len(names("svgf_joint")) < len(paper)
    assert not any(plan_of(case).culled for case in CASES)
    assert plan_of("none").feeds == {}
    assert [history.name for history in plan_of("svgf_without_temporal").feeds.values()] == ["taa.svgf"]


@pytest.mark.parametrize("mode", ["clamp", "variance"])
@pytest.mark.parametrize("denoiser", DENOISERS)
def test_fireflies_are_rejected_before_anything_else(denoiser: str, mode: str) -> None:
    """By every method but the mean of many paths: no pass reads the noisy samples but those that cut them."""
    config = replace(Config(), firefly=Firefly(mode=mode))
    plan = build(config, denoiser, FrameTraits()).compile()
    noisy = {"frame.direct", "frame.indirect"}
    readers = [node.name for node in plan.passes if noisy & {tex.name for tex in node.reads.values()}]
    assert readers == ([] if denoiser == "reference" else ["firefly.direct", "firefly.indirect"])


def test_what_the_display_leaves_out_costs_nothing() -> None:
    def added(case: str) -> set[str]:
        return {name for name in names(case) if name not in names("accumulate")}

    assert added("accumulate_auto_exposure") == {"exposure.log_luminance", "exposure.adapt"}
    assert added("accumulate_mark_bad") == {"mark_bad"}
    assert added("accumulate_split") == {"noisy.modulate", "noisy.tonemap", "noisy.encode"}
    assert plan_of("accumulate").outputs.keys() == {"radiance", "display"}
    assert plan_of("svgf_split").outputs.keys() == {"radiance", "display", "bad", "noisy"}
    small = plan_of("accumulate_auto_exposure").bytes((640, 360)) - plan_of("accumulate").bytes((640, 360))
    assert small == 20 * 12 * 8 + 2 * 4  # sums of tiles, and one texel twice


def test_only_what_is_needed_is_uploaded() -> None:
    def imports(case: str) -> set[str]:
        return {tex.name.removeprefix("frame.") for tex in plan_of(case).imports}

    signals = {"direct", "indirect", "albedo", "emission"}
    assert imports("none") == signals
    assert imports("reference") == {"reference"}
    assert imports("svgf") == signals | {"motion", "surface", "gradient"}
    assert imports("svgf_moving") == imports("svgf") | {"prev_normal"}
    assert imports("svgf_without_either") == imports("svgf")  # TAA still needs the motion
