"""What happens in the window, line by line, for those who read it in the terminal: ``app.py --log``."""

from __future__ import annotations

from typing import TextIO

from bench.judge import Verdict
from gl.plan import Plan

Size = tuple[int, int]


class Log:
    """Writes what has changed to ``stream``, each line with the number of the frame shown; to None: nothing."""

    def __init__(self, stream: TextIO | None) -> None:
        self._stream = stream
        self._frame = 0
        self._passes = ""
        self._errors: list[str] = []
        self._samples = 0

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

    def error(self, verdict: Verdict | None) -> None:
        """What is known of the error of the picture: told when it is first known, and when the reference has twice as
        many paths as the last time."""
        if verdict is None:
            if self._samples:
                self._write("no reference: something moves")
            self._samples = 0
        elif verdict.samples >= 2 * self._samples:
            self._samples = verdict.samples
            numbers = f"RMSE {verdict.rmse:.4f}, PSNR {verdict.psnr:.2f} dB, FLIP {verdict.flip:.4f}"
            self._write(f"{numbers} against {verdict.samples} paths, whose own RMSE is {verdict.noise:.4f}")

    def news(self, text: str) -> None:
        """One line about the last thing done, "" for nothing."""
        if text:
            self._write(text)

    def _write(self, text: str) -> None:
        if self._stream is not None:
            print(f"frame {self._frame}: {text}", file=self._stream, flush=True)
