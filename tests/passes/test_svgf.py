"""Variance estimate and à-trous wavelet: Schied et al. 2017, sec. 4.2 to 4.4; Dammertz et al. 2010."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from config import Config, Svgf, Taa
from gl.graph import Graph
from raytrace.frame import FramePacket
from tests.passes.harness import (
    HALF,
    PAPER,
    PIXEL_SIZE,
    SIZES,
    Bench,
    Size,
    atrous,
    columns,
    frame,
    noise,
    signal,
    variance,
    with_sky,
)

SPLINE = np.array([1, 4, 6, 4, 1]) / 16
OPEN = replace(PAPER, sigma_l=1000.0)
"""No luminance is too different."""

UNGUIDED = Svgf(variance_guided=False)


def run(
    bench: Bench, packet: FramePacket, graph: Graph, color: ArrayLike, sigma: ArrayLike = 0.0
) -> NDArray[np.float32]:
    return bench.run(packet, graph, extra=signal(packet.size, color, sigma))["color"]


def without_taa(**svgf: object) -> Config:
    return Config(svgf=replace(Svgf(), **svgf), taa=Taa(enabled=False))  # type: ignore[arg-type]


# ------------------------------------------------------------------------------------------------------- whole filter


@pytest.mark.parametrize("size", SIZES)
def test_a_constant_stays_constant_at_any_size(bench: Bench, size: Size) -> None:
    check_constant(bench, size, Config())


@pytest.mark.parametrize(
    "config",
    [
        without_taa(separate=False),
        without_taa(temporal=False),
        without_taa(variance_guided=False),
        without_taa(temporal=False, variance_guided=False),
        without_taa(demodulate=False),
        without_taa(iterations=0),
        without_taa(feedback_level=-1),
        without_taa(feedback_level=2, sigma_n=100),
        without_taa(iterations=8, feedback_level=7),
        without_taa(prefilter=True, color_clamp=True),
    ],
    ids=lambda c: "-".join(f"{k}={v}" for k, v in vars(c.svgf).items() if v != getattr(Svgf(), k)),
)
def test_a_constant_stays_constant_in_every_form_of_the_filter(bench: Bench, config: Config) -> None:
    check_constant(bench, (31, 33), config)


def check_constant(bench: Bench, size: Size, config: Config) -> None:
    albedo, emission = np.array([0.5, 0.25, 1.0]), 0.125
    packet = frame(size, direct=(1.5, 0.7, 0.1), indirect=0.3, albedo=albedo, emission=emission)
    for _ in range(6):
        images = bench.denoise(packet, config)
    radiance = images["radiance"][..., :3]
    expected = (np.array([1.5, 0.7, 0.1]) + 0.3) * albedo + emission
    np.testing.assert_allclose(radiance, np.broadcast_to(expected, radiance.shape), rtol=2 * HALF)
    display = images["display"][..., :3]
    assert (display == display[0, 0]).all()


@pytest.mark.parametrize("size", [(60, 44), (31, 33)])
@pytest.mark.parametrize("separate", [True, False])
def test_noise_goes_and_the_mean_stays(bench: Bench, size: Size, separate: bool) -> None:
    for index in range(6):
        packet = frame(size, direct=noise(size, index), indirect=noise(size, 100 + index))
        images = bench.denoise(packet, without_taa(separate=separate))
    radiance = images["radiance"][..., 0].astype(np.float64)
    noisy = packet.radiance()[..., 0]
    assert radiance.std() < 0.06 * noisy.std()
    # The bright tail is what the luminance weight finds most unlike the rest: it costs some of the energy.
    assert radiance.mean() == pytest.approx(2.0, rel=0.04)


@pytest.mark.parametrize(("frames", "changes"), [(3, {"normal_history": 0, "sigma_n": 128}), (20, {})])
def test_surfaces_do_not_mix(bench: Bench, frames: int, changes: dict[str, int]) -> None:
    """Two walls side by side that differ in depth only, and in normal only: never with a fixed weight of normals, and
    once the history is long where that weight grows."""
    size = (50, 30)
    left = np.broadcast_to(np.arange(50) < 24, (30, 50))
    brightness = np.where(left, 1.0, 50.0)
    tilted = np.where(left[..., None], (0.0, 0.0, 1.0), (0.6, 0.0, 0.8))
    flat = np.broadcast_to((0.0, 0.0, 1.0), tilted.shape)
    for depth, normal in ((np.where(left, 4.0, 5.0), flat), (np.full(left.shape, 4.0), tilted)):
        bench.restart()
        for index in range(frames):
            grain = 1.0 + 0.5 * np.random.default_rng(index).standard_normal(left.shape).clip(-1.5, 1.5)
            packet = frame(size, direct=brightness * grain, object_id=~left, depth=depth, normal=normal)
            images = bench.denoise(packet, without_taa(**changes))
        radiance = images["radiance"][..., 0]
        assert radiance[left & (brightness == 1.0)].max() < 2.0
        assert radiance[brightness == 50.0].min() > 25.0


@pytest.mark.parametrize(("level", "iterations"), [(-1, 5), (0, 5), (2, 5), (4, 5), (7, 5), (0, 0), (3, 2)])
def test_the_history_is_the_output_of_the_chosen_iteration(bench: Bench, level: int, iterations: int) -> None:
    config = without_taa(feedback_level=level, iterations=iterations, separate=False)
    packet = frame((26, 18), direct=noise((26, 18), 1))
    names = {
        "accumulated": "svgf.both.accumulate.out_color",
        **{f"iteration {i}": f"svgf.both.atrous{i}.out_color" for i in range(iterations)},
    }
    images = bench.denoise(packet, config, keep=names.values())
    source = {tex.name: history.name for tex, history in images.result.plan.feeds.items()}
    expected = "accumulated" if min(level, iterations - 1) < 0 else f"iteration {min(level, iterations - 1)}"
    assert source[names[expected]] == "svgf.both.both"
    fed = images[names[expected]]
    # The next sample has no weight at all: what comes out of the accumulation is what was fed.
    black = bench.denoise(frame((26, 18)), config, keep=names.values())[names["accumulated"]]
    np.testing.assert_allclose(black[..., :3], fed[..., :3] / 2, rtol=2 * HALF, atol=1e-6)


def test_separate_signals_keep_their_own_histories(bench: Bench) -> None:
    size = (26, 18)
    for index in range(4):
        images = bench.denoise(frame(size, direct=noise(size, index), indirect=3.0), without_taa(), keep=[
            "svgf.direct.accumulate.out_moments", "svgf.indirect.accumulate.out_moments"])  # fmt: skip
    indirect = images["svgf.indirect.accumulate.out_moments"]
    np.testing.assert_allclose(indirect, np.broadcast_to((3.0, 9.0), indirect.shape), rtol=1e-6)
    assert images["svgf.direct.accumulate.out_moments"][..., 0].std() > 0.1


# ------------------------------------------------------------------------------------------------- one iteration


@pytest.mark.parametrize("step", [1, 2, 4])
def test_equal_weights_leave_the_variance_their_share(bench: Bench, step: int) -> None:
    """Constant variance v: v · Σk² / (Σk)², with k the kernel; here by standard deviations. Σk = 1."""
    size = (60, 44)
    result = run(bench, frame(size), atrous(OPEN, (step,)), 1.0, sigma=3.0)
    inner = (slice(2 * step, -2 * step), slice(2 * step, -2 * step))
    kernel = np.outer(SPLINE, SPLINE)
    np.testing.assert_allclose(result[inner][..., 3], 3.0 * np.sqrt((kernel**2).sum()), rtol=2 * HALF)
    # At a corner only a quarter of the kernel is inside, and its weights are divided by what they sum up to.
    corner = kernel[2:, 2:]
    np.testing.assert_allclose(result[0, 0, 3], 3.0 * np.sqrt((corner**2).sum()) / corner.sum(), rtol=2 * HALF)


@pytest.mark.parametrize("step", [1, 2, 4, 8])
def test_the_kernel_is_the_spline(bench: Bench, step: int) -> None:
    """The picture of a single bright pixel is the kernel itself, with gaps of step - 1 pixels."""
    size = (67, 65)  # whoever has the bright pixel in its window has all of its window inside
    color = np.zeros((65, 67))
    color[32, 33] = 1.0
    result = run(bench, frame(size), atrous(UNGUIDED, (step,)), color)
    expected = np.zeros_like(color)
    for y, x in np.ndindex(5, 5):
        expected[32 + (y - 2) * step, 33 + (x - 2) * step] = SPLINE[y] * SPLINE[x]
    np.testing.assert_allclose(result[..., 0], expected, rtol=2 * HALF, atol=1e-7)


def test_five_iterations_reach_62_pixels(bench: Bench) -> None:
    size = (160, 3)
    color = np.zeros((3, 160))
    color[:, 80] = 1.0
    result = run(bench, frame(size), atrous(UNGUIDED, (1, 2, 4, 8, 16)), color)[1, :, 0]
    assert np.flatnonzero(result).tolist() == list(range(80 - 62, 80 + 63))
    spread = (result * (np.arange(160) - 80.0) ** 2).sum() / result.sum()
    assert spread == pytest.approx(1 + 4 + 16 + 64 + 256, rel=0.01)  # the spline's variance is 1 step²


def test_luminance_decides_in_units_of_the_deviation(bench: Bench) -> None:
    """Two levels l apart: weight exp(-|Δl| / (σ_l σ)) across the edge."""
    size = (34, 9)
    level = np.where(np.arange(34) < 16, 1.0, 1.5) * np.ones((9, 1))
    for deviation in (0.02, 0.1, 1.0):
        result = run(bench, frame(size), atrous(PAPER), level, sigma=deviation)
        across = np.exp(-0.5 / (4.0 * deviation + 1e-6))
        right = SPLINE[3] + SPLINE[4]  # for the last pixel on the left
        expected = 1.0 + 0.5 * right * across / (1.0 - right + right * across)
        np.testing.assert_allclose(result[4, 15, 0], expected, rtol=2 * HALF)


def test_the_first_iteration_has_a_tolerance_of_its_own(bench: Bench) -> None:
    """Between the levels of the test above: at a step of 1 that many times sigma_l, at every other step sigma_l."""
    size = (37, 9)
    p = Svgf(sigma_l=2.0, first_sigma_l=3.0)
    for step, reach in ((1, 6.0), (2, 2.0)):
        level = np.where(np.arange(37) < 16, 1.0, 1.5) * np.ones((9, 1))
        result = run(bench, frame(size), atrous(p, (step,)), level, sigma=0.1)
        across = np.exp(-0.5 / (reach * 0.1 + 1e-6))
        right = SPLINE[3] + SPLINE[4]
        expected = 1.0 + 0.5 * right * across / (1.0 - right + right * across)
        np.testing.assert_allclose(result[4, 15, 0], expected, rtol=2 * HALF)


@pytest.mark.parametrize("alpha", [0.0, 0.2, 0.5])
def test_the_variance_becomes_that_of_the_accumulated_colour(bench: Bench, alpha: float) -> None:
    """Of h samples 1 / h of one sample's variance, and of an exponential mean never less than a / (2 - a)."""
    size = (31, 33)
    name = "svgf.both.atrous0.out_color"

    def deviation(frames: int, accumulated: bool) -> NDArray[np.float32]:
        bench.restart()
        config = without_taa(separate=False, alpha=alpha, accumulated_variance=accumulated, feedback_level=-1)
        for index in range(frames):
            images = bench.denoise(frame(size, direct=noise(size, index)), config, keep=[name])
        return images[name][..., 3]

    for frames in (1, 2, 4, 6):
        share = max(1 / frames, alpha / (2 - alpha))
        np.testing.assert_allclose(deviation(frames, True), deviation(frames, False) * np.sqrt(share), rtol=2 * HALF)


