"""Numerical hazards of filters like these. Each test writes the unguarded formula out in NumPy, shows that it fails on
the test's input, and that ours does not. NaN and infinity have a file of their own, test_not_finite.py; what the tracer
has to guard is in test_traced.py.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Svgf
from tests.passes.harness import (
    HALF,
    PIXEL_SIZE,
    Bench,
    accumulation,
    atrous,
    columns,
    frame,
    noise,
    signal,
    variance,
)

F32 = NDArray[np.float32]

SIZE = (33, 21)
UNGUIDED = Svgf(variance_guided=False)


X = np.arange(SIZE[0])

# ------------------------------------------------------------------------------------------------- range of the numbers


def test_the_variance_of_what_is_bright_and_nearly_constant(bench: Bench) -> None:
    """E[x²] - E[x]² cancels: at 10 000 ± 0.1 the two differ by rounding alone, often by less than nothing."""
    rng = np.random.default_rng(3)
    samples = [np.float32(10000.0) + rng.normal(0, 0.1, SIZE[::-1]).astype(np.float32) for _ in range(8)]
    first, second = samples[0], samples[0] ** 2
    for count, sample in enumerate(samples[1:], 1):
        weight = np.float32(max(1 / (count + 1), 0.2))
        first = first + (sample - first) * weight
        second = second + (sample**2 - second) * weight
    with np.errstate(invalid="ignore"):
        unguarded = np.sqrt(second - first**2)
    assert np.isnan(unguarded).mean() > 0.1
    for sample in samples:
        images = bench.run(frame(SIZE, direct=sample), accumulation())
    deviation = images["color"][..., 3]
    assert np.isfinite(deviation).all()
    assert (deviation >= 0).all()
    assert deviation.max() < 10.0  # a thousandth of the brightness: no edge is seen where there is none
    # The estimate in space subtracts the same way.
    spatial = bench.run(frame(SIZE), variance(), extra=signal(SIZE, 10000.0 / 3.0))["color"][..., 3]
    assert (spatial >= 0).all()
    assert (spatial < 2e-3 * 10000 / 3).all()


def test_a_second_moment_beyond_half_precision(bench: Bench) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = np.float16(290.0), np.float16(310.0)
        second = np.float16(0.5) * (low * low + high * high)
        assert np.isinf(second)
        assert np.isinf(second - np.float16(300.0) ** 2) or np.isnan(second - np.float16(300.0) ** 2)
    p = Svgf(alpha=0.0, alpha_moments=0.0)
    for value in (290.0, 310.0) * 3:
        images = bench.run(frame(SIZE, direct=value), accumulation(p, fmt="rgba16f"))
    np.testing.assert_allclose(images["moments"], np.broadcast_to((300.0, 90100.0), (21, 33, 2)), rtol=1e-6)
    np.testing.assert_allclose(images["color"][..., 3], 10.0, rtol=1e-2)


@pytest.mark.parametrize("radiance", [1e5, 1e19, 3e38])
def test_radiance_beyond_half_precision(bench: Bench, radiance: float) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        stored = np.float32(radiance).astype(np.float16)
        assert np.isnan(stored - stored)  # the first difference of two such neighbours
    spots = np.zeros((SIZE[1], SIZE[0]))
    spots[::4, ::3] = radiance
    for index in range(5):
        images = bench.denoise(frame(SIZE, direct=np.roll(spots, index, 1), indirect=spots))
        out = images["radiance"][..., :3]
        assert np.isfinite(out).all()
        assert (out >= 0).all()
        assert out.max() <= 2 * 65000.0
    assert out.mean() > 1000.0  # clamped, not thrown away


def test_a_variance_beyond_half_precision(bench: Bench) -> None:
    """Radiance from 0 to 65000 has a variance of 10^9, with the exaggeration of a short history 4·10^9."""
    with np.errstate(over="ignore"):
        assert np.isinf(np.float32(65000.0**2 / 4).astype(np.float16))
    board = np.where((X + np.arange(SIZE[1])[:, None]) % 2 == 0, 0.0, 65000.0)
    deviation = bench.run(frame(SIZE), variance(), extra=signal(SIZE, board))["color"][..., 3]
    np.testing.assert_allclose(deviation[3:-3, 3:-3], 65000.0, rtol=2e-3)
    for _ in range(3):
        out = bench.denoise(frame(SIZE, direct=board))["radiance"][..., 0]
    np.testing.assert_allclose(out, 32500.0, rtol=0.2)


def test_rounding_to_half_precision_has_no_direction(bench: Bench) -> None:
    """Renderers may cut off what a half cannot hold, and a recursive filter would lose that in every frame."""
    samples = [noise(SIZE, seed) for seed in range(60)]
    cut = samples[0].astype(np.float64)
    for count, sample in enumerate(samples[1:], 1):
        mean = cut + (sample - cut) / (count + 1)
        nearest = mean.astype(np.float16)
        cut = np.where(nearest > mean, np.nextafter(nearest, np.float16(0)), nearest).astype(np.float64)
    exact = np.mean(samples, axis=0, dtype=np.float64)
    assert (cut / exact).mean() < 1 - 15 * HALF
    p = Svgf(alpha=0.0)
    for sample in samples:
        images = bench.run(frame(SIZE, direct=sample), accumulation(p, fmt="rgba16f"))
    assert (images["color"][..., :3] / exact).mean() == pytest.approx(1.0, abs=HALF / 2)
    # The same in the dark, where halves are denormal.
    bench.restart()
    for sample in samples:
        images = bench.run(frame(SIZE, direct=sample * 1e-5), accumulation(p, fmt="rgba16f"))
    assert images["color"][..., :3].mean(dtype=np.float64) == pytest.approx(1e-5 * exact.mean(), rel=0.01)


# ------------------------------------------------------------------------------------------------------ depth and slope


def test_no_slope_at_all(bench: Bench) -> None:
    """A wall that faces the camera: its gradient is 0, and its depths differ by their last bit."""
    depth = np.float32(4.0) + np.where((X + np.arange(SIZE[1])[:, None]) % 2 == 0, 0, np.float32(2**-21))
    dz = float(np.abs(np.diff(depth.astype(np.float64))).max())
    assert np.exp(-dz / (1.0 * 0.0 + 1e-8)) < 1e-20  # every second pixel is cut out
    level = noise(SIZE, 1)[..., 0]
    packet = frame(SIZE, depth=depth)
    rough = bench.run(packet, atrous(UNGUIDED, (1, 2, 4)), extra=signal(SIZE, level))["color"]
    smooth = bench.run(frame(SIZE), atrous(UNGUIDED, (1, 2, 4)), extra=signal(SIZE, level))["color"]
    np.testing.assert_allclose(rough, smooth, rtol=5e-3)
    # As good as an exact plane also for what is estimated in space and for what is found in the last frame.
    np.testing.assert_allclose(
        bench.run(packet, variance(), extra=signal(SIZE, level))["color"],
        bench.run(frame(SIZE), variance(), extra=signal(SIZE, level))["color"],
        rtol=5e-3,
    )
    for _ in range(2):
        images = bench.run(packet, accumulation())
    assert (images["reprojection"][..., 3] == 1).all()


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_the_scale_of_the_scene_does_not_matter(bench: Bench, scale: float) -> None:
    """An additive constant in the denominator of the depth weight would be a length: right in one unit only."""
    steps = np.where(X < 16, 4.0, 4.4) * scale
    step = 0.4 * scale
    constant = np.exp(-step / 0.01)
    assert (constant > 0.9) == (scale == 1e-4)  # two surfaces become one
    level = columns(SIZE, np.where(X < 16, 1.0, 3.0))
    out = bench.run(frame(SIZE, depth=columns(SIZE, steps)), atrous(UNGUIDED, (1, 2)), extra=signal(SIZE, level))[
        "color"
    ]
    np.testing.assert_allclose(out[..., 0], level, rtol=2 * HALF)


@pytest.mark.parametrize("slope", [1e3, 1e18, 1e25, 3e38])
def test_a_surface_seen_edge_on(bench: Bench, slope: float) -> None:
    """The cosine to the view ray goes to 0, in single precision to exactly 0: a history shortened by the ratio of two
    such cosines is 0 / 0."""
    with np.errstate(all="ignore"):
        cosine = np.float32(1) / np.sqrt(np.float32(1) + np.float32(slope / (PIXEL_SIZE * 4)) ** 2)
        assert cosine < 1e-4
        assert np.isnan(cosine / cosine) == (slope > 1e20)
    packet = frame(SIZE, direct=2.0, gradient=(slope, -slope))
    for count in range(4):
        images = bench.run(packet, accumulation())
        assert (images["reprojection"][..., 3] == count).all()
        np.testing.assert_allclose(images["color"][..., :3], 2.0)
    level = noise(SIZE, 1)[..., 0]
    out = bench.run(packet, atrous(UNGUIDED), extra=signal(SIZE, level))["color"]
    assert np.isfinite(out).all()
    out = bench.run(packet, variance(), extra=signal(SIZE, level))["color"]
    assert np.isfinite(out).all()


def test_a_camera_that_moves_forwards(bench: Bench) -> None:
    """10 % nearer in one frame: the depth now is not the depth then."""
    before, now = 4.0, 3.6
    assert abs(now - before) > Svgf().depth_tolerance * now  # the unguarded test: rejected everywhere
    for depth in (before, before):
        bench.run(frame(SIZE, depth=depth), accumulation())
    images = bench.run(frame(SIZE, depth=now, previous_depth=before), accumulation())
    assert (images["reprojection"][..., 3] == 2).all()
    # And the depth kept for the next frame is the new one.
    images = bench.run(frame(SIZE, depth=now, previous_depth=now), accumulation())
    assert (images["reprojection"][..., 3] == 3).all()
