"""How long each pass takes on the GPU, as rolling medians.

On hardware a pass is timed by a timer query, read some frames later so that nothing waits. On software renderers those
queries lie (they time the recording of commands, not the work), so there the pipeline is drained around every pass.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from statistics import median
from typing import Final

import moderngl

WINDOW: Final = 64
"""Frames a median is taken over."""

LATENCY: Final = 4
"""Frames after which timer queries are read: later than any driver's queue of frames is long."""

SOFTWARE_RENDERERS: Final = ("llvmpipe", "softpipe", "swrast", "swr")


def is_software(ctx: moderngl.Context) -> bool:
    """Whether ``GL_RENDERER`` names a renderer that runs on the CPU."""
    renderer = str(ctx.info["GL_RENDERER"]).lower()
    return any(name in renderer for name in SOFTWARE_RENDERERS)


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the report: a name, its median in milliseconds, and its share [0;1] of the sum of all rows."""

    name: str
    milliseconds: float
    share: float


@dataclass(slots=True)
class _Frame:
    queries: list[tuple[str, moderngl.Query]] = field(default_factory=list)
    milliseconds: dict[str, float] = field(default_factory=dict)
    total: float = 0.0

    def add(self, name: str, milliseconds: float) -> None:
        """A name measured twice in a frame counts with the sum."""
        self.milliseconds[name] = self.milliseconds.get(name, 0.0) + milliseconds


class Profiler:
    """Collects timings::

        with profiler.frame():
            with profiler.measure("upload"):
                ...
            executor.run(plan, size, uploads, profiler=profiler)
        for row in profiler.rows():
            ...

    The executor opens a frame itself where there is none.

    Args:
        queries: use timer queries; by default exactly on hardware.
    """

    def __init__(self, ctx: moderngl.Context, queries: bool | None = None) -> None:
        self._ctx = ctx
        self._queries = not is_software(ctx) if queries is None else queries
        self._free: list[moderngl.Query] = []
        self._pending: deque[_Frame] = deque()
        self._frame: _Frame | None = None
        self._order: list[str] = []
        self._windows: dict[str, deque[float]] = {}
        self._totals: deque[float] = deque(maxlen=WINDOW)

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Group measurements to one frame; inside another frame this does nothing.

        The frame's total is its wall time on software renderers, where it may be compared with the sum of the rows,
        and the sum of its timer queries on hardware, where the CPU's time says nothing about the GPU's.
        """
        if self._frame is not None:
            yield
            return
        frame = self._frame = _Frame()
        if not self._queries:
            self._ctx.finish()
        start = time.perf_counter()
        try:
            yield
        finally:
            self._frame = None
            if not self._queries:
                self._ctx.finish()
                frame.total = (time.perf_counter() - start) * 1e3
        self._pending.append(frame)
        while len(self._pending) > (LATENCY if self._queries else 0):
            self._collect(self._pending.popleft())

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Time the GL commands issued inside. Measurements cannot be nested (OpenGL's queries cannot).

        Raises:
            RuntimeError: no frame is open.
        """
        frame = self._frame
        if frame is None:
            raise RuntimeError(f"Profiler.measure({name!r}) outside of Profiler.frame()")
        if self._queries:
            query = self._free.pop() if self._free else self._ctx.query(time=True)
            frame.queries.append((name, query))
            with query:
                yield
        else:
            self._ctx.finish()
            start = time.perf_counter()
            try:
                yield
            finally:
                self._ctx.finish()
                frame.add(name, (time.perf_counter() - start) * 1e3)

    def flush(self) -> None:
        """Wait for the measurements that are still on their way; for reports at the end of a run."""
        while self._pending:
            self._collect(self._pending.popleft())

    def rows(self) -> list[Row]:
        """Medians of what the latest collected frame measured, in its order."""
        medians = [(name, median(self._windows[name])) for name in self._order]
        total = sum(milliseconds for _, milliseconds in medians) or 1.0
        return [Row(name, milliseconds, milliseconds / total) for name, milliseconds in medians]

    @property
    def total(self) -> float:
        """Median of the frames' totals in milliseconds; 0 before the first frame is collected."""
        return median(self._totals) if self._totals else 0.0

    def report(self) -> str:
        """The rows and the total as a table."""
        rows = self.rows()
        width = max([len(row.name) for row in rows] + [len("frame")])
        lines = [f"{row.name:<{width}} {row.milliseconds:8.2f} ms {row.share:6.1%}" for row in rows]
        return "\n".join([*lines, f"{'frame':<{width}} {self.total:8.2f} ms"])

    def _collect(self, frame: _Frame) -> None:
        for name, query in frame.queries:
            frame.add(name, query.elapsed * 1e-6)
            self._free.append(query)
        self._order = list(frame.milliseconds)
        for name, milliseconds in frame.milliseconds.items():
            self._windows.setdefault(name, deque(maxlen=WINDOW)).append(milliseconds)
        self._totals.append(sum(frame.milliseconds.values()) if self._queries else frame.total)
