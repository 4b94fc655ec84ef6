"""Goals beside what was measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from bench.methods import APART_TAA, BMFR_PAPER, BMFR_TAA, ONE_SIGNAL_TAA
from bench.results import Report
from bench.running import MethodResult
from bench.tracing import TracingResult


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
