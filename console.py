"""Lines for people: progress that overwrites itself on a terminal, and tables."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from types import TracebackType
from typing import TextIO


class Progress:
    """``with Progress("reference") as p: p.update(0.5)``: one line on stderr with the share done and the time left.

    On a terminal the line overwrites itself; elsewhere (a log) it is printed once, when it ends. Nothing is printed for
    work that ends within half a second.
    """

    def __init__(self, what: str, stream: TextIO | None = None) -> None:
        self._what, self._stream = what, stream or sys.stderr
        self._start = self._last = time.monotonic()
        self._shown = False

    def __enter__(self) -> Progress:
        return self

    def update(self, share: float) -> None:
        """``share`` of the work done, in [0, 1]."""
        now = time.monotonic()
        if now - self._last < 0.2 or now - self._start < 0.5 or not self._stream.isatty():
            return
        self._last, self._shown = now, True
        left = (now - self._start) * (1.0 - share) / share if share > 0.0 else 0.0
        filled = round(share * 24)
        bar = "#" * filled + "." * (24 - filled)
        self._stream.write(f"\r{self._what} [{bar}] {share:4.0%}, {left:.0f} s left \x1b[K")
        self._stream.flush()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        seconds = time.monotonic() - self._start
        if self._shown:
            self._stream.write("\r\x1b[K")
        if kind is None and seconds > 0.5:
            self._stream.write(f"{self._what}: {seconds:.1f} s\n")
        self._stream.flush()


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns of text: the first aligned left, the others right."""
    widths = [max(len(row[i]) for row in (header, *rows)) for i in range(len(header))]

    def line(cells: Sequence[str]) -> str:
        first = cells[0].ljust(widths[0])
        return "  ".join([first, *(c.rjust(w) for c, w in zip(cells[1:], widths[1:], strict=True))]).rstrip()

    return "\n".join([line(header), line(["-" * w for w in widths]), *(line(row) for row in rows)])
