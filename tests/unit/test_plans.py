"""The plan of every denoiser against golden files, so that a change of wiring shows in review.

``make references`` writes the files anew.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from config import Config, Svgf, Taa, load
from gl.pipelines import DENOISERS, FrameTraits, build
from gl.plan import Plan, check_no_feedback

PLANS = Path(__file__).parent.parent / "plans"


def svgf(**changes: object) -> Config:
    return Config(svgf=replace(Svgf(), **changes))  # type: ignore[arg-type]


CASES: dict[str, tuple[Config, str, FrameTraits]] = {
    "none": (Config(), "none", FrameTraits()),
    "reference": (Config(), "reference", FrameTraits()),
    "accumulate": (Config(), "accumulate", FrameTraits()),
    "svgf": (Config(), "svgf", FrameTraits()),
    "svgf_paper": (load(None, ("svgf.preset=paper",)), "svgf", FrameTraits()),
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
    "svgf_moving": (Config(), "svgf", FrameTraits(moving=True)),
}


def plan_of(case: str) -> Plan:
    config, denoiser, traits = CASES[case]
    return build(config, denoiser, traits).compile()


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
    assert sum("atrous" in name for name in paper) == 10
    assert not [name for name in names("svgf_0_iterations") if "atrous" in name]
    assert not [name for name in names("svgf_without_variance") if "variance" in name]
    assert not [name for name in names("svgf_without_temporal") if "accumulate" in name or "reproject" in name]
    assert set(paper) - set(names("svgf_without_taa")) == {"taa"}
    assert len(names("svgf_joint")) < len(paper)
    assert not any(plan_of(case).culled for case in CASES)
    assert plan_of("none").feeds == {}
    assert [history.name for history in plan_of("svgf_without_temporal").feeds.values()] == ["taa.svgf"]


def test_only_what_is_needed_is_uploaded() -> None:
    def imports(case: str) -> set[str]:
        return {tex.name.removeprefix("frame.") for tex in plan_of(case).imports}

    signals = {"direct", "indirect", "albedo", "emission"}
    assert imports("none") == signals
    assert imports("reference") == {"reference"}
    assert imports("svgf") == signals | {"motion", "surface", "gradient"}
    assert imports("svgf_moving") == imports("svgf") | {"prev_normal"}
    assert imports("svgf_without_either") == imports("svgf")  # TAA still needs the motion
