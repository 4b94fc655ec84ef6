"""common/octahedral.glsl: normals to 24 bits and back."""

from __future__ import annotations

import itertools

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.shaders.harness import Glsl

F64 = NDArray[np.float64]

ENCODE, DECODE = "vec4(encode_normal(a.xyz))", "vec4(decode_normal(a.x), 0.0)"

BOUND = 1.001 * np.degrees(np.sqrt(18) / 4095)
"""Degrees. Half a step of 2 / 4095 in both coordinates is a way of sqrt(6) / 4095 on the octahedron, seen from
1 / sqrt(3), the distance of its faces; the thousandth is for the terms of second order."""


@pytest.fixture
def glsl(ctx: moderngl.Context) -> Glsl:
    return Glsl(ctx, "common/octahedral.glsl")


def unit(v: F64) -> F64:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def normals() -> F64:
    """All directions, and those where the map is folded: axes, diagonals, equator, and next to each of them."""
    rng = np.random.default_rng(3)
    special = np.array([v for v in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(v)])
    near = np.repeat(special, 20, axis=0) + rng.normal(0, 1e-4, (20 * len(special), 3))
    equator = rng.normal(size=(200, 3)) * (1, 1, 0)
    return unit(np.concatenate([special, near, equator, rng.normal(size=(4000, 3))]))


def encode(n: F64) -> F64:
    """Cigolle et al. 2014, listing 1 and 2, each coordinate rounded to one of 4096 values."""
    n = n / np.abs(n).sum(-1, keepdims=True)
    sign = np.where(n[:, :2] >= 0, 1.0, -1.0)
    o = np.where(n[:, 2:] >= 0, n[:, :2], (1 - np.abs(n[:, 1::-1])) * sign)
    return np.asarray(np.floor((o * 0.5 + 0.5) * 4095 + 0.5))


def angle(a: F64, b: F64) -> F64:
    """Degrees between unit vectors, exact for small angles, where acos is not."""
    return np.asarray(np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2, 0, 1))))


def test_codes_are_integers_of_24_bits(glsl: Glsl) -> None:
    codes = glsl(ENCODE, normals())[:, 0]
    np.testing.assert_array_equal(codes, np.floor(codes))
    assert codes.min() >= 0
    assert codes.max() < 2**24


def test_codes_are_those_of_double_precision(glsl: Glsl) -> None:
    n = normals()
    codes = glsl(ENCODE, n)[:, 0]
    ours = np.stack([codes // 4096, codes % 4096], -1)
    expected = encode(n)
    # Halfway between two codes, and on the fold where two codes mean the same vector, rounding decides.
    different = np.abs(ours - expected).max(-1) > 0
    assert different.mean() < 0.08
    decoded = glsl(DECODE, expected[:, 0] * 4096 + expected[:, 1])[:, :3].astype(np.float64)
    assert angle(decoded, glsl(DECODE, codes)[:, :3].astype(np.float64)).max() <= 2 * BOUND


def test_round_trip_keeps_the_bound(glsl: Glsl) -> None:
    n = normals()
    decoded = glsl(DECODE, glsl(ENCODE, n)[:, 0])[:, :3].astype(np.float64)
    np.testing.assert_allclose(np.linalg.norm(decoded, axis=-1), 1.0, atol=1e-6)
    assert angle(decoded, n).max() <= BOUND


def test_what_was_decoded_encodes_to_the_same_vector(glsl: Glsl) -> None:
    decoded = glsl(DECODE, glsl(ENCODE, normals())[:, 0])[:, :3]
    again = glsl(DECODE, glsl(ENCODE, decoded)[:, 0])[:, :3]
    np.testing.assert_allclose(again, decoded, atol=2e-6)


def test_no_vector_is_not_nan(glsl: Glsl) -> None:
    zero = np.zeros((1, 3), np.float32)
    with np.errstate(invalid="ignore"):
        assert np.isnan(zero / np.abs(zero).sum()).all()  # unguarded
    code = glsl(ENCODE, zero)[0, 0]
    assert 0 <= code < 2**24
    assert np.isfinite(glsl(DECODE, np.array([code]))).all()