def test_the_variance_that_steers_is_blurred_the_one_that_travels_is_not(bench: Bench) -> None:
    size = (33, 33)
    sigma = np.zeros((33, 33))
    sigma[16, 16] = 2.0
    level = np.ones((33, 33))
    level[16, 17] = 1.5
    result = run(bench, frame(size), atrous(PAPER), level, sigma=sigma)
    # Beside the one pixel with a deviation: 1/8 of its variance counts, sqrt(4 / 8) = 0.71.
    weights = np.outer(SPLINE, SPLINE)
    across = np.exp(-0.5 / (4.0 * np.sqrt(0.5) + 1e-6))
    at = 15, 16  # below the noisy one, diagonally below the bright one
    w = weights[3, 3] * across
    expected = 1.0 + 0.5 * w / (1.0 - weights[3, 3] + w)
    np.testing.assert_allclose(result[*at, 0], expected, rtol=2 * HALF)
    np.testing.assert_allclose(result[*at, 3], weights[3, 2] * 2.0 / (1.0 - weights[3, 3] + w), rtol=2 * HALF)


def test_normals_decide_by_a_power_of_their_cosine(bench: Bench) -> None:
    size = (34, 9)
    for degrees in (2.0, 8.0, 20.0, 80.0, 100.0, 180.0):
        turned = (np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees)))
        left = np.broadcast_to(np.arange(34) < 16, (9, 34))
        normal = np.where(left[..., None], (0.0, 0.0, 1.0), turned)
        level = np.where(left, 0.0, 1.0)
        cosine = max(np.cos(np.radians(degrees)), 0.0)
        for exponent in (1, 100, 128):  # 128 is squared into place, 100 is not
            p = replace(UNGUIDED, sigma_n=exponent)
            result = run(bench, frame(size, normal=normal), atrous(p), level)
            across = cosine**exponent if cosine > 0 else 0.0
            right = SPLINE[3] + SPLINE[4]
            expected = right * across / (1.0 - right + right * across)
            np.testing.assert_allclose(result[4, 15, 0], expected, rtol=1e-3, atol=1e-6)


