"""All textures of a scene in one array, with mip levels, and their lookup inside the kernels.

Texels stay 8-bit sRGB as they were in the file and are decoded by a table of 256 floats: a quarter of the memory
traffic of floats, and the traffic is what a lookup costs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raytrace.compilation import device, inlined
from raytrace.scene import Texture

F64 = NDArray[np.float64]

_codes = np.arange(256) / 255.0
SRGB_TO_LINEAR = np.where(_codes <= 0.04045, _codes / 12.92, ((_codes + 0.055) / 1.055) ** 2.4).astype(np.float32)
"""Linear value of each 8-bit sRGB code, (256,) float32. IEC 61966-2-1."""

LINEAR = (np.arange(256) / 255.0).astype(np.float32)
"""Value of each 8-bit code of a linear texture, (256,) float32."""

MAX_LEVELS = 15

_ONE = np.float32(1.0)
_HALF = np.float32(0.5)
_COARSEST = np.float32(MAX_LEVELS - 1)


@dataclass(frozen=True)
class TextureAtlas:
    """``texels`` (n, 3) uint8, every level of every texture row by row; ``levels`` (k, MAX_LEVELS, 3) int64: first
    texel, width, height of each level, the last one repeated."""

    texels: NDArray[np.uint8]
    levels: NDArray[np.int64]


# Mip levels are averaged as 16-bit linear integers: exact sums, and both transfer curves are one table lookup.
_LINEAR_16 = np.rint(SRGB_TO_LINEAR.astype(np.float64) * 65535.0).astype(np.uint16)


def _encode_table() -> NDArray[np.uint8]:
    """The 8-bit sRGB code nearest to each of the 65,536 linear values."""
    linear = np.arange(65536) / 65535.0
    srgb = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    return np.rint(srgb * 255.0).astype(np.uint8)


_ENCODE_16 = _encode_table()


def _halve(image: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Box-filter to half the size in each direction that is longer than one texel; an odd last row is dropped."""
    height, width = image.shape[:2]
    if height > 1:
        even, odd = image[0 : height - height % 2 : 2].astype(np.uint32), image[1 : height - height % 2 + 1 : 2]
        image = ((even + odd + 1) >> 1).astype(np.uint16)
    if width > 1:
        even, odd = image[:, 0 : width - width % 2 : 2].astype(np.uint32), image[:, 1 : width - width % 2 + 1 : 2]
        image = ((even + odd + 1) >> 1).astype(np.uint16)
    return image


def build_atlas(textures: Sequence[Texture]) -> TextureAtlas:
    """Pack ``textures`` and their mip levels, which are averaged in linear light, or as they are where linear."""
    parts: list[NDArray[np.uint8]] = []
    levels = np.zeros((max(1, len(textures)), MAX_LEVELS, 3), dtype=np.int64)
    offset = 0
    for index, texture in enumerate(textures):
        pixels = np.ascontiguousarray(texture.pixels[..., :3])
        linear: NDArray[np.uint16] | None = None
        for level in range(MAX_LEVELS):
            height, width = pixels.shape[:2]
            levels[index, level:] = offset, width, height
            parts.append(pixels.reshape(-1, 3))
            offset += width * height
            if width == 1 and height == 1:
                break
            if linear is None:
                linear = pixels.astype(np.uint16) * np.uint16(257) if texture.linear else _LINEAR_16[pixels]
            linear = _halve(linear)
            pixels = (linear >> 8).astype(np.uint8) if texture.linear else _ENCODE_16[linear]
    texels = np.concatenate(parts) if parts else np.zeros((1, 3), np.uint8)
    return TextureAtlas(texels, levels)


def _decode(texels: NDArray[np.uint8]) -> F64:
    return SRGB_TO_LINEAR[texels].astype(np.float64)


def sample_bilinear(atlas: TextureAtlas, index: int, uvs: F64, level: int = 0) -> F64:
    """A level at ``uvs`` (n, 2), bilinear and repeated: (n, 3) float64, linear. The NumPy twin of `lookup`."""
    offset, width, height = (int(v) for v in atlas.levels[index, level])
    texels = atlas.texels[offset : offset + width * height].reshape(height, width, 3)
    x, y = uvs[:, 0] * width - 0.5, uvs[:, 1] * height - 0.5
    x0, y0 = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    x0, x1, y0, y1 = x0 % width, (x0 + 1) % width, y0 % height, (y0 + 1) % height
    low = _decode(texels[y0, x0]) * (1 - fx) + _decode(texels[y0, x1]) * fx
    high = _decode(texels[y1, x0]) * (1 - fx) + _decode(texels[y1, x1]) * fx
    result: F64 = low * (1 - fy) + high * fy
    return result


@device
def level_for(footprint_texels):  # type: ignore[no-untyped-def]
    """Mip level whose texel is nearest in size to ``footprint_texels`` (level-0 texels)."""
    if not footprint_texels > _ONE:
        return 0
    return int(min(math.log2(footprint_texels) + _HALF, _COARSEST))  # infinity has no integer: limit first


@inlined
def lookup(texels, levels, decode, index, u, v, level):  # type: ignore[no-untyped-def]
    """Bilinear, repeated lookup at a mip level: three linear float32."""
    offset, width, height = levels[index, level, 0], levels[index, level, 1], levels[index, level, 2]
    # Wrap first: far from 0 the fraction of u * width would lose the bits that count.
    x = (u - np.float32(math.floor(u))) * np.float32(width) - _HALF
    y = (v - np.float32(math.floor(v))) * np.float32(height) - _HALF
    x0 = math.floor(x)
    y0 = math.floor(y)
    fx = x - np.float32(x0)
    fy = y - np.float32(y0)
    x1 = x0 + 1 if x0 + 1 < width else x0 + 1 - width
    y1 = y0 + 1 if y0 + 1 < height else y0 + 1 - height
    if x0 < 0:
        x0 += width
    if y0 < 0:
        y0 += height
    a, b = offset + y0 * width + x0, offset + y0 * width + x1
    c, d = offset + y1 * width + x0, offset + y1 * width + x1
    wa, wb, wc, wd = (_ONE - fx) * (_ONE - fy), fx * (_ONE - fy), (_ONE - fx) * fy, fx * fy
    red = wa * decode[texels[a, 0]] + wb * decode[texels[b, 0]]
    green = wa * decode[texels[a, 1]] + wb * decode[texels[b, 1]]
    blue = wa * decode[texels[a, 2]] + wb * decode[texels[b, 2]]
    red += wc * decode[texels[c, 0]] + wd * decode[texels[d, 0]]
    green += wc * decode[texels[c, 1]] + wd * decode[texels[d, 1]]
    blue += wc * decode[texels[c, 2]] + wd * decode[texels[d, 2]]
    return red, green, blue
