"""What happens in the window, line by line, for those who read it in the terminal: ``app.py --log``."""

from __future__ import annotations

from typing import TextIO

from gl.plan import Plan

Size = tuple[int, int]


class Log:
    """Writes what has changed to ``stream``, each line with the number of the frame shown; to None: nothing."""

    def __init__(self, stream: TextIO | None) -> None:
        self._stream = stream
        self._frame = 0
        self._passes = ""
        self._errors: list[str] = []

    def frame(self, index: int, size: Size, plan: Plan, errors: list[str]) -> None:
        """Frame ``index`` of the scene is shown: size in pixels, passes, and what is wrong by now."""
        self._frame = index
        names = [node.name for node in plan.passes]
        passes = f"{size[0]}x{size[1]}, {len(names)} {'pass' if len(names) == 1 else 'passes'}: {' '.join(names)}"
        if passes != self._passes:
            self._passes = passes
            self._write(passes)
        for error in errors:
            if error not in self._errors:
                self._write(f"error: {error}")
        self._errors = list(errors)

    def news(self, text: str) -> None:
        """One line about the last thing done, "" for nothing."""
        if text:
            self._write(text)

    def _write(self, text: str) -> None:
        if self._stream is not None:
            print(f"frame {self._frame}: {text}", file=self._stream, flush=True)
