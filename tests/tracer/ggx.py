"""glTF's metallic-roughness model in float64, integrated without the tracer's sampling: what its results are held to.

Written down from glTF 2.0, appendix B, and Heitz 2014; integrals over the light's directions are taken over half
vectors, distributed as the normals are (not as those that are seen), on a fine grid.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

F64 = NDArray[np.float64]

F0 = 0.04


def distribution(h: F64, alpha: float) -> F64:
    """GGX's D of unit vectors (..., 3)."""
    tangent = (h[..., 0] ** 2 + h[..., 1] ** 2) / h[..., 2] ** 2
    result: F64 = 1 / (np.pi * alpha**2 * h[..., 2] ** 4 * (1 + tangent / alpha**2) ** 2)
    return result


def smith_lambda(w: F64, alpha: float) -> F64:
    tangent = (w[..., 0] ** 2 + w[..., 1] ** 2) / w[..., 2] ** 2
    result: F64 = (np.sqrt(1 + alpha**2 * tangent) - 1) / 2
    return result


def masking(v: F64, light: F64, alpha: float, separable: bool = False) -> F64:
    """Smith's G2, 0 where either direction is below the surface."""
    a, b = smith_lambda(v, alpha), smith_lambda(light, alpha)
    both = 1 / ((1 + a) * (1 + b)) if separable else 1 / (1 + a + b)
    result: F64 = np.where((v[..., 2] > 0) & (light[..., 2] > 0), both, 0.0)
    return result


@cache
def half_vectors(alpha: float, count: int = 240) -> tuple[F64, F64]:
    """Unit vectors (count², 3), and weights (count²,) for integrals of D(h) h_z times something over them."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    u, share = (nodes + 1) / 2, weights / 2
    turn = (np.arange(count) + 0.5) * 2 * np.pi / count
    cosine = np.sqrt((1 - u) / (1 + (alpha**2 - 1) * u))[:, None]
    sine = np.sqrt(1 - cosine**2)
    h = np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine * np.ones(count)], axis=-1)
    return h.reshape(-1, 3), np.repeat(share / count, count)


def view(cosine: float) -> F64:
    return np.array([np.sqrt(1 - cosine**2), 0.0, cosine])


@cache
def lobe_terms(cosine: float, alpha: float, separable: bool = False) -> tuple[float, float]:
    """Integrals over all light of D V cos, and of that times Schlick's weight (1 - v·h)^5."""
    v = view(cosine)
    h, share = half_vectors(alpha)
    vh = h @ v
    light = 2 * vh[:, None] * h - v
    # f cos dl = F G2 D / (4 v_z l_z) l_z 4 v·h dh, and share is D h_z dh.
    weight = share * masking(v, light, alpha, separable) * np.maximum(vh, 0) / (v[2] * h[:, 2])
    return float(weight.sum()), float((weight * (1 - np.maximum(vh, 0)) ** 5).sum())


def albedo(cosine: float, base: ArrayLike, metallic: float, roughness: float, separable: bool = False) -> F64:
    """Directional albedo of a material, (3,): the lobe's, and what it leaves for the base of a dielectric."""
    base = np.asarray(base, np.float64)
    x, y = lobe_terms(cosine, max(roughness**2, 1e-3), separable)
    head_on = F0 + metallic * (base - F0)
    return (1 - metallic) * base * (1 - F0 * (x - y) - y) + head_on * (x - y) + y
