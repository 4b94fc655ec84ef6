"""The program as someone at a terminal has it: words in, files, text and an exit code out."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 120.0

SMALL = ("--size", "32x18")


@dataclass(frozen=True)
class Outcome:
    """What a run left behind."""

    code: int
    out: str
    err: str

    def error(self) -> str:
        """The one message of a run that the user has to mend; asserts that it is one, and that nothing else is told."""
        assert (self.code, self.out) == (2, ""), self
        assert "Traceback" not in self.err
        lines = [line for line in self.err.splitlines() if not line.startswith("  ")]
        assert len(lines) == 1, self.err
        assert lines[0].startswith("error: ")
        return self.err

    def files(self) -> list[str]:
        """Lines of a successful run's output: the names of what it wrote."""
        assert self.code == 0, self
        return self.out.splitlines()


App = Callable[..., Outcome]
"""``app("render", "--frames", "1")`` in this process."""


def environment(**changes: str) -> dict[str, str]:
    """This process's variables without a display, with ``changes``."""
    kept = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return {**kept, **changes}


def command(*words: str | Path) -> list[str]:
    return [sys.executable, str(ROOT / "app.py"), *map(str, words)]


def process(*words: str | Path, env: Mapping[str, str] | None = None, cwd: Path = ROOT) -> Outcome:
    """``app.py`` in a process of its own."""
    done = subprocess.run(
        command(*words), cwd=cwd, env=env or environment(), capture_output=True, text=True, timeout=SECONDS, check=False
    )
    return Outcome(done.returncode, done.stdout, done.stderr)


def png(path: Path) -> NDArray[np.uint8]:
    """(H, W, 3) uint8, row 0 = top row."""
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))
