"""``app.py bench`` from end to end, and the parts that a whole run cannot prove."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench import command, files, memory, methods, report, running, tracing
from bench.cases import FRAMES, SCORED, Case, quality_case, quick_size, tracing_cases
from bench.goals import GOALS
from bench.machine import describe
from bench.methods import METHODS, NOISY, Method
from bench.references import Reference
from bench.results import QualityResult, Report
from bench.running import MethodResult, PassTime
from bench.scores import Score, Truth
from bench.timing import Summary
from config import Config, load
from errors import UserError
from gl.pipelines import DENOISERS
from gl.renderer import Renderer
from raytrace.frame import FramePacket
from raytrace.shot import Shot
from storage import replace_file, require_writable

CONFIG = Config()
MEASURED = tuple(method for method in METHODS if not method.stage and not method.quality)[:9]
SMALL = replace(CONFIG, render=replace(CONFIG.render, width=80, height=45))


@pytest.fixture
def shot() -> Iterator[Shot]:
    shot = Case("cornell", "flight", animate=True).open(SMALL)
    with shot.tracer:
        yield shot


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The JSON of one quick run; the CSV and the page are beside it."""
    folder = tmp_path_factory.mktemp("bench")
    out = folder / "new" / "bench.json"
    command.run(SMALL, ("cornell",), True, out, True, folder / "references", MEASURED)
    assert len(list((folder / "references").iterdir())) == len(SCORED) + 3  # and one for each event
    return json.loads(out.read_text()) | {"folder": out.parent}


def numbers(value: Any) -> Iterator[float]:
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from numbers(item)
    elif isinstance(value, int | float):
        yield value


@pytest.mark.gl
def test_a_quick_run_writes_everything(quick):
    assert {"machine", "config", "quick", "quality", "tracing", "memory", "goals", "seconds"} <= set(quick)
    assert quick["machine"]["renderer"]
    assert quick["config"]["render"]["width"] == 80
    (quality,) = quick["quality"]
    assert [method["name"] for method in quality["methods"]] == [method.name for method in MEASURED]
    assert quality["samples"] == 64
    (traced,) = quick["tracing"]
    assert traced["size"] == [80, 45]
    assert all(math.isfinite(number) for part in ("quality", "tracing") for number in numbers(quick[part]))


@pytest.mark.gl
def test_a_quick_run_measures_every_error(quick):
    (quality,) = quick["quality"]
    by_name = {contender["name"]: contender for contender in quality["contenders"]}
    noisy, filtered = by_name[NOISY.name], by_name[methods.APART.name]
    for error in ("rmse", "relmse", "flip", "temporal"):
        assert 0.0 < filtered["errors"][error] < noisy["errors"][error]
        assert 0.0 < quality["floors"][error] < noisy["errors"][error]
    for error in ("psnr", "ssim"):
        assert noisy["errors"][error] < filtered["errors"][error] < quality["floors"][error]
    assert [frame["frame"] for frame in filtered["errors"]["frames"]] == list(SCORED)
    assert noisy["milliseconds"] > quality["trace"]["median"]


@pytest.mark.gl
def test_path_tracing_gets_the_same_time(quick):
    (quality,) = quick["quality"]
    traced = {row["samples"]: row for row in quality["path_tracing"]}
    errors = [traced[samples]["errors"]["rmse"] for samples in sorted(traced)]
    assert errors == sorted(errors, reverse=True)
    assert traced[1]["errors"]["rmse"] == pytest.approx(quality["methods"][0]["rmse"], rel=0.15)
    most = max(traced)
    # The reference is noisy, too.
    expected = math.hypot(errors[0] / math.sqrt(most), quality["noise"])
    assert traced[most]["errors"]["rmse"] == pytest.approx(expected, rel=0.25)
    for contender in quality["contenders"][1 : len(MEASURED)]:
        equal = traced[contender["equal"]["samples"]]
        spent = contender["filter_milliseconds"] - quality["methods"][0]["milliseconds"]
        assert equal["samples"] == 1 or (equal["samples"] - 1) * quality["sample_milliseconds"] <= spent + 1e-9


