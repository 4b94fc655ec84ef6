"""common/color.glsl against the same formulas in double precision."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from images import to_srgb8
from tests.shaders.harness import Glsl

F64 = NDArray[np.float64]


@pytest.fixture
def glsl(ctx: moderngl.Context) -> Glsl:
    return Glsl(ctx, "common/color.glsl")


def colors(scale: float = 1.0, count: int = 257) -> NDArray[np.float32]:
    """(count, 3) random colours in [0, scale], black, white, primaries and the ends of the range among them."""
    values = np.random.default_rng(7).random((count, 3))
    values[:5] = [[0, 0, 0], [1, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    return (values * scale).astype(np.float32)


def aces(c: F64) -> F64:
    """Narkowicz 2015."""
    return np.asarray(np.clip(c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14), 0.0, 1.0))


def srgb(c: F64) -> F64:
    """IEC 61966-2-1."""
    c = np.clip(c, 0.0, 1.0)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)


def test_luminance_has_the_weights_of_rec_709(glsl: Glsl) -> None:
    c = colors(10.0)
    expected = c.astype(np.float64) @ (0.2126, 0.7152, 0.0722)
    np.testing.assert_allclose(glsl("vec4(luminance(a.rgb))", c)[:, 0], expected, rtol=1e-6)
    assert glsl("vec4(luminance(a.rgb))", np.ones((1, 3)))[0, 0] == pytest.approx(1.0, abs=1e-6)


def test_ycocg_against_its_matrix_and_back(glsl: Glsl) -> None:
    c = colors()
    matrix = np.array([[0.25, 0.5, 0.25], [0.5, 0.0, -0.5], [-0.25, 0.5, -0.25]])
    np.testing.assert_allclose(glsl("vec4(to_ycocg(a.rgb), 0.0)", c)[:, :3], c @ matrix.T, atol=1e-7)
    # Inverse: R = Y + Co - Cg, G = Y + Cg, B = Y - Co - Cg.
    inverse = np.array([[1.0, 1.0, -1.0], [1.0, 0.0, 1.0], [1.0, -1.0, -1.0]])
    np.testing.assert_allclose(glsl("vec4(from_ycocg(a.rgb), 0.0)", c)[:, :3], c @ inverse.T, atol=3e-7)
    np.testing.assert_allclose(glsl("vec4(from_ycocg(to_ycocg(a.rgb)), 0.0)", c)[:, :3], c, atol=3e-7)


def test_grey_has_no_chroma(glsl: Glsl) -> None:
    grey = np.repeat(np.linspace(0, 4, 9)[:, None], 3, axis=1)
    converted = glsl("vec4(to_ycocg(a.rgb), 0.0)", grey)
    np.testing.assert_array_equal(converted[:, 1:3], 0.0)
    np.testing.assert_allclose(converted[:, 0], grey[:, 0])


def test_reinhard_over_the_whole_range_of_half_precision(glsl: Glsl) -> None:
    c = np.geomspace(1e-7, 65000.0, 200).astype(np.float32)
    expected = c / (1.0 + c.astype(np.float64))
    np.testing.assert_allclose(glsl("vec4(tonemap_reinhard(a.rrr), 0.0)", c)[:, 0], expected, rtol=1e-6)


def test_aces_over_the_whole_range(glsl: Glsl) -> None:
    c = np.concatenate([[0.0], np.geomspace(1e-7, 65000.0, 400)]).astype(np.float32)
    mapped = glsl("vec4(tonemap_aces(a.rrr), 0.0)", c)[:, 0]
    np.testing.assert_allclose(mapped, aces(c.astype(np.float64)), rtol=2e-5, atol=1e-9)
    assert (np.diff(mapped) >= 0).all()
    assert mapped[0] == 0.0
    assert mapped[-1] == 1.0


def test_aces_where_both_polynomials_overflow(glsl: Glsl) -> None:
    huge = np.array([1e20, 1e25, 3e38], np.float32)
    with np.errstate(all="ignore"):
        unguarded = huge * (np.float32(2.51) * huge) / (huge * (np.float32(2.43) * huge))
    assert np.isnan(unguarded).all()
    np.testing.assert_array_equal(glsl("vec4(tonemap_aces(a.rrr), 0.0)", huge)[:, 0], 1.0)


def test_srgb_on_both_sides_of_its_threshold(glsl: Glsl) -> None:
    c = np.concatenate([np.linspace(0, 1, 300), 0.0031308 + np.linspace(-1e-5, 1e-5, 21)]).astype(np.float32)
    encoded = glsl("vec4(encode_srgb(a.rrr), 0.0)", c)[:, 0]
    np.testing.assert_allclose(encoded, srgb(c.astype(np.float64)), atol=3e-6)
    rgb = np.repeat(c[:, None], 3, axis=1)
    # The shader and the writer of PNGs must agree; values halfway between two bytes may go either way.
    assert np.abs(np.rint(encoded * 255.0) - to_srgb8(rgb[None])[0, :, 0]).max() <= 1


def test_srgb_of_what_is_outside_of_the_unit_interval(glsl: Glsl) -> None:
    outside = np.array([-0.5, -1e-6, -1e30, 1.5, 1e30], np.float32)
    with np.errstate(invalid="ignore"):
        assert np.isnan(outside[0] ** np.float32(1 / 2.4))  # the unguarded curve
    np.testing.assert_allclose(glsl("vec4(encode_srgb(a.rrr), 0.0)", outside)[:, 0], [0, 0, 0, 1, 1], atol=1e-6)
