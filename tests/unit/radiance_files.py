"""Radiance pictures for tests, written byte by byte."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

U8 = NDArray[np.uint8]

HEADER = b"#?RADIANCE\n# a comment\nGAMMA=1\nPRIMARIES=0 0 0 0 0 0 0 0\nFORMAT=32-bit_rle_rgbe\n\n"


def run_lengths(coded: U8) -> bytes:
    """Scanlines channel by channel, with runs where three or more are equal."""
    out = bytearray()
    for row in coded:
        out += bytes((2, 2, len(row) >> 8, len(row) & 255))
        for channel in row.T:
            at = 0
            while at < len(channel):
                end = at + 1
                while end < len(channel) and channel[end] == channel[at] and end - at < 127:
                    end += 1
                if end - at >= 3:
                    out += bytes((128 + end - at, int(channel[at])))
                else:
                    end = min(at + 3, len(channel))
                    out += bytes((end - at,)) + channel[at:end].tobytes()
                at = end
    return bytes(out)


def written(path: Path, coded: U8, body: bytes, header: bytes = HEADER, size: bytes = b"-Y %d +X %d\n") -> Path:
    path.write_bytes(header + size % coded.shape[:2] + body)
    return path


def encoded(linear: NDArray[np.floating]) -> U8:
    """(H, W, 3) radiance as mantissas and a common exponent, (H, W, 4). Ward 1991."""
    largest = linear.max(axis=2)
    mantissa, exponent = np.frexp(largest)
    scale = np.where(largest > 0.0, mantissa * 256.0 / np.where(largest > 0.0, largest, 1.0), 0.0)
    coded = np.concatenate([linear * scale[..., None], (exponent + 128)[..., None]], axis=2).astype(np.uint8)
    return np.where((largest > 1e-30)[..., None], coded, np.uint8(0))