@pytest.mark.gl
def test_a_quick_run_has_events(quick):
    events = quick["events"]
    assert set(events["noise"]) == {"cut", "light switched", "disocclusion"}
    found = {method["name"]: method for method in events["methods"]}
    assert found["accumulation"]["flicker"] < 0.5 * found[NOISY.name]["flicker"]
    assert found[NOISY.name]["recovery"]["cut"] <= 1
    after = found["accumulation"]["errors"]["light switched"]
    assert after[0] > 3.0 * after[-1]  # the old light lags
    assert not any("TAA" in name for name in found)


@pytest.mark.gl
def test_a_quick_run_writes_a_table_and_a_page(quick):
    with (quick["folder"] / "bench.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == files.CSV_HEADER
    names = [row["method"] for row in rows]
    assert names[: len(MEASURED)] == [method.name for method in MEASURED]
    assert [float(row["rmse"]) for row in rows[: len(MEASURED)]] == pytest.approx(
        [method["rmse"] for method in quick["quality"][0]["methods"]], rel=1e-5
    )
    assert any(row["front_rmse"] == "1" for row in rows)
    page = (quick["folder"] / "bench.html").read_text()
    assert "SVGF, direct and indirect" in page


@pytest.mark.gl
def test_filters_beat_the_noise_in_a_quick_run(quick):
    found = {method["name"]: method for method in quick["quality"][0]["methods"]}
    noisy, accumulated, filtered = (found[name] for name in (NOISY.name, "accumulation", methods.APART.name))
    assert accumulated["rmse"] < 0.5 * noisy["rmse"]
    assert filtered["rmse"] < 0.5 * noisy["rmse"]
    assert filtered["temporal"] < accumulated["temporal"] < 0.5 * noisy["temporal"]
    assert noisy["rmse_ratio"] == noisy["temporal_ratio"] == 1.0
    assert 0.0 < quick["quality"][0]["noise"] < filtered["rmse"]
    # Anti-aliasing comes after the radiance that is measured.
    assert found[methods.APART_TAA.name]["rmse"] == filtered["rmse"]


@pytest.mark.gl
def test_a_quick_run_times_every_pass(quick):
    for method in quick["quality"][0]["methods"]:
        names = [row["name"] for row in method["passes"]]
        assert names[0] == running.UPLOAD
        assert names[-1] == "encode"
        assert ("taa" in names) == ("TAA" in method["name"])
        assert method["wall"]["count"] == (FRAMES - 4) // 2
        assert 0.0 < method["wall"]["median"] <= method["wall"]["p95"]


@pytest.mark.gl
def test_a_quick_run_counts_the_rays(quick):
    (traced,) = quick["tracing"]
    pixels = 80 * 45
    assert pixels < traced["rays"] <= 4 * pixels
    assert traced["outside"]["count"] == FRAMES - 4
    expected = traced["rays"] / traced["frame"]["median"] / 1e3
    assert traced["mrays_frame"] == pytest.approx(expected, rel=0.5)


def test_recorded_rays_are_those_of_the_frame(shot):
    caster = shot.tracer.rays
    tiles = tracing.record(shot, 5)
    assert shot.tracer.rays is caster
    assert sum(tile[0].rays for tile in tiles) == 80 * 45
    assert all(1 <= len(tile) <= 4 for tile in tiles)
    for tile in tiles:
        hits = tile[0].trace()
        assert isinstance(hits, tuple)
        assert (hits[0] >= 0).any()


def test_recording_changes_no_picture(shot, monkeypatch):
    plain, recorded = shot.frame(5), []
    frame = shot.frame
    monkeypatch.setattr(shot, "frame", lambda index: recorded.append(frame(index)))
    tracing.record(shot, 5)
    np.testing.assert_array_equal(recorded[0].direct, plain.direct)
    np.testing.assert_array_equal(recorded[0].indirect, plain.indirect)


def test_every_recorded_batch_is_traced_alone_once():
    traced: list[int] = []
    tiles = [[tracing.Batch(1, partial(traced.append, 10 * i + j)) for j in range(3)] for i in range(4)]
    assert tracing.trace_alone(tiles, 2) > 0.0
    assert sorted(traced) == sorted(10 * i + j for i in range(4) for j in range(3))


def flat(value: float, index: int = 0, lamp: bool = False) -> FramePacket:
    zero = np.zeros((4, 6, 4), np.float32)
    emission = zero.copy()
    if lamp:
        emission[0] = 50.0
    direct = np.full_like(zero, value)
    return FramePacket(index, 0.0, direct, zero, np.ones_like(zero), emission, zero, zero[..., :2], zero)


def constant_truth(lamp: bool = False) -> tuple[list[FramePacket], Truth]:
    packets = [flat(0.5, index, lamp) for index in range(FRAMES)]
    mean = np.full((4, 6, 3), 0.5)
    references = {index: Reference.empty((6, 4)).plus(mean, 2).plus(mean, 2) for index in SCORED}
    return packets, Truth(packets, references)


def test_scores_pool_frames_and_compare_pairs_only():
    _, truth = constant_truth()
    score = Score(truth)
    for number, index in enumerate(SCORED):
        score.add(index, np.full((4, 6, 3), 0.5 + (0.1 if number % 2 else -0.1), np.float32))
    assert score.rmse() == pytest.approx(0.1)
    assert score.temporal() == pytest.approx(0.6 ** (1 / 2.2) - 0.4 ** (1 / 2.2), rel=1e-5)


def test_scores_leave_lamps_out():
    packets, truth = constant_truth(lamp=True)
    score = Score(truth)
    for index in SCORED:
        image = packets[index].radiance()
        image[0] = 0.0
        score.add(index, image)
    assert score.rmse() == 0.0
    assert score.temporal() == 0.0
    assert truth.noise() == 0.0
    assert truth.samples == 4


def test_methods_measure_the_noisy_frame_as_it_is(ctx):
    """Frames of known error, through GL and back."""
    _, truth = constant_truth()
    packets = [flat(0.75, index) for index in range(FRAMES)]
    (result,) = running.measure(packets, truth, CONFIG, lambda: Renderer(ctx), 2, [NOISY])
    assert result.rmse == pytest.approx(0.25)
    assert result.rmse_ratio == 1.0
    assert result.temporal == 0.0
    assert math.isnan(result.temporal_ratio)
    assert result.wall.count == FRAMES - 4


def test_a_view_without_surfaces_is_one_message():
    packets = [replace(flat(0.5, index), scene="lamps") for index in range(FRAMES)]
    packets[11].emission[:] = 1.0
    with pytest.raises(UserError, match="lamps: frame 11 shows nothing but sky"):
        Truth(packets, {index: Reference.empty((6, 4)).plus(np.ones((4, 6, 3)), 1) for index in SCORED})


def test_memory_is_read_at_both_marks(ctx, shot):
    renderer = Renderer(ctx)
    result = memory.measure(shot, SMALL, renderer, frames=4, first=2)
    renderer.release()
    if memory.resident_megabytes() is None:
        assert result is None
        return
    assert result is not None
    assert (result.first, result.frames) == (2, 4)
    assert 10.0 < result.megabytes_first < 1e5
    assert abs(result.growth) < 100.0


def test_resident_memory_follows_what_is_held():
    before = memory.resident_megabytes()
    if before is None:
        pytest.skip("this system has no /proc")
    held = np.ones(10_000_000)
    grown = memory.resident_megabytes()
    assert grown is not None
    assert grown - before == pytest.approx(held.nbytes / 1e6, rel=0.1)


def method_result(name: str, deviation: float | None = 0.0, ratio: float = 0.05) -> MethodResult:
    wall = Summary(100.0, 120.0, 3)
    passes = (PassTime("upload", 1.5), PassTime("encode", 98.5))
    return MethodResult(name, 100.0, wall, passes, deviation, 0.01, ratio, 0.002, ratio)


def small_report(quick: bool = False, **changes: Any) -> Report:
    noisy, apart = method_result(NOISY.name, ratio=1.0), method_result(methods.APART_TAA.name, **changes)
    quality = QualityResult("cornell", "moving camera", (80, 45), 64, 0.004, 0.001, 3.0, (noisy, apart))
    machine = describe({"GL_RENDERER": "some renderer", "GL_VERSION": "4.5"}, 2)
    grown = memory.MemoryResult("cornell", (160, 90), 200, 1000, 250.0, 256.5)
    return Report(machine, SMALL, quick, (quality,), (), grown, 12.0, 34.0)


def test_goals_stand_beside_what_was_measured_and_are_silent_on_the_rest():
    text = report.goals_table(small_report())
    lines = {line.split("  ")[0]: line.split() for line in text.splitlines()}
    assert lines["SVGF + TAA, direct and indirect"][-5:] == ["100.0", "ms", "190", "ms", "met"]
    assert lines["memory gained over 800 frames"][-5:] == ["6.5", "MB", "5", "MB", "missed"]
    assert lines["cornell: RMSE of SVGF / noisy"][-3:] == ["0.0500", "0.06", "met"]
    assert not any("interior" in name or "one signal" in name for name in lines)


def test_quick_runs_are_not_judged():
    text = report.goals_table(small_report(quick=True))
    assert "100.0 ms" in text
    assert "met" not in text.split()
    assert "missed" not in text.split()


def test_every_goal_reads_a_report_of_both_scenes():
    once = Summary(150.0, 160.0, 3)
    cases = (("cornell", False), ("interior", False), ("interior", True))
    traced = tuple(
        tracing.TracingResult(scene, "", moves, (80, 45), 32, 100, once, once, once, once, 5.0, 6.0, "some")
        for scene, moves in cases
    )
    full = small_report()
    named = (methods.ONE_SIGNAL_TAA, methods.BMFR_TAA, methods.BMFR_PAPER)
    quality = replace(
        full.quality[0], methods=(*full.quality[0].methods, *(method_result(method.name) for method in named))
    )
    full = replace(full, quality=(quality,), tracing=traced)
    assert all(goal.find(full) is not None for goal in GOALS)
    assert report.goals_table(full).count("150.0 ms") == 6


@pytest.mark.parametrize(("deviation", "told"), [(0.09, False), (-0.11, True), (0.2, True), (None, False)])
def test_passes_that_do_not_add_up_are_told(deviation, told):
    text = report.text(small_report(deviation=deviation))
    assert ("add up" in text) == told


def test_the_text_names_machine_memory_and_time():
    text = report.text(small_report())
    for expected in (
        "some renderer",
        "80x45, seed 0",
        "+6.5 MB",
        "measured in 12 s; 34 s more",
        "of the reference (64",
    ):
        assert expected in text


def test_json_has_null_for_what_is_no_number(tmp_path):
    path = tmp_path / "bench.json"
    files.write_json(path, small_report(ratio=math.nan))
    content = json.loads(path.read_text())
    assert content["quality"][0]["methods"][1]["rmse_ratio"] is None
    assert content["quality"][0]["methods"][0]["rmse_ratio"] == 1.0
    goals = {goal["what"]: goal for goal in content["goals"]}
    assert goals["cornell: RMSE of SVGF / noisy"] == {
        "what": "cornell: RMSE of SVGF / noisy", "unit": "", "limit": 0.06, "value": None
    }  # fmt: skip


def test_an_error_while_writing_leaves_the_file_that_was_there(tmp_path):
    path = tmp_path / "some.json"
    path.write_text("old")

    def fails(target: Path) -> None:
        target.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        replace_file(path, fails)
    assert path.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["some.json"]


def test_places_that_cannot_be_written_are_told_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path, tmp_path / "file" / "bench.json"):
        with pytest.raises(UserError):
            require_writable(path)
        with pytest.raises(UserError):
            command.run(SMALL, ("cornell",), True, path, cache=tmp_path / "references")
    require_writable(tmp_path / "new" / "bench.json")
    assert list((tmp_path / "new").iterdir()) == []


