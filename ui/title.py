"""The window's title."""

from __future__ import annotations

from collections import deque
from statistics import median
from typing import Final

_EVERY: Final = 0.5  # seconds
_NEWS_FOR: Final = 3.0  # seconds


class Pace:
    """Frames per second and milliseconds of tracing, over the last frames shown.

    ``work``: what those milliseconds went into.
    """

    def __init__(self) -> None:
        self.work = "tracing"
        self._shown: deque[float] = deque(maxlen=32)
        self._trace_ms: deque[float] = deque(maxlen=32)

    def count(self, now: float, trace_ms: float) -> None:
        """One more frame was shown, at ``now`` seconds of any clock; it took so long to trace."""
        self._shown.append(now)
        self._trace_ms.append(trace_ms)

    def clear(self) -> None:
        """What follows is not to be compared with what was: another size, another scene."""
        self._shown.clear()
        self._trace_ms.clear()

    @property
    def fps(self) -> float:
        """Frames per second; 0 until there are two."""
        span = self._shown[-1] - self._shown[0] if self._shown else 0.0
        return (len(self._shown) - 1) / span if span > 0.0 else 0.0

    @property
    def trace_ms(self) -> float:
        """Median time of tracing a frame; 0 before the first."""
        return median(self._trace_ms) if self._trace_ms else 0.0


class Title:
    """Scene, method, frames per second, milliseconds; for a while also what was just done."""

    def __init__(self, renderer: str) -> None:
        self._renderer = renderer
        self._news, self._news_until = "", 0.0
        self._changed = -_EVERY

    def update(self, now: float, scene: str, method: str, pace: Pace, news: str) -> str:
        """A new title, or "" while the old one is fresh enough. ``now``: seconds of any clock."""
        if news:
            self._news, self._news_until = news, now + _NEWS_FOR
        elif now - self._changed < _EVERY:
            return ""
        self._changed = now
        parts = [self._news] if now < self._news_until else []
        parts += [scene, method, f"{pace.fps:.1f} fps", f"{pace.work} {pace.trace_ms:.0f} ms", self._renderer]
        return " · ".join(parts)
