"""What the page shows, as JSON: numbers and words here, all layout in the page."""

from __future__ import annotations

from typing import Any

from bench.cases import SCORED
from bench.claims import claims
from bench.events import EventsResult
from bench.files import plain
from bench.goals import GOALS
from bench.methods import METHODS, PATH_TRACING
from bench.oidn import INSTALL
from bench.page.pictures import encoded
from bench.results import Contender, QualityResult, Report, contenders
from bench.running import MethodResult, available
from bench.scores import FRAMES_OF_STRIP, MAP_TOP, SHOWN, Errors
from bench.tracing import TracingResult


def content(report: Report) -> dict[str, Any]:
    """Everything on the page; nothing in it is NaN or infinite."""
    shown: dict[str, Any] = plain(
        {
            "quick": report.quick,
            "machine": report.machine,
            "seed": report.config.render.seed,
            "preset": {"svgf": report.config.svgf.preset, "bmfr": report.config.bmfr.preset},
            "seconds": report.seconds,
            "referenceSeconds": report.reference_seconds,
            "notes": _notes(report),
            "mapTop": MAP_TOP,
            "scenes": [_scene(result) for result in report.quality if result.trace is not None],
            "events": _events(report.events) if report.events else None,
            "hard": [plain(table) for table in report.hard],
            "tracing": [_tracing(result) for result in report.tracing],
            "goals": [_goal(report, number) for number in range(len(GOALS))],
            "memory": report.memory,
        }
    )
    return shown


def _notes(report: Report) -> list[str]:
    notes = []
    if report.quick:
        notes.append(
            "A quick run: small pictures, noisy references, few repeats. It shows that it works, not how well."
        )
    if len(available(METHODS)) < len(METHODS):
        notes.append(f"Intel Open Image Denoise is not among the methods: {INSTALL}.")
    return notes


def _scene(result: QualityResult) -> dict[str, Any]:
    methods = {m.name: m for m in result.methods}
    assert result.trace is not None
    return {
        "name": result.scene,
        "motion": result.motion,
        "size": list(result.size),
        "samples": result.samples,
        "trace": result.trace.median,
        "traceP95": result.trace.p95,
        "sample": result.sample_milliseconds,
        "floors": _errors(result.floors) if result.floors else None,
        "shown": SHOWN,
        "stripFrames": list(FRAMES_OF_STRIP),
        "scored": list(SCORED),
        "claims": [plain(claim) for claim in claims(result)],
        "truth": encoded(result.truth) if result.truth else None,
        "methods": [_contender(c, methods.get(c.name)) for c in contenders(result)],
    }


def _errors(errors: Errors) -> dict[str, float]:
    return {
        "rmse": errors.rmse,
        "relmse": errors.relmse,
        "psnr": errors.psnr,
        "ssim": errors.ssim,
        "flip": errors.flip,
        "temporal": errors.temporal,
    }


def _contender(c: Contender, method: MethodResult | None) -> dict[str, Any]:
    exact = not c.stage and c.group != PATH_TRACING
    equal = None
    if c.equal is not None:
        equal = {"samples": c.equal.samples, **_errors(c.equal.errors)}
    return {
        "name": c.name,
        "group": c.group,
        "settings": c.described,
        "stage": c.stage,
        "ms": c.milliseconds,
        "filter": c.filter_milliseconds,
        "p95": c.p95,
        "errors": _errors(c.errors),
        "frames": [{"frame": f.frame, "rmse": f.rmse, "flip": f.flip} for f in c.errors.frames],
        "equal": equal,
        "competes": c.competes,
        "front": {"rmse": c.best_rmse, "flip": c.best_flip},
        "passes": [[row.name, row.milliseconds] for row in method.passes] if method else [],
        "pictures": encoded(c.pictures, exact) if c.pictures is not None and c.competes else None,
    }


def _events(result: EventsResult) -> dict[str, Any]:
    return {
        "scene": result.scene,
        "size": list(result.size),
        "samples": result.samples,
        "before": result.frames[0],
        "noise": result.noise,
        "methods": [
            {
                "name": m.name,
                "group": m.group,
                "stage": m.stage,
                "flicker": m.flicker,
                "errors": {name: list(errors) for name, errors in m.errors.items()},
                "steady": m.steady,
                "recovery": m.recovery,
            }
            for m in result.methods
        ],
    }


def _tracing(t: TracingResult) -> dict[str, Any]:
    return {
        "what": f"{t.scene}, {t.motion}",
        "size": f"{t.size[0]}x{t.size[1]}",
        "triangles": t.triangles,
        "frame": t.frame.median,
        "p95": t.frame.p95,
        "outside": t.outside.median,
        "mrays": t.mrays_frame,
        "alone": t.mrays_alone,
    }


def _goal(report: Report, number: int) -> dict[str, Any]:
    goal = GOALS[number]
    return {"what": goal.what, "unit": goal.unit, "limit": goal.limit, "value": goal.find(report)}
