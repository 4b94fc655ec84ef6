"""The commands that need no window: render one picture, print a graph, fly the demo."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np
from numpy.typing import NDArray

from bench.metrics import rmse
from config import Config
from console import Progress, table
from errors import UserError, did_you_mean
from gl.context import create_headless
from gl.executor import Result
from gl.pipelines import FrameTraits, build
from gl.renderer import Renderer, read
from images import side_by_side, to_srgb8, write_apng, write_exr, write_png
from raytrace.frame import FramePacket
from raytrace.shot import FPS, Shot, modulate
from session import open_shot

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class RenderJob:
    """Arguments of ``app.py render``."""

    scene: str
    denoiser: str
    frames: int
    samples: int
    camera: str
    animate: bool
    jitter: bool
    out: Path
    exr: bool
    show: str


def render(job: RenderJob, config: Config) -> None:
    """Render frame ``job.frames - 1`` of the shot and write it."""
    shot = open_shot(job.scene, config, job.camera, job.animate, job.jitter)
    with shot.tracer:
        renderer = Renderer(create_headless())
        keep = (job.show,) if job.show else ()
        _check_show(job, config, shot)
        last = job.frames - 1
        reference = None
        # Without a history only the last frame matters, and it looks the same on its own.
        first = 0 if job.denoiser in ("accumulate", "svgf") else last
        with Progress(f"{job.denoiser}: {job.frames - first} frames") as progress:
            for index in range(first, last + 1):
                packet = shot.frame(index)
                if job.denoiser == "reference":
                    reference = modulate(packet, *shot.reference(index, job.samples, progress.update))
                result = renderer.run(packet, config, job.denoiser, reference, keep)
                progress.update((index + 1 - first) / (job.frames - first))
        _write_result(job, result)
        renderer.release()


def _check_show(job: RenderJob, config: Config, shot: Shot) -> None:
    """Refuse an unknown texture before the work, not after it."""
    if not job.show:
        return
    plan = build(config, job.denoiser, FrameTraits(moving=shot.scene.has_motion)).compile()
    known = sorted({tex.name for tex in (*plan.imports, *plan.slot_of, *plan.feeds)})
    if job.show not in known:
        listing = "\n  ".join(known)
        raise UserError(
            f"--show {job.show}: no such texture{did_you_mean(job.show, known)}", f"there are:\n  {listing}"
        )


def _write_result(job: RenderJob, result: Result) -> None:
    if job.show:
        values = read(result.texture(job.show))
        write_png(job.out, to_srgb8(viewable(values)))
        exr = values[..., :3] if values.shape[2] >= 3 else np.repeat(values[..., :1], 3, axis=2)
    else:
        write_png(job.out, (read(result.outputs["display"])[..., :3] * 255.0 + 0.5).astype(np.uint8))
        exr = read(result.outputs["radiance"])[..., :3]
    print(job.out)
    if job.exr:
        path = job.out.with_suffix(".exr")
        write_exr(path, exr)
        print(path)


def viewable(values: F32) -> F32:
    """(H, W, C) values of any range as (H, W, 3) in [0, 1]: one channel as grey, two with blue 0, scaled by range."""
    channels = values.shape[2]
    if channels == 1:
        rgb = np.repeat(values, 3, axis=2)
    elif channels == 2:
        rgb = np.concatenate([values, np.zeros_like(values[..., :1])], axis=2)
    else:
        rgb = values[..., :3]
    finite = rgb[np.isfinite(rgb)]
    if finite.size == 0:
        return np.zeros_like(rgb)
    low, high = min(0.0, float(np.percentile(finite, 1))), float(np.percentile(finite, 99))
    if low >= 0.0 and high <= 1.0:
        return rgb
    return ((rgb - low) / max(high - low, 1e-9)).astype(np.float32)


def print_graph(config: Config, denoiser: str, dot: bool, moving: bool = False) -> None:
    """The compiled plan of one frame, as text or Graphviz."""
    plan = build(config, denoiser, FrameTraits(moving=moving)).compile()
    print(plan.dot() if dot else plan.text())


DEMO_FRAMES = 32
DEMO_SAMPLES = 64


def demo(config: Config, scene: str, out: Path) -> None:
    """What ``make run`` does without a display: a flight, ``demo.png`` and ``demo_flight.png``, and a table."""
    shot = open_shot(scene, config, "flight", animate=False)
    with shot.tracer:
        renderer = Renderer(create_headless())
        packets: list[FramePacket] = []
        pictures: list[NDArray[np.uint8]] = []
        trace_ms: list[float] = []
        filter_ms: list[float] = []
        with Progress(f"{scene}: flight of {DEMO_FRAMES} frames") as progress:
            for index in range(DEMO_FRAMES):
                packet = shot.frame(index)
                start = time.perf_counter()
                result = renderer.run(packet, config, "svgf")
                renderer.ctx.finish()
                filter_ms.append((time.perf_counter() - start) * 1e3)
                trace_ms.append(packet.timings["trace"] * 1e3)
                packets = [packet]
                pictures.append(_display(result))
                progress.update((index + 1) / DEMO_FRAMES)
        filtered = read(result.outputs["radiance"])[..., :3]
        packet = packets[-1]
        noisy_picture = _display(renderer.run(packet, config, "none"))
        picture = out / "demo.png"
        write_png(picture, side_by_side([noisy_picture, pictures[-1]]))
        print(f"{picture} (noisy | SVGF)", flush=True)
        flight = out / "demo_flight.png"
        write_apng(flight, pictures, round(1000 / FPS))
        print(f"{flight} (animation)", flush=True)

        with Progress(f"{scene}: reference, {DEMO_SAMPLES} paths per pixel of one frame") as progress:
            reference = modulate(packet, *shot.reference(DEMO_FRAMES - 1, DEMO_SAMPLES, progress.update))
        reference_picture = _display(renderer.run(packet, config, "reference", reference))
        write_png(picture, side_by_side([noisy_picture, pictures[-1], reference_picture]))
        print(f"{picture} (noisy | SVGF | reference)")
        print()
        surfaces = packet.emission[..., :3].max(axis=2) == 0.0
        rows = []
        for name, image, ms in (
            ("noisy", packet.radiance(), 0.0),
            ("SVGF + TAA", filtered, median(filter_ms[8:])),
        ):
            error = rmse(image, reference[..., :3], surfaces)
            rows.append((name, f"{median(trace_ms[8:]):.0f}", f"{ms:.0f}", f"{error:.4f}"))
        print(table(("last frame", "trace ms", "filter ms", f"RMSE against {DEMO_SAMPLES} paths"), rows))
        width, height = shot.size
        print(
            f"\n{width}x{height}, {shot.tracer.threads} threads, {renderer.ctx.info['GL_RENDERER']}; "
            "error before anti-aliasing, on linear radiance without the lamps"
        )
        renderer.release()


def _display(result: Result) -> NDArray[np.uint8]:
    return (read(result.outputs["display"])[..., :3] * 255.0 + 0.5).astype(np.uint8)
