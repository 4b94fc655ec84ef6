"""common/finite.glsl: what counts as finite, and what half precision holds."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from tests.shaders.harness import Glsl

FINITE = np.array(
    [0.0, -0.0, 1.0, -1.0, 65504.0, 1e38, np.finfo(np.float32).max, -np.finfo(np.float32).max], np.float32
)
DENORMAL = np.array([1e-45, -1e-45, 1e-39, np.finfo(np.float32).tiny], np.float32)
QUIET, SIGNALLING, NEGATIVE, PAYLOAD = 0x7FC00000, 0x7F800001, 0xFFC00000, 0x7FFFFFFF
NANS = np.array([QUIET, SIGNALLING, NEGATIVE, PAYLOAD], np.uint32).view(np.float32)
BAD = np.concatenate([NANS, np.array([np.inf, -np.inf], np.float32)])


@pytest.fixture
def glsl(ctx: moderngl.Context) -> Glsl:
    return Glsl(ctx, "common/finite.glsl")


def test_every_finite_number_is_finite(glsl: Glsl) -> None:
    values = np.concatenate([FINITE, DENORMAL])
    assert (glsl("vec4(is_finite(a.x))", values)[:, 0] == 1.0).all()


def test_every_nan_and_both_infinities_are_not(glsl: Glsl) -> None:
    assert (glsl("vec4(is_finite(a.x))", BAD)[:, 0] == 0.0).all()


@pytest.mark.parametrize("channels", [2, 3, 4])
def test_one_bad_channel_spoils_a_vector(glsl: Glsl, channels: int) -> None:
    swizzle = "xyzw"[:channels]
    rows = np.ones((1 + channels * len(BAD), 4), np.float32)
    for row, (channel, value) in enumerate(((c, v) for c in range(channels) for v in BAD), 1):
        rows[row, channel] = value
    result = glsl(f"vec4(is_finite(a.{swizzle}))", rows)[:, 0]
    assert result[0] == 1.0
    assert (result[1:] == 0.0).all()


def test_channels_that_are_not_asked_for_do_not_count(glsl: Glsl) -> None:
    rows = np.array([[1.0, 2.0, 3.0, np.nan]], np.float32)
    assert glsl("vec4(is_finite(a.xyz))", rows)[0, 0] == 1.0


def test_a_clamped_radiance_fits_into_a_half(glsl: Glsl) -> None:
    values = np.array([-1.0, 0.0, 0.5, 65000.0, 65504.0, 65520.0, 1e5, 3e38], np.float32)
    with np.errstate(over="ignore"):
        assert np.isinf(values[-3:].astype(np.float16)).all()  # what happens to them unclamped
    clamped = glsl("vec4(clamp_radiance(a.xxx), 0.0)", values)[:, 0]
    np.testing.assert_array_equal(clamped, np.clip(values, 0.0, 65000.0))
    assert np.isfinite(clamped.astype(np.float16)).all()
