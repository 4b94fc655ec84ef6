"""Numerical hazards at edges, in histories and on the way to the screen, tested as in test_hazards.py."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config import Config, Display, Svgf, Taa
from gl.graph import Graph
from gl.passes.display import Encode
from tests.passes.harness import (
    HALF,
    Bench,
    Increment,
    accumulation,
    anti_aliasing,
    atrous,
    columns,
    frame,
    noise,
    signal,
    variance,
    with_sky,
)

SIZE = (33, 21)
SPLINE = np.array([1, 4, 6, 4, 1]) / 16
UNGUIDED = Svgf(variance_guided=False)


X = np.arange(SIZE[0])

# ---------------------------------------------------------------------------------------------------- edges and nothing


def test_back_to_back_surfaces(bench: Bench) -> None:
    """cos^σ of opposite normals: squared into place it is 1, by exp2 and log2 it is NaN."""
    assert (-1.0) ** 128 == 1.0
    with np.errstate(invalid="ignore"):
        assert np.isnan(np.exp2(np.float32(100.0) * np.log2(np.float32(-1.0))))
    left = X < 16
    normal = np.broadcast_to(np.where(left[:, None], (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)), (21, 33, 3))
    level = columns(SIZE, np.where(left, 1.0, 5.0))
    for exponent in (128, 100, 1):
        p = Svgf(variance_guided=False, sigma_n=exponent)
        out = bench.run(frame(SIZE, normal=normal), atrous(p, (1, 2)), extra=signal(SIZE, level))["color"]
        np.testing.assert_allclose(out[..., 0], level, rtol=2 * HALF)
    out = bench.run(frame(SIZE, normal=normal), variance(), extra=signal(SIZE, level))["color"]
    assert out[..., 3].max() < 0.01


def test_normals_a_rounding_longer_than_one(bench: Bench) -> None:
    """A product of 1 + 2^-23 is outside of acos' domain."""
    length = 1 + 2.0**-22  # a number of single precision
    with np.errstate(invalid="ignore"):
        assert np.isnan(np.arccos(np.float32(length * length)))
    level = noise(SIZE, 1)[..., 0]
    for exponent in (1024, 1000):
        p = Svgf(variance_guided=False, sigma_n=exponent)
        out = bench.run(frame(SIZE, normal=(0, 0, length)), atrous(p), extra=signal(SIZE, level))["color"]
        expected = bench.run(frame(SIZE), atrous(p), extra=signal(SIZE, level))["color"]
        np.testing.assert_allclose(out, expected, rtol=2e-3)
    for _ in range(2):
        images = bench.run(frame(SIZE, normal=(0, 0, length)), accumulation(Svgf(normal_tolerance=0.999)))
    assert (images["reprojection"][..., 3] == 1).all()


@pytest.mark.parametrize("step", [1, 4, 8, 16])
def test_what_lies_beyond_the_border_does_not_come_in(bench: Bench, step: int) -> None:
    """A sampler that wraps around brings in the other side; one that clamps counts the border several times."""
    level = columns(SIZE, np.where(X >= 17, 1e4, 1.0))
    taps = np.arange(-2, 3) * step
    assert (SPLINE * level[0][taps % SIZE[0]]).sum() > 100.0  # column 0, wrapped
    packet = frame(SIZE, object_id=columns(SIZE, X >= 17))
    out = bench.run(packet, atrous(UNGUIDED, (step,)), extra=signal(SIZE, level))["color"][:, 0, 0]
    inside = taps[(taps >= 0) & (taps < SIZE[0])]
    weights = SPLINE[(taps >= 0) & (taps < SIZE[0])]
    np.testing.assert_allclose(out, (weights * level[0][inside]).sum() / weights.sum(), rtol=2 * HALF)

    ramp = columns(SIZE, X.astype(float))
    clamped = (SPLINE * ramp[0][np.clip(taps, 0, None)]).sum()
    expected = (weights * ramp[0][inside]).sum() / weights.sum()
    assert abs(clamped - expected) > 0.1 * expected
    out = bench.run(frame(SIZE), atrous(UNGUIDED, (step,)), extra=signal(SIZE, ramp))["color"][:, 0, 0]
    np.testing.assert_allclose(out, expected, rtol=2 * HALF)


