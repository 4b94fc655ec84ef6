"""Automatic exposure: what it measures, what it leaves out, how it follows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Config, Display
from gl.pipelines import FrameTraits, build
from images import to_srgb8
from raytrace.frame import FramePacket
from tests.passes.harness import SIZES, Bench, Images, Size, frame

EXPOSURE = "exposure.adapt.out_exposure"
SIZE = (37, 70)  # more than one tile, and no whole number of them
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def show(bench: Bench, packet: FramePacket, reset: str = "", split: bool = False, **display: object) -> Images:
    config = Config(display=replace(Display(auto_exposure=True, tonemap="none"), **display))  # type: ignore[arg-type]
    return bench.run(packet, build(config, "none", FrameTraits(), split), [EXPOSURE], reset)


def picture(size: Size, seed: int = 0) -> NDArray[np.float64]:
    """Radiance over eight orders of magnitude."""
    return 2.0 ** np.random.default_rng(seed).uniform(-13.0, 13.0, (size[1], size[0], 3))


def measured(radiance: NDArray[np.float64]) -> float:
    """Reinhard et al. 2002, eq. 1 and 2, in EV."""
    return float(np.log2(0.18) - np.log2(radiance @ LUMINANCE).mean())


@pytest.mark.parametrize("size", [SIZE, *SIZES])
def test_the_log_average_of_the_luminance_becomes_middle_grey(bench: Bench, size: Size) -> None:
    radiance = picture(size)
    (value,) = show(bench, frame(size, emission=radiance))[EXPOSURE].ravel()
    np.testing.assert_allclose(value, measured(radiance), atol=1e-4)


@pytest.mark.parametrize("level", [1e-3, 1.0, 60000.0])
@pytest.mark.parametrize("exposure", [0.0, 1.0])
def test_a_grey_wall_is_middle_grey_and_the_exposure_comes_on_top(bench: Bench, level: float, exposure: float) -> None:
    shown = show(bench, frame(SIZE, emission=level), exposure=exposure)["display"][..., :3]
    grey = to_srgb8(np.full((1, 1, 3), 0.18 * 2.0**exposure))[0, 0, 0]
    assert np.abs(np.rint(shown * 255) - grey).max() <= 1


@pytest.mark.parametrize("value", [0.0, -3.0, 1e-9, np.nan, np.inf, -np.inf])
def test_black_and_what_is_no_radiance_are_left_out(bench: Bench, value: float) -> None:
    radiance = picture(SIZE)
    rest = np.random.default_rng(1).random(SIZE[::-1]) < 0.5
    mixed = np.where(rest[..., None], value, radiance)
    (found,) = show(bench, frame(SIZE, emission=mixed))[EXPOSURE].ravel()
    np.testing.assert_allclose(found, measured(radiance[~rest]), atol=1e-4)


def test_unbounded_light_counts_as_the_brightest_that_can_be_shown(bench: Bench) -> None:
    (found,) = show(bench, frame(SIZE, emission=3e38))[EXPOSURE].ravel()
    np.testing.assert_allclose(found, np.log2(0.18 / 65000.0), atol=1e-4)


def test_a_dark_room_stays_dark(bench: Bench) -> None:
    (found,) = show(bench, frame(SIZE, emission=2.0**-15))[EXPOSURE].ravel()
    assert found == 10.0  # not the 12.5 that would make it grey


def test_a_black_frame_says_nothing(bench: Bench) -> None:
    assert show(bench, frame(SIZE))[EXPOSURE] == 0.0
    bright = show(bench, frame(SIZE, emission=8.0), reset="cut")[EXPOSURE]
    assert show(bench, frame(SIZE))[EXPOSURE] == bright
    assert show(bench, frame(SIZE), reset="cut")[EXPOSURE] == 0.0


@pytest.mark.parametrize("adaptation", [0.1, 0.5, 1.0])
def test_it_follows_a_change_and_jumps_at_a_cut(bench: Bench, adaptation: float) -> None:
    dark, bright = frame(SIZE, emission=0.5), frame(SIZE, emission=8.0)
    start, end = np.log2(0.18 / 0.5), np.log2(0.18 / 8.0)
    for _ in range(3):
        (value,) = show(bench, dark, adaptation=adaptation)[EXPOSURE].ravel()
        np.testing.assert_allclose(value, start, atol=1e-5)
    for count in range(1, 5):
        (value,) = show(bench, bright, adaptation=adaptation)[EXPOSURE].ravel()
        np.testing.assert_allclose(value, end + (start - end) * (1.0 - adaptation) ** count, atol=1e-4)
    (value,) = show(bench, dark, adaptation=adaptation, reset="cut")[EXPOSURE].ravel()
    np.testing.assert_allclose(value, start, atol=1e-5)


def test_another_size_of_the_frame_begins_anew_though_the_texture_has_one_texel(bench: Bench) -> None:
    assert show(bench, frame(SIZE, emission=1.0))[EXPOSURE].shape == (1, 1, 1)
    resized = show(bench, frame((20, 20), emission=64.0))
    assert resized.histories == {"exposure": "resized"}
    np.testing.assert_allclose(resized[EXPOSURE], np.log2(0.18 / 64.0), atol=1e-5)


def test_both_halves_of_a_split_view_have_one_exposure(bench: Bench) -> None:
    """That of the filtered picture: its light is steady, while that of the samples is mostly black."""
    samples = np.where(np.random.default_rng(2).random(SIZE[::-1]) < 0.05, 20.0, 0.0)
    packet = frame(SIZE, direct=samples, emission=0.01)
    config = Config(display=Display(auto_exposure=True, tonemap="none"))
    images = bench.run(packet, build(config, "svgf", FrameTraits(), split=True), [EXPOSURE])
    (exposure,) = images[EXPOSURE].ravel()
    shown = np.rint(images["noisy"][..., :3] * 255).astype(int)
    expected = to_srgb8(packet.radiance().astype(np.float64) * 2.0**exposure)
    assert np.abs(shown - expected).max() <= 1
    assert abs(exposure - measured(packet.radiance().astype(np.float64))) > 0.5
