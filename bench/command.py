"""``app.py bench``: measure, print tables, write JSON, CSV and, if asked to, the page with everything on it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from bench import events, files, memory, page, path_tracing, report, running, tracing
from bench.cases import FULL, QUICK, SCORED, Case, Effort, quality_case, quick_size, tracing_cases
from bench.hardness import hard_cases
from bench.machine import describe
from bench.methods import METHODS, Method, NewRenderer
from bench.references import FOLDER, ReferenceCache
from bench.results import QualityResult, Report, equal_samples
from bench.scores import Truth
from config import Config
from errors import UserError
from gl.context import create_headless
from gl.renderer import Renderer
from raytrace.shot import Shot
from storage import require_writable

_MEMORY_SIZE = (160, 90)


def run(
    config: Config,
    scenes: tuple[str, ...],
    quick: bool,
    out: Path,
    html: bool = False,
    cache: Path = FOLDER,
    methods: Sequence[Method] = METHODS,
) -> None:
    """Measure ``methods`` and the tracer on ``scenes``, print the tables and write ``out`` (JSON), a CSV beside it.

    ``quick``: small pictures and noisy references, to see that it runs. ``html``: a page as well, of the same name,
    for which events are measured too. ``cache``: the folder of the references.
    Raises UserError for scenes that cannot be loaded, places that cannot be written, and missing OpenGL.
    """
    if out.suffix in (".csv", ".html"):
        raise UserError(f"{out}: is what the JSON goes to", "name a .json file: the others are written beside it")
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
        quality = tuple(
            _quality(case, shots[case], config, new_renderer, references, effort, methods) for case in quality_cases
        )
        happened = events.measure(config, new_renderer, references, effort.events, methods) if html else None
        filling = sum(result.reference_seconds for result in quality) + (happened.reference_seconds if happened else 0)
        threads = next(iter(shots.values())).tracer.threads
        result = Report(
            machine=describe(ctx.info, threads),
            config=config,
            quick=quick,
            quality=quality,
            tracing=tuple(traced),
            memory=grown,
            seconds=time.perf_counter() - start - filling,
            reference_seconds=filling,
            events=happened,
            hard=hard_cases(new_renderer, quick) if html else (),
        )
    print()
    print(report.text(result))
    files.write_json(out, result)
    files.write_csv(out.with_suffix(".csv"), result)
    print(out)
    if html:
        page.write(out.with_suffix(".html"), result)
        print(out.with_suffix(".html"))


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
    case: Case,
    shot: Shot,
    config: Config,
    new_renderer: NewRenderer,
    references: ReferenceCache,
    effort: Effort,
    methods: Sequence[Method],
) -> QualityResult:
    """Trace the sequence of ``case``, complete its references, run every method."""
    found, seconds = references.fill(shot, SCORED, effort.samples, effort.slice)
    footage = running.Footage(shot)
    packets = footage()
    truth = Truth(packets, found)
    times = path_tracing.TracingTimes(shot)
    results = running.measure(packets, truth, config, new_renderer, effort.repeats, methods, times, footage)
    result = QualityResult(
        scene=case.scene,
        motion=case.motion,
        size=shot.size,
        samples=truth.samples,
        noise=truth.noise(),
        temporal_noise=truth.temporal_noise(),
        reference_seconds=seconds,
        methods=results,
        floors=truth.floors(),
        trace=times.frame,
        sample_milliseconds=times.sample,
        truth=truth.pictures(),
    )
    counts = {1, *(equal_samples(result, method) for method in results)}
    return replace(result, path_tracing=path_tracing.measure(shot, packets, truth, times, counts))
