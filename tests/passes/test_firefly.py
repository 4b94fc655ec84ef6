"""Firefly rejection: what it cuts, what it leaves, what it costs. Ray Tracing Gems 2019, ch. 17 and 25."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Config, Display, Firefly, Taa
from gl.graph import Graph
from gl.passes.firefly import reject_fireflies
from gl.pipelines import DENOISERS
from raytrace.frame import FramePacket
from tests.passes.harness import SIZES, Bench, Size, frame, noise, with_sky

SIZE = (31, 33)
MODES = ("clamp", "variance")
LONE = 1.0 + 0.1 + 8.0 * np.sqrt(1e-5)
"""What the variance leaves of an outlier on a surface whose light is 1 everywhere."""


def cut(bench: Bench, samples: NDArray[np.floating], p: Firefly, exposure: float = 0.0) -> NDArray[np.float32]:
    """``samples`` (H, W, 3) after the pass."""
    g = Graph()
    g.output("color", reject_fireflies(g, "direct", g.import_("frame.direct", "rgba32f"), p, exposure))
    packet = frame((samples.shape[1], samples.shape[0]), direct=samples)
    return bench.run(packet, g)["color"][..., :3]


def expected(samples: NDArray[np.floating], p: Firefly) -> NDArray[np.float64]:
    """The bound by the variance in double precision."""
    around = np.pad(samples.astype(np.float64), ((3, 3), (3, 3), (0, 0)), constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(around, (7, 7), axis=(0, 1)).copy()
    windows[..., 3, 3] = np.nan
    mean, variance = np.nanmean(windows, axis=(3, 4)), np.nanvar(windows, axis=(3, 4))
    excess = np.maximum(0.0, samples - (p.margin + mean + p.deviations * np.sqrt(np.maximum(1e-5, variance))))
    return np.asarray(samples - excess)


def spike(value: float | tuple[float, float, float], at: tuple[int, int] = (16, 15)) -> NDArray[np.float64]:
    samples = np.ones((SIZE[1], SIZE[0], 3))
    samples[at] = value
    return samples


# --------------------------------------------------------------------------------------------------------- what is cut


@pytest.mark.parametrize("at", [(16, 15), (0, 0), (32, 30), (0, 15)])
@pytest.mark.parametrize("value", [2.0, 50.0, 6e4, 1e30])
def test_a_lone_firefly_is_capped_and_nothing_else(bench: Bench, value: float, at: tuple[int, int]) -> None:
    for p, limit in ((Firefly(mode="clamp", max_radiance=1.5), 1.5), (Firefly(mode="variance"), LONE)):
        result = cut(bench, spike(value, at), p)
        np.testing.assert_allclose(result[at], limit, rtol=1e-5)
        np.testing.assert_array_equal(np.delete(result.reshape(-1, 3), at[0] * SIZE[0] + at[1], axis=0), 1.0)


def test_two_alike_in_one_window_vouch_for_each_other(bench: Bench) -> None:
    """The mean of 48 pixels and 8 deviations are 1.16 of the one among them that is bright: so edges stay."""
    samples = np.zeros((SIZE[1], SIZE[0], 3))
    samples[16, 15] = samples[19, 18] = 50.0
    samples[16, 5] = samples[20, 5] = 50.0  # out of each other's window
    result = cut(bench, samples, Firefly(mode="variance"))
    assert (result[16, 15] == 50.0).all()
    assert (result[19, 18] == 50.0).all()
    np.testing.assert_allclose(result[16, 5], 0.1 + 8.0 * np.sqrt(1e-5), rtol=1e-5)
    np.testing.assert_allclose(result[20, 5], 0.1 + 8.0 * np.sqrt(1e-5), rtol=1e-5)


@pytest.mark.parametrize("size", [(31, 33), (5, 3), (1, 9)])
@pytest.mark.parametrize("p", [Firefly("variance"), Firefly("variance", deviations=1.5, margin=0.0)])
def test_the_bound_is_that_of_the_formula(bench: Bench, size: Size, p: Firefly) -> None:
    """On coloured noise with a long tail, at the borders as well, where the window is smaller."""
    samples = np.random.default_rng(3).lognormal(-1.0, 2.0, (size[1], size[0], 3)).astype(np.float32)
    result = cut(bench, samples, p)
    np.testing.assert_allclose(result, expected(samples, p), rtol=2e-5)
    assert (result < samples).any()
    assert (result == samples).any()


def test_each_channel_is_cut_by_itself_so_that_hue_fades(bench: Bench) -> None:
    result = cut(bench, spike((100.0, 1.0, 0.5)), Firefly(mode="variance"))[16, 15]
    np.testing.assert_allclose(result, (LONE, 1.0, 0.5), rtol=1e-5)
    result = cut(bench, spike((100.0, 20.0, 0.5)), Firefly(mode="clamp", max_radiance=10.0))[16, 15]
    np.testing.assert_array_equal(result, (10.0, 10.0, 0.5))  # orange before, yellow now


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("stops", [-6.0, 10.0])
def test_limits_follow_the_exposure(bench: Bench, mode: str, stops: float) -> None:
    """The same picture in other units of light, shown alike, loses the same."""
    samples = np.random.default_rng(4).lognormal(0.0, 1.5, (*SIZE[::-1], 3)).astype(np.float32)
    p = Firefly(mode=mode, max_radiance=3.0, deviations=2.0)
    scale = np.float32(2.0**-stops)
    bright, other = cut(bench, samples, p), cut(bench, samples * scale, p, exposure=stops)
    np.testing.assert_allclose(other, bright * scale, rtol=1e-5)
    assert (bright < samples).any()
    assert not np.allclose(other, cut(bench, samples * scale, p))


# ------------------------------------------------------------------------------------------------------ what is left


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("mode", MODES)
def test_a_constant_is_left_as_it_is(bench: Bench, size: Size, mode: str) -> None:
    samples = np.broadcast_to((1.5, 0.7, 0.0), (size[1], size[0], 3)).astype(np.float32)
    np.testing.assert_array_equal(cut(bench, samples, Firefly(mode=mode)), samples)


def test_edges_are_left_as_they_are(bench: Bench) -> None:
    """Between light and shadow, at corners, and lines a pixel wide."""
    samples = np.full((*SIZE[::-1], 3), 0.02)
    samples[:12, :9] = 5.0
    samples[20] = 3.0
    samples[:, 22] = 8.0
    np.testing.assert_array_equal(cut(bench, samples, Firefly("variance")), samples.astype(np.float32))


@pytest.mark.parametrize("mode", MODES)
def test_what_is_no_number_stays_and_counts_for_nobody(bench: Bench, mode: str) -> None:
    """So accumulation can leave it out, instead of taking in what it was bounded by."""
    samples = np.random.default_rng(5).uniform(0.5, 1.0, (*SIZE[::-1], 3)).astype(np.float32)
    samples[16, 15] = 50.0
    for value in (np.nan, np.inf, -np.inf):
        bad = samples.copy()
        bad[16, 17] = bad[16, 14, 1] = bad[0, 0] = value
        result = cut(bench, bad, Firefly(mode=mode))
        np.testing.assert_array_equal(np.isfinite(result), np.isfinite(bad))
        if mode == "variance":
            gone = np.where(np.isfinite(bad).all(axis=2, keepdims=True), bad, np.nan)
            np.testing.assert_allclose(result[16, 15], expected(gone, Firefly(mode))[16, 15], rtol=1e-5)


def test_bright_neighbours_do_not_overflow(bench: Bench) -> None:
    """Squares of what half precision cannot hold any more would: such neighbours count as the brightest it can."""
    samples = np.full((*SIZE[::-1], 3), 1e25)
    samples[16, 15] = 1e30
    result = cut(bench, samples, Firefly("variance"))
    assert np.isfinite(result).all()
    assert result.max() < 1e6


@pytest.mark.parametrize("mode", MODES)
def test_the_sky_black_surfaces_and_lamps_are_no_trouble(bench: Bench, mode: str) -> None:
    sky = np.broadcast_to(np.arange(SIZE[0]) >= 20, SIZE[::-1])
    albedo = np.where(np.arange(SIZE[1]) < 12, 0.0, 0.5)[:, None, None] * np.ones((*SIZE[::-1], 3))
    emission = np.where(sky, 1000.0, 0.0)
    emission[20:24, 5:8] = 500.0
    packet = with_sky(frame(SIZE, direct=1.0, indirect=0.5, albedo=albedo, emission=emission), sky)
    config = Config(firefly=Firefly(mode=mode), taa=Taa(enabled=False))
    plain = bench.denoise(packet, replace(config, firefly=Firefly()), "none")["radiance"]
    for denoiser in ("none", "accumulate", "svgf"):
        bench.restart()
        radiance = bench.denoise(packet, config, denoiser)["radiance"]
        np.testing.assert_allclose(radiance, plain, rtol=1e-3)


# ------------------------------------------------------------------------------------------------- inside the methods


@pytest.mark.parametrize("denoiser", [name for name in DENOISERS if name != "reference"])
@pytest.mark.parametrize("mode", MODES)
def test_every_method_sees_both_signals_without_their_fireflies(bench: Bench, denoiser: str, mode: str) -> None:
    """As if the tracer had never found them."""
    p = Firefly(mode=mode, max_radiance=4.0)
    found = frame(SIZE, direct=spike(900.0, (8, 8)), indirect=spike(900.0, (24, 20)), albedo=0.5)
    limit = {"clamp": 4.0, "variance": LONE}[mode]
    never = frame(SIZE, direct=spike(limit, (8, 8)), indirect=spike(limit, (24, 20)), albedo=0.5)

    def radiance(packet: FramePacket, p: Firefly) -> NDArray[np.float32]:
        bench.restart()
        return bench.denoise(packet, Config(firefly=p, taa=Taa(enabled=False)), denoiser)["radiance"][..., :3]

    np.testing.assert_allclose(radiance(found, p), radiance(never, Firefly()), rtol=1e-3)
    assert not np.allclose(radiance(found, Firefly()), radiance(never, Firefly()), rtol=1e-2)


def test_the_exposure_of_the_display_counts(bench: Bench) -> None:
    packet = frame(SIZE, direct=spike(900.0))
    for stops in (0.0, 3.0):
        config = Config(firefly=Firefly(mode="clamp", max_radiance=80.0), display=Display(exposure=stops))
        assert bench.denoise(packet, config, "none")["radiance"].max() == 80.0 / 2.0**stops


def test_the_light_that_is_lost_is_bounded(bench: Bench) -> None:
    """Noise of one path per pixel loses next to nothing; where one sample in 400 is a firefly, nearly all of that."""
    size = (120, 90)
    samples = noise(size, 6)
    lost = 1.0 - cut(bench, samples, Firefly("variance")).mean() / samples.mean()
    assert 0.0 <= lost < 1e-3
    fireflies = np.random.default_rng(7).random(samples.shape[:2]) < 1 / 400
    spoiled = samples + 200.0 * fireflies[..., None]
    kept = cut(bench, spoiled, Firefly("variance")).mean() / samples.mean()
    assert spoiled.mean() / samples.mean() > 1.3
    assert 1.0 <= kept < 1.1
