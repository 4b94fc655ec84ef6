"""EXR images of a recorded sequence: what a file holds, whether it is whole, its pixels.

What a file's own header says is read here and not by OpenEXR: of a file that was cut short that library prints messages
of its own, and it reads all pixels to tell the size. Format: https://openexr.com/en/latest/OpenEXRFileLayout.html
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from errors import UserError
from storage import replace_file

F32 = NDArray[np.float32]

_MAGIC: Final = b"\x76\x2f\x31\x01"
_TILED, _LONG_NAMES, _DEEP, _SEVERAL = 0x200, 0x400, 0x800, 0x1000
_LINES: Final = (1, 1, 2, 16, 32, 16, 32, 32, 32, 256)
"""Rows in a chunk, by number of the compression: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB."""


@dataclass(frozen=True)
class Facts:
    """``size``: width and height in pixels; ``channels``: their names."""

    size: tuple[int, int]
    channels: tuple[str, ...]


def examine(path: Path) -> Facts:
    """What the EXR file ``path`` holds, from its header; no pixel is decoded.

    Raises UserError where there is no such file, it is no EXR file, or its end is missing.
    """
    try:
        with path.open("rb") as file:
            return _facts(path, file)
    except FileNotFoundError as error:
        raise UserError(f"{path}: there is no such file") from error
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from error
    except (struct.error, KeyError, ValueError) as error:
        raise UserError(f"{path}: is not a readable EXR (its header is damaged or cut short)") from error


def _facts(path: Path, file: BinaryIO) -> Facts:
    magic, version = file.read(4), file.read(4)
    if magic != _MAGIC:
        raise UserError(f"{path}: is {'empty' if not magic else 'not an EXR file'}")
    (flags,) = struct.unpack("<I", version)
    attributes = _attributes(file)
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    if width < 1 or height < 1:
        raise ValueError("an empty data window")
    (compression,) = attributes["compression"]
    if not flags & (_TILED | _DEEP | _SEVERAL) and compression < len(_LINES):
        _require_whole(path, file, -(-height // _LINES[compression]))
    return Facts((width, height), _channels(attributes["channels"]))


def _attributes(file: BinaryIO) -> dict[str, bytes]:
    """The attributes of the first part, as they are in the file; leaves ``file`` after them."""
    found: dict[str, bytes] = {}
    while name := _text(file):
        _text(file)  # its type
        (size,) = struct.unpack("<i", file.read(4))
        value = file.read(size)
        if size < 0 or len(value) != size:
            raise ValueError("an attribute is cut short")
        found[name] = value
    return found


def _text(file: BinaryIO) -> str:
    """Characters up to the next zero byte."""
    text = bytearray()
    while (byte := file.read(1)) != b"\0":
        if not byte or len(text) > 255:
            raise ValueError("a name without end")
        text += byte
    return text.decode("latin-1")


def _channels(value: bytes) -> tuple[str, ...]:
    names, at = [], 0
    while value[at] != 0:
        end = value.index(0, at)
        names.append(value[at:end].decode("latin-1"))
        at = end + 1 + 16  # pixel type, linearity, sampling in x and y
    return tuple(names)


def _require_whole(path: Path, file: BinaryIO, chunks: int) -> None:
    """Raises UserError where the file ends before the last of its ``chunks``, whose places follow the header."""
    table = file.read(8 * chunks)
    size = path.stat().st_size
    places = struct.unpack(f"<{chunks}Q", table) if len(table) == 8 * chunks else (0,)
    last = max(places)
    whole = min(places) > 0 and last + 8 <= size  # a writer that was stopped leaves zeros
    if whole:
        file.seek(last + 4)
        (length,) = struct.unpack("<i", file.read(4))
        whole = last + 8 + length <= size
    if not whole:
        raise UserError(f"{path}: is only half written", "record the frame again, or copy the file again")


def read(path: Path, channels: int) -> F32:
    """(H, W, ``channels``) float32, row 0 at the bottom: 3 (R, G and B), 4 (A as well) or 1 (whichever there is).

    Half and integer pixels are converted. Raises UserError where the file is missing, broken or lacks the channels.
    """
    examine(path)
    try:
        found = OpenEXR.File(str(path)).channels()
    except (RuntimeError, ValueError) as error:
        raise UserError(f"{path}: is not a readable EXR ({error})") from error
    colors = found.get("RGB") or found.get("RGBA")  # OpenEXR joins these
    if colors is not None and colors.pixels.shape[2] >= channels:
        pixels = colors.pixels[:, :, :channels]
    elif channels == 1 and len(found) == 1:
        pixels = next(iter(found.values())).pixels[:, :, None]
    else:
        wanted = {1: "one channel", 3: "channels R, G and B"}.get(channels, "channels R, G, B and A")
        raise UserError(f"{path}: must have {wanted}, but has {', '.join(found)}")
    return np.ascontiguousarray(pixels[::-1], dtype=np.float32)


def write(path: Path, values: F32) -> None:
    """``values`` (H, W, C) float32, C = 1 (as channel Y), 3 (R, G, B) or 4, row 0 at the bottom; lossless.

    Raises UserError where the file cannot be written; it is then as it was before.
    """
    name = {1: "Y", 3: "RGB", 4: "RGBA"}[values.shape[2]]
    channels = {name: values[::-1, :, 0] if name == "Y" else values[::-1]}
    arrays = {name: np.ascontiguousarray(pixels, dtype=np.float32) for name, pixels in channels.items()}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}

    def save(target: Path) -> None:
        try:
            OpenEXR.File(header, arrays).write(str(target))
        except (RuntimeError, ValueError) as error:
            raise OSError(str(error)) from error
        examine(target)  # a full disk is not always told

    replace_file(path, save)
