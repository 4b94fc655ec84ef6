"""The clamp of the history's colour to this frame's colours around the pixel. Salvi 2016."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Config, Svgf, Taa
from tests.passes.harness import HALF, SIZES, Bench, Size, accumulation, frame, noise

SIZE = (31, 33)


def clamped(sigma: float = 1.0, **changes: float) -> Config:
    p = Svgf(color_clamp=True, color_clamp_sigma=sigma, separate=False, **changes)  # type: ignore[arg-type]
    return Config(svgf=p, taa=Taa(enabled=False))


def accumulated(bench: Bench, config: Config, frames: list[NDArray[np.float64]]) -> NDArray[np.float32]:
    """Radiance (H, W, 3) of the last of ``frames``, direct light (H, W) or (H, W, 3), accumulated in time alone."""
    bench.restart()
    for light in frames:
        images = bench.denoise(frame((light.shape[1], light.shape[0]), direct=light), config, "accumulate")
    return images["radiance"][..., :3]


def bounds(light: NDArray[np.float64], y: int, x: int) -> tuple[float, float]:
    """Mean and standard deviation of the 7x7 pixels around, those of the image."""
    window = light[max(y - 3, 0) : y + 4, max(x - 3, 0) : x + 4]
    return float(window.mean()), float(window.std())


@pytest.mark.parametrize("sigma", [0.0, 1.0, 2.5])
@pytest.mark.parametrize("ghost", [0.0, 40.0])
def test_a_ghost_is_brought_to_the_edge_of_what_is_seen(bench: Bench, ghost: float, sigma: float) -> None:
    """Light that changes from one frame to the next; at a share of 0 all that is shown comes from the history."""
    light = noise(SIZE, 1)[..., 0].astype(np.float64)
    before = [np.full_like(light, ghost)] * 12
    shown = accumulated(bench, clamped(sigma, alpha=0.0), [*before, light])[..., 0]
    for y, x in ((16, 15), (0, 0), (32, 30), (1, 29), (16, 0)):
        mean, deviation = bounds(light, y, x)
        edge = max(mean - sigma * deviation, 0.0) if ghost == 0.0 else mean + sigma * deviation
        # Of 13 frames: 12 parts of the history, one of this frame.
        assert shown[y, x] == pytest.approx((12 * edge + light[y, x]) / 13, rel=2 * HALF, abs=1e-6)


def test_without_the_clamp_the_ghost_stays(bench: Bench) -> None:
    light = noise(SIZE, 1)[..., 0].astype(np.float64)
    plain = Config(svgf=Svgf(separate=False))
    ghost = accumulated(bench, plain, [np.full_like(light, 40.0)] * 12 + [light] * 3)
    assert ghost.mean() > 15.0
    assert accumulated(bench, clamped(), [np.full_like(light, 40.0)] * 12 + [light] * 3).mean() < 3.0


def test_a_history_inside_the_bounds_is_used_as_it_is(bench: Bench) -> None:
    frames = [noise(SIZE, index)[..., 0].astype(np.float64) for index in range(8)]
    wide = accumulated(bench, clamped(10.0), frames)
    plain = accumulated(bench, Config(svgf=Svgf(separate=False)), frames)
    np.testing.assert_array_equal(wide, plain)


def test_channels_are_clamped_apart(bench: Bench) -> None:
    """And the variance of a constant, which may round below 0, is no reason not to clamp."""
    for level in (0.1, 0.7, 1.0, 1.1, 1.7, 3.3):
        grey = np.full((*SIZE[::-1], 3), level)
        red = grey * (9.0, 1.0, 1.0)
        shown = accumulated(bench, clamped(alpha=0.0), [red] * 4 + [grey])
        np.testing.assert_allclose(shown, level, rtol=1e-3)


@pytest.mark.parametrize("size", SIZES)
def test_a_constant_stays_constant(bench: Bench, size: Size) -> None:
    light = np.broadcast_to((1.5, 0.7, 0.1), (size[1], size[0], 3)).astype(np.float64)
    shown = accumulated(bench, clamped(), [light] * 5)
    np.testing.assert_allclose(shown, light, rtol=2 * HALF)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_samples_that_are_no_radiance_bound_nothing(bench: Bench, value: float) -> None:
    """A missing sample counts in no mean; where there is none at all the history stays."""
    light = noise(SIZE, 2)[..., 0].astype(np.float64)
    bad = light.copy()
    bad[16, 15] = value
    before = [np.full_like(light, 0.5)] * 3
    shown = accumulated(bench, clamped(), [*before, bad])
    assert np.isfinite(shown).all()
    if np.isfinite(value):  # counts as what half precision can hold, and widens the bounds
        plain = accumulated(bench, Config(svgf=Svgf(separate=False)), [*before, bad])
        np.testing.assert_array_equal(shown[13:20, 12:19], plain[13:20, 12:19])
    else:
        window = np.delete(bad[13:20, 12:19].ravel(), 24)
        expected = np.clip(0.5, window.mean() - window.std(), window.mean() + window.std())
        assert shown[16, 15, 0] == pytest.approx(expected, rel=2 * HALF)
        nothing = accumulated(bench, clamped(), [*before, np.full_like(light, value)])
        np.testing.assert_allclose(nothing, 0.5, rtol=HALF)


def test_moments_keep_what_they_have_seen(bench: Bench) -> None:
    """Where light changes, the variance is to be high, so that the filter in space takes over."""
    keep = ["svgf.both.accumulate.out_moments", "svgf.both.accumulate.out_color"]
    for light in (20.0, 20.0, 20.0, 20.0, 20.0, 1.0):
        images = bench.denoise(frame(SIZE, direct=light), clamped(), keep=keep)
    np.testing.assert_allclose(images[keep[0]][..., 0], 0.2 * 1.0 + 0.8 * 20.0, rtol=1e-5)
    np.testing.assert_allclose(images[keep[1]][..., 0], 1.0, rtol=HALF)
    np.testing.assert_allclose(images[keep[1]][..., 3], 0.4 * 19.0, rtol=1e-3)


def test_off_it_is_no_part_of_the_program() -> None:
    plan = accumulation(Svgf(color_clamp_sigma=3.0)).compile()
    assert not [node.name for node in plan.passes if "neighbourhood" in node.name]
    assert [node.work.defines for node in plan.passes if node.name == "accumulate"] == [{"HALF": "0"}]
