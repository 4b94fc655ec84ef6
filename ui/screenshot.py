"""Pictures of what the window shows."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np

from errors import UserError
from images import write_png


def save_screenshot(folder: Path, pixels: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> str:
    """Write ``pixels`` (H, W, 3), row 0 = bottom, to ``shot_NNN.png``, NNN not used yet; returns what to tell the user.

    A folder that cannot be written to is told as well, but closes no window.
    """
    taken = [int(found[1]) for path in folder.glob("shot_*.png") if (found := re.fullmatch(r"shot_(\d+)", path.stem))]
    path = folder / f"shot_{max(taken, default=-1) + 1:03d}.png"
    try:
        write_png(path, pixels)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return str(error).partition("\n")[0]
    print(path, flush=True)
    return f"saved {path}"
