"""What is seen over time: flicker of a still picture, and how long a cut, a switched light and a disocclusion last.

Four short sequences in the Cornell box, in which the camera rests but for the event. After it the picture stands still,
so that one converged reference serves all frames. The error is the RMSE of linear radiance without light sources; after
a disocclusion on the pixels that were hidden before, which is where it lasts.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import assets
from bench.cases import EventEffort
from bench.methods import METHODS, Method, NewRenderer
from bench.metrics import Mask, rmse
from bench.metrics_time import Deviation, recovery, steady
from bench.references import ReferenceCache
from bench.running import Contestant, available, contestant
from config import Config
from console import Progress
from raytrace.camera import Camera
from raytrace.frame import MISS, FramePacket, Vector
from raytrace.scene import Scene
from raytrace.shot import FPS, Shot
from session import open_tracer

SCENE = "cornell"

CUT_TO = 45
"""Frame of the flight whose view the cut goes to."""

SIDESTEP = 0.12
"""Of the scene's extent: how far the camera jumps sideways, unannounced, to uncover what was hidden."""

DIMMED = 0.25
"""What is left of the lamp's radiance once it is switched."""

_SLICE = 64
_DEPTH = 0.02  # share of the depth by which a point seen before may differ and still be the same


@dataclass(frozen=True)
class EventResult:
    """One method: ``flicker``, mean standard deviation over time on the display curve; ``errors`` from the event on,
    by its name; ``recovery``: frames until they are within 10 % of ``steady``, their value in the end."""

    name: str
    group: str
    stage: bool
    flicker: float
    errors: dict[str, tuple[float, ...]]
    steady: dict[str, float]
    recovery: dict[str, int]


@dataclass(frozen=True)
class EventsResult:
    """All methods. ``frames``: before the event, and from it on. ``noise``: RMSE of the references, by event."""

    scene: str
    size: tuple[int, int]
    frames: tuple[int, int]
    samples: int
    noise: dict[str, float]
    methods: tuple[EventResult, ...]
    reference_seconds: float


@dataclass(frozen=True)
class Film:
    """``packets`` of one sequence; ``truth`` (H, W, 3): linear radiance from the event on, ``noise`` its RMSE on
    ``mask``, the pixels that count."""

    packets: tuple[FramePacket, ...]
    truth: NDArray[np.float64]
    mask: Mask
    noise: float


def measure(
    config: Config,
    new_renderer: NewRenderer,
    references: ReferenceCache,
    effort: EventEffort,
    methods: Sequence[Method] = METHODS,
) -> EventsResult:
    """Run the ``methods`` through all events. Raises UserError where references cannot be kept."""
    chosen = [m for m in available(methods) if not m.taa and (effort.stages or not m.stage)]
    still, films, seconds = _films(config, references, effort)
    results = []
    with Progress(f"{len(chosen)} methods through {1 + len(films)} events") as progress:
        for number, method in enumerate(chosen):
            runner = contestant(method, config, new_renderer())
            try:
                results.append(_run(runner, still, films, effort.frames[0]))
            finally:
                runner.release()
            progress.update((number + 1) / len(chosen))
    noise = {name: film.noise for name, film in films.items()}
    return EventsResult(SCENE, effort.size, effort.frames, effort.samples, noise, tuple(results), seconds)


def _run(runner: Contestant, still: tuple[FramePacket, ...], films: dict[str, Film], event: int) -> EventResult:
    deviation = Deviation()
    mask = still[0].emission[..., :3].max(axis=2) == 0.0
    for packet in still:
        runner.filter(packet, None)
        if packet.index >= len(still) // 2:
            deviation.add(runner.radiance())
    errors: dict[str, tuple[float, ...]] = {}
    for name, film in films.items():
        found = []
        for packet in film.packets:
            runner.filter(packet, None)
            if packet.index >= event:
                found.append(rmse(runner.radiance(), film.truth, film.mask))
        errors[name] = tuple(found)
    return EventResult(
        name=runner.method.name,
        group=runner.method.group,
        stage=runner.method.stage,
        flicker=deviation.mean(mask),
        errors=errors,
        steady={name: steady(found) for name, found in errors.items()},
        recovery={name: recovery(found) for name, found in errors.items()},
    )


