"""The metallic-roughness model, function by function, against float64."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from raytrace.brdf import MIN_ALPHA, alpha_of, evaluate, regularized, sample_lobe
from raytrace.directional_albedo import look_up, table
from tests.tracer import ggx

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

ALPHAS = (1e-3, 0.01, 0.09, 0.36, 1.0)
COSINES = (0.05, 0.3, 0.8, 1.0)
any_alpha = pytest.mark.parametrize("alpha", ALPHAS)
any_cosine = pytest.mark.parametrize("cosine", COSINES)


@njit
def _evaluate_all(v, light, alpha, separable, out):
    for i in range(light.shape[0]):
        out[i] = evaluate(v[i, 0], v[i, 1], v[i, 2], light[i, 0], light[i, 1], light[i, 2], alpha, separable)


@njit
def _sample_all(v, alpha, u, out):
    for i in range(u.shape[0]):
        out[i] = sample_lobe(v[0], v[1], v[2], alpha, u[i, 0], u[i, 1])


@njit
def _look_up_all(values, at, out):
    for i in range(at.shape[0]):
        out[i] = look_up(values, at[i, 0], at[i, 1])


def evaluated(v: F64, light: F64, alpha: float, separable: bool = False) -> F64:
    """D V cos, Schlick's weight and the density of the lobe, (n, 3)."""
    out = np.empty((len(light), 3), np.float32)
    both = np.broadcast_to(v, light.shape).astype(np.float32)
    _evaluate_all(both, light.astype(np.float32), np.float32(alpha), separable, out)
    return out.astype(np.float64)


def sampled(v: F64, alpha: float, side: int = 300) -> F64:
    """Directions of a grid of random numbers, (side², 3)."""
    at = (np.arange(side) + 0.5) / side
    u = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2).astype(np.float32)
    out = np.empty((len(u), 3), np.float32)
    _sample_all(v.astype(np.float32), np.float32(alpha), u, out)
    return out.astype(np.float64)


def around(v: F64, alpha: float, count: int = 2000) -> F64:
    """Lights in and around the lobe of ``v``, above the surface, (n, 3)."""
    random = np.random.default_rng(3)
    spread = alpha * random.normal(size=(count, 3)) * random.choice([0.3, 1.0, 3.0], (count, 1))
    h = np.array([0.0, 0.0, 1.0]) + spread
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    light = 2 * (h @ v)[:, None] * h - v
    chosen: F64 = light[(light[:, 2] > 1e-3) & (h @ v > 1e-3)]
    return chosen


@any_cosine
@any_alpha
@pytest.mark.parametrize("separable", [False, True], ids=["correlated", "separable"])
def test_the_lobe_is_that_of_float64(cosine: float, alpha: float, separable: bool) -> None:
    v = ggx.view(cosine)
    light = around(v, alpha)
    h = light + v
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    d = ggx.distribution(h, alpha)
    value = d * ggx.masking(v, light, alpha, separable) / (4 * v[2])  # times cos, which cancels
    density = d / (1 + ggx.smith_lambda(v, alpha)) / (4 * v[2])  # G1 D v·h / v_z, over 4 v·h
    got = evaluated(v, light, alpha, separable)
    # Rounding moves h by 1e-7, and D of the narrowest lobe changes by 1e-3 over that.
    tolerance = 1e-5 + 3e-6 / alpha
    np.testing.assert_allclose(got[:, 0], value, rtol=tolerance)
    np.testing.assert_allclose(got[:, 2], density, rtol=tolerance)
    np.testing.assert_allclose(got[:, 1], (1 - np.einsum("ni,i->n", h, v)) ** 5, rtol=1e-4, atol=1e-6)


@any_alpha
@pytest.mark.parametrize("separable", [False, True], ids=["correlated", "separable"])
def test_light_may_go_either_way(alpha: float, separable: bool) -> None:
    """Helmholtz: D V is the same for v and l exchanged."""
    random = np.random.default_rng(5)
    v, light = random.normal(size=(2, 500, 3))
    for w in (v, light):
        w[:, 2] = np.abs(w[:, 2]) + 0.05
        w /= np.linalg.norm(w, axis=1, keepdims=True)
    there, back = evaluated(v, light, alpha, separable), evaluated(light, v, alpha, separable)
    np.testing.assert_allclose(there[:, 0] / light[:, 2], back[:, 0] / v[:, 2], rtol=1e-5)