def test_an_unknown_scene_is_told(tmp_path):
    with pytest.raises(UserError, match="cornel"):
        command.run(SMALL, ("cornel",), True, tmp_path / "bench.json", cache=tmp_path / "references")


def test_cases_of_scenes_from_files_stand_still():
    assert quality_case("room.glb", quick=False) == Case("room.glb")
    assert tracing_cases("room.glb") == (Case("room.glb"),)


def test_cases_say_what_moves():
    assert Case("a").motion == "nothing moves"
    assert Case("a", "flight").motion == "moving camera"
    assert Case("a", animate=True).label == "a, moving objects"
    assert Case("a", "flight", True).motion == "moving camera and objects"


def test_a_divided_case_is_smaller():
    shot = Case("cornell", divisor=2).open(SMALL)
    with shot.tracer:
        assert shot.size == (40, 22)
        assert shot.frame(0).jitter == (0.0, 0.0)


def test_quick_pictures_are_small():
    assert (quick_size(CONFIG).render.width, quick_size(CONFIG).render.height) == (160, 90)
    assert quick_size(SMALL) == SMALL


def test_summaries_are_medians_and_percentiles():
    assert Summary.of([float(i) for i in range(1, 22)]) == Summary(11.0, 20.0, 21)
    with pytest.raises(ValueError, match="nothing was measured"):
        Summary.of([])


