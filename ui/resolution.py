"""How many pixels are rendered, whatever the window's size: a ladder of sizes, and the rung to begin on."""

from __future__ import annotations

from fractions import Fraction
from statistics import median
from typing import Final

Size = tuple[int, int]

_RUNGS: Final = tuple(Fraction(n, 24) for n in (3, 4, 6, 8, 12, 16, 18, 24, 32, 36, 48, 72, 96))  # 1/8 to 4
_SMALLEST: Final = 8  # pixels a side
_LARGEST: Final = 16384

FPS_WANTED: Final = 10.0
"""Frames per second that the first resolution is chosen for."""

_FIRST: Final = Fraction(1, 4)
_SKIPPED: Final = 3  # intervals after a change of size: programs, kernels and textures are made in them
_COUNTED: Final = 4  # intervals a median is taken over
_MARGIN: Final = 0.85  # of the time a frame may take, for sizes not measured yet


def ladder(base: Size) -> list[Size]:
    """The sizes to choose from, growing, ``base`` among them, all of its shape as far as whole pixels go."""
    sizes = [tuple(max(1, round(side * rung)) for side in base) for rung in _RUNGS]
    fitting = [(w, h) for w, h in sizes if min(w, h) >= _SMALLEST and max(w, h) <= _LARGEST]
    return sorted({*fitting, base}, key=_pixels)


def step(base: Size, size: Size, rungs: int) -> Size:
    """The size ``rungs`` above ``size`` (below, where negative), or the last one in that direction."""
    sizes = ladder(base)
    return sizes[min(max(sizes.index(size) + rungs, 0), len(sizes) - 1)]


class Calibration:
    """Finds the largest rung, ``base`` at most, that is shown :data:`FPS_WANTED` times a second or more.

    It begins at a quarter of ``base``, whose first frames are there soon. What it concludes from the time between them
    is measured in turn: a frame takes some time whatever its size, and some for every pixel, and two measurements tell
    the two apart. Where no size is fast enough the picture stays at a quarter: fewer pixels would help little.
    """

    def __init__(self, base: Size) -> None:
        wanted = base[0] * base[1] * float(_FIRST * _FIRST)
        known = [size for size in ladder(base) if _pixels(size) <= _pixels(base)]
        self.size = min(known, key=lambda size: abs(_pixels(size) - wanted))
        self._sizes = [size for size in known if _pixels(size) >= _pixels(self.size)]
        self.done = len(self._sizes) == 1
        self._seconds: dict[Size, float] = {}
        self._seen = 0
        self._intervals: list[float] = []

    def count(self, seconds: float) -> bool:
        """One more frame was shown, so long after the one before; returns whether :attr:`size` has changed."""
        if self.done:
            return False
        self._seen += 1
        if self._seen <= _SKIPPED:
            return False
        self._intervals.append(seconds)
        if len(self._intervals) < _COUNTED:
            return False
        before, self._seconds[self.size] = self.size, median(self._intervals)
        self._seen, self._intervals = 0, []
        self.size = self._best()
        self.done = self.size in self._seconds
        return self.size != before

    def _best(self) -> Size:
        """The largest size that is fast enough, as far as is known: measured, or else concluded."""
        allowed = 1.0 / FPS_WANTED
        too_slow = [_pixels(size) for size, seconds in self._seconds.items() if seconds > allowed]
        fixed, per_pixel = self._model()
        best = self._sizes[0]
        for size in self._sizes:
            expected = (fixed + per_pixel * _pixels(size)) / _MARGIN
            fast = self._seconds[size] <= allowed if size in self._seconds else expected <= allowed
            if fast and all(_pixels(size) < slow for slow in too_slow):
                best = size
        return best

    def _model(self) -> tuple[float, float]:
        """Seconds of a frame without pixels, and seconds per pixel, of the two sizes measured last."""
        points = [(_pixels(size), seconds) for size, seconds in self._seconds.items()][-2:]
        (small, quick), (large, slow) = min(points), max(points)
        if small == large:
            return 0.0, slow / large
        per_pixel = max(slow - quick, 0.0) / (large - small)
        return max(slow - per_pixel * large, 0.0), per_pixel


def _pixels(size: Size) -> int:
    return size[0] * size[1]