def test_depth_decides_by_the_slope_of_the_surface(bench: Bench) -> None:
    """On a plane exp(-1) off the line of equal depth and 1 on it, if the floor were not: a tenth of a pixel's width."""
    size = (33, 33)
    slope = 0.5
    depth = 10.0 + slope * np.arange(33) * np.ones((33, 1))
    color = np.zeros((33, 33))
    color[16, 16] = 1.0
    p = replace(UNGUIDED, sigma_z=2.0)
    result = run(bench, frame(size, depth=depth, gradient=(slope, 0.0)), atrous(p), color)[..., 0]

    def weight(x: int, y: int, dx: int, dy: int) -> float:
        z = depth[y, x]
        floor = 0.1 * PIXEL_SIZE * z * np.hypot(dx, dy)
        return float(
            SPLINE[dx + 2] * SPLINE[dy + 2] * np.exp(-abs(slope * dx) / (2.0 * abs(slope * dx) + floor + 1e-30))
        )

    for x, y in ((15, 16), (14, 16), (16, 15), (16, 14), (15, 15), (18, 17)):
        total = sum(weight(x, y, dx, dy) for dx in range(-2, 3) for dy in range(-2, 3))
        expected = weight(x, y, 16 - x, 16 - y) / total
        np.testing.assert_allclose(result[y, x], expected, rtol=2 * HALF)


