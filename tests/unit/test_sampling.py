"""Random numbers and sample warps: every sampler against its density."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from raytrace import sampling
from raytrace.sampling import HALTON, HASH, build_alias, radical_inverse

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U32 = NDArray[np.uint32]

PAIRS = (sampling.PAIR_LIGHT, sampling.PAIR_BOUNCE, sampling.PAIR_SECOND_LIGHT, sampling.PAIR_SELECT)

wang, unit_float, path_key, random_pair = sampling.wang, sampling.unit_float, sampling.path_key, sampling.random_pair
tangent_frame, sample_cosine = sampling.tangent_frame, sampling.sample_cosine
sample_triangle, sample_alias = sampling.sample_triangle, sampling.sample_alias


@njit
def hashes(count):
    result = np.empty(count, np.uint32)
    for i in range(count):
        result[i] = wang(np.uint32(i))
    return result


@njit
def pairs(seed, pixels, frames, pair, generator):
    result = np.empty((len(pixels), len(frames), 2), np.float32)
    for i in range(len(pixels)):
        key = path_key(seed, pixels[i])
        for k in range(len(frames)):
            result[i, k] = random_pair(key, frames[k], pair, generator)
    return result


@njit
def cosine_directions(normal, uv):
    result = np.empty((len(uv), 4), np.float32)
    for i in range(len(uv)):
        result[i] = sample_cosine(normal[0], normal[1], normal[2], uv[i, 0], uv[i, 1])
    return result


@njit
def frames_of(normals):
    result = np.empty((len(normals), 6), np.float32)
    for i in range(len(normals)):
        result[i] = tangent_frame(normals[i, 0], normals[i, 1], normals[i, 2])
    return result


@njit
def triangle_points(uv):
    result = np.empty((len(uv), 2), np.float32)
    for i in range(len(uv)):
        result[i] = sample_triangle(uv[i, 0], uv[i, 1])
    return result


@njit
def alias_counts(count, threshold, alias):
    """How often each index comes out over all 2^24 numbers that the generators can make."""
    result = np.zeros(count, np.int64)
    for i in range(1 << 24):
        result[sample_alias(np.float32(i) * np.float32(2.0**-24), threshold, alias)] += 1
    return result


def random_numbers(pair: int, generator: int, pixels: int, frames: int, seed: int = 0) -> F32:
    """(pixels, frames, 2) float32."""
    result: F32 = pairs(seed, np.arange(pixels, dtype=np.uint32), np.arange(frames, dtype=np.uint32), pair, generator)
    return result


@pytest.mark.parametrize("generator", [sampling.HALTON, sampling.HASH])
def test_all_numbers_of_a_path_drawn_at_once_are_those_drawn_one_by_one(generator: int) -> None:
    pixels, frames = np.meshgrid(np.arange(37, dtype=np.uint32), np.arange(19, dtype=np.uint32), indexing="ij")
    numbers = np.full((5, 2, pixels.size + 3), np.nan, np.float32)  # buffers are as long as the largest tile
    sampling.draw(pixels.ravel(), frames.ravel(), 7, generator, np.empty(pixels.size + 3, np.uint32), numbers)
    assert np.isnan(numbers[..., -3:]).all()
    for pair in range(5):
        expected = random_numbers(pair, generator, 37, 19, seed=7)
        np.testing.assert_array_equal(numbers[pair, :, :-3].T.reshape(37, 19, 2), expected)


# ---------------------------------------------------------------------------------------------------------- generators


def wang_in_python(value: int) -> int:
    """Wang's hash as he wrote it."""
    value = (value ^ 61) ^ (value >> 16)
    value = (value + (value << 3)) & 0xFFFFFFFF
    value ^= value >> 4
    value = (value * 0x27D4EB2D) & 0xFFFFFFFF
    return value ^ (value >> 15)


def test_wang_is_wangs_hash() -> None:
    for value in (0, 1, 61, 12345, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF):
        assert int(wang(np.uint32(value))) == wang_in_python(value)


def test_wang_spreads_over_all_bits_and_never_repeats() -> None:
    count = 1 << 18
    values = hashes(count)
    assert len(np.unique(values)) == count
    for bit in range(32):
        share = ((values >> np.uint32(bit)) & 1).mean()
        assert share == pytest.approx(0.5, abs=5 * 0.5 / math.sqrt(count)), bit


def test_unit_float_stays_below_one() -> None:
    """A division by 2^32 in single precision rounds the last 128 codes up to 1."""
    assert unit_float(np.uint32(0xFFFFFFFF)) == 1.0 - 2.0**-24
    assert unit_float(np.uint32(0xFFFFFF80)) < 1.0
    assert unit_float(np.uint32(0)) == 0.0
    assert unit_float(np.uint32(0x80000000)) == 0.5
    assert np.float32(0xFFFFFFFF) * np.float32(2.0**-32) == 1.0


