"""Does a long run grow? Resident memory of the process over many frames, traced and filtered."""

from __future__ import annotations

import gc
import os
from dataclasses import dataclass
from pathlib import Path

from config import Config
from console import Progress
from gl.renderer import Renderer
from raytrace.shot import Shot

WARM_UP = 200
"""Frames after which everything that is allocated once has been."""

_STATM = Path("/proc/self/statm")


@dataclass(frozen=True)
class MemoryResult:
    """Resident megabytes (10^6 bytes) after ``first`` and after ``frames`` frames of ``size``."""

    scene: str
    size: tuple[int, int]
    first: int
    frames: int
    megabytes_first: float
    megabytes_last: float

    @property
    def growth(self) -> float:
        """Megabytes gained in between."""
        return self.megabytes_last - self.megabytes_first


def resident_megabytes() -> float | None:
    """Physical memory that this process holds, 10^6 bytes; None where the system does not tell (no /proc)."""
    if not _STATM.exists():
        return None
    gc.collect()
    pages = int(_STATM.read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def measure(shot: Shot, config: Config, renderer: Renderer, frames: int, first: int = WARM_UP) -> MemoryResult | None:
    """Trace and filter ``frames`` frames of ``shot`` by SVGF; None where memory cannot be read."""
    marks: dict[int, float] = {}
    with Progress(f"memory over {frames} frames") as progress:
        for index in range(frames):
            renderer.run(shot.frame(index), config, "svgf")
            if index + 1 in (first, frames):
                renderer.ctx.finish()
                megabytes = resident_megabytes()
                if megabytes is None:
                    return None
                marks[index + 1] = megabytes
            progress.update((index + 1) / frames)
    return MemoryResult(shot.scene.scene.name, shot.size, first, frames, marks[first], marks[frames])