@pytest.mark.parametrize("shift", [(-5.0, 0.0), (5.0, 0.0), (0.0, 3.0), (-40.0, 0.0), (1e9, 0.0), (0.0, -3e38)])
def test_a_point_that_was_off_the_screen(bench: Bench, shift: tuple[float, float]) -> None:
    picture = columns(SIZE, np.where((X < 3) | (X > 29), 1e4, 1.0))
    wrapped = np.roll(picture, (-int(np.clip(shift[1], -99, 99)), -int(np.clip(shift[0], -99, 99))), (0, 1))
    y, x = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.float64)
    x, y = x + shift[0], y + shift[1]
    outside = (x < -1) | (x > SIZE[0]) | (y < -1) | (y > SIZE[1])
    assert wrapped[outside].max() == 1e4
    p = Svgf(alpha=0.0)
    bench.run(frame(SIZE, direct=picture), accumulation(p))
    images = bench.run(frame(SIZE, direct=1.0, shift=shift), accumulation(p))
    assert not images["reprojection"][outside][:, 3].any()
    np.testing.assert_array_equal(images["color"][outside][:, :3], 1.0)
    # Anti-aliasing reads with a wider window.
    shown = np.ones((SIZE[1], SIZE[0], 4), np.float32)
    bench.restart()
    for value in (picture.astype(np.float32)[..., None] * shown, shown):
        images = bench.run(frame(SIZE, shift=shift), anti_aliasing(Taa(clip=False)), extra={"frame.color": value})
    np.testing.assert_array_equal(images["color"][outside][:, :3], 1.0)


def test_sky_at_depth_infinity_or_nothing(bench: Bench) -> None:
    """As a depth of infinity sky is NaN away from sky; as one of 0 it must not be near."""
    with np.errstate(invalid="ignore"):
        assert np.isnan(np.exp(-np.abs(np.float32(np.inf) - np.float32(np.inf)) / np.float32(1)))
    sky = columns(SIZE, X >= 20).astype(bool)
    emission = np.where(sky[..., None], (0.2, 0.4, 0.9), 0.0)
    packet = with_sky(frame(SIZE, direct=2.0, indirect=1.0, albedo=0.5, emission=emission), sky)
    for config in (Config(), Config(svgf=Svgf(temporal=False)), Config(svgf=UNGUIDED)):
        bench.restart()
        for _ in range(5):
            images = bench.denoise(packet, config)
            radiance = images["radiance"][..., :3]
            np.testing.assert_array_equal(radiance[sky], emission[sky].astype(np.float32))
            np.testing.assert_allclose(radiance[~sky], 1.5, rtol=2 * HALF)
    keep = ["svgf.reproject.out_reprojection"]
    images = bench.denoise(packet, keep=keep)
    assert not images[keep[0]][sky][:, 3].any()
    assert images[keep[0]][~sky][:, 3].all()


def test_isolated_pixels(bench: Bench) -> None:
    """Every weight may be 0, the pixel's own as well if its normal is 0: 0 / 0."""
    with np.errstate(invalid="ignore"):
        own = np.float32(max(0.0, float(np.dot(np.zeros(3), np.zeros(3))))) ** 128
        assert np.isnan(own * np.float32(1) / own)
    rng = np.random.default_rng(5)
    level = noise(SIZE, 1)[..., 0]
    far = 4.0 * 1.5 ** rng.permutation(SIZE[0] * SIZE[1]).reshape(SIZE[1], SIZE[0]).clip(0, 60)
    for packet in (frame(SIZE, normal=(0.0, 0.0, 0.0)), frame(SIZE, depth=far), frame(SIZE, depth=0.0)):
        out = bench.run(packet, atrous(UNGUIDED, (1, 2, 4)), extra=signal(SIZE, level, 0.5))["color"]
        assert np.isfinite(out).all()
        assert np.isfinite(bench.run(packet, variance(), extra=signal(SIZE, level))["color"]).all()
    alone = bench.run(frame(SIZE, normal=(0.0, 0.0, 0.0)), atrous(Svgf()), extra=signal(SIZE, level, 0.5))["color"]
    np.testing.assert_allclose(alone[..., 0], level, rtol=HALF)
    np.testing.assert_allclose(alone[..., 3], 0.5, rtol=HALF)


