"""What SVGF and BMFR have against light that changes: gradients for BMFR, and the short history for both."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from config import Asvgf, Bmfr, Config, Svgf, Taa
from raytrace.frame import FramePacket
from tests.passes.asvgf_oracle import changing_room
from tests.passes.harness import F32, HALF, Bench, frame, noise
from tests.passes.test_asvgf import PLAIN, wall

SIZE = (55, 38)
SMALL = (30, 20)


def bmfr(**changes: Any) -> Config:
    return Config(bmfr=replace(Bmfr(), **changes), taa=PLAIN)


def svgf(**changes: Any) -> Config:
    return Config(svgf=replace(Svgf(), **changes), taa=Taa(enabled=False))


# ------------------------------------------------------------------------------------------------ BMFR with gradients


def test_where_nothing_changed_adaptive_bmfr_is_bmfr_to_the_bit(bench: Bench) -> None:
    pictures: dict[bool, list[F32]] = {False: [], True: []}
    for adaptive, radiance in pictures.items():
        bench.restart()
        for index in range(4):
            packet = changing_room(index, SIZE)
            assert packet.temporal_gradient is not None
            still = packet.temporal_gradient * np.array([0, 1, 0, 1], np.float32)
            packet = replace(packet, temporal_gradient=still)
            radiance.append(bench.denoise(packet, bmfr(adaptive=adaptive), "bmfr")["radiance"])
    np.testing.assert_array_equal(pictures[False], pictures[True])


def test_both_histories_of_bmfr_follow_the_light(bench: Bench) -> None:
    """Halved, with gain 0 so that nothing is cut: a history of 1s becomes one of halves before the sample is added."""
    names = ["bmfr.accumulate.out_color", "bmfr.accumulate_fit.out_color"]
    config = bmfr(adaptive=True, gain=0.0, part=0)
    for _ in range(12):
        bench.denoise(wall(SMALL, 0.5, (0, 0.5, 0, 0.5)), config, "bmfr")
    images = bench.denoise(wall(SMALL, 0.25, (-0.25, 0.5, -0.25, 0.5)), config, "bmfr", keep=names)
    for name in names:
        np.testing.assert_allclose(images[name][..., :3], 0.5, rtol=8 * HALF, err_msg=name)
    assert (images[names[0]][..., 3] == 13.0).all()
    plain = bench.denoise(wall(SMALL, 0.25, (0, 0.5, 0, 0.5)), config, "bmfr", keep=names)
    np.testing.assert_allclose(plain[names[1]][..., :3], 0.5, rtol=8 * HALF)


def test_both_histories_of_bmfr_are_cut(bench: Bench) -> None:
    """λ = 1/2 of a mean over 12 frames: the sample weighs as in one of h / (1 + λ (h - 1)), in the fits as well."""
    names = ["bmfr.accumulate.out_color", "bmfr.accumulate_fit.out_color", "bmfr.accumulate.out_reprojection"]
    config = bmfr(adaptive=True, gain=1.0, part=0, alpha=0.0, alpha_fit=0.0)
    config = replace(config, asvgf=replace(config.asvgf, follow=False))
    for _ in range(11):
        bench.denoise(wall(SMALL, 0.5, (0, 0.5, 0, 0.5)), config, "bmfr")
    images = bench.denoise(wall(SMALL, 0.25, (-0.25, 0.5, -0.25, 0.5)), config, "bmfr", keep=names)
    length = 12 / (1 + 0.5 * 11)
    np.testing.assert_allclose(images[names[2]][..., 3], length - 1, rtol=2 * HALF)
    color = 1.0 - 0.5 / length
    np.testing.assert_allclose(images[names[0]][..., :3], color, rtol=8 * HALF)
    np.testing.assert_allclose(images[names[1]][..., :3], 1.0 + (color - 1.0) / length, rtol=8 * HALF)


def test_light_that_is_gone_is_gone_from_bmfr(bench: Bench) -> None:
    for seed in range(6):
        bench.denoise(wall(SIZE, noise(SIZE, seed), (0, 1, 0, 1)), bmfr(adaptive=True), "bmfr")
    dark = bench.denoise(wall(SIZE, 0.0, (-1, 1, -1, 1)), bmfr(adaptive=True), "bmfr")["radiance"]
    assert not dark[..., :3].any()
    bench.restart()
    for seed in range(6):
        bench.denoise(wall(SIZE, noise(SIZE, seed), (0, 1, 0, 1)), bmfr(), "bmfr")
    assert bench.denoise(wall(SIZE, 0.0, (-1, 1, -1, 1)), bmfr(), "bmfr")["radiance"][..., :3].min() > 0.5


@pytest.mark.parametrize(
    ("denoiser", "names"),
    [
        ("asvgf", ["asvgf.direct.accumulate.out_color"]),
        ("bmfr", ["bmfr.accumulate.out_color", "bmfr.accumulate_fit.out_color"]),
    ],
)
def test_light_that_grows_beyond_half_precision_is_cut(bench: Bench, denoiser: str, names: list[str]) -> None:
    """Four times the brightest that there is: in histories as in samples the limit is below the largest half."""
    config = replace(bmfr(adaptive=True, gain=0.0), asvgf=Asvgf(gain=0.0))
    for change in ((0, 1, 0, 1), (0, 1, 0, 1), (0.75, 1, 0.75, 1)):
        images = bench.denoise(wall(SMALL, 32000.0, change), config, denoiser, keep=names)
    for name in names:
        assert 50000.0 < images[name][..., :3].max() <= 65024.0


# ------------------------------------------------------------------------------------------------- the short history


FAST, CLAMPED = "svgf.both.fast_accumulate.out_color", "svgf.both.fast_clamp.out_color"
LONG = "svgf.both.accumulate.out_color"


def run(bench: Bench, packets: list[FramePacket], **changes: Any) -> dict[str, F32]:
    """The last of ``packets`` with one signal, no wavelet and a plain mean as the long history."""
    p = svgf(separate=False, iterations=0, alpha=0.0, alpha_moments=0.0, fast_clamp=True, **changes)
    for packet in packets:
        images = bench.denoise(packet, p, keep=[FAST, CLAMPED, LONG])
    return {name: images[name] for name in (FAST, CLAMPED, LONG)}


def test_the_short_history_is_a_mean_that_becomes_exponential(bench: Bench) -> None:
    samples = [noise(SMALL, seed) for seed in range(7)]
    found = run(bench, [frame(SMALL, direct=sample) for sample in samples], fast_frames=3, fast_sigma=10.0)
    expected = samples[0].astype(np.float64)
    for index, sample in enumerate(samples[1:], start=1):
        share = 1 / min(index + 1, 3)
        expected += share * (sample - expected)
    np.testing.assert_allclose(found[FAST][..., :3], expected, rtol=8 * HALF)


@pytest.mark.parametrize("size", [SMALL, (1, 1), (1, 7), (2, 3)])
def test_the_long_history_is_brought_within_the_short_one(bench: Bench, size: tuple[int, int]) -> None:
    """5x5 pixels, fewer at the borders; what feeds the next frame is the bounded one."""
    lit = [frame(size, direct=5.0 + noise(size, seed)) for seed in range(8)]
    dim = [frame(size, direct=noise(size, seed + 50)) for seed in range(3)]
    found = run(bench, [*lit, *dim], fast_frames=2, fast_sigma=1.5)
    fast = found[FAST][..., :3].astype(np.float64)
    padded = np.pad(fast, ((2, 2), (2, 2), (0, 0)), constant_values=np.nan)
    window = np.lib.stride_tricks.sliding_window_view(padded, (5, 5), axis=(0, 1))
    mean, reach = np.nanmean(window, axis=(3, 4)), 1.5 * np.nanstd(window, axis=(3, 4))
    expected = np.clip(found[LONG][..., :3], np.maximum(mean - reach, 0.0), mean + reach)
    np.testing.assert_allclose(found[CLAMPED][..., :3], expected, rtol=1e-2, atol=1e-3)
    np.testing.assert_allclose(found[CLAMPED][..., 3], found[LONG][..., 3], rtol=HALF)
    assert (found[CLAMPED] < found[LONG]).any()


def test_a_wide_bound_changes_nothing(bench: Bench) -> None:
    packets = [frame(SMALL, direct=1.0) for _ in range(5)]
    found = run(bench, packets, fast_sigma=2.0)
    np.testing.assert_array_equal(found[CLAMPED], found[LONG])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("denoiser", ["svgf", "bmfr"])
def test_samples_that_are_no_number_leave_the_short_history_alone(bench: Bench, denoiser: str, bad: float) -> None:
    config = replace(svgf(fast_clamp=True), bmfr=Bmfr(fast_clamp=True))
    for index in range(6):
        direct = 1.0 + noise(SMALL, index)
        if index in (0, 3):
            direct[5, 6, 1] = bad
        images = bench.denoise(frame(SMALL, direct=direct), config, denoiser)
        assert np.isfinite(images["radiance"]).all()


def test_light_that_is_gone_leaves_sooner_with_the_short_history(bench: Bench) -> None:
    def left(denoiser: str, config: Config) -> float:
        bench.restart()
        for seed in range(12):
            bench.denoise(frame(SIZE, direct=1.0 + 0.1 * noise(SIZE, seed)), config, denoiser)
        for _ in range(6):
            images = bench.denoise(frame(SIZE, direct=0.0), config, denoiser)
        return float(images["radiance"][..., :3].mean())

    long = {"alpha": 0.05, "alpha_moments": 0.05}
    assert left("svgf", svgf(fast_clamp=True, fast_frames=2, **long)) < 0.2 * left("svgf", svgf(**long))
    assert left("bmfr", bmfr(fast_clamp=True, fast_frames=2)) < 0.2 * left("bmfr", bmfr())