@any_cosine
@any_alpha
def test_samples_have_the_density_that_is_told(cosine: float, alpha: float) -> None:
    """Means over the samples of the half vector's components are those under the density of visible normals."""
    v = ggx.view(cosine)
    light = sampled(v, alpha)
    np.testing.assert_allclose(np.linalg.norm(light, axis=1), 1.0, atol=2e-6)
    h, share = ggx.half_vectors(alpha)
    # D_v(h) dh = G1 max(v·h, 0) D dh / v_z, and share is D h_z dh.
    seen = share * np.maximum(h @ v, 0) / (h[:, 2] * v[2] * (1 + ggx.smith_lambda(v, alpha)))
    assert seen.sum() == pytest.approx(1.0, abs=4e-3)  # it is a density
    mirrored = 2 * (h @ v)[:, None] * h - v
    expected = seen @ mirrored / seen.sum()
    np.testing.assert_allclose(light.mean(0), expected, atol=3e-3)
    assert (light[:, 2] > 0).mean() == pytest.approx(seen @ (mirrored[:, 2] > 0) / seen.sum(), abs=3e-3)


@any_cosine
@any_alpha
def test_samples_estimate_the_directional_albedo(cosine: float, alpha: float) -> None:
    """Lobe over density is at most 1, so that no sample is a firefly; its mean is the white lobe's albedo."""
    v = ggx.view(cosine)
    light = sampled(v, alpha)
    weights = np.zeros((len(light), 2))
    above = light[:, 2] > 0
    got = evaluated(v, light[above], alpha)
    weights[above, 0] = got[:, 0] / got[:, 2]
    weights[above, 1] = weights[above, 0] * got[:, 1]
    assert weights.max() <= 1 + 1e-5
    np.testing.assert_allclose(weights.mean(0), ggx.lobe_terms(cosine, alpha), atol=2e-3)


def test_the_table_is_the_directional_albedo() -> None:
    """Between its entries, too; a divisor that is a little off costs nothing, it is multiplied with again."""
    random = np.random.default_rng(1)
    at = np.column_stack([random.uniform(0.05, 1, 12), random.uniform(0, 1, 12)])
    got = np.empty((12, 2), np.float32)
    _look_up_all(table(), at.astype(np.float32), got)
    for (cosine, roughness), (x, y) in zip(at, got, strict=True):
        expected = ggx.lobe_terms(cosine, max(roughness**2, 1e-3))
        assert x == pytest.approx(expected[0], abs=0.01)
        assert y == pytest.approx(expected[1], abs=0.01)


def test_no_material_reflects_more_than_it_gets() -> None:
    """White ones, at every angle and roughness: what is missing was scattered twice, and is lost."""
    x, y = np.moveaxis(table().astype(np.float64), -1, 0)
    assert x.max() <= 1.0 + 1e-6
    assert (y <= x).all()
    for metallic in (0.0, 0.3, 1.0):
        plastic = ggx.F0 * (x - y) + y
        whole = (1 - metallic) * (1 - plastic) + (ggx.F0 + metallic * (1 - ggx.F0)) * (x - y) + y
        assert whole.max() <= 1.0 + 1e-6
    assert x[1:, 0].min() > 0.995
    assert 0.30 < x[-1, -1] < 0.32


def test_regularisation_widens_narrow_lobes_only() -> None:
    assert alpha_of(np.float32(0.0)) == MIN_ALPHA
    got = [float(regularized(np.float32(width))) for width in (1e-3, 0.05, 0.1, 0.2, 0.299, 0.3, 0.5, 1.0)]
    np.testing.assert_allclose(got, [0.1, 0.1, 0.2, 0.3, 0.3, 0.3, 0.5, 1.0], rtol=1e-6)
