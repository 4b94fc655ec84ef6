"""Speed of the tracer, and what of it is not Embree.

The share outside Embree is the wall time of a frame minus that of the same rays traced alone: every batch that the frame
handed to Embree is recorded, then handed over once more in the same order, tile by tile, on as many threads, with
nothing in between. Rebuilding what moves is no ray and counts as outside.
"""

from __future__ import annotations

import copy
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.cases import FIRST_MEASURED, FRAMES, Case
from bench.timing import Summary
from console import Progress
from raytrace.embree import RayCaster
from raytrace.integrator import Tracer
from raytrace.shot import Shot


class Query(NamedTuple):
    """One batch of rays as Embree's wrapper was given it."""

    scene: Any
    arguments: tuple[Any, ...]
    options: dict[str, Any]

    @property
    def rays(self) -> int:
        return len(self.arguments[0])

    def run(self) -> None:
        """Trace the batch. Only once: occlusion queries use up their array of limits."""
        self.scene.run(*self.arguments, **self.options)


class _Log(threading.local):
    """The queries of the tile that this thread is at."""

    def __init__(self) -> None:
        self.queries: list[Query] = []


class _RecordingScene:
    """An Embree scene that keeps a copy of every batch it traces."""

    def __init__(self, scene: Any, log: _Log) -> None:
        self._scene, self._log = scene, log

    def run(self, *arguments: Any, **options: Any) -> Any:
        kept = tuple(_copied(value) for value in arguments)
        self._log.queries.append(Query(self._scene, kept, {name: _copied(value) for name, value in options.items()}))
        return self._scene.run(*arguments, **options)


def _copied(value: Any) -> Any:
    return value.copy() if isinstance(value, np.ndarray) else value


class _RecordingCaster(RayCaster):
    def __init__(self, triangles: NDArray[np.float32], static_count: int, log: _Log) -> None:
        self._log = log
        super().__init__(triangles, static_count)
        if self._static is not None:
            self._static = _RecordingScene(self._static, log)

    def move(self, triangles: NDArray[np.float32], box: tuple[NDArray[np.float32], NDArray[np.float32]]) -> None:
        super().move(triangles, box)
        self._moving = _RecordingScene(self._moving, self._log)


class RecordingTracer(Tracer):
    """Traces the same frames as ``tracer`` and keeps the rays of the latest in :attr:`tiles`, in the tiles' order."""

    def __init__(self, tracer: Tracer) -> None:
        super().__init__(tracer.scene, tracer.settings)
        self._log = _Log()
        self.rays = _RecordingCaster(self.scene.triangles, self.scene.static_count, self._log)
        self.tiles: list[list[Query]] = []

    def for_each_tile(self, work: Callable[[NDArray[np.int32]], None], count: int) -> float:
        recorded: dict[int, list[Query]] = {}

        def record(pixels: NDArray[np.int32]) -> None:
            self._log.queries = []
            work(pixels)
            recorded[int(pixels[0])] = self._log.queries

        seconds = super().for_each_tile(record, count)
        self.tiles = [recorded[first] for first in sorted(recorded)]
        if sum(query.rays for tile in self.tiles for query in tile) < count:
            raise RuntimeError("fewer rays recorded than there are pixels: RayCaster traces past the recorder")
        return seconds


def trace_alone(tiles: Sequence[Sequence[Query]], threads: int) -> float:
    """Seconds of wall time in which ``threads`` threads trace the recorded ``tiles`` and do nothing else."""

    def trace(tile: Sequence[Query]) -> None:
        for query in tile:
            query.run()

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(trace, [[]] * threads))  # threads start with their first task
        start = time.perf_counter()
        list(pool.map(trace, tiles))
        return time.perf_counter() - start


@dataclass(frozen=True)
class TracingResult:
    """Milliseconds of one frame at one path per pixel.

    ``frame``: wall time; ``inside``: in Embree's calls, mean over the threads; ``alone``: the same rays by themselves;
    ``outside``: ``frame`` minus ``alone``, frame by frame. ``rays`` per frame; the rates count them against ``frame``
    and ``alone``, 10^6 rays/s.
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


class _Subject:
    """One shot being measured: its tracer, a second one that records, and the times so far (ms)."""

    def __init__(self, case: Case, shot: Shot) -> None:
        self.case, self.shot = case, shot
        self.recorder = RecordingTracer(shot.tracer)
        self._recorded = copy.copy(shot)
        self._recorded.tracer = self.recorder
        self.frame: list[float] = []
        self.inside: list[float] = []
        self.alone: list[float] = []
        self.rays: list[int] = []

    def measure(self, index: int) -> None:
        start = time.perf_counter()
        packet = self.shot.frame(index)
        seconds = time.perf_counter() - start
        if index < FIRST_MEASURED:
            return
        self._recorded.frame(index)
        tiles = self.recorder.tiles
        self.frame.append(seconds * 1e3)
        self.inside.append(packet.timings["embree"] * 1e3)
        self.rays.append(sum(query.rays for tile in tiles for query in tile))
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
        )


def measure(shots: dict[Case, Shot], repeats: int) -> list[TracingResult]:
    """Trace the frames of all ``shots``, one frame of each after the other, ``repeats`` times over."""
    subjects = [_Subject(case, shot) for case, shot in shots.items()]
    try:
        with Progress("tracing") as progress:
            for step in range(repeats * FRAMES):
                for subject in subjects:
                    subject.measure(step % FRAMES)
                progress.update((step + 1) / (repeats * FRAMES))
    finally:
        for subject in subjects:
            subject.recorder.close()
    return [subject.result() for subject in subjects]