def test_methods_get_the_frames_they_would_get_in_use(ctx, shot, monkeypatch):
    """A-SVGF needs points that the tracer has remembered; nobody else pays for them."""
    (adaptive,) = [method for method in METHODS if method.denoiser == "asvgf"]
    rule = running.remembers(adaptive, CONFIG)
    assert rule
    assert running.remembers(NOISY, CONFIG) == running.remembers(methods.BMFR, CONFIG) == ""
    monkeypatch.setattr(running, "trace", lambda shot: [shot.frame(index) for index in range(3)])
    footage = running.Footage(shot)
    assert all(packet.temporal_gradient is None for packet in footage())
    assert all(packet.temporal_gradient is not None for packet in footage(rule))
    assert footage(rule) is footage(rule)
    assert shot.remember == ""


def test_every_denoiser_is_measured_and_names_are_unique():
    assert {method.denoiser for method in METHODS} - {"oidn"} == set(DENOISERS) - {"reference"}
    names = [method.name for method in METHODS]
    assert len(set(names)) == len(names)
    assert METHODS[0] is NOISY


@pytest.mark.parametrize("method", [method for method in METHODS if method.stage], ids=lambda method: method.name)
def test_a_variant_differs_from_its_method(method):
    """Or it would be measured twice and mean nothing."""
    known = {"bmfr": methods.BMFR, "svgf": methods.ONE_SIGNAL}
    whole = known.get(method.denoiser, Method(method.denoiser, method.denoiser))
    assert method.configure(CONFIG) != whole.configure(CONFIG)


