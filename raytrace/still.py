"""The converged picture of a view at rest, refined sample by sample while other frames are traced."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.frame import FramePacket
from raytrace.sampling import radical_inverse

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_CYCLE = 256  # places in a pixel that the samples of a filtered picture go through, Halton in bases 2 and 3
_PLACES = np.stack([radical_inverse(base, _CYCLE + 1)[1:] for base in (2, 3)], axis=1) - 0.5


class SampleSource(Protocol):
    """What is needed of :class:`raytrace.integrator.Tracer`."""

    def reference_frame(
        self, sample: int, camera: Camera, size: tuple[int, int], now: float, lamps: float
    ) -> FramePacket: ...


@dataclass(frozen=True)
class StillView:
    """``camera`` without jitter; ``size`` (width, height) in pixels; ``time`` of the scene in seconds. ``filtered``:
    the mean over the pixels' squares (a box filter) instead of their centres, as jittered frames converge to.
    ``lamps``: share of their light that lamps give."""

    camera: Camera
    size: tuple[int, int]
    time: float
    filtered: bool
    lamps: float = 1.0


@dataclass(frozen=True)
class Snapshot:
    """The picture so far: ``radiance`` (H, W, 3) float32, linear, the mean of ``samples`` paths per pixel; ``mask``
    (H, W): pixels without light sources; ``noise``: RMSE that the mean itself has there, NaN before it can be told."""

    view: StillView
    samples: int
    radiance: F32
    mask: NDArray[np.bool_]
    noise: float


class StillReference:
    """Sums of the samples of one view, in two halves, whose difference tells the noise of their mean."""

    def __init__(self, view: StillView) -> None:
        self.view = view
        height, width = view.size[1], view.size[0]
        self._sums: F64 = np.zeros((2, height, width, 3))
        self._emits: NDArray[np.bool_] = np.zeros((height, width), dtype=bool)
        self._samples = 0

    def refine(self, source: SampleSource) -> Snapshot:
        """Add one path to every pixel."""
        camera = self.view.camera
        if self.view.filtered:
            camera = camera.with_jitter(_place(self._samples))
        packet = source.reference_frame(self._samples, camera, self.view.size, self.view.time, self.view.lamps)
        self._sums[self._samples % 2] += packet.radiance()
        self._emits |= packet.emission[..., :3].max(axis=2) > 0.0
        self._samples += 1
        mask = ~self._emits
        mean = (self._sums[0] + self._sums[1]) / self._samples
        return Snapshot(self.view, self._samples, mean.astype(np.float32), mask, self._noise(mask))

    def _noise(self, mask: NDArray[np.bool_]) -> float:
        """With n_a and n_b paths in the halves the variance of the mean of all is n_a n_b / (n_a + n_b)² of that of
        the difference of theirs."""
        first, second = (self._samples + 1) // 2, self._samples // 2
        if second == 0 or not mask.any():
            return math.nan
        difference = (self._sums[0] / first - self._sums[1] / second)[mask]
        return float(np.sqrt(np.mean(difference * difference) * first * second)) / self._samples


def _place(sample: int) -> tuple[float, float]:
    """Offset of a camera ray in its pixel, in pixels, each in (-0.5, 0.5)."""
    x, y = _PLACES[sample % _CYCLE]
    return float(x), float(y)
