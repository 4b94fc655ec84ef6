"""The honest alternative to every filter: as many paths per pixel as fit into the time of tracing and filtering."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.cases import FIRST_MEASURED, SCORED
from bench.scores import Errors, Pictures, Score, Truth
from bench.timing import Summary
from console import Progress
from raytrace.frame import FramePacket
from raytrace.shot import Shot

F64 = NDArray[np.float64]

_FIRST_SAMPLE = 1 << 20
"""Beyond the samples of any reference: what is judged shares no path with its judge."""

_STRIDE = 1 << 14
"""Samples between two frames: each has its own, as the noise of a moving picture has."""

_EVERY = 3  # frames between two measurements of what a sample takes
_SAMPLES = 4  # of one such measurement


@dataclass(frozen=True)
class PathTracing:
    """The mean of ``samples`` paths per pixel. ``milliseconds``: of tracing; the primary hits are traced once."""

    samples: int
    milliseconds: float
    errors: Errors
    pictures: Pictures | None = None


class TracingTimes:
    """What a frame of one path per pixel takes, and each further path. Call it with the index of every frame."""

    def __init__(self, shot: Shot) -> None:
        self._shot = shot
        self._frame: list[float] = []
        self._sample: list[float] = []

    def __call__(self, index: int) -> None:
        if index < FIRST_MEASURED:
            return
        shot = self._shot
        start = time.perf_counter()
        shot.frame(index)
        self._frame.append((time.perf_counter() - start) * 1e3)
        if index % _EVERY == 0:
            one, more = self._reference(index, 1), self._reference(index, 1 + _SAMPLES)
            self._sample.append((more - one) / _SAMPLES)

    def _reference(self, index: int, samples: int) -> float:
        shot = self._shot
        start = time.perf_counter()
        shot.tracer.reference(shot.camera(index), shot.size, samples, shot.time(index), _FIRST_SAMPLE)
        return (time.perf_counter() - start) * 1e3

    @property
    def frame(self) -> Summary:
        """Milliseconds of a frame."""
        return Summary.of(self._frame)

    @property
    def sample(self) -> float:
        """Median milliseconds of one path more for every pixel."""
        return max(float(np.median(self._sample)), 1e-3)


def measure(
    shot: Shot, packets: Sequence[FramePacket], truth: Truth, times: TracingTimes, counts: Iterable[int]
) -> tuple[PathTracing, ...]:
    """Trace the scored frames of ``shot`` with each number of paths in ``counts``; ascending."""
    wanted = sorted(set(counts))
    scores = {count: Score(truth) for count in wanted}
    with Progress(f"{shot.scene.scene.name}: path tracing, up to {wanted[-1]} paths") as progress:
        for number, index in enumerate(SCORED):
            sums: tuple[F64, ...] = ()
            done = 0
            for count in wanted:
                first = _FIRST_SAMPLE + index * _STRIDE + done
                means = shot.tracer.reference(
                    shot.camera(index), shot.size, count - done, shot.time(index), first_sample=first
                )
                added = tuple(mean * (count - done) for mean in means)
                sums = tuple(before + more for before, more in zip(sums, added, strict=True)) if sums else added
                done = count
                image = packets[index].modulated(*(total / count for total in sums)).astype(np.float32)
                scores[count].watch(index, image)
                scores[count].add(index, image)
            progress.update((number + 1) / len(SCORED))
    return tuple(
        PathTracing(
            samples=count,
            milliseconds=times.frame.median + (count - 1) * times.sample,
            errors=score.errors(),
            pictures=score.pictures(),
        )
        for count, score in scores.items()
    )