def test_the_sky_neither_gives_nor_takes(bench: Bench) -> None:
    size = (34, 18)
    sky = np.broadcast_to(np.arange(34) >= 20, (18, 34))
    packet = with_sky(frame(size), sky)
    color = np.where(sky, 7.0, 1.0)
    result = run(bench, packet, atrous(UNGUIDED, (1, 2, 4, 8, 16)), color)[..., 0]
    np.testing.assert_allclose(result, color, rtol=2 * HALF)


# ------------------------------------------------------------------------------------------------- variance in space


def spatial(bench: Bench, packet: FramePacket, color: ArrayLike) -> NDArray[np.float32]:
    return run(bench, packet, variance(), color)


def test_variance_in_space_is_that_of_the_window(bench: Bench) -> None:
    """On a wall that faces the camera all 49 weights are 1; one frame's is exaggerated fourfold."""
    size = (31, 33)
    level = noise(size, 5)[..., 0]
    result = spatial(bench, frame(size), level)
    windows = np.lib.stride_tricks.sliding_window_view(level.astype(np.float64), (7, 7))
    expected = 2.0 * windows.std(axis=(2, 3))
    np.testing.assert_allclose(result[3:-3, 3:-3, 3], expected, rtol=2 * HALF)
    np.testing.assert_array_equal(result[..., 0], level.astype(np.float16))
    assert result[0, 0, 3] == pytest.approx(2.0 * level[:4, :4].astype(np.float64).std(), rel=2 * HALF)


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (5, 2)])
def test_variance_in_windows_that_are_mostly_outside(bench: Bench, size: Size) -> None:
    level = noise(size, 5)[..., 0]
    result = spatial(bench, frame(size), level)[..., 3]
    for y, x in np.ndindex(level.shape):
        window = level[max(y - 3, 0) : y + 4, max(x - 3, 0) : x + 4].astype(np.float64)
        assert result[y, x] == pytest.approx(2.0 * window.std(), rel=1e-3, abs=1e-3)


