"""Speed of the tracer, and what of it is not Embree.

The share outside Embree is the wall time of a frame minus that of the same rays traced alone: every batch of rays that
the frame needs is recorded, then traced once more in the same order, tile by tile, on as many threads, with nothing in
between. Rebuilding what moves is no ray and counts as outside.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.cases import FIRST_MEASURED, FRAMES, Case
from bench.timing import Summary
from console import Progress
from raytrace.casting import RayCaster
from raytrace.shot import Shot

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]


class Batch(NamedTuple):
    """``rays`` rays, which ``trace()`` traces. Only once: an occlusion query may use up its array of limits."""

    rays: int
    trace: Callable[[], object]


class Recorder(RayCaster):
    """Traces through ``caster`` and keeps a copy of every batch in :attr:`tiles`, one list for each tile of the image.

    A tile begins with its camera rays, the only ones that come in rows.
    """

    name = "recorder"

    def __init__(self, caster: RayCaster) -> None:
        super().__init__()
        self._caster = caster
        self.clock = caster.clock
        self.tiles: list[list[Batch]] = []
        self._here = threading.local()

    def move(self, triangles: F32, box: F32) -> None:
        self._caster.move(triangles, box)

    def intersect(self, origins: F32, directions: F32) -> tuple[I32, F32, F32]:
        self._keep(len(origins), partial(self._caster.intersect, origins.copy(), directions.copy()))
        return self._caster.intersect(origins, directions)

    def intersect_rows(self, origins: F32, directions: F32, width: int) -> tuple[I32, F32, F32]:
        self._here.tile = []
        self.tiles.append(self._here.tile)
        self._keep(len(origins), partial(self._caster.intersect_rows, origins.copy(), directions.copy(), width))
        return self._caster.intersect_rows(origins, directions, width)

    def occluded(self, origins: F32, directions: F32, limits: F32) -> I32:
        self._keep(len(origins), partial(self._caster.occluded, origins.copy(), directions.copy(), limits.copy()))
        return self._caster.occluded(origins, directions, limits)

    def close(self) -> None:
        self._caster.close()

    def _keep(self, rays: int, trace: Callable[[], object]) -> None:
        self._here.tile.append(Batch(rays, trace))


def record(shot: Shot, index: int) -> list[list[Batch]]:
    """The rays of frame ``index``, tile by tile."""
    tracer = shot.tracer
    caster = tracer.rays
    recorder = Recorder(caster)
    tracer.rays = recorder
    try:
        shot.frame(index)
    finally:
        tracer.rays = caster
    return recorder.tiles


def trace_alone(tiles: Sequence[Sequence[Batch]], threads: int) -> float:
    """Seconds of wall time in which ``threads`` threads trace the recorded ``tiles`` and do nothing else."""

    def trace(tile: Sequence[Batch]) -> None:
        for batch in tile:
            batch.trace()

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(trace, [[]] * threads))  # threads start with their first task
        start = time.perf_counter()
        list(pool.map(trace, tiles))
        return time.perf_counter() - start


@dataclass(frozen=True)
class TracingResult:
    """Milliseconds of one frame at one path per pixel.

    ``frame``: wall time; ``inside``: in calls to Embree, mean over the threads; ``alone``: the same rays by themselves;
    ``outside``: ``frame`` minus ``alone``, frame by frame. ``rays`` per frame; the rates count them against ``frame``
    and ``alone``, 10^6 rays/s. ``backend``: the way to Embree.
    """

    scene: str
    motion: str
    animate: bool
    size: tuple[int, int]
    triangles: int
    rays: int
    frame: Summary
    inside: Summary
    alone: Summary
    outside: Summary
    mrays_frame: float
    mrays_alone: float
    backend: str


class _Subject:
    """One shot being measured, and its times so far (ms)."""

    def __init__(self, case: Case, shot: Shot) -> None:
        self.case, self.shot = case, shot
        self.frame: list[float] = []
        self.inside: list[float] = []
        self.alone: list[float] = []
        self.rays: list[int] = []

    def measure(self, index: int) -> None:
        if index >= FIRST_MEASURED:
            # Not measured: what was done since this scene's last frame, by one thread or for another scene, leaves its
            # traces in caches and in where the system lets threads run. Frames in a row are what a viewer sees.
            self.shot.frame(index - 1)
        start = time.perf_counter()
        packet = self.shot.frame(index)
        seconds = time.perf_counter() - start
        if index < FIRST_MEASURED:
            return
        tiles = record(self.shot, index)
        self.frame.append(seconds * 1e3)
        self.inside.append(packet.timings["embree"] * 1e3)
        self.rays.append(sum(batch.rays for tile in tiles for batch in tile))
        self.alone.append(trace_alone(tiles, self.shot.tracer.threads) * 1e3)

    def result(self) -> TracingResult:
        rays = np.array(self.rays)
        return TracingResult(
            scene=self.case.scene,
            motion=self.case.motion,
            animate=self.case.animate,
            size=self.shot.size,
            triangles=len(self.shot.scene.triangles),
            rays=int(np.median(rays)),
            frame=Summary.of(self.frame),
            inside=Summary.of(self.inside),
            alone=Summary.of(self.alone),
            outside=Summary.of([frame - alone for frame, alone in zip(self.frame, self.alone, strict=True)]),
            mrays_frame=float(np.median(rays / self.frame)) / 1e3,
            mrays_alone=float(np.median(rays / self.alone)) / 1e3,
            backend=self.shot.tracer.rays.name,
        )


def measure(shots: dict[Case, Shot], repeats: int) -> list[TracingResult]:
    """Trace the frames of all ``shots``, one frame of each after the other, ``repeats`` times over."""
    subjects = [_Subject(case, shot) for case, shot in shots.items()]
    with Progress("tracing") as progress:
        for step in range(repeats * FRAMES):
            for subject in subjects:
                subject.measure(step % FRAMES)
            progress.update((step + 1) / (repeats * FRAMES))
    return [subject.result() for subject in subjects]
