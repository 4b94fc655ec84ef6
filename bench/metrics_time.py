"""What happens over time: flicker of a picture that should stand still, and how long an event is seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bench.metrics import Image, Mask, display_curve

TOLERANCE = 0.1
"""Recovered: the error is at most this share above its steady value."""

TAIL = 0.25
"""Share of the frames after an event, the last ones, whose median is the steady value."""


class Deviation:
    """Standard deviation of every pixel over the frames added, on the display curve, by Welford's recurrence."""

    def __init__(self) -> None:
        self._count = 0
        self._mean: NDArray[np.float64] | None = None
        self._squares: NDArray[np.float64] | None = None

    def add(self, image: Image) -> None:
        """One more frame, (H, W, 3) linear radiance; all of the same size."""
        value = display_curve(image)
        if self._mean is None or self._squares is None:
            self._mean, self._squares = np.zeros_like(value), np.zeros_like(value)
        self._count += 1
        step = value - self._mean
        self._mean += step / self._count
        self._squares += step * (value - self._mean)

    def per_pixel(self) -> NDArray[np.float64]:
        """(H, W, 3), of the sample (divided by n - 1). Raises ValueError for fewer than two frames."""
        if self._squares is None or self._count < 2:
            raise ValueError("a deviation over time takes two frames")
        return np.asarray(np.sqrt(self._squares / (self._count - 1)))

    def mean(self, mask: Mask) -> float:
        """Over the pixels of ``mask`` and all channels."""
        return float(self.per_pixel()[mask].mean())


def steady(errors: Sequence[float]) -> float:
    """Median of the last quarter of ``errors``. Raises ValueError for none."""
    if not errors:
        raise ValueError("no error, no steady value")
    return float(np.median(errors[-_tail(errors) :]))


def _tail(errors: Sequence[float]) -> int:
    return max(1, round(TAIL * len(errors)))


def recovery(errors: Sequence[float]) -> int | None:
    """Frames after an event until the error is within 10 % of its steady value; 0: from the first frame on.

    None: not before the last quarter, whose median is then no steady value: it takes longer than was looked.

    ``errors``: of the frames from the event on, long enough for the last quarter to be steady. A single frame above the
    limit later on, as noise has it, does not count against the method.
    """
    limit = (1.0 + TOLERANCE) * steady(errors)
    first = next(index for index, error in enumerate(errors) if error <= limit)
    return first if first < max(1, len(errors) - _tail(errors)) else None