# -------------------------------------------------------------------------------------------------------------- history


def test_the_weight_of_a_first_and_of_a_very_old_sample(bench: Bench) -> None:
    """1 / h: infinite before the first sample, and of no effect once h counts more frames than its type holds."""
    with np.errstate(divide="ignore", invalid="ignore"):
        assert np.isnan(np.float32(0) * (np.float32(1) / np.float32(0)))
        assert np.float16(2048) + np.float16(1) == np.float16(2048)
    p = Svgf(alpha=0.0, alpha_moments=0.0, max_history=255)
    size = (3, 3)
    first = bench.run(frame(size, direct=7.0), accumulation(p))
    np.testing.assert_array_equal(first["color"][..., :3], 7.0)
    for _ in range(300):
        bench.run(frame(size, direct=7.0), accumulation(p))
    images = bench.run(frame(size, direct=7.0 + 255.0), accumulation(p))
    assert (images["reprojection"][..., 3] == 254).all()
    np.testing.assert_allclose(images["color"][..., :3], 8.0, rtol=1e-5)


def test_a_length_from_the_nearest_texel_would_not_fit_the_colour(bench: Bench) -> None:
    """Three quarters of the colour come from a pixel seen 20 times, one from a pixel seen once."""
    p = Svgf(alpha=0.0, alpha_moments=0.0)
    outside = np.broadcast_to(np.where(X[:, None] < 16, 0.0, 500.0) * (1.0, 0.0), (21, 33, 2))
    for _ in range(19):
        bench.run(frame(SIZE), accumulation(p))
    bench.run(frame(SIZE, shift=outside), accumulation(p))
    length = bench.run(frame(SIZE, shift=(0.25, 0.0)), accumulation(p))["reprojection"][10, 15, 3]
    nearest = 20.0
    assert length != nearest
    assert length == round(0.75 * 20 + 0.25 * 1)


def test_a_variance_of_zero_does_not_lock_an_outlier_in(bench: Bench) -> None:
    """One bright pixel whose own estimate says that it has no noise: only a variance blurred over its neighbours lets
    it go. The spatial estimate of a new pixel never has that problem."""
    level, sigma = columns(SIZE, np.ones(SIZE[0])), columns(SIZE, np.full(SIZE[0], 3.0))
    level[10, 16], sigma[10, 16] = 10.0, 0.0
    unguarded = np.exp(-9.0 / (4.0 * 0.0 + 1e-6))
    assert unguarded == 0.0  # nothing is mixed into it, now and for ever
    out = bench.run(frame(SIZE), atrous(Svgf()), extra=signal(SIZE, level, sigma))["color"]
    assert out[10, 16, 0] < 4.0
    spatial = bench.run(frame(SIZE), variance(), extra=signal(SIZE, level))["color"]
    assert spatial[10, 16, 3] > 2.0


# ------------------------------------------------------------------------------------------------- picture and executor


def test_anti_aliasing_of_a_flat_picture(bench: Bench) -> None:
    """The way from the mean to the history, divided by the room in the box: 0 / 0 where all pixels are equal."""
    with np.errstate(invalid="ignore"):
        assert np.isnan(np.float32(0) / np.float32(0))
    for value in (0.0, 0.5, 1.0, 65000.0):
        bench.restart()
        shown = {"frame.color": np.full((SIZE[1], SIZE[0], 4), value, np.float32)}
        for _ in range(3):
            out = bench.run(frame(SIZE), anti_aliasing(), extra=shown)["color"][..., :3]
        np.testing.assert_allclose(out, value, rtol=HALF, atol=1e-6)


