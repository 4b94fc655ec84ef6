"""Every hard case is within its bound, and the formula without care is not."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest

import cli
from bench.hard import cases, over_time, variance
from bench.hard.stage import Row, Stage, deviation, recovery, worst
from gl.renderer import Renderer

DOCS = Path(__file__).resolve().parents[2] / "docs" / "hard_cases.md"
FRAMES = 10_000
"""Of the long accumulation where it has to be quick; drift would show after a few times 255."""


@pytest.fixture(scope="module")
def _module_stage(_session_context: moderngl.Context) -> Iterator[Stage]:
    with _session_context:
        renderer = Renderer(_session_context)
        yield Stage(renderer)
        renderer.release()


@pytest.fixture(scope="module")
def rows(_module_stage: Stage, _session_context: moderngl.Context) -> dict[str, list[Row]]:
    """Every group, measured once."""
    with _session_context, pytest.MonkeyPatch.context() as patch:
        patch.setattr(over_time, "MANY", FRAMES)
        return cases.measure(_module_stage.renderer)


@pytest.fixture
def stage(ctx: moderngl.Context, _module_stage: Stage) -> Stage:
    return _module_stage


@pytest.mark.gl
@pytest.mark.parametrize("group", cases.GROUPS)
def test_every_case_is_as_it_should_be(rows: dict[str, list[Row]], group: str) -> None:
    assert rows[group]
    for row in rows[group]:
        assert row.passed, cases.cells(row)


@pytest.mark.gl
def test_nothing_is_left_out(rows: dict[str, list[Row]]) -> None:
    """What has to be there, by a word of its name."""
    names = [row.case for group in rows.values() for row in group]
    wanted = [
        *(
            "variance of 1000 ± 0.1",
            "variance of 10000 ± 1",
            "at 256",
            "constant features",
            "constant normal",
            "of sky",
        ),
        *(
            "half outside",
            "at 1e6",
            "two equal features",
            "equal to 1e-7",
            "radiance 6e4",
            "pixel NaN",
            "pixel infinite",
        ),
        *("albedo 0", "albedo 1e-06", "1e5 on one pixel", "6e4 everywhere", "colour", "normal", "depth gradient"),
        *("motion vector", "histories", "gradient 0", "gradient infinite", "opposite", "horizon", "1e+05", "1e+06"),
        *("1 mm", "1x1", "1x9", "31x33", "4097x3", "first frame", "cut", "another size", "frames of accumulation"),
        *("inside of geometry", "0.0001 sr", "all black", "sky only"),
    ]
    assert [word for word in wanted if not any(word in name for name in names)] == []
    estimators = {row.method for row in rows["variance"] if row.case.startswith("variance of 1000")}
    assert estimators == {f"svgf, {name}" for name in variance.ESTIMATORS}


@pytest.mark.gl
def test_what_takes_no_care_fails(rows: dict[str, list[Row]]) -> None:
    """The formulas that are compared with are computed, and break: no row is easy."""
    for group in ("variance", "light", "not finite"):
        for row in rows[group]:
            assert any(
                word in row.unguarded for word in ("NaN", "infinite", "in single", "in half", "mean of", "texel")
            )
    assert sum("no solution" in row.unguarded for row in rows["regression"]) >= 6
    exact = variance.unguarded(variance.flicker(1000.0, 0.1)[1])
    assert exact > 1.0 * 0.1**2, "no correct digit is left"


@pytest.mark.slow
def test_a_hundred_thousand_frames_do_not_drift(stage: Stage) -> None:
    row = over_time.accumulation(stage, 100_000)
    assert row.passed, cases.cells(row)


@pytest.mark.gl
def test_the_documentation_has_every_case(rows: dict[str, list[Row]]) -> None:
    text = DOCS.read_text(encoding="utf-8")
    names = {row.case.replace(f"{FRAMES:,}", f"{over_time.MANY:,}") for group in rows.values() for row in group}
    assert [name for name in sorted(names) if f"| {name} |" not in text] == []


@pytest.mark.gl
def test_tables_and_json(rows: dict[str, list[Row]]) -> None:
    text = cases.text(rows)
    assert all(group in text for group in rows)
    assert "FAILS" not in text
    loaded = json.loads(json.dumps(cases.as_json(rows)))
    assert len(loaded) == sum(map(len, rows.values()))
    assert all(entry["passed"] for entry in loaded)


# ------------------------------------------------------------------------------------------- what the table is made of

ROW = Row("case", "method", "1", 0.5, 1.0, "NaN")


@pytest.mark.parametrize(
    "bad",
    [{"error": 2.0}, {"error": math.inf}, {"error": math.nan}, {"finite": False}, {"recovery": 3}],
    ids=str,
)
def test_a_row_fails_for_any_reason(bad: dict[str, float]) -> None:
    assert ROW.passed
    assert replace(ROW, recovery=2).passed
    failed = replace(ROW, **bad)  # type: ignore[arg-type]
    assert not failed.passed
    assert "FAILS" in cases.text({"group": [ROW, failed]})
    assert worst([ROW, failed, ROW]) is failed
    assert worst([replace(ROW, error=0.0)] * 3).method == "all 3"
    entry = cases.as_json({"group": [failed]})[0]
    assert not entry["passed"]
    json.dumps(entry, allow_nan=False)


def test_deviation_is_relative_and_knows_what_is_not_finite() -> None:
    assert deviation(np.array([1.1, 2.0]), np.array([1.0, 2.0])) == pytest.approx(0.1)
    assert deviation(np.array([0.1, 0.0]), 0.0) == pytest.approx(0.1)
    assert deviation(np.array([1.0, np.nan]), 1.0) == math.inf


def test_recovery_counts_frames_until_the_error_stays_small() -> None:
    assert recovery([0.0, 0.0], 0.1) == 1
    assert recovery([1.0, 0.0], 0.1) == 2
    assert recovery([0.0, 1.0, 0.0], 0.1) == 3
    assert recovery([math.nan, 0.0], 0.1) == 2


@pytest.mark.gl
def test_the_command_prints_and_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cases, "measure", lambda renderer: {"group": [ROW, replace(ROW, error=2.0)]})
    cases.run(tmp_path / "new" / "hard.json")
    told = capsys.readouterr().out
    assert "1 of 2 cases beyond their bounds" in told
    assert [row["passed"] for row in json.loads((tmp_path / "new" / "hard.json").read_text())] == [True, False]
    assert cli.parse(["bench", "--hard"]).hard
