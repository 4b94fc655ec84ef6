"""``app.py bench``: measure, print tables, write JSON."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from bench import memory, methods, report, tracing
from bench.cases import FULL, QUICK, SCORED, Case, Effort, quality_case, quick_size, tracing_cases
from bench.machine import describe
from bench.references import FOLDER, ReferenceCache
from bench.storage import require_writable
from config import Config
from gl.context import create_headless
from gl.renderer import Renderer
from raytrace.shot import Shot

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

        # First, while the process has nothing on its heap that a leak could hide in.
        grown = _measure_memory(scenes[0], config, new_renderer(), effort.memory_frames) if effort.memory_frames else None
        shots = _open(scenes, quick, config, stack)
        traced = tracing.measure({c: shots[c] for s in scenes for c in tracing_cases(s)}, max(1, effort.repeats // 2))
        references = ReferenceCache(cache)
        quality = tuple(
            _measure_quality(case, shots[case], config, new_renderer, references, effort)
            for case in dict.fromkeys(quality_case(scene, quick) for scene in scenes)
        )
        ...