def test_radical_inverse_reverses_digits() -> None:
    np.testing.assert_array_equal(radical_inverse(2, 8), np.array([0, 4, 2, 6, 1, 5, 3, 7]) / 8)
    np.testing.assert_allclose(radical_inverse(3, 9), np.array([0, 3, 6, 1, 4, 7, 2, 5, 8]) / 9, rtol=1e-7)
    assert radical_inverse(3, 16).dtype == np.float32


@pytest.mark.parametrize("generator", [HALTON, HASH], ids=["halton", "hash"])
def test_numbers_are_uniform_over_pixels(generator: int) -> None:
    """Chi-square of 400 cells of the unit square, for each pair of dimensions. Mean 399, standard deviation 28.2."""
    for pair in PAIRS:
        values = random_numbers(pair, generator, 40_000, 1)[:, 0]
        assert values.min() >= 0.0
        assert values.max() < 1.0
        cells = np.histogram2d(values[:, 0], values[:, 1], 20, ((0, 1), (0, 1)))[0]  # 20: no multiple of 16 or 3
        chi = ((cells - 100) ** 2 / 100).sum()
        assert 399 - 5 * 28.2 < chi < 399 + 5 * 28.2


def test_hash_numbers_are_uniform_over_frames_and_seeds() -> None:
    over_frames = random_numbers(sampling.PAIR_BOUNCE, HASH, 1, 40_000)[0]
    over_seeds = np.concatenate([random_numbers(sampling.PAIR_BOUNCE, HASH, 1, 1, s)[:, 0] for s in range(4000)])
    for values, count in ((over_frames, 40_000), (over_seeds, 4000)):
        cells = np.histogram2d(values[:, 0], values[:, 1], 8, ((0, 1), (0, 1)))[0]
        chi = ((cells - count / 64) ** 2 / (count / 64)).sum()
        assert 63 - 5 * 11.2 < chi < 63 + 5 * 11.2


@pytest.mark.parametrize("generator", [HALTON, HASH], ids=["halton", "hash"])
def test_dimensions_pixels_and_frames_are_uncorrelated(generator: int) -> None:
    count = 40_000
    columns = [random_numbers(pair, generator, count, 1)[:, 0, k] for pair in PAIRS for k in (0, 1)]
    columns.append(np.roll(columns[0], 1))  # the neighbour to the left
    columns.append(np.roll(columns[0], 640))  # the neighbour below
    columns.append(random_numbers(PAIRS[0], generator, count, 1, seed=1)[:, 0, 0])
    if generator == HASH:
        columns.append(random_numbers(PAIRS[0], generator, count, 2)[:, 1, 0])  # the next frame
    correlation = np.corrcoef(np.stack(columns))
    np.testing.assert_allclose(correlation, np.eye(len(columns)), atol=5 / math.sqrt(count))


def test_sixteen_frames_of_halton_visit_every_stratum_once() -> None:
    """From any frame on, up to the pixel's rotation: the base-2 number falls into each sixteenth once, and the base-3
    number takes the 16 first points of its sequence."""
    pixels = 50
    ternary = np.sort(radical_inverse(3, 16).astype(np.float64))
    for pair in PAIRS:
        values = random_numbers(pair, HALTON, pixels, 23)[:, 7:].astype(np.float64)
        rotation = values[:, :, 0] * 16 % 1.0
        spread = np.abs((rotation - rotation[:, :1] + 0.5) % 1.0 - 0.5)
        assert spread.max() < 1e-4  # one rotation for all frames of a pixel
        strata = np.sort(np.floor(values[:, :, 0] * 16).astype(int), axis=1)
        np.testing.assert_array_equal(strata, np.broadcast_to(np.arange(16), (pixels, 16)))
        for row in values[:, :, 1]:
            rotations = [np.sort((ternary - ternary[0] + start) % 1.0) for start in row]
            assert min(np.abs(np.sort(row) - rotated).max() for rotated in rotations) < 1e-6


def test_halton_repeats_after_sixteen_frames_and_hash_does_not() -> None:
    for pair in PAIRS:
        cycled = random_numbers(pair, HALTON, 20, 32)
        np.testing.assert_array_equal(cycled[:, :16], cycled[:, 16:])
        fresh = random_numbers(pair, HASH, 20, 32)
        assert not (fresh[:, :16] == fresh[:, 16:]).any()


