"""Texture lookup against its NumPy twin, and mip levels against means."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from raytrace import textures
from raytrace.scene import Texture
from raytrace.textures import MAX_LEVELS, SRGB_TO_LINEAR, TextureAtlas, build_atlas, sample_bilinear

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

lookup, level_for = textures.lookup, textures.level_for


@njit
def lookups(texels, levels, decode, index, uvs, level):
    result = np.empty((len(uvs), 3), np.float32)
    for i in range(len(uvs)):
        result[i] = lookup(texels, levels, decode, index, uvs[i, 0], uvs[i, 1], level)
    return result


def looked_up(atlas: TextureAtlas, index: int, uvs: NDArray[np.floating], level: int = 0) -> F32:
    uvs = np.ascontiguousarray(uvs, dtype=np.float32)
    result: F32 = lookups(atlas.texels, atlas.levels, SRGB_TO_LINEAR, index, uvs, level)
    return result


def noise(width: int, height: int, seed: int = 0) -> Texture:
    return Texture("noise", np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8))


def image_of(atlas: TextureAtlas, index: int, level: int) -> F64:
    """The linear texels of one level, (h, w, 3), straight from the atlas."""
    offset, width, height = atlas.levels[index, level]
    return SRGB_TO_LINEAR[atlas.texels[offset : offset + width * height]].reshape(height, width, 3).astype(np.float64)


SIZES = [(1, 1), (2, 2), (16, 16), (13, 7), (1, 9), (9, 1), (5, 64)]


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_lookup_is_its_numpy_twin_at_every_level(size: tuple[int, int]) -> None:
    atlas = build_atlas([noise(3, 5, 1), noise(*size)])
    # Multiples of 2^-12: exact in both precisions, so that both see the same texels to the last digit.
    uvs = np.random.default_rng(2).integers(-3 * 4096, 3 * 4096, (3000, 2)) / 4096
    for level in range(MAX_LEVELS):
        expected = sample_bilinear(atlas, 1, uvs, level)
        np.testing.assert_allclose(looked_up(atlas, 1, uvs, level), expected, atol=1e-5)


def test_a_texel_is_found_at_its_centre() -> None:
    """Row 0 is the bottom row, v = 0."""
    texture = noise(5, 3)
    atlas = build_atlas([texture])
    x, y = np.meshgrid(np.arange(5), np.arange(3))
    centres = np.stack([(x + 0.5) / 5, (y + 0.5) / 3], axis=-1).reshape(-1, 2)
    expected = SRGB_TO_LINEAR[texture.pixels].reshape(-1, 3)
    np.testing.assert_allclose(looked_up(atlas, 0, centres), expected, atol=2e-6)


def test_halfway_between_texels_is_their_mean_across_the_border_too() -> None:
    texture = noise(4, 4)
    linear = SRGB_TO_LINEAR[texture.pixels].astype(np.float64)
    got = looked_up(build_atlas([texture]), 0, np.array([(0.5, 0.125), (0.0, 0.125), (1.0, 0.125), (0.125, 0.0)]))
    means = [(linear[0, 1] + linear[0, 2]), (linear[0, 3] + linear[0, 0]), (linear[0, 3] + linear[0, 0])]
    np.testing.assert_allclose(got, np.array([*means, linear[3, 0] + linear[0, 0]]) / 2, atol=2e-6)


@pytest.mark.parametrize("size", [(8, 8), (7, 5), (1, 1)], ids=str)
def test_coordinates_repeat(size: tuple[int, int]) -> None:
    atlas = build_atlas([noise(*size)])
    uvs = np.random.default_rng(3).integers(0, 1024, (500, 2)) / 1024
    expected = looked_up(atlas, 0, uvs)
    for shift in ((1, 0), (0, -1), (-7, 300), (-4096, 4096)):
        np.testing.assert_array_equal(looked_up(atlas, 0, uvs + np.array(shift)), expected)


@pytest.mark.parametrize("value", [-1e-9, -1e-38, 1.0, 1e6, -1e6, 123456.789, 16777216.0, -1e15, 1e18])
def test_coordinates_of_any_size_stay_inside_the_texture(value: float) -> None:
    """Just below 0 the wrapped coordinate rounds to 1; far out single precision has no fraction left."""
    atlas = build_atlas([noise(6, 5, 4), Texture("white", np.full((7, 3, 3), 255, np.uint8)), noise(6, 5, 5)])
    for uv in ((value, 0.3), (0.3, value), (value, value)):
        np.testing.assert_allclose(looked_up(atlas, 1, np.array([uv])), 1.0, atol=1e-6)


@pytest.mark.parametrize("size", [(16, 16), (64, 4), (1, 8)], ids=str)
def test_levels_halve_down_to_one_texel_and_keep_the_mean(size: tuple[int, int]) -> None:
    """Means in linear light; each level is rounded to 8 bits once, from the exact texels."""
    texture = noise(*size)
    atlas = build_atlas([texture])
    exact = SRGB_TO_LINEAR[texture.pixels].astype(np.float64)
    width, height = size
    for level in range(MAX_LEVELS):
        assert tuple(atlas.levels[0, level, 1:]) == (width, height)
        image = image_of(atlas, 0, level)
        assert image.mean((0, 1)) == pytest.approx(exact.mean((0, 1)), abs=0.005)
        blocks = exact.reshape(height, size[1] // height, width, size[0] // width, 3).mean((1, 3))
        np.testing.assert_allclose(image, blocks, atol=0.005)
        width, height = max(1, width // 2), max(1, height // 2)
    assert (width, height) == (1, 1)


def test_odd_sizes_drop_the_last_row_and_column_of_a_level() -> None:
    atlas = build_atlas([noise(7, 5)])
    assert [tuple(size) for size in atlas.levels[0, :4, 1:]] == [(7, 5), (3, 2), (1, 1), (1, 1)]
    exact = image_of(atlas, 0, 0)
    blocks = exact[:4, :6].reshape(2, 2, 3, 2, 3).mean((1, 3))
    np.testing.assert_allclose(image_of(atlas, 0, 1), blocks, atol=0.005)


def test_averages_are_taken_in_linear_light() -> None:
    """Black and white make sRGB code 188, not 128."""
    checks = (np.indices((8, 8)).sum(0) % 2 * 255).astype(np.uint8)
    atlas = build_atlas([Texture("checks", np.repeat(checks[..., None], 3, axis=2))])
    for level in (1, 2, 3):
        offset = atlas.levels[0, level, 0]
        np.testing.assert_array_equal(atlas.texels[offset], 188)


def test_textures_do_not_touch_in_the_atlas() -> None:
    many = [noise(*size, seed) for seed, size in enumerate(SIZES)]
    atlas = build_atlas(many)
    for index, texture in enumerate(many):
        np.testing.assert_array_equal(image_of(atlas, index, 0), SRGB_TO_LINEAR[texture.pixels].astype(np.float64))
    spans = sorted({(int(o), int(o + w * h)) for o, w, h in atlas.levels.reshape(-1, 3)})
    assert all(end <= start for (_, end), (start, _) in pairwise(spans))
    assert spans[-1][1] == len(atlas.texels)


def test_an_alpha_channel_is_left_out() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (3, 4, 4), dtype=np.uint8)
    atlas = build_atlas([Texture("rgba", pixels)])
    np.testing.assert_array_equal(atlas.texels[:12], pixels[..., :3].reshape(-1, 3))


def test_no_textures_make_an_atlas_that_can_be_passed_on() -> None:
    atlas = build_atlas([])
    assert atlas.texels.shape == (1, 3)
    assert atlas.levels.shape == (1, MAX_LEVELS, 3)


def test_srgb_codes() -> None:
    """IEC 61966-2-1: ends, the linear part, and a value of the curved one."""
    assert (SRGB_TO_LINEAR[0], SRGB_TO_LINEAR[255]) == (0.0, 1.0)
    assert SRGB_TO_LINEAR[10] == pytest.approx(10 / 255 / 12.92)
    assert SRGB_TO_LINEAR[188] == pytest.approx(0.5029, abs=1e-4)
    assert (np.diff(SRGB_TO_LINEAR) > 0).all()


def test_the_level_is_the_one_with_texels_nearest_in_size() -> None:
    for footprint, level in (
        (0.0, 0),
        (1.0, 0),
        (1.4, 0),
        (1.42, 1),
        (2.0, 1),
        (2.82, 1),
        (2.84, 2),
        (4.0, 2),
        (64.0, 6),
    ):
        assert level_for(np.float32(footprint)) == level
    assert level_for(np.float32(1e30)) == MAX_LEVELS - 1
    assert level_for(np.float32(math.nan)) == 0
    assert level_for(np.float32(math.inf)) == MAX_LEVELS - 1
