"""Random numbers and sample warps, compiled.

Two generators, both pure functions of (seed, pixel, frame, dimension), so that a picture depends neither on the number
of threads nor on the tiling, and a remembered surface point can be shaded again with the numbers it had:

``HALTON``  16 points of the Halton sequence in bases 2 and 3, cycled over the frames, as in Schied et al. 2017 ("a
            fixed set of 16 samples"). Each pixel rotates them (Cranley and Patterson 1976) and visits them in an order
            of its own. The mean over the cycle keeps the noise of 16 samples for ever: for the live filter only.
``HASH``    Wang's integer hash (Wang 1997; Koskela et al. 2019 use it). Uncycled: references and statistics use this.

Dimensions come in pairs, because 16 points in a base above 16 would not cover [0, 1): every pair uses bases 2 and 3,
and its order of visit is scrambled by an XOR of its own, otherwise all pairs would be the same two numbers.
"""

from __future__ import annotations

import math

import numpy as np
from numba import uint32

from raytrace.compilation import device, kernel

HALTON, HASH = 0, 1

PAIR_LIGHT, PAIR_BOUNCE, PAIR_SECOND_LIGHT, PAIR_SELECT, PAIR_LOBE = 0, 1, 2, 3, 4
"""Pairs of dimensions of one path: point on the first light, bounce direction, point on the second hit's light, the
choice of the two lights, and that of the lobe which the bounce follows."""

_TINY = np.float32(2.0**-24)
_ONE, _TWO = np.float32(1.0), np.float32(2.0)
_ZERO = np.float32(0.0)
_HALF_PI = np.float32(math.pi / 2.0)
_S3, _S5, _S7 = np.float32(-1 / 6), np.float32(1 / 120), np.float32(-1 / 5040)
_C2, _C4, _C6, _C8 = np.float32(-1 / 2), np.float32(1 / 24), np.float32(-1 / 720), np.float32(1 / 40320)


def radical_inverse(base: int, count: int) -> np.ndarray:
    """First ``count`` points of the van der Corput sequence in ``base``, (count,) float32 in [0, 1)."""
    points = np.zeros(count)
    for index in range(count):
        scale, rest = 1.0, index
        while rest:
            scale /= base
            points[index] += scale * (rest % base)
            rest //= base
    return points.astype(np.float32)


_HALTON_2, _HALTON_3 = radical_inverse(2, 16), radical_inverse(3, 16)


@device
def wang(value):  # type: ignore[no-untyped-def]
    """Wang's 32-bit integer hash."""
    value = uint32(value)
    value = uint32((value ^ uint32(61)) ^ (value >> uint32(16)))
    value = uint32(value * uint32(9))
    value = uint32(value ^ (value >> uint32(4)))
    value = uint32(value * uint32(0x27D4EB2D))
    return uint32(value ^ (value >> uint32(15)))


@device
def unit_float(bits):  # type: ignore[no-untyped-def]
    """[0, 1) from 24 of 32 bits: a division by 2^32 in single precision would round up to 1."""
    return np.float32(uint32(bits) >> uint32(8)) * _TINY


@device
def path_key(seed, pixel):  # type: ignore[no-untyped-def]
    """Hash that stands for one pixel of one run."""
    return wang(uint32(wang(uint32(seed) * uint32(0x9E3779B9) + uint32(1))) ^ uint32(pixel))


@device
def random_pair(key, frame, pair, generator):  # type: ignore[no-untyped-def]
    """Two numbers in [0, 1) for one pair of dimensions of the path ``key`` in ``frame``."""
    salt = uint32(pair + 1) * uint32(0x85EBCA6B)
    if generator == HASH:
        base = wang(uint32(wang(key ^ uint32(frame) * uint32(0xC2B2AE35))) ^ salt)
        return unit_float(base), unit_float(wang(base ^ uint32(0x68BC21EB)))
    base = wang(key ^ salt)
    other = wang(base ^ uint32(0x68BC21EB))
    point = (uint32(frame) ^ (other & uint32(15))) & uint32(15)  # low bits are not used by unit_float
    x = _HALTON_2[point] + unit_float(base)
    y = _HALTON_3[point] + unit_float(other)
    if x >= _ONE:
        x -= _ONE
    if y >= _ONE:
        y -= _ONE
    return x, y


@device
def _draw_pair(keys, frames, pair, x, y):  # type: ignore[no-untyped-def]
    for i in range(frames.shape[0]):
        x[i], y[i] = random_pair(keys[i], frames[i], pair, HALTON)


@device
def _draw_hashed_pair(keys, frames, pair, x, y):  # type: ignore[no-untyped-def]
    for i in range(frames.shape[0]):
        x[i], y[i] = random_pair(keys[i], frames[i], pair, HASH)


