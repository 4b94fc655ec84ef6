"""The results of a run, as JSON and as tables, and the goals that stand beside them."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.machine import Machine
from bench.memory import MemoryResult
from bench.methods import APART_TAA, BMFR_PAPER, BMFR_TAA, ONE_SIGNAL_TAA, MethodResult, QualityResult
from bench.tracing import TracingResult
from config import Config
from console import table
from storage import replace_file

DEVIATION = 0.1
"""How far the passes' sum may be from the frame."""


@dataclass(frozen=True)
class Report:
    """Everything measured in one run. ``seconds``: of the whole run without ``reference_seconds``, which went into
    references that were not on disk yet."""

    machine: Machine
    config: Config
    quick: bool
    quality: tuple[QualityResult, ...]
    tracing: tuple[TracingResult, ...]
    memory: MemoryResult | None
    seconds: float
    reference_seconds: float


@dataclass(frozen=True)
class Goal:
    """``limit``: largest value wanted; ``find``: the value in a report, None where it was not measured."""

    what: str
    unit: str
    limit: float
    find: Callable[[Report], float | None]


def _method(scene: str, name: str, value: Callable[[MethodResult], float]) -> Callable[[Report], float | None]:
    def find(report: Report) -> float | None:
        found = [m for q in report.quality if q.scene == scene for m in q.methods if m.name == name]
        return value(found[0]) if found else None

    return find


def _tracing(scene: str, animate: bool, value: Callable[[TracingResult], float]) -> Callable[[Report], float | None]:
    def find(report: Report) -> float | None:
        found = [t for t in report.tracing if (t.scene, t.animate) == (scene, animate)]
        return value(found[0]) if found else None

    return find


# Goals at 640x360 on two cores of a server CPU of 2.5 GHz with llvmpipe. They are printed, never enforced: on another
# machine the times mean something else.
GOALS = (
    Goal("cornell: RMSE of SVGF / noisy", "", 0.06, _method("cornell", APART_TAA.name, lambda m: m.rmse_ratio)),
    Goal(
        "cornell: temporal error of SVGF / noisy",
        "",
        0.06,
        _method("cornell", APART_TAA.name, lambda m: m.temporal_ratio),
    ),
    Goal("SVGF + TAA, one signal", "ms", 110.0, _method("cornell", ONE_SIGNAL_TAA.name, lambda m: m.milliseconds)),
    Goal("SVGF + TAA, direct and indirect", "ms", 190.0, _method("cornell", APART_TAA.name, lambda m: m.milliseconds)),
    Goal("cornell: RMSE of BMFR / noisy", "", 0.04, _method("cornell", BMFR_TAA.name, lambda m: m.rmse_ratio)),
    Goal(
        "cornell: temporal error of BMFR / noisy",
        "",
        0.04,
        _method("cornell", BMFR_TAA.name, lambda m: m.temporal_ratio),
    ),
    Goal("the same as published: RMSE", "", 0.045, _method("cornell", BMFR_PAPER.name, lambda m: m.rmse_ratio)),
    Goal(
        "the same as published: temporal error",
        "",
        0.045,
        _method("cornell", BMFR_PAPER.name, lambda m: m.temporal_ratio),
    ),
    Goal("BMFR + TAA", "ms", 60.0, _method("cornell", BMFR_TAA.name, lambda m: m.milliseconds)),
    Goal("of it the fit", "ms", 20.0, _method("cornell", BMFR_TAA.name, lambda m: m.of_pass("bmfr.fit"))),
    Goal("cornell: tracing", "ms", 60.0, _tracing("cornell", False, lambda t: t.frame.median)),
    Goal("cornell: outside Embree", "ms", 20.0, _tracing("cornell", False, lambda t: t.outside.median)),
    Goal("interior at rest: tracing", "ms", 190.0, _tracing("interior", False, lambda t: t.frame.median)),
    Goal("interior at rest: outside Embree", "ms", 35.0, _tracing("interior", False, lambda t: t.outside.median)),
    Goal("interior in motion: tracing", "ms", 230.0, _tracing("interior", True, lambda t: t.frame.median)),
    Goal("interior in motion: outside Embree", "ms", 35.0, _tracing("interior", True, lambda t: t.outside.median)),
    Goal("memory gained over 800 frames", "MB", 5.0, lambda report: report.memory.growth if report.memory else None),
)


def write_json(path: Path, report: Report) -> None:
    """Write the whole report; what is not a finite number becomes null. Raises UserError where writing fails."""
    goals = [{"what": g.what, "unit": g.unit, "limit": g.limit, "value": g.find(report)} for g in GOALS]
    content = _finite(dataclasses.asdict(report) | {"goals": goals})
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    replace_file(path, lambda target: target.write_text(text, encoding="utf-8"))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def header(report: Report) -> str:
    """The machine and the settings, in a few lines."""
    machine, render = report.machine, report.config.render
    packages = ", ".join(f"{name} {number}" for name, number in machine.packages.items())
    return "\n".join(
        [
            f"{machine.renderer} (OpenGL {machine.opengl})",
            f"{machine.cpu}, {machine.threads} threads, {machine.system}",
            f"Python {machine.python}, {packages}",
            f"{render.width}x{render.height}, seed {render.seed}, {machine.date}"
            + (", --quick" if report.quick else ""),
        ]
    )