def _films(
    config: Config, references: ReferenceCache, effort: EventEffort
) -> tuple[tuple[FramePacket, ...], dict[str, Film], float]:
    """The sequence at rest, those with an event by name, and the seconds that their references took."""
    scene = assets.build(SCENE)
    assert scene.flight is not None
    here, there = scene.camera, scene.flight(CUT_TO / FPS)
    first, then = effort.frames
    films, seconds = {}, 0.0
    with ExitStack() as stack:

        def shot(scene: Scene, cameras: list[Camera]) -> Shot:
            compiled, tracer = open_tracer(scene, config)
            stack.callback(tracer.close)
            return Shot(compiled, tracer, effort.size, cameras)

        def film(before: Shot, after: Shot, cut: bool = False) -> Film:
            nonlocal seconds
            packets = [before.frame(index) for index in range(first)]
            for index in range(first, first + then):
                packet = after.frame(index)
                packets.append(replace(packet, scene_id=packets[0].scene_id, cut=cut and index == first))
            found, took = references.fill(after, [first], effort.samples, _SLICE)
            seconds += took
            mask = packets[first].emission[..., :3].max(axis=2) == 0.0
            reference = found[first]
            return Film(tuple(packets), reference.radiance(packets[first]), mask, reference.noise(packets[first], mask))

        rest = shot(scene, [here])
        still = tuple(rest.frame(index) for index in range(first + then))
        jump = shot(scene, [here] * first + [there])
        films["cut"] = film(jump, jump, cut=True)
        films["light switched"] = film(rest, shot(dimmed(scene), [here]))
        step = shot(scene, [here] * first + [sidestepped(here, SIDESTEP * rest.scene.extent)])
        uncovered = film(step, step)
        hidden = uncovered.mask & disoccluded(uncovered.packets[first], uncovered.packets[first - 1])
        films["disocclusion"] = replace(uncovered, mask=hidden)
    return still, films, seconds


def dimmed(scene: Scene) -> Scene:
    """``scene`` with :data:`DIMMED` of the radiance of its lamps and its sky."""

    def scaled(color: Vector) -> Vector:
        red, green, blue = (DIMMED * channel for channel in color)
        return red, green, blue

    materials = tuple(replace(material, emission=scaled(material.emission)) for material in scene.materials)
    return replace(scene, materials=materials, sky=None if scene.sky is None else scaled(scene.sky))


def sidestepped(camera: Camera, distance: float) -> Camera:
    """``camera`` moved to its right, looking the same way."""
    right, _, _ = camera.axes()
    x, y, z = (at + distance * axis for at, axis in zip(camera.position, right, strict=True))
    return replace(camera, position=(x, y, z))


def disoccluded(now: FramePacket, before: FramePacket) -> Mask:
    """Pixels (H, W) of ``now`` whose surface point was hidden, or out of sight, in the frame ``before``."""
    height, width = now.surface.shape[:2]
    rows, columns = np.mgrid[0:height, 0:width]
    x = np.floor(columns + 0.5 + now.motion[..., 0] * width).astype(np.int64)
    y = np.floor(rows + 0.5 + now.motion[..., 1] * height).astype(np.int64)
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height) & (now.motion[..., 2] > 0.0)
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    same = before.motion[y, x, 3] == now.motion[..., 3]
    depth = now.motion[..., 2]
    same &= np.abs(before.surface[y, x, 3] - depth) <= _DEPTH * np.abs(depth)
    return np.asarray((now.motion[..., 3] != MISS) & ~(inside & same))