def test_four_consecutive_frames_of_halton_are_spread_already() -> None:
    """The filters never average 16 frames alike: aligned runs of 2, 4 and 8 fall into as many different strata."""
    values = random_numbers(sampling.PAIR_LIGHT, HALTON, 200, 16)[:, :, 0].astype(np.float64)
    unrotated = (values - values.min(1, keepdims=True) + 0.5 / 16) % 1.0  # the least one is the rotated 0 or its like
    for run in (2, 4, 8):
        groups = np.floor(unrotated * run).astype(int).reshape(200, 16 // run, run)
        assert (np.sort(groups, axis=2) == np.arange(run)).all(axis=2).mean() > 0.99


def test_each_pixel_and_pair_visits_the_points_in_an_order_of_its_own() -> None:
    """Steps from frame 0 on do not feel the rotation. Of the 16 orders that an XOR can make 8 differ by more than one;
    all occur, and two pairs of one pixel agree as often as chance has it."""
    steps = []
    for pair in PAIRS:
        values = random_numbers(pair, HALTON, 800, 16)[:, :, 0].astype(np.float64)
        steps.append(np.rint((values - values[:, :1]) * 16).astype(int) % 16)
        assert len(np.unique(steps[-1], axis=0)) == 8
    for first, second in ((0, 1), (1, 2), (2, 3), (0, 3)):
        assert (steps[first] == steps[second]).all(axis=1).mean() == pytest.approx(1 / 8, abs=0.05)


@pytest.mark.parametrize("generator", [HALTON, HASH], ids=["halton", "hash"])
def test_numbers_are_a_function_of_seed_pixel_frame_and_pair(generator: int) -> None:
    """The same in any order and in any company, and different when any one of the four differs."""
    everything = random_numbers(PAIRS[1], generator, 64, 8, seed=9)
    some = np.array([17, 3, 17, 63], np.uint32)
    frames = np.array([5, 0, 5], np.uint32)
    again = pairs(9, some, frames, PAIRS[1], generator)
    np.testing.assert_array_equal(again, everything[some][:, frames])
    for other in (
        random_numbers(PAIRS[2], generator, 64, 8, seed=9),
        random_numbers(PAIRS[1], generator, 64, 8, seed=10),
        np.roll(everything, 1, axis=0),
        np.roll(everything, 1, axis=1),
    ):
        assert (other == everything).all(axis=2).mean() < 0.2


def test_seeds_differ_over_their_whole_range() -> None:
    seeds = [0, 1, 2, 0x5EED0000, 2**31, 2**32 - 1]
    keys = {int(path_key(np.uint32(seed), np.uint32(5))) for seed in seeds}
    assert len(keys) == len(seeds)


# --------------------------------------------------------------------------------------------------------------- warps


def grid(side: int) -> F32:
    """Centres of ``side``² cells of the unit square, (side², 2) float32."""
    s = (np.arange(side) + 0.5) / side
    return np.stack(np.meshgrid(s, s), axis=-1).reshape(-1, 2).astype(np.float32)


NORMALS = {
    "up": (0.0, 1.0, 0.0),
    "forward": (0.0, 0.0, 1.0),
    "backward": (0.0, 0.0, -1.0),
    "almost backward": (1e-4, -1e-4, -math.sqrt(1 - 2e-8)),
    "nothing in z": (0.6, 0.8, 0.0),
    "minus nothing in z": (0.6, 0.8, -0.0),
    "oblique": (0.48, -0.6, 0.64),
    "oblique backward": (-0.48, 0.6, -0.64),
}


def test_tangent_frames_are_orthonormal_and_right_handed() -> None:
    random = np.random.default_rng(0).normal(size=(2000, 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    normals = np.concatenate([np.array(list(NORMALS.values())), random]).astype(np.float32)
    frames = frames_of(normals).astype(np.float64)
    tangent, bitangent, normal = frames[:, :3], frames[:, 3:], normals.astype(np.float64)
    for a, b, expected in (
        (tangent, tangent, 1.0),
        (bitangent, bitangent, 1.0),
        (tangent, bitangent, 0.0),
        (tangent, normal, 0.0),
        (bitangent, normal, 0.0),
    ):
        np.testing.assert_allclose((a * b).sum(1), expected, atol=5e-7)
    np.testing.assert_allclose(np.cross(tangent, bitangent), normal, atol=1e-6)


@pytest.mark.parametrize("name", NORMALS)
def test_cosine_directions_have_the_density_of_the_cosine(name: str) -> None:
    """Moments of cos/π over the hemisphere: E[cos] = 2/3, E[cos²] = 1/2, E[sin² cos² φ] = 1/4, mixed ones 0."""
    normal = np.array(NORMALS[name], np.float32)
    directions = cosine_directions(normal, grid(256)).astype(np.float64)
    w, cosine = directions[:, :3], directions[:, 3]
    np.testing.assert_allclose((w * w).sum(1), 1.0, atol=1e-6)
    np.testing.assert_allclose(w @ normal.astype(np.float64), cosine, atol=1e-6)
    assert (cosine > 0.0).all()
    axes = frames_of(normal[None])[0].astype(np.float64).reshape(2, 3)
    x, y = w @ axes[0], w @ axes[1]
    for value, expected in ((cosine, 2 / 3), (cosine**2, 1 / 2), (x * x, 1 / 4), (y * y, 1 / 4)):
        assert value.mean() == pytest.approx(expected, abs=2e-4)
    for value in (x, y, x * y, x * cosine, y * cosine):
        assert value.mean() == pytest.approx(0.0, abs=2e-4)


def test_cosine_directions_fill_equal_cells_equally() -> None:
    """Chi-square with random numbers: cells of equal cos² and equal angle have equal probability."""
    uv = random_numbers(sampling.PAIR_BOUNCE, HASH, 60_000, 1)[:, 0]
    directions = cosine_directions(np.array((0.0, 0.0, 1.0), np.float32), uv)
    angle = np.arctan2(directions[:, 1], directions[:, 0])
    cells = np.histogram2d(directions[:, 3] ** 2, angle, (8, 16), ((0, 1), (-np.pi, np.pi)))[0]
    chi = ((cells - 60_000 / 128) ** 2 / (60_000 / 128)).sum()
    assert 127 - 5 * 15.9 < chi < 127 + 5 * 15.9


def test_cosine_directions_at_the_ends_of_the_square() -> None:
    last = 1.0 - 2.0**-24
    corners = np.array([(0, 0), (0, last), (last, 0), (last, last)], np.float32)
    directions = cosine_directions(np.array((0.0, 0.0, -1.0), np.float32), corners)
    assert np.isfinite(directions).all()
    np.testing.assert_allclose(directions[:2], np.tile((0, 0, -1, 1), (2, 1)), atol=1e-6)
    assert (directions[:, 3] > 0.0).all()


def test_triangle_points_are_uniform() -> None:
    points = triangle_points(grid(512)).astype(np.float64)
    b, c = points.T
    a = 1 - b - c
    assert min(a.min(), b.min(), c.min()) >= -1e-7
    for value, expected in ((a, 1 / 3), (b, 1 / 3), (c, 1 / 3), (b * b, 1 / 6), (c * c, 1 / 6), (b * c, 1 / 12)):
        assert value.mean() == pytest.approx(expected, abs=1e-4)
    # Cut into 4 x 4 cells of equal area, without those on the long side: each has its share.
    cells = np.histogram2d(b, c, 4, ((0, 1), (0, 1)))[0] / len(points)
    full = [(i, j) for i in range(4) for j in range(4) if i + j < 3]
    np.testing.assert_allclose([cells[k] for k in full], 2 / 16, rtol=0.01)


def test_triangle_points_at_the_ends_of_the_square() -> None:
    last = 1.0 - 2.0**-24
    corners = np.array([(0, 0), (0, last), (last, 0), (last, last)], np.float32)
    np.testing.assert_allclose(triangle_points(corners), [(0, 0), (0, 1), (1, 0), (0.5, 0.5)], atol=1e-6)


# --------------------------------------------------------------------------------------------------------- alias tables

WEIGHTS = {
    "one": np.array([3.0]),
    "equal": np.full(7, 0.25),
    "unlike": np.array([1e-6, 1.0, 0.0, 1000.0, 3.0, 3.0, 1e-3]),
    "many": np.random.default_rng(5).pareto(1.2, 1000),
    "one in all": np.eye(33)[17],
}


@pytest.mark.parametrize("name", WEIGHTS)
def test_alias_tables_draw_what_their_pdf_says(name: str) -> None:
    """Counted over all numbers that there are, so that nothing is left to chance but the last unit of each entry."""
    weights = WEIGHTS[name]
    threshold, alias, pdf = build_alias(weights)
    assert threshold.dtype == np.float32
    assert alias.dtype == np.int32
    assert pdf.dtype == np.float32
    np.testing.assert_allclose(pdf, weights / weights.sum(), rtol=2e-6, atol=1e-7 / len(weights))
    assert pdf.sum(dtype=np.float64) == pytest.approx(1.0, abs=1e-6)
    drawn = alias_counts(len(weights), threshold, alias) / 2.0**24
    # Each cell's share is counted in steps of 2^-24, and every cell may lead to this entry.
    steps = 1 + np.bincount(alias, minlength=len(weights))
    assert (np.abs(drawn - pdf) <= (steps + 1) * 2.0**-24 + 1e-6 * pdf).all()
    assert not drawn[weights == 0.0].any()


def test_weights_of_nothing_give_a_uniform_table() -> None:
    threshold, alias, pdf = build_alias(np.zeros(5))
    np.testing.assert_allclose(pdf, 0.2, rtol=1e-6)
    np.testing.assert_array_equal(alias_counts(5, threshold, alias) > 0, True)
