"""The results of a run as tables for a terminal."""

from __future__ import annotations

from bench.claims import claims
from bench.events import EventResult, EventsResult
from bench.goals import GOALS
from bench.methods import APART_TAA, BMFR_TAA, METHODS, ONE_SIGNAL_TAA
from bench.metrics_time import TAIL
from bench.oidn import INSTALL
from bench.results import QualityResult, Report, contenders
from bench.running import available
from bench.tracing import TracingResult
from console import table

DEVIATION = 0.1
"""How far the passes' sum may be from the frame."""


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
    heads = (result.title, "frame ms", "p95", "upload", "RMSE", "/ noisy", "temporal", "/ noisy")
    lines = [table(heads, rows)]
    for m in result.methods:
        if m.deviation is not None and abs(m.deviation) > DEVIATION:
            lines.append(f"{m.name}: the passes add up to {1 + m.deviation:.0%} of the frame")
    return "\n".join(lines)


def above(value: float, floor: float | None, digits: int = 4) -> str:
    """``value``; "< floor" where the reference's own noise is all that it can be."""
    return f"< {floor:.{digits}f}" if floor is not None and value < floor else f"{value:.{digits}f}"


def error_table(result: QualityResult) -> str:
    """Every error beside the time of tracing and filtering, the fronts, and path tracing in the same time."""
    floors = result.floors
    rows = []
    for c in sorted(contenders(result), key=lambda c: c.milliseconds):
        e, equal = c.errors, c.equal
        front = " ".join(name for name, best in (("RMSE", c.best_rmse), ("FLIP", c.best_flip)) if best)
        rows.append(
            (
                c.name,
                f"{c.milliseconds:.1f}",
                above(e.rmse, floors.rmse if floors else None),
                above(e.relmse, floors.relmse if floors else None),
                f"{e.psnr:.2f}",
                f"{e.ssim:.4f}",
                above(e.flip, floors.flip if floors else None),
                above(e.temporal, floors.temporal if floors else None),
                front if c.competes else "-",
                f"{equal.samples}" if equal else "",
                f"{equal.errors.rmse / e.rmse:.2f}" if equal and e.rmse > 0.0 else "",
                f"{equal.errors.flip / e.flip:.2f}" if equal and e.flip > 0.0 else "",
            )
        )
    if not rows:
        return ""
    if floors:
        noise = (floors.rmse, floors.relmse, floors.flip, floors.temporal)
        rmse, relmse, flip, temporal = (f"{value:.4f}" for value in noise)
        psnr, ssim = f"{floors.psnr:.2f}", f"{floors.ssim:.4f}"
        rows.append(("the reference's own noise", "", rmse, relmse, psnr, ssim, flip, temporal, "", "", "", ""))
    heads = (
        f"{result.title}: tracing and filtering", "ms", "RMSE", "relMSE", "PSNR", "SSIM", "FLIP", "temporal",
        "on the front", "paths in that time", "their RMSE / its", "FLIP / its",
    )  # fmt: skip
    return table(heads, rows)


def events_table(result: EventsResult) -> str:
    """Flicker, and frames until an event is over."""
    names = list(result.noise)

    def cells(m: EventResult) -> list[str]:
        return [cell for n in names for cell in (_frames(m.recovery[n], len(m.errors[n])), f"{m.steady[n]:.4f}")]

    rows = [(m.name, f"{m.flicker:.4f}", *cells(m)) for m in result.methods]
    rows.append(("noise of the reference", "", *(cell for n in names for cell in ("", f"{result.noise[n]:.4f}"))))
    heads = (
        f"{result.scene}, {result.size[0]}x{result.size[1]}, at rest: flicker",
        "",
        *(cell for name in names for cell in (f"frames after {name}", "steady RMSE")),
    )
    return table(heads, rows)


def claims_table(result: QualityResult) -> str:
    """What the filters are meant to be worth, and whether they are."""
    rows = [(f"{c.method}: {c.what}", c.value, c.limit, "holds" if c.holds else "does not") for c in claims(result)]
    return table((f"{result.scene}, claimed", "measured", "at least", ""), rows) if rows else ""


def _frames(count: int | None, looked: int) -> str:
    return f"> {round((1.0 - TAIL) * looked)}" if count is None else str(count)


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
        parts += [quality_table(result), error_table(result), claims_table(result), passes_table(result)]
    if report.events:
        parts.append(events_table(report.events))
    if len(available(METHODS)) < len(METHODS):
        parts.append(f"Intel Open Image Denoise is not among them: {INSTALL}")
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
