"""Every estimator of the variance against the same recurrence in double precision."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Config, load
from raytrace.frame import FramePacket
from tests.passes.harness import HALF, Bench, columns, frame, noise

F64 = NDArray[np.float64]

SIZE = (17, 13)
OVER_TIME = ("raw", "raw-mean", "welford", "welford-mean")
CENTRED = ("welford", "welford-mean")
ALL = (*OVER_TIME, "spatial", "spatial-temporal", "exaggerated")
ALPHA = 0.2
REC_709 = np.array([0.2126, 0.7152, 0.0722])


def config(estimator: str, *settings: str) -> Config:
    one = ("svgf.separate=false", "svgf.alpha_moments=0.2", "taa.enabled=false")
    return load(None, (f"svgf.variance={estimator}", *one, *settings))


def last_of(estimator: str) -> str:
    return "svgf.both.variance_mean.out_color" if estimator == "spatial-temporal" else "svgf.both.variance.out_color"


def run(bench: Bench, packets: Sequence[FramePacket], estimator: str, *settings: str) -> F64:
    """(H, W) variance that steers the wavelet in the last of ``packets``."""
    bench.restart()
    name = last_of(estimator)
    for packet in packets:
        images = bench.denoise(packet, config(estimator, *settings), keep=(name,))
    return np.asarray(images[name][..., 3].astype(np.float64) ** 2)


def luminances(packets: Sequence[FramePacket]) -> list[F64]:
    return [packet.direct[..., :3].astype(np.float64) @ REC_709 for packet in packets]


def over_time(estimator: str, samples: Sequence[F64]) -> F64:
    """What the estimator is in exact arithmetic, nothing moving, from the definitions of the moments."""
    n = len(samples)
    if estimator in ("raw-mean", "welford-mean"):
        weights = np.full(n, 1.0 / n)
    else:
        weights = np.zeros(n)
        for i in range(n):
            share = max(1.0 / (i + 1), ALPHA)
            weights *= 1.0 - share
            weights[i] = share
    mean = sum(w * x for w, x in zip(weights, samples, strict=True))
    variance = np.asarray(sum(w * (x - mean) ** 2 for w, x in zip(weights, samples, strict=True)))
    return variance * n / (n - 1) if estimator == "welford-mean" else variance


def window(image: F64, radius: int) -> F64:
    """Mean over the square around each pixel, as much of it as there is."""
    padded = np.pad(image, radius, constant_values=np.nan)
    side = 2 * radius + 1
    views = np.lib.stride_tricks.sliding_window_view(padded, (side, side))
    return np.asarray(np.nanmean(views, axis=(2, 3)))


def in_space(samples: F64) -> F64:
    """On a wall that faces the camera every pixel of 7x7 has the same weight."""
    return np.asarray(window(samples**2, 3) - window(samples, 3) ** 2)


def flicker(count: int) -> list[FramePacket]:
    return [frame(SIZE, direct=noise(SIZE, i)) for i in range(count)]


@pytest.mark.parametrize("estimator", OVER_TIME)
def test_over_time(bench: Bench, estimator: str) -> None:
    packets = flicker(9)
    got = run(bench, packets, estimator)
    np.testing.assert_allclose(got, over_time(estimator, luminances(packets)), rtol=4 * HALF, atol=1e-6)


@pytest.mark.parametrize("estimator", OVER_TIME)
@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_short_history_takes_the_estimate_in_space(bench: Bench, estimator: str, count: int) -> None:
    """Of the moments over time, exaggerated by 4 / h, until four frames are there."""
    packets = flicker(count)
    samples = luminances(packets)
    mean, square = np.mean(samples, axis=0), np.mean(np.square(samples), axis=0)
    expected = (window(square, 3) - window(mean, 3) ** 2) * 4 / count
    np.testing.assert_allclose(run(bench, packets, estimator), expected, rtol=4 * HALF, atol=1e-6)


def test_in_space(bench: Bench) -> None:
    """Of the last frame, whatever was before."""
    packets = flicker(6)
    np.testing.assert_allclose(run(bench, packets, "spatial"), in_space(luminances(packets)[-1]), rtol=4 * HALF)


def test_in_space_and_time(bench: Bench) -> None:
    packets = flicker(7)
    expected = np.zeros(SIZE[::-1])
    for i, samples in enumerate(luminances(packets)):
        expected += max(1.0 / (i + 1), ALPHA) * (in_space(samples) - expected)
    got = run(bench, packets, "spatial-temporal")
    np.testing.assert_allclose(got, window(expected, 1), rtol=8 * HALF)


def test_exaggerated(bench: Bench) -> None:
    assert run(bench, flicker(1), "exaggerated") == pytest.approx(100.0)
    packets = flicker(6)
    expected = 100 * over_time("raw", luminances(packets))
    np.testing.assert_allclose(run(bench, packets, "exaggerated"), expected, rtol=8 * HALF, atol=1e-4)


@pytest.mark.parametrize(("level", "sigma"), [(1000.0, 0.1), (1e4, 1.0)])
@pytest.mark.parametrize("estimator", ["welford", "welford-mean", "spatial", "spatial-temporal"])
def test_bright_and_nearly_free_of_noise(bench: Bench, estimator: str, level: float, sigma: float) -> None:
    """Where the raw moments have no correct digit left (tests/hard): within what rounding does to the samples."""
    rng = np.random.default_rng(0)
    packets = [frame(SIZE, direct=level + sigma * rng.choice([-1.0, 1.0], SIZE[::-1])) for _ in range(8)]
    samples = luminances(packets)
    if estimator == "spatial":
        expected = in_space(samples[-1])
    elif estimator == "spatial-temporal":
        expected = np.zeros(SIZE[::-1])
        for i, values in enumerate(samples):
            expected += max(1.0 / (i + 1), ALPHA) * (in_space(values) - expected)
        expected = window(expected, 1)
    else:
        expected = over_time(estimator, samples)
    np.testing.assert_allclose(run(bench, packets, estimator), expected, rtol=0.02, atol=1e-3 * sigma**2)
    raw = run(bench, packets, "raw")
    assert np.abs(raw - over_time("raw", samples)).max() > 0.3 * sigma**2, "the formula that cancels"


@pytest.mark.parametrize("estimator", CENTRED)
def test_texels_put_together_have_the_variance_between_them(bench: Bench, estimator: str) -> None:
    """Half a pixel of motion over stripes that do not flicker: each is without noise, their mixture is not."""
    stripes = columns(SIZE, np.arange(SIZE[0]) % 2)
    still = [frame(SIZE, direct=stripes)] * 6
    moved = frame(SIZE, direct=0.5, shift=(0.5, 0.0))
    settings = ("svgf.alpha=0.2",)
    got = run(bench, [*still, moved], estimator, *settings)
    n = len(still) + 1
    share = 1.0 / n if estimator == "welford-mean" else max(1.0 / n, ALPHA)
    expected = (1 - share) * 0.25 * (n / (n - 1) if estimator == "welford-mean" else 1.0)
    np.testing.assert_allclose(got[:, 1:-2], expected, rtol=4 * HALF)


@pytest.mark.parametrize("estimator", ALL)
def test_without_noise_there_is_no_variance(bench: Bench, estimator: str) -> None:
    got = run(bench, [frame(SIZE, direct=0.7)] * 5, estimator)
    assert got.max() < 1e-6


@pytest.mark.parametrize("estimator", ALL)
def test_the_colour_is_accumulated_whatever_the_estimator(bench: Bench, estimator: str) -> None:
    """Also where the variance is 0, which an alpha of the history then is."""
    bench.restart()
    for value in (1.0, 3.0):
        got = bench.denoise(frame(SIZE, direct=value), config(estimator))["radiance"]
    np.testing.assert_allclose(got[..., :3], 2.0, rtol=4 * HALF)


@pytest.mark.parametrize("estimator", ALL)
def test_what_is_not_finite_is_gone_in_the_next_frames(bench: Bench, estimator: str) -> None:
    bench.restart()
    light = np.full((*SIZE[::-1], 3), 0.5)
    light[4, 6], light[8, 2] = np.nan, np.inf
    for packet in (frame(SIZE, direct=0.5), frame(SIZE, direct=light), frame(SIZE, direct=0.5)):
        got = bench.denoise(packet, config(estimator))["radiance"]
        assert np.isfinite(got).all()
    np.testing.assert_allclose(got[..., :3], 0.5, rtol=4 * HALF)


@pytest.mark.parametrize("estimator", ["spatial", "spatial-temporal"])
def test_a_clamped_history_needs_no_moments(bench: Bench, estimator: str) -> None:
    """Light that goes out is gone at once, with any estimator."""
    bench.restart()
    settings = config(estimator, "svgf.color_clamp=true")
    for value in (1.0, 1.0, 0.1):
        got = bench.denoise(frame(SIZE, direct=value), settings)["radiance"]
    np.testing.assert_allclose(got[..., :3], 0.1, rtol=4 * HALF)


@pytest.mark.parametrize("estimator", ["raw", "welford", "spatial", "spatial-temporal"])
def test_the_prefilter_ends_with_the_short_history(bench: Bench, estimator: str) -> None:
    """It begins with means of 7x7 pixels; from the fourth frame on every pixel has its own."""
    bench.restart()
    settings = config(estimator, "svgf.prefilter=true", "svgf.iterations=0", "svgf.feedback_level=-1")
    stripes = columns(SIZE, np.arange(SIZE[0]) % 2)
    got = [bench.denoise(frame(SIZE, direct=stripes), settings)["radiance"][..., 0] for _ in range(4)]
    np.testing.assert_allclose(got[2], window(stripes, 3), rtol=4 * HALF)
    np.testing.assert_allclose(got[3], stripes, rtol=4 * HALF)


def test_raw_and_centred_moments_have_histories_of_their_own(bench: Bench) -> None:
    """A change of the estimator begins the moments anew: those of the other mean something else."""
    packets = flicker(6)
    bench.restart()
    for packet in packets[:5]:
        bench.denoise(packet, config("raw"))
    images = bench.denoise(packets[5], config("welford"))
    assert {name: reason for name, reason in images.histories.items() if name.endswith("centred")} == {
        "svgf.both.both.centred": "first use"
    }
