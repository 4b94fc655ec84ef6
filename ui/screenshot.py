"""What the window writes to files: pictures, and the ways that the camera went."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from errors import UserError
from images import write_png
from raytrace.camera import Camera
from raytrace.camera_path import Keyframe, as_toml
from raytrace.shot import FPS
from storage import replace_file


def save_screenshot(folder: Path, pixels: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> str:
    """Write ``pixels`` (H, W, 3), row 0 = bottom, to ``shot_NNN.png``, NNN not used yet; returns what to tell the user.

    A folder that cannot be written to is told as well, but closes no window.
    """
    return _saved(folder, "shot", ".png", lambda path: write_png(path, pixels))


def save_path(folder: Path, cameras: Sequence[Camera], scene: str) -> str:
    """Write the ``cameras`` of consecutive frames to ``camera_NNN.toml``; otherwise as :func:`save_screenshot`.

    :meth:`raytrace.shot.Shot.camera` then returns the same for each frame, to the bit.
    """
    keys = [Keyframe(index / FPS, camera) for index, camera in enumerate(cameras)]
    text = as_toml(keys, f"camera path through {scene}, {len(keys)} frames: app.py --camera THIS_FILE")

    def write(path: Path) -> None:
        replace_file(path, lambda target: Path(target).write_text(text, encoding="utf-8"))

    return _saved(folder, "camera", ".toml", write)


def _saved(folder: Path, stem: str, suffix: str, write: Callable[[Path], None]) -> str:
    names = (re.fullmatch(rf"{stem}_(\d+)", path.stem) for path in folder.glob(f"{stem}_*{suffix}"))
    path = folder / f"{stem}_{max((int(found[1]) for found in names if found), default=-1) + 1:03d}{suffix}"
    try:
        write(path)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return str(error).partition("\n")[0]
    print(path, flush=True)
    return f"saved {path}"
