"""Pictures to and from disk. In memory row 0 is the bottom row, in files the top one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image

from errors import UserError
from storage import replace_file

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]


def to_srgb8(linear: NDArray[np.floating]) -> U8:
    """(H, W, 3) linear colour in [0, 1] to 8-bit sRGB, clamped; IEC 61966-2-1."""
    c = np.clip(np.nan_to_num(linear[..., :3].astype(np.float64)), 0.0, 1.0)
    srgb = np.where(c <= 0.0031308, 12.92 * c, 1.055 * np.maximum(c, 1e-9) ** (1 / 2.4) - 0.055)
    return np.rint(srgb * 255.0).astype(np.uint8)


def value_range(values: NDArray[np.floating]) -> tuple[float, float]:
    """The values to show as black and white, low < high: (0, 1) where that will do.

    The range includes 0 and leaves out the highest and the lowest hundredth, and all that is NaN or infinite.
    """
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0, 1.0
    low, high = min(0.0, float(np.percentile(finite, 1))), max(0.0, float(np.percentile(finite, 99)))
    return (0.0, 1.0) if low >= 0.0 and high <= 1.0 else (low, max(high, low + 1e-9))


def viewable(values: F32) -> F32:
    """(H, W, C) values of any range as (H, W, 3): one channel as grey, two with blue 0, scaled by :func:`value_range`.

    Values in [0, 1] stay as they are. Where nothing is finite all is 0.
    """
    channels = values.shape[2]
    if channels == 1:
        rgb = np.repeat(values, 3, axis=2)
    elif channels == 2:
        rgb = np.concatenate([values, np.zeros_like(values[..., :1])], axis=2)
    else:
        rgb = values[..., :3]
    if not np.isfinite(rgb).any():
        return np.zeros_like(rgb)
    low, high = value_range(rgb)
    return ((rgb - low) / (high - low)).astype(np.float32)


def write_png(path: Path, pixels: U8) -> None:
    """``pixels`` (H, W, 3) uint8. Missing folders are created. Raises UserError where that or writing fails."""
    replace_file(path, lambda target: Image.fromarray(pixels[::-1]).save(target, format="PNG"))


def write_apng(path: Path, frames: Sequence[U8], milliseconds: int) -> None:
    """Animated PNG of ``frames`` (H, W, 3) uint8, endless, each shown for ``milliseconds``."""
    images = [Image.fromarray(frame[::-1]) for frame in frames]
    replace_file(
        path,
        lambda target: images[0].save(
            target, format="PNG", save_all=True, append_images=images[1:], duration=milliseconds, loop=0
        ),
    )


def write_exr(path: Path, values: F32) -> None:
    """``values`` (H, W, 3) float32 as channels R, G, B, lossless."""
    top_first = np.ascontiguousarray(values[::-1, :, :3], dtype=np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}

    def save(target: Path) -> None:
        try:
            OpenEXR.File(header, {"RGB": top_first}).write(str(target))
        except (RuntimeError, ValueError) as error:
            raise OSError(str(error)) from error

    replace_file(path, save)


def read_exr(path: Path) -> F32:
    """(H, W, 3) float32 of the channels R, G, B. Raises UserError when the file is missing, broken or lacks them."""
    if not path.is_file():
        raise UserError(f"{path}: there is no such file")
    try:
        channels = OpenEXR.File(str(path)).channels()
    except (RuntimeError, ValueError) as error:
        raise UserError(f"{path}: is not a readable EXR ({error})") from error
    colors = channels.get("RGB") or channels.get("RGBA")  # with alpha, OpenEXR joins all four
    if colors is None:
        raise UserError(f"{path}: has no channels R, G and B (it has {', '.join(channels)})")
    return np.ascontiguousarray(colors.pixels[::-1, :, :3], dtype=np.float32)


def side_by_side(images: Sequence[U8], gap: int = 4) -> U8:
    """Pictures of equal height from left to right, with a dark gap between them."""
    height = images[0].shape[0]
    bar = np.full((height, gap, 3), 24, np.uint8)
    parts: list[U8] = []
    for image in images:
        parts += [image, bar]
    return np.concatenate(parts[:-1], axis=1)