def quality_table(result: QualityResult) -> str:
    """Time and error of every method of one sequence."""
    rows = [
        (
            m.name,
            f"{m.milliseconds:.1f}",
            f"{m.wall.p95:.1f}",
            f"{m.upload:.1f}",
            f"{m.rmse:.4f}",
            f"{m.rmse_ratio:.4f}",
            f"{m.temporal:.4f}",
            f"{m.temporal_ratio:.4f}",
        )
        for m in result.methods
    ]
    noisy = result.methods[0]
    rows.append(
        (
            f"noise of the reference ({result.samples} paths)",
            "",
            "",
            "",
            f"{result.noise:.4f}",
            f"{result.noise / noisy.rmse:.4f}",
            f"{result.temporal_noise:.4f}",
            f"{result.temporal_noise / noisy.temporal:.4f}",
        )
    )
    title = f"{result.scene}, {result.motion}, {result.size[0]}x{result.size[1]}"
    heads = (title, "frame ms", "p95", "upload", "RMSE", "/ noisy", "temporal", "/ noisy")
    lines = [table(heads, rows)]
    for m in result.methods:
        if m.deviation is not None and abs(m.deviation) > DEVIATION:
            lines.append(f"{m.name}: the passes add up to {1 + m.deviation:.0%} of the frame")
    return "\n".join(lines)


def passes_table(result: QualityResult) -> str:
    """Milliseconds of every pass of the complete pipelines."""
    chosen = [m for m in result.methods if m.name in (ONE_SIGNAL_TAA.name, APART_TAA.name, BMFR_TAA.name)]
    names = list(dict.fromkeys(row.name for m in reversed(chosen) for row in m.passes))
    times = [{row.name: row.milliseconds for row in m.passes} for m in chosen]
    rows = [(name, *(f"{t[name]:.2f}" if name in t else "" for t in times)) for name in names]
    rows.append(("sum", *(f"{sum(t.values()):.2f}" for t in times)))
    rows.append(("frame", *(f"{m.milliseconds:.2f}" for m in chosen)))
    return table(("ms per pass", *(m.name for m in chosen)), rows)


def tracing_table(results: tuple[TracingResult, ...]) -> str:
    """Speed of the tracer."""
    rows = [
        (
            f"{t.scene}, {t.motion}",
            f"{t.size[0]}x{t.size[1]}",
            f"{t.triangles:,}",
            f"{t.frame.median:.1f}",
            f"{t.frame.p95:.1f}",
            f"{t.inside.median:.1f}",
            f"{t.alone.median:.1f}",
            f"{t.outside.median:.1f}",
            f"{t.mrays_frame:.1f}",
            f"{t.mrays_alone:.1f}",
        )
        for t in results
    ]
    heads = (
        "tracing, 1 path per pixel", "size", "triangles", "frame ms", "p95", "in Embree", "rays alone", "outside",
        "Mrays/s", "alone",
    )  # fmt: skip
    return table(heads, rows)


def goals_table(report: Report) -> str:
    """Goals beside what was measured; without a verdict where the run was a quick one."""
    rows = []
    for goal in GOALS:
        value = goal.find(report)
        if value is None:
            continue
        verdict = "" if report.quick else "met" if value <= goal.limit else "missed"
        measured, limit = (f"{value:.1f}", f"{goal.limit:.0f}") if goal.unit else (f"{value:.4f}", f"{goal.limit:g}")
        rows.append((goal.what, f"{measured} {goal.unit}".strip(), f"{limit} {goal.unit}".strip(), verdict))
    return table(("at 640x360 on two cores with llvmpipe", "measured", "at most", "goal"), rows) if rows else ""


def text(report: Report) -> str:
    """The whole report for a terminal."""
    parts = [header(report), tracing_table(report.tracing)]
    for result in report.quality:
        parts += [quality_table(result), passes_table(result)]
    if report.memory:
        m = report.memory
        parts.append(
            f"memory: {m.megabytes_first:.1f} MB after {m.first} frames of {m.size[0]}x{m.size[1]}, "
            f"{m.megabytes_last:.1f} MB after {m.frames} ({m.growth:+.1f} MB)"
        )
    parts.append(goals_table(report))
    took = f"measured in {report.seconds:.0f} s"
    if report.reference_seconds >= 1.0:
        took += f"; {report.reference_seconds:.0f} s more for references that were not on disk yet"
    return "\n\n".join(part for part in [*parts, took] if part)
