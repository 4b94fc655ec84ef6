"""The commands that need no window: render one picture, print a graph."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config import Config
from console import Progress
from errors import UserError, did_you_mean
from gl.context import create_headless
from gl.executor import Result
from gl.pipelines import FrameTraits, build, remembered
from gl.renderer import Renderer, read
from images import to_srgb8, viewable, write_exr, write_png
from raytrace.frame import FramePacket
from raytrace.shot import Shot, modulate
from session import find_scene, open_shot
from storage import require_writable

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]

PATHS_AT_ONCE = 2_000_000
"""Of references, about a second's worth: between two portions progress is shown and Ctrl-C heard."""


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

    @staticmethod
    def of(args: argparse.Namespace, config: Config) -> RenderJob:
        """From the parsed command line; ``--spp`` is ``--frames`` where it is not given."""
        return RenderJob(
            scene=args.scene,
            denoiser=args.denoiser,
            frames=args.frames,
            samples=args.spp or args.frames,
            camera=args.camera,
            animate=args.animate,
            jitter=args.jitter or config.render.jitter == "on",
            out=args.out,
            exr=args.exr,
            show=args.show,
        )


def render(job: RenderJob, config: Config) -> None:
    """Render frame ``job.frames - 1`` of the shot and write it. What cannot work is refused before the work."""
    require_writable(job.out)
    if job.exr:
        require_writable(job.out.with_suffix(".exr"))
    with ExitStack() as stack:
        renderer = open_renderer((config.render.width, config.render.height), stack)
        shot = open_shot(job.scene, config, job.camera, job.animate, job.jitter)
        shot.remember = remembered(config, job.denoiser)
        stack.enter_context(shot.tracer)
        _require_texture(job, config, shot)
        with telling_of_memory(renderer, shot.size):
            result = _last_frame(job, config, shot, renderer)
        _write_result(job, result)


def open_renderer(size: tuple[int, int], stack: ExitStack) -> Renderer:
    """A renderer on a context of its own, both released by ``stack``.

    Raises UserError where there is no OpenGL 4.3, or none that can draw pictures of ``size``.
    """
    ctx = create_headless()
    stack.callback(ctx.release)
    largest = ctx.info["GL_MAX_TEXTURE_SIZE"]
    if max(size) > largest:
        raise UserError(
            f"{size[0]}x{size[1]} pixels: {ctx.info['GL_RENDERER']} can draw {largest}x{largest} at most",
            "choose a smaller --size",
        )
    renderer = Renderer(ctx)
    with telling_of_memory(renderer, size):
        ctx.texture(size, 4, dtype="f4").release()
    stack.callback(renderer.release)
    return renderer


@contextmanager
def telling_of_memory(renderer: Renderer, size: tuple[int, int]) -> Iterator[None]:
    """Turn OpenGL's lack of memory, which it reports as a flag and through later failures, into a UserError."""
    failure: Exception | None = None
    try:
        yield
    except Exception as error:
        failure = error
    if renderer.ctx.error == "GL_OUT_OF_MEMORY":
        message = f"{size[0]}x{size[1]} pixels: {renderer.ctx.info['GL_RENDERER']} has not enough memory for them"
        raise UserError(message, "choose a smaller --size") from failure
    if failure is not None:
        raise failure


def _last_frame(job: RenderJob, config: Config, shot: Shot, renderer: Renderer) -> Result:
    last = job.frames - 1
    keep = (job.show,) if job.show else ()
    if job.denoiser == "reference":
        with Progress(f"reference: {job.samples} paths per pixel") as progress:
            packet = shot.frame(last)
            truth = reference_of(shot, packet, job.samples, progress.update)
        return renderer.run(packet, config, job.denoiser, truth, keep)
    # Without a history only the last frame matters, and it looks the same on its own.
    first = last if job.denoiser == "none" else 0
    with Progress(f"{job.denoiser}: frames {first} to {last}") as progress:
        for index in range(first, job.frames):
            packet = shot.frame(index)
            result = renderer.run(packet, config, job.denoiser, keep=keep)
            progress.update((index + 1 - first) / (job.frames - first))
    return result


def reference_of(shot: Shot, packet: FramePacket, samples: int, progress: Callable[[float], None]) -> F32:
    """Mean of ``samples`` paths per pixel of the frame of ``packet``, its camera (jitter included) and time held.

    (H, W, 4) float32 radiance.
    """
    width, height = shot.size
    camera = shot.camera(packet.index).with_jitter(packet.jitter)
    portion = max(1, PATHS_AT_ONCE // (width * height))
    signals = np.zeros((2 if packet.specular is None else 3, height, width, 3))
    for first in range(0, samples, portion):
        count = min(portion, samples - first)
        means = shot.tracer.reference(camera, shot.size, count, packet.time, first)
        signals += np.stack(means) * (count / samples)
        progress((first + count) / samples)
    return modulate(packet, *signals)


def _require_texture(job: RenderJob, config: Config, shot: Shot) -> None:
    """Raises UserError, listing what there is, when the graph has no texture of the name asked for."""
    if not job.show:
        return
    plan = build(config, job.denoiser, FrameTraits(moving=shot.scene.has_motion)).compile()
    known = sorted({tex.name for tex in (*plan.imports, *plan.slot_of, *plan.feeds)})
    if job.show not in known:
        listing = "\n    ".join(known)
        raise UserError(
            f"--show {job.show}: {job.denoiser} has no such texture{did_you_mean(job.show, known)}",
            f"there are:\n    {listing}",
        )


def _write_result(job: RenderJob, result: Result) -> None:
    if job.show:
        texture = result.texture(job.show)
        values = read(texture)
        encoded = texture.dtype == "f1"  # eight bits are for the screen: sRGB already
        write_png(job.out, to_8bit(values) if encoded else to_srgb8(viewable(values)))
        channels = values.shape[2]
        exr = values[..., :3] if channels >= 3 else np.pad(values, ((0, 0), (0, 0), (0, 3 - channels)))
    else:
        write_png(job.out, display_of(result))
        exr = read(result.outputs["radiance"])[..., :3]
    print(job.out)
    if job.exr:
        path = job.out.with_suffix(".exr")
        write_exr(path, exr)
        print(path)


def display_of(result: Result) -> U8:
    """The picture for the screen, (H, W, 3) uint8 sRGB."""
    return to_8bit(read(result.outputs["display"]))


def to_8bit(values: F32) -> U8:
    """(H, W, >= 3) values in [0, 1] of an 8-bit texture back to (H, W, 3) uint8."""
    return (values[..., :3] * 255.0 + 0.5).astype(np.uint8)


def print_graph(config: Config, denoiser: str, dot: bool, moving: bool = False, scene: str | None = None) -> None:
    """The compiled plan of one frame, as text or Graphviz.

    ``moving``: as where objects move; with ``scene``, a scene or file, only if some of its objects can.
    Raises UserError where there is no such scene.
    """
    if scene is not None:
        moving = find_scene(scene, moving).has_motion
    plan = build(config, denoiser, FrameTraits(moving=moving)).compile()
    print(plan.dot() if dot else plan.text())
