"""What a surface reflects of light that is the same from everywhere: the divisor of its illumination.

Illumination divided by it is that of a white surface, whatever metal or plastic it fell on, so that a filter may take
means over texture and colour. In a white furnace it is 1.

The lobe's share is linear in the reflectance F0 (Karis 2013's split sum): F0 (x - y) + y with tabulated x, y.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from raytrace.brdf import MIN_ALPHA
from raytrace.compilation import device

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

SIZE = 32
"""Entries of the table along the cosine and along the roughness, both from 0 to 1."""

_LAST = np.float32(SIZE - 1)
_ONE, _ZERO = np.float32(1.0), np.float32(0.0)
_GRAZING = 1e-3  # stands for a cosine of 0, where nothing is defined
_POINTS = 32  # of the quadrature, in each direction


@cache
def table() -> F32:
    """(SIZE, SIZE, 2) float32 by cosine and roughness: x and y as above, height-correlated masking.

    Quadrature in float64: Gauss and Legendre's rule along one random number of the sampling routine, a midpoint rule
    along the other, which goes once around.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    u: F64 = np.asarray((nodes + 1) / 2, dtype=np.float64)
    share: F64 = np.asarray(weights / 2, dtype=np.float64)
    turn: F64 = (np.arange(_POINTS, dtype=np.float64) + 0.5) * (2 * math.pi / _POINTS)
    result = np.empty((SIZE, SIZE, 2))
    for i, cosine in enumerate(np.linspace(0.0, 1.0, SIZE)):
        vz = max(float(cosine), _GRAZING)
        for k, roughness in enumerate(np.linspace(0.0, 1.0, SIZE)):
            result[i, k] = _lobe(vz, max(float(roughness) ** 2, float(MIN_ALPHA)), u, share, turn)
    return result.astype(np.float32)


def _lobe(vz: float, alpha: float, u: F64, share: F64, turn: F64) -> tuple[float, float]:
    """Means of G2 / G1 and of that times Schlick's weight over the visible normals (Heitz 2018)."""
    vx = math.sqrt(1 - vz * vz)
    s = np.array([alpha * vx, vz]) / math.hypot(alpha * vx, vz)
    r = np.sqrt(u)[:, None]
    a, b = r * np.cos(turn), r * np.sin(turn)
    tilt = (1 + s[1]) / 2
    b = (1 - tilt) * np.sqrt(1 - a * a) + tilt * b
    c = np.sqrt(np.maximum(1 - a * a - b * b, 0))
    # Tangents are y and its product with s.
    h = np.stack([alpha * (c * s[0] - b * s[1]), alpha * a, np.maximum(b * s[0] + c * s[1], 0)])
    h /= np.linalg.norm(h, axis=0)
    vh = vx * h[0] + vz * h[2]
    lz = 2 * vh * h[2] - vz
    seen = np.maximum(lz, 0)
    square = alpha * alpha
    slant_v, slant_l = math.sqrt(square + (1 - square) * vz * vz), np.sqrt(square + (1 - square) * seen * seen)
    # V cos / density without D: 2 (v_z + slant_v) l_z / (2 (l_z slant_v + v_z slant_l))
    weight = np.where(lz > 0, seen * (vz + slant_v) / (seen * slant_v + vz * slant_l), 0)
    mean = share / len(turn)
    return float((mean @ weight).sum()), float((mean @ (weight * (1 - vh) ** 5)).sum())


@device
def look_up(values, cosine, roughness):  # type: ignore[no-untyped-def]
    """x and y of :func:`table` at a cosine and a roughness, both in [0, 1], bilinear."""
    a, b = min(max(cosine, _ZERO), _ONE) * _LAST, min(max(roughness, _ZERO), _ONE) * _LAST
    i, k = min(int(a), SIZE - 2), min(int(b), SIZE - 2)
    p, q = a - np.float32(i), b - np.float32(k)
    w00, w01, w10, w11 = (_ONE - p) * (_ONE - q), (_ONE - p) * q, p * (_ONE - q), p * q
    low, high = values[i], values[i + 1]
    x = w00 * low[k, 0] + w01 * low[k + 1, 0] + w10 * high[k, 0] + w11 * high[k + 1, 0]
    y = w00 * low[k, 1] + w01 * low[k + 1, 1] + w10 * high[k, 1] + w11 * high[k + 1, 1]
    return x, y
