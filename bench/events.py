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
from bench.running import Contestant, available, contestant, remembers
from config import Config
from console import Progress
from raytrace.camera import Camera
from raytrace.frame import MISS, FramePacket
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

REST, CUT, SWITCH, STEP = "at rest", "cut", "light switched", "disocclusion"

_SLICE = 64
_DEPTH = 0.02  # share of the depth by which a point seen before may differ and still be the same


@dataclass(frozen=True)
class EventResult:
    """One method: ``flicker``, mean standard deviation over time on the display curve; ``errors`` from the event on,
    by its name; ``recovery``: frames until they are within 10 % of ``steady``, their value in the end;
    None: longer than was looked."""

    name: str
    group: str
    stage: bool
    flicker: float
    errors: dict[str, tuple[float, ...]]
    steady: dict[str, float]
    recovery: dict[str, int | None]


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
class Truth:
    """From the event on: ``radiance`` (H, W, 3), linear, ``noise`` its RMSE on ``mask``, the pixels that count."""

    radiance: NDArray[np.float64]
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
    results = []
    with ExitStack() as stack:
        films = Films(config, effort, stack)
        seconds = films.converge(references)
        with Progress(f"{len(chosen)} methods through {len(films.truths)} events") as progress:
            for number, method in enumerate(chosen):
                runner = contestant(method, config, new_renderer())
                try:
                    results.append(_run(runner, films, remembers(method, config)))
                finally:
                    runner.release()
                progress.update((number + 1) / len(chosen))
    noise = {name: truth.noise for name, truth in films.truths.items()}
    return EventsResult(SCENE, effort.size, effort.frames, effort.samples, noise, tuple(results), seconds)


def _run(runner: Contestant, films: Films, rule: str) -> EventResult:
    deviation = Deviation()
    rest = films.packets(REST, rule)
    mask = rest[0].emission[..., :3].max(axis=2) == 0.0
    for packet in rest:
        runner.filter(packet, None)
        if packet.index >= len(rest) // 2:
            deviation.add(runner.radiance())
    errors: dict[str, tuple[float, ...]] = {}
    for name, truth in films.truths.items():
        found = []
        for packet in films.packets(name, rule):
            runner.filter(packet, None)
            if packet.index >= films.event:
                found.append(rmse(runner.radiance(), truth.radiance, truth.mask))
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


class Films:
    """The sequences by name, each traced once for every rule by which points are remembered, and what is true from
    frame ``event`` on (:meth:`converge`). ``stack`` closes the tracers."""

    def __init__(self, config: Config, effort: EventEffort, stack: ExitStack) -> None:
        scene = assets.build(SCENE)
        assert scene.flight is not None
        here, there = scene.camera, scene.flight(CUT_TO / FPS)
        self.event, then = effort.frames
        self._count, self._samples = self.event + then, effort.samples
        self._packets: dict[tuple[str, str], tuple[FramePacket, ...]] = {}
        self.truths: dict[str, Truth] = {}

        def shot(scene: Scene, after: Camera, animate: bool = False) -> Shot:
            compiled, tracer = open_tracer(scene, config)
            stack.callback(tracer.close)
            return Shot(compiled, tracer, effort.size, [here] * self.event + [after], animate)

        rest = shot(scene, here)
        self._shots = {
            REST: rest,
            CUT: shot(scene, there),
            SWITCH: shot(switched(scene, self.event), here, animate=True),
            STEP: shot(scene, sidestepped(here, SIDESTEP * rest.scene.extent)),
        }

    def packets(self, name: str, rule: str = "") -> tuple[FramePacket, ...]:
        """All frames of a sequence, with points remembered by ``rule``."""
        if (name, rule) not in self._packets:
            shot = self._shots[name]
            shot.remember = rule
            packets = [shot.frame(index) for index in range(self._count)]
            if name == CUT:
                packets[self.event] = replace(packets[self.event], cut=True)
            self._packets[name, rule] = tuple(packets)
        return self._packets[name, rule]

    def converge(self, references: ReferenceCache) -> float:
        """Complete the references; returns the seconds that took."""
        seconds = 0.0
        for name, shot in self._shots.items():
            if name == REST:
                continue
            found, took = references.fill(shot, [self.event], self._samples, _SLICE)
            seconds += took
            reference, packets = found[self.event], self.packets(name)
            now = packets[self.event]
            mask = now.emission[..., :3].max(axis=2) == 0.0
            if name == STEP:
                mask &= disoccluded(now, packets[self.event - 1])
            self.truths[name] = Truth(reference.radiance(now), mask, reference.noise(now, mask))
        return seconds


def switched(scene: Scene, event: int) -> Scene:
    """``scene``, whose lamps give :data:`DIMMED` of their light from frame ``event`` on."""

    def dimmer(time: float) -> float:
        return 1.0 if time < (event - 0.5) / FPS else DIMMED

    materials = (replace(material, dimmer=dimmer) if material.emits else material for material in scene.materials)
    return replace(scene, materials=tuple(materials))


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