def test_the_spline_s_negative_lobes(bench: Bench) -> None:
    """Beside an edge Catmull-Rom rings below black, which the square root of an encoder would not survive."""
    f = 0.5
    weights = [-0.5 * f + f**2 - 0.5 * f**3, 1 - 2.5 * f**2 + 1.5 * f**3, 0.5 * f + 2 * f**2 - 1.5 * f**3]
    weights.append(-0.5 * f**2 + 0.5 * f**3)
    edge = np.where(X < 16, 0.0, 100.0)
    ringing = sum(w * edge[13 + k] for k, w in enumerate(weights))
    assert ringing < -5.0
    shown = {"frame.color": np.repeat(columns(SIZE, edge).astype(np.float32)[..., None], 4, axis=2)}
    for clip in (True, False):
        bench.restart()
        for shift in (0.0, 0.5, 0.5, -0.5):
            packet = frame(SIZE, shift=(shift, 0.0))
            out = bench.run(packet, anti_aliasing(Taa(clip=clip, alpha=0.01)), extra=shown)["color"]
            assert (out >= 0).all()


def test_the_spline_s_overshoot_at_the_end_of_half_precision(bench: Bench) -> None:
    edge = columns(SIZE, np.where(X < 16, 0.0, 65000.0)).astype(np.float32)
    shown = {"frame.color": np.repeat(edge[..., None], 4, axis=2)}
    with np.errstate(over="ignore"):
        assert np.isinf(np.float32(65000.0 * (1 + 1 / 16)).astype(np.float16))
    for shift in (0.0, 0.5, 0.5, -0.5):
        out = bench.run(frame(SIZE, shift=(shift, 0.0)), anti_aliasing(Taa(clip=False, alpha=0.01)), extra=shown)[
            "color"
        ]
        assert out[..., :3].max() <= 65000.0


def test_negative_light_on_its_way_to_the_screen(bench: Bench) -> None:
    with np.errstate(invalid="ignore"):
        assert np.isnan(np.float32(-0.01) ** np.float32(1 / 2.4))
    g = Graph()
    g.output("bytes", g.add(Encode(), in_color=g.import_("frame.emission", "rgba32f")).out_color)
    np.testing.assert_array_equal(bench.run(frame(SIZE, emission=-0.01), g)["bytes"][..., :3], 0.0)
    for tonemap in ("none", "reinhard", "aces"):
        config = Config(display=Display(tonemap=tonemap))
        shown = bench.denoise(frame(SIZE, emission=-1.0), config, "none")["display"]  # Reinhard: -1 / 0
        np.testing.assert_array_equal(shown[..., :3], 0.0)


def test_compute_passes_wait_for_each_other(bench: Bench) -> None:
    """Each reads what other work groups of the one before wrote: without separate textures and a barrier, whatever is
    there. 16 passes are a row of binomial coefficients."""
    count = 16
    size = (67, 35)
    start = np.zeros((35, 67, 1), np.float32)
    start[:, 33] = 1.0
    in_place = start[..., 0].copy()
    for _ in range(count):
        for x in range(67):  # one order in which threads may run: left to right, in the same memory
            in_place[:, x] += in_place[:, (x + 1) % 67]
    expected = np.zeros(67)
    for k in range(count + 1):
        expected[33 - k] = math.comb(count, k)
    assert np.array_equal(in_place[0], expected)  # this order happens to be right ...
    in_place = start[..., 0].copy()
    for x in reversed(range(67)):
        in_place[:, x] += in_place[:, (x + 1) % 67]
    assert in_place[0, 0] == 1.0  # ... and the reverse one runs away in a single pass
    g = Graph()
    tex = g.import_("frame.start", "r32f")
    for _ in range(count):
        tex = g.add(Increment(), in_value=tex).out_value
    g.output("result", tex)
    plan = g.compile()
    for node in plan.passes:
        places = [plan.slot_of[tex] for tex in node.reads.values() if tex in plan.slot_of]
        assert plan.slot_of[node.writes["out_value"]] not in places
    images = bench.run(frame(size), g, extra={"frame.start": start})
    assert images.result.barriers == count
    np.testing.assert_allclose(images["result"][..., 0], np.broadcast_to(expected, (35, 67)), rtol=1e-6)
