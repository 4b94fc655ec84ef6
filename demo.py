"""The demo: what ``app.py`` shows where there is no display. A flight, a comparison, and a table of numbers."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np
from numpy.typing import NDArray

from bench.metrics import rmse
from config import Config
from console import Progress, table
from gl.renderer import Renderer, read
from headless import display_of, open_renderer, reference_of, telling_of_memory
from images import side_by_side, write_apng, write_png
from raytrace.frame import FramePacket
from raytrace.shot import FPS, Shot
from session import open_shot
from storage import require_writable

U8 = NDArray[np.uint8]

FIRST = 30
FRAMES = 6
"""The picture shows the last of these frames, a second into the flight. The filter weighs a new frame as it always will
from the fifth on: more of them would only let the picture wait."""

SAMPLES = 64
"""Paths per pixel of the reference."""

ANIMATED = 48
"""Frames of the animation, which are shown there and back again, at half the picture's width and height."""


@dataclass(frozen=True)
class Comparison:
    """One frame, noisy and filtered. ``trace_ms`` and ``filter_ms``: medians of the frames that led to it."""

    packet: FramePacket
    noisy: U8
    filtered: U8
    filtered_radiance: NDArray[np.float32]
    trace_ms: float
    filter_ms: float


def run(config: Config, scene: str, camera: str | None, out: Path) -> None:
    """Write ``out``/demo.png (noisy | SVGF | reference) and ``out``/demo_flight.png, and print a table.

    ``camera`` None: the scene's flight if it has one. The picture is there first without the reference, which takes
    longest and fills in last. Raises UserError as :func:`headless.render` does.
    """
    picture, animation = out / "demo.png", out / "demo_flight.png"
    require_writable(picture)
    with ExitStack() as stack:
        renderer = open_renderer((config.render.width, config.render.height), stack)
        shot = open_shot(scene, config, camera, animate=False)
        stack.enter_context(shot.tracer)

        with telling_of_memory(renderer, shot.size):
            compared = _compare(shot, config, renderer)
        write_png(picture, side_by_side([compared.noisy, compared.filtered]))
        print(f"{picture}  noisy | SVGF", flush=True)

        if shot.camera(0) != shot.camera(1):
            write_apng(animation, _there_and_back(shot, config, renderer), round(1000 / FPS))
            print(f"{animation}  animation", flush=True)

        with Progress(f"reference: {SAMPLES} paths per pixel") as progress:
            reference = reference_of(shot, compared.packet, SAMPLES, progress.update)
        shown = display_of(renderer.run(compared.packet, config, "reference", reference))
        write_png(picture, side_by_side([compared.noisy, compared.filtered, shown]))
        print(f"{picture}  noisy | SVGF | reference\n")
        print(_numbers(compared, reference))
        width, height = shot.size
        print(
            f"\n{width}x{height}, {shot.tracer.threads} threads, {renderer.ctx.info['GL_RENDERER']}\n"
            "Errors are of linear radiance without the lamps, before anti-aliasing; the reference has noise of its own."
        )


def _compare(shot: Shot, config: Config, renderer: Renderer) -> Comparison:
    trace_ms, filter_ms = [], []
    with Progress(f"{shot.scene.scene.name}: {FRAMES} frames") as progress:
        for index in range(FIRST, FIRST + FRAMES):
            packet = shot.frame(index)
            start = time.perf_counter()
            result = renderer.run(packet, config, "svgf")
            renderer.ctx.finish()
            filter_ms.append((time.perf_counter() - start) * 1e3)
            trace_ms.append(packet.timings["trace"] * 1e3)
            progress.update((index + 1 - FIRST) / FRAMES)
    filtered, radiance = display_of(result), read(result.outputs["radiance"])[..., :3]
    noisy = display_of(renderer.run(packet, config, "none"))
    # The first frame compiles shaders and fills caches.
    return Comparison(packet, noisy, filtered, radiance, median(trace_ms[1:]), median(filter_ms[1:]))


def _there_and_back(shot: Shot, config: Config, renderer: Renderer) -> list[U8]:
    """Pictures of the flight, small enough for a file to be sent around, that end where they began."""
    width, height = (max(1, side // 2) for side in shot.size)
    small = Shot(shot.scene, shot.tracer, (width, height), [shot.camera(index) for index in range(ANIMATED)])
    pictures = []
    with Progress(f"{shot.scene.scene.name}: animation of {ANIMATED} frames") as progress:
        for index in range(ANIMATED):
            pictures.append(display_of(renderer.run(small.frame(index), config, "svgf")))
            progress.update((index + 1) / ANIMATED)
    return pictures + pictures[-2:0:-1]


def _numbers(compared: Comparison, reference: NDArray[np.float32]) -> str:
    packet = compared.packet
    surfaces = packet.emission[..., :3].max(axis=2) == 0.0

    def error(image: NDArray[np.float32]) -> str:
        return f"{rmse(image, reference[..., :3], surfaces):.4f}" if surfaces.any() else "-"

    trace = f"{compared.trace_ms:.0f}"
    return table(
        (f"frame {packet.index}", "tracing ms", "filtering ms", f"RMSE against {SAMPLES} paths"),
        (
            ("noisy", trace, "0", error(packet.radiance())),
            ("SVGF", trace, f"{compared.filter_ms:.0f}", error(compared.filtered_radiance)),
        ),
    )
