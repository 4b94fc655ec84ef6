"""``app.py bench``: measure, print tables, write JSON."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from bench import memory, methods, report, tracing
from bench.cases import FULL, QUICK, SCORED, Case, Effort, quality_case, quick_size, tracing_cases
from bench.machine import describe
from bench.methods import NewRenderer, QualityResult, Truth
from bench.references import FOLDER, ReferenceCache
from config import Config
from gl.context import create_headless
from gl.renderer import Renderer
from raytrace.shot import Shot
from storage import require_writable

_MEMORY_SIZE = (160, 90)


def run(config: Config, scenes: tuple[str, ...], quick: bool, out: Path, cache: Path = FOLDER) -> None:
    """Measure all methods and the tracer on ``scenes``, print the tables and write ``out`` (JSON).

    ``quick``: small pictures and noisy references, to see that it runs. ``cache``: the folder of the references.
    Raises UserError for scenes that cannot be loaded, places that cannot be written, and missing OpenGL.
    """
    require_writable(out)
    start = time.perf_counter()
    effort = QUICK if quick else FULL
    config = quick_size(config) if quick else config
    with ExitStack() as stack:
        ctx = create_headless()
        stack.callback(ctx.release)

        def new_renderer() -> Renderer:
            return Renderer(ctx)

        # First, while there is nothing else on the heap that a leak could hide in.
        grown = _memory(tracing_cases(scenes[0])[0], config, new_renderer, effort)
        quality_cases = tuple(dict.fromkeys(quality_case(scene, quick) for scene in scenes))
        tracing_of = tuple(dict.fromkeys(case for scene in scenes for case in tracing_cases(scene)))
        shots = {case: _open(case, config, stack) for case in dict.fromkeys((*tracing_of, *quality_cases))}
        traced = tracing.measure({case: shots[case] for case in tracing_of}, effort.tracing_repeats)
        references = ReferenceCache(cache)
        quality = tuple(_quality(case, shots[case], config, new_renderer, references, effort) for case in quality_cases)
        filling = sum(result.reference_seconds for result in quality)
        threads = next(iter(shots.values())).tracer.threads
        result = report.Report(
            machine=describe(ctx.info, threads),
            config=config,
            quick=quick,
            quality=quality,
            tracing=tuple(traced),
            memory=grown,
            seconds=time.perf_counter() - start - filling,
            reference_seconds=filling,
        )
    print()
    print(report.text(result))
    report.write_json(out, result)
    print(out)


def _open(case: Case, config: Config, stack: ExitStack) -> Shot:
    shot = case.open(config)
    stack.callback(shot.tracer.close)
    return shot


def _memory(case: Case, config: Config, new_renderer: NewRenderer, effort: Effort) -> memory.MemoryResult | None:
    if effort.memory_frames == 0:
        return None
    width, height = _MEMORY_SIZE
    small = replace(config, render=replace(config.render, width=width, height=height))
    with ExitStack() as stack:
        shot = _open(case, small, stack)
        renderer = new_renderer()
        stack.callback(renderer.release)
        return memory.measure(shot, small, renderer, effort.memory_frames)


def _quality(
    case: Case, shot: Shot, config: Config, new_renderer: NewRenderer, references: ReferenceCache, effort: Effort
) -> QualityResult:
    """Trace the sequence of ``case``, complete its references, run every method."""
    found, seconds = references.fill(shot, SCORED, effort.samples, effort.slice)
    packets = methods.trace(shot)
    truth = Truth(packets, found)
    results = methods.measure(packets, truth, config, new_renderer, effort.repeats)
    return QualityResult(
        scene=case.scene,
        motion=case.motion,
        size=shot.size,
        samples=truth.samples,
        noise=truth.noise(),
        temporal_noise=truth.temporal_noise(),
        reference_seconds=seconds,
        methods=results,
    )