def test_a_method_is_described_as_on_a_command_line():
    described = methods.BMFR_PAPER.described
    assert described == "--denoiser bmfr --set bmfr.preset=paper --set taa.enabled=false"
    assert methods.APART_TAA.described == "--denoiser svgf --set svgf.separate=true"


@pytest.mark.parametrize("separate", [True, False])
def test_methods_change_only_what_is_theirs(separate):
    config = replace(CONFIG, svgf=replace(CONFIG.svgf, iterations=2, separate=separate))
    assert methods.ONE_SIGNAL_TAA.configure(config).svgf == replace(config.svgf, separate=False)
    assert methods.APART.configure(config).svgf == replace(config.svgf, separate=True)
    assert not methods.APART.configure(config).taa.enabled
    assert methods.APART_TAA.configure(config).taa == config.taa
    assert NOISY.configure(config).svgf == config.svgf


def test_a_method_with_a_preset_has_all_of_it_and_nothing_of_the_user_s():
    own = load(None, ["svgf.prefilter=true", "svgf.max_history=20", "svgf.iterations=2", "bmfr.part=0"])
    for denoiser, preset in product(("svgf", "bmfr"), ("paper", "reference")):
        (method,) = [method for method in METHODS if (method.denoiser, method.preset) == (denoiser, preset)]
        expected = load(None, [f"{denoiser}.preset={preset}"])
        assert getattr(method.configure(own), denoiser) == getattr(expected, denoiser)
