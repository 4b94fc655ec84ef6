"""glTF's metallic-roughness model, compiled: sample, evaluate, density.

glTF 2.0, appendix B.2: a dielectric is a diffuse base under a specular lobe of reflectance 0.04, a metal the lobe
alone, coloured; what is neither is their linear mix. The lobe is GGX with Smith's masking and Schlick's Fresnel term
(Walter et al. 2007; Heitz 2014, "Understanding the Masking-Shadowing Function"; Schlick 1994):

    specular = F D V,   diffuse = (1 - metallic) (1 - E_dielectric(v)) base / pi,   F = F0 + (1 - F0) (1 - v·h)^5

Deviations:

* B.2 mixes base and lobe by F. At grazing angles v·h is large for nearly all light, so that the base keeps its light
  while the lobe reflects all of it: a white plastic reflects up to 1.8 times what it gets. Here the base gets what the
  lobe's directional albedo E leaves, which is the albedo scaling that glTF itself prescribes for sheen: no material
  reflects more than it gets. What the base then sends to the eye is plain irradiance, times what filters divide by.
* Light is scattered once: rough surfaces lose what a real one would scatter twice (docs/materials.md has the loss).

All directions are unit vectors in the frame of the shading normal, z along it, on its side: z > 0. ``alpha`` is the
roughness squared, at least :data:`MIN_ALPHA`.
"""

from __future__ import annotations

import math

import numpy as np

from raytrace.compilation import device
from raytrace.sampling import sincos_turn

MIN_ALPHA = np.float32(1e-3)
"""Of a mirror: its lobe is 0.1 degrees wide. D = 3e5 there, far from the limits of single precision."""

DIELECTRIC = np.float32(0.04)
"""Reflectance of a dielectric seen head-on: an index of refraction of 1.5."""

_ZERO, _ONE, _TWO, _HALF = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.float32(0.5)
_INV_PI = np.float32(1.0 / math.pi)
_WIDE, _NARROW = np.float32(0.3), np.float32(0.1)


@device
def alpha_of(roughness):  # type: ignore[no-untyped-def]
    """Width of the lobe for glTF's roughness in [0, 1]."""
    return max(roughness * roughness, MIN_ALPHA)


@device
def regularized(alpha):  # type: ignore[no-untyped-def]
    """A width at which a light sample of a bounce's hit finds the lobe: narrow lobes are doubled, between 0.1 and 0.3.

    Path-space regularisation (Kaplanyan and Dachsbacher 2013) in the form of pbrt-v4 (Pharr et al., sec. 9.6.1's
    ``Regularize``). A bias; references are made without it.
    """
    return min(max(_TWO * alpha, _NARROW), _WIDE) if alpha < _WIDE else alpha


@device
def schlick(cosine):  # type: ignore[no-untyped-def]
    """(1 - cosine)^5: the weight of white in Schlick's Fresnel term."""
    m = max(_ONE - cosine, _ZERO)
    square = m * m
    return square * square * m


@device
def distribution(hx, hy, hz, alpha):  # type: ignore[no-untyped-def]
    """GGX's density of normals D at the unit vector h. Walter et al. 2007, eq. 33.

    From the sine, whose square x² + y² loses no digits near the normal, where 1 - z² would lose all.
    """
    square = alpha * alpha
    t = hx * hx + hy * hy + square * hz * hz
    return square * _INV_PI / (t * t)


@device
def _slant(z, square):  # type: ignore[no-untyped-def]
    """sqrt(alpha² + (1 - alpha²) z²), which Smith's terms are made of: z times (1 + 2 Lambda)."""
    return math.sqrt(square + (_ONE - square) * z * z)


@device
def visibility(vz, lz, alpha, separable):  # type: ignore[no-untyped-def]
    """Smith's masking and shadowing over 4 v_z l_z. Heitz 2014, eq. 99 (height-correlated) and 98 (``separable``)."""
    square = alpha * alpha
    if separable:
        return _ONE / ((vz + _slant(vz, square)) * (lz + _slant(lz, square)))
    return _HALF / (lz * _slant(vz, square) + vz * _slant(lz, square))


@device
def evaluate(vx, vy, vz, lx, ly, lz, alpha, separable):  # type: ignore[no-untyped-def]
    """Lobe towards v of light from l: D V cos(l), Schlick's weight, and the density of :func:`sample_lobe` for l."""
    hx, hy, hz = vx + lx, vy + ly, vz + lz
    scale = _ONE / math.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx * scale, hy * scale, hz * scale
    d = distribution(hx, hy, hz, alpha)
    density = _HALF * d / (vz + _slant(vz, alpha * alpha))
    return d * visibility(vz, lz, alpha, separable) * lz, schlick(vx * hx + vy * hy + vz * hz), density


@device
def sample_lobe(vx, vy, vz, alpha, u, v):  # type: ignore[no-untyped-def]
    """Direction l with the density of normals that v sees, reflected; z <= 0 where it leaves through the surface.

    Heitz 2018, "Sampling the GGX Distribution of Visible Normals".
    """
    # The ellipsoid becomes a hemisphere, a disk stands in for the part of it that is seen.
    sx, sy, sz = alpha * vx, alpha * vy, vz
    scale = _ONE / math.sqrt(sx * sx + sy * sy + sz * sz)
    sx, sy, sz = sx * scale, sy * scale, sz * scale
    flat = sx * sx + sy * sy
    tx, ty = _ONE, _ZERO
    if flat > _ZERO:
        inverse = _ONE / math.sqrt(flat)
        tx, ty = -sy * inverse, sx * inverse
    sine, cosine = sincos_turn(v)
    r = math.sqrt(u)
    a, b = r * cosine, r * sine
    s = _HALF * (_ONE + sz)
    b = (_ONE - s) * math.sqrt(max(_ONE - a * a, _ZERO)) + s * b
    c = math.sqrt(max(_ONE - a * a - b * b, _ZERO))
    # a t + b (s x t) + c s, then back to the ellipsoid.
    hx = alpha * (a * tx - b * sz * ty + c * sx)
    hy = alpha * (a * ty + b * sz * tx + c * sy)
    hz = max(b * (sx * ty - sy * tx) + c * sz, _ZERO)
    scale = _ONE / math.sqrt(max(hx * hx + hy * hy + hz * hz, np.float32(1e-30)))
    hx, hy, hz = hx * scale, hy * scale, hz * scale
    twice = _TWO * (vx * hx + vy * hy + vz * hz)
    return twice * hx - vx, twice * hy - vy, twice * hz - vz