def test_variance_in_space_sees_one_surface_only(bench: Bench) -> None:
    size = (34, 18)
    left = np.broadcast_to(np.arange(34) < 16, (18, 34))
    level = np.where(left, 1.0, 100.0)
    for packet in (
        frame(size, depth=np.where(left, 4.0, 6.0)),
        frame(size, normal=np.where(left[..., None], (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))),
        with_sky(frame(size), ~left),
    ):
        assert spatial(bench, packet, level)[left][:, 3].max() < 0.01


def test_history_shortens_the_exaggeration_and_four_frames_end_it(bench: Bench) -> None:
    size = (31, 33)
    graph = variance(temporal=True)
    level = noise(size, 5)[..., 0].astype(np.float64)
    moments = np.stack([level, level**2], -1).astype(np.float32)
    windows = np.lib.stride_tricks.sliding_window_view(level, (7, 7))
    for history in range(6):
        reprojection = np.zeros((*level.shape, 4), np.float32)
        reprojection[..., 3] = history
        extra = signal(size, level, 0.25) | {"frame.moments": moments, "frame.history": reprojection}
        result = bench.run(frame(size), graph, extra=extra)["color"][3:-3, 3:-3, 3]
        h = history + 1
        expected = windows.std(axis=(2, 3)) * np.sqrt(4 / h) if h < 4 else 0.25
        np.testing.assert_allclose(result, np.broadcast_to(expected, result.shape), rtol=2 * HALF)


def test_normals_count_the_more_the_longer_the_history(bench: Bench) -> None:
    """Ridges whose sides face 20 degrees apart, each lit in its own way: mixed at first, apart in the end."""
    size, frames = (31, 33), 12
    side = np.arange(size[0]) % 2
    normal = np.where(columns(size, side)[..., None] > 0, (0.17, 0.0, 0.985), (-0.17, 0.0, 0.985))
    packet = frame(size, direct=columns(size, side), normal=normal)

    def contrast(image: NDArray[np.float32]) -> float:
        return float(image[16, 15, 0] - image[16, 14, 0])

    def sequence(**changes: object) -> list[float]:
        bench.restart()
        p = Svgf(separate=False, variance_guided=False, feedback_level=-1, iterations=2, **changes)  # type: ignore[arg-type]
        return [contrast(bench.denoise(packet, Config(svgf=p))["radiance"]) for _ in range(frames)]

    at_once, growing = (sequence(sigma_n=128, normal_history=history) for history in (0, 8))
    np.testing.assert_allclose(at_once, 1.0, atol=0.02)
    assert growing[0] < 0.7
    assert all(now >= before - 1e-3 for before, now in pairwise(growing))
    # From the eighth frame on it is as sharp as the exponent says.
    np.testing.assert_allclose(growing[7:], at_once[7:], atol=2e-3)