@kernel
def draw(pixels, frames, seed, generator, keys, numbers):  # type: ignore[no-untyped-def]
    """All numbers of some paths: ``numbers`` (pairs, 2, >= n) float32 from ``pixels`` and ``frames`` (n,) uint32.

    ``keys`` (>= n,) uint32 is used up. Loops that do nothing else, with one generator each, become vector
    instructions: drawn here four pairs take a third of the time that they take amid the shading.
    """
    for i in range(pixels.shape[0]):
        keys[i] = path_key(seed, pixels[i])
    for pair in range(numbers.shape[0]):
        if generator == HASH:
            _draw_hashed_pair(keys, frames, pair, numbers[pair, 0], numbers[pair, 1])
        else:
            _draw_pair(keys, frames, pair, numbers[pair, 0], numbers[pair, 1])


@device
def tangent_frame(nx, ny, nz):  # type: ignore[no-untyped-def]
    """Two unit vectors that complete a unit normal to an orthonormal basis, from the normal alone.

    Duff et al. 2017, "Building an Orthonormal Basis, Revisited". A direction built on it depends on the surface and on
    the random numbers, never on the camera: this is what lets a shading be repeated exactly from another view.
    """
    sign = _ONE if nz >= _ZERO else -_ONE
    a = -_ONE / (sign + nz)
    b = nx * ny * a
    return _ONE + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny


@device
def sincos_turn(turns):  # type: ignore[no-untyped-def]
    """sin and cos of 2π·turns for turns in [0, 1), to 4e-7: Taylor series on an eighth of a turn.

    Faster than the C library's, and the same on every machine.
    """
    quarters = turns * np.float32(4.0)
    nearest = int(quarters + np.float32(0.5))
    x = (quarters - np.float32(nearest)) * _HALF_PI
    y = x * x
    s = x * (_ONE + y * (_S3 + y * (_S5 + y * _S7)))
    c = _ONE + y * (_C2 + y * (_C4 + y * (_C6 + y * _C8)))
    # Which quadrant it is nobody can predict: no branches, but selections.
    sine, cosine = (c, s) if nearest & 1 else (s, c)
    return -sine if nearest & 2 else sine, -cosine if (nearest + 1) & 2 else cosine


@device
def sample_cosine(nx, ny, nz, u, v):  # type: ignore[no-untyped-def]
    """Direction about the unit normal with density cos/π per solid angle, and its cosine."""
    r = math.sqrt(u)
    sine, cosine = sincos_turn(v)
    x, y = r * cosine, r * sine
    z = math.sqrt(max(_ZERO, _ONE - u))
    tx, ty, tz, bx, by, bz = tangent_frame(nx, ny, nz)
    return x * tx + y * bx + z * nx, x * ty + y * by + z * ny, x * tz + y * bz + z * nz, z


@device
def sample_triangle(u, v):  # type: ignore[no-untyped-def]
    """Barycentrics (of the second and third vertex) of a uniform point on a triangle.

    Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
    """
    half = min(u, v) * np.float32(0.5)
    return (half, v - half) if v > u else (u - half, half)


@device
def sample_alias(u, threshold, alias):  # type: ignore[no-untyped-def]
    """Index drawn from an alias table (Walker 1977) with one number in [0, 1)."""
    count = threshold.shape[0]
    scaled = u * np.float32(count)
    index = min(int(scaled), count - 1)
    if scaled - np.float32(index) < threshold[index]:
        return index
    return alias[index]


def build_alias(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Alias table of non-negative ``weights`` (n,): thresholds (n,) float32, aliases (n,) int32, pdf (n,) float32.

    Vose 1991. The pdf returned is that of the rounded table, so that sample and pdf agree to the last bit. All-zero
    weights give a uniform table.
    """
    weights = np.asarray(weights, dtype=np.float64)
    count = len(weights)
    total = weights.sum()
    scaled = weights * (count / total) if total > 0 else np.ones(count)
    threshold, alias = np.ones(count), np.arange(count, dtype=np.int32)
    small = [i for i in range(count) if scaled[i] < 1.0]
    large = [i for i in range(count) if scaled[i] >= 1.0]
    remaining = scaled.copy()
    while small and large:
        low, high = small.pop(), large.pop()
        threshold[low], alias[low] = remaining[low], high
        remaining[high] -= 1.0 - remaining[low]
        (small if remaining[high] < 1.0 else large).append(high)
    rounded = threshold.astype(np.float32)
    pdf = rounded.astype(np.float64).copy()
    np.add.at(pdf, alias, 1.0 - rounded.astype(np.float64))
    return rounded, alias, (pdf / count).astype(np.float32)
