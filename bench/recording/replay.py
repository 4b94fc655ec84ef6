"""``app.py replay``: recorded frames through the filters, without any scene."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence as Several
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.machine import describe
from bench.recording import exr
from bench.recording.scores import HIGHER_IS_BETTER, Scores
from bench.recording.sequence import Sequence, open_sequence
from config import Config
from console import Progress, table
from errors import UserError
from gl.context import create_headless
from gl.pipelines import remembered
from gl.profiler import Profiler
from gl.renderer import Renderer, read
from images import write_png
from session import require_memory
from storage import replace_file, require_writable


@dataclass(frozen=True)
class ReplayJob:
    """Arguments of ``app.py replay``. ``frames``: first and one past the last, None for the sequence's own."""

    folder: Path
    denoiser: str
    frames: tuple[int | None, int | None]
    out: Path
    log: bool = False

    @staticmethod
    def of(args: argparse.Namespace) -> ReplayJob:
        """From the parsed command line."""
        return ReplayJob(args.folder, args.denoiser, args.frames, args.out, args.log)


def selected(sequence: Sequence, frames: tuple[int | None, int | None]) -> range:
    """The frames asked for. Raises UserError where the sequence has none of them."""
    first, end = frames[0] or 0, sequence.frames if frames[1] is None else frames[1]
    if not 0 <= first < end <= sequence.frames:
        raise UserError(
            f"--frames {'' if frames[0] is None else frames[0]}:{'' if frames[1] is None else frames[1]}: "
            f"{sequence.folder} has the frames 0 to {sequence.frames - 1}",
            "A:B is from frame A up to frame B - 1",
        )
    return range(first, end)


def suited(sequence: Sequence, config: Config, denoiser: str) -> Config:
    """``config`` for the signals that the sequence has; tells on stderr what that changes for ``denoiser``."""
    for notice in sequence.notices:
        print(notice, file=sys.stderr)
    if sequence.separate or not config.svgf.separate:
        return config
    if denoiser == "svgf":
        print(f"{sequence.name}: direct and indirect light are not told apart: SVGF filters their sum", file=sys.stderr)
    return replace(config, svgf=replace(config.svgf, separate=False))


def prepare(job: ReplayJob, config: Config) -> tuple[Sequence, range, Config]:
    """The sequence, the frames of it that are wanted, and the parameters that suit it. Raises UserError."""
    sequence = open_sequence(job.folder)
    if remembered(config, job.denoiser) and "gradient" not in sequence.images:
        raise UserError(
            f"--denoiser {job.denoiser}: {sequence.folder} has no gradient0.exr, which tells where light changes",
            "record with --gradients; or, without it: --denoiser svgf --set svgf.fast_clamp=true",
        )
    return sequence, selected(sequence, job.frames), suited(sequence, config, job.denoiser)


def run(job: ReplayJob, config: Config) -> None:
    """Filter the frames and write them, their times and errors to ``job.out``; prints what was written."""
    sequence, frames, config = prepare(job, config)
    if job.out.resolve() == job.folder.resolve():
        raise UserError(f"--out {job.out}: is the recording itself", "choose another folder")
    require_writable(job.out / "timings.json")
    require_memory(sequence.size)
    scores = Scores(sequence.notes.get("references", {}))
    times: list[dict[str, Any]] = []
    with ExitStack() as stack:
        ctx = create_headless()
        stack.callback(ctx.release)
        largest = ctx.info["GL_MAX_TEXTURE_SIZE"]
        if max(sequence.size) > largest:
            raise UserError(f"{sequence.folder}: {ctx.info['GL_RENDERER']} can draw {largest}x{largest} pixels at most")
        renderer = Renderer(ctx)
        stack.callback(renderer.release)
        with Progress(f"{sequence.name}: {job.denoiser}, {len(frames)} frames") as progress:
            for index in frames:
                times.append(_frame(job, config, sequence, renderer, scores, index, index == frames[0]))
                progress.update((index + 1 - frames[0]) / len(frames))
        machine = describe(ctx.info, threads=0)
    _write(job.out / "timings.json", _timings(job, times, machine.renderer, machine.cpu))
    if scores.rows:
        summary = scores.summary()
        _write(job.out / "metrics.json", {"denoiser": job.denoiser, "summary": summary, "frames": scores.rows})
        print(_text(job.denoiser, summary))
    print(job.out)


def _frame(
    job: ReplayJob, config: Config, sequence: Sequence, renderer: Renderer, scores: Scores, index: int, first: bool
) -> dict[str, Any]:
    """Filter, write and score one frame; returns its times in milliseconds."""
    start = time.perf_counter()
    packet = sequence.packet(index, cut=first or index in sequence.cuts)
    reading = time.perf_counter() - start
    profiler = Profiler(renderer.ctx)
    start = time.perf_counter()
    result = renderer.run(packet, config, job.denoiser, profiler=profiler)
    renderer.ctx.finish()
    wall = time.perf_counter() - start
    profiler.flush()
    image = read(result.outputs["radiance"])[..., :3]
    exr.write(job.out / f"denoised{index}.exr", image)
    display = read(result.outputs["display"])[..., :3]
    write_png(job.out / f"display{index}.png", (display * 255.0 + 0.5).astype(np.uint8))
    if (reference := sequence.reference(index)) is not None:
        scores.add(packet, image, reference)
    return {
        "frame": index,
        "read_ms": reading * 1e3,
        "wall_ms": wall * 1e3,
        "frame_ms": profiler.total,
        "passes_ms": {row.name: row.milliseconds for row in profiler.rows()},
    }


def _timings(job: ReplayJob, times: Several[dict[str, Any]], renderer: str, cpu: str) -> dict[str, Any]:
    # The first frame compiles shaders and makes textures.
    settled = [row["frame_ms"] for row in times[1:]] or [row["frame_ms"] for row in times]
    return {
        "denoiser": job.denoiser,
        "renderer": renderer,
        "cpu": cpu,
        "how": "frame_ms: upload and all passes; passes are timed one by one, which drains the pipeline on software "
        "renderers; wall_ms: by the clock; the first frame also compiles and is left out of the median",
        "median_frame_ms": float(np.median(settled)),
        "p95_frame_ms": float(np.percentile(settled, 95)),
        "frames": list(times),
    }


def _write(path: Path, content: dict[str, Any]) -> None:
    text = json.dumps(content, indent=1)
    replace_file(path, lambda target: target.write_text(text, encoding="utf-8"))


def _text(denoiser: str, summary: dict[str, Any]) -> str:
    """Errors as a table; where they are no worse than the references' own they are bounds."""
    rows = []
    for name, value in summary["errors"].items():
        floor, noisy = summary["of_reference"].get(name), summary["noisy"].get(name)
        shown = f"{value:.4g}"
        if summary["means_something"][name] is False:
            shown = f"{'>' if name in HIGHER_IS_BETTER else '<'} {floor:.4g}"
        rows.append([name, shown, *("unknown" if other is None else f"{other:.4g}" for other in (noisy, floor))])
    return table(["error", denoiser, "noisy", "of the reference"], rows)
