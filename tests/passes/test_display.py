"""From illumination to bytes: combine, modulate, exposure and tone curve, sRGB."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Config, Display, Svgf, Taa
from gl.graph import Graph
from gl.passes.display import Combine, Encode, Modulate
from gl.pipelines import FrameTraits, build
from images import to_srgb8
from tests.passes.harness import HALF, SIZES, Bench, Size, frame

SIZE = (18, 12)
CURVES = {
    "none": lambda c: c,
    "reinhard": lambda c: c / (1 + c),
    "aces": lambda c: np.clip(c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14), 0, 1),
}


def picture(size: Size, seed: int, scale: float = 1.0) -> NDArray[np.float64]:
    return np.random.default_rng(seed).random((size[1], size[0], 3)) * scale


@pytest.mark.parametrize("size", SIZES)
def test_the_noisy_frame_is_the_packet_s_radiance(bench: Bench, size: Size) -> None:
    packet = frame(size, direct=picture(size, 1, 4), indirect=picture(size, 2), albedo=picture(size, 3),
                   emission=picture(size, 4, 20))  # fmt: skip
    images = bench.denoise(packet, denoiser="none")
    np.testing.assert_allclose(images["radiance"][..., :3], packet.radiance(), rtol=3e-7)


@pytest.mark.parametrize("tonemap", ["none", "reinhard", "aces"])
@pytest.mark.parametrize("exposure", [0.0, -1.5, 3.0])
def test_display_is_exposure_tone_curve_and_srgb(bench: Bench, tonemap: str, exposure: float) -> None:
    packet = frame(SIZE, emission=picture(SIZE, 1, 2.0))
    images = bench.denoise(packet, Config(display=Display(exposure=exposure, tonemap=tonemap)), "none")
    expected = to_srgb8(CURVES[tonemap](packet.radiance().astype(np.float64) * 2.0**exposure))
    shown = np.rint(images["display"][..., :3] * 255).astype(int)
    assert np.abs(shown - expected).max() <= 1  # half precision in between
    assert (shown != expected).mean() < 0.1
    assert (images["display"][..., 3] == 1.0).all()


def test_black_is_black_and_white_is_white(bench: Bench) -> None:
    display = Config(display=Display(tonemap="none"))
    for level, byte in ((0.0, 0), (1.0, 255), (3.0, 255)):
        shown = bench.denoise(frame(SIZE, emission=level), display, "none")["display"]
        np.testing.assert_array_equal(np.rint(shown[..., :3] * 255), byte)


@pytest.mark.parametrize("tonemap", ["none", "reinhard", "aces"])
@pytest.mark.parametrize("radiance", [1e6, 1e20, 3e38])
def test_as_bright_as_can_be_is_white(bench: Bench, tonemap: str, radiance: float) -> None:
    """Also where exposure or the curve's polynomials leave the range of single precision."""
    config = Config(display=Display(exposure=20.0, tonemap=tonemap))
    shown = bench.denoise(frame(SIZE, emission=radiance), config, "none")["display"]
    np.testing.assert_array_equal(shown, 1.0)


@pytest.mark.parametrize("tonemap", ["none", "reinhard", "aces"])
@pytest.mark.parametrize("exposure", [-20.0, 0.0, 20.0])
@pytest.mark.parametrize("radiance", [-1e-3, -1.0, -3e38, np.nan, np.inf, -np.inf])
def test_what_is_no_radiance_is_black(bench: Bench, tonemap: str, exposure: float, radiance: float) -> None:
    """Reinhard's curve has its pole at -1, and both of ACES's polynomials have zeros below 0."""
    config = Config(display=Display(exposure=exposure, tonemap=tonemap))
    shown = bench.denoise(frame(SIZE, emission=radiance), config, "none")["display"]
    np.testing.assert_array_equal(shown[..., :3], 0.0)


@pytest.mark.parametrize("tonemap", ["none", "reinhard", "aces"])
def test_the_curves_never_fall(bench: Bench, tonemap: str) -> None:
    levels = np.concatenate([[0.0], np.geomspace(1e-30, 3e38, 18 * 12 - 1)]).reshape(12, 18)
    config = Config(display=Display(tonemap=tonemap))
    shown = bench.denoise(frame(SIZE, emission=levels), config, "none")["display"][..., 0].ravel()
    assert (np.diff(shown) >= 0.0).all()
    assert (shown[0], shown[-1]) == (0.0, 1.0)


@pytest.mark.parametrize("denoiser", ["none", "svgf", "reference"])
def test_the_other_half_of_a_split_view_is_the_frame_as_it_came(bench: Bench, denoiser: str) -> None:
    packet = frame(SIZE, direct=picture(SIZE, 1, 4), indirect=picture(SIZE, 2), albedo=picture(SIZE, 3), emission=0.1)
    config = Config(display=Display(exposure=-1.0, tonemap="reinhard"))
    extra = {"frame.reference": np.full((12, 18, 4), 0.5, np.float32)}
    whole = bench.run(packet, build(config, "none", FrameTraits()))["display"]
    images = bench.run(packet, build(config, denoiser, FrameTraits(), split=True), extra=extra)
    np.testing.assert_array_equal(images["noisy"], whole)
    assert np.array_equal(images["display"], whole) == (denoiser == "none")


@pytest.mark.parametrize("separate", [True, False])
@pytest.mark.parametrize("demodulate", [True, False])
def test_light_without_noise_comes_back_as_it_was(bench: Bench, separate: bool, demodulate: bool) -> None:
    """Albedo and emission differ from pixel to pixel, illumination does not: demodulation keeps all detail."""
    packet = frame(SIZE, direct=(3.0, 2.0, 1.0), indirect=0.5, albedo=picture(SIZE, 3), emission=picture(SIZE, 4, 20))
    config = Config(svgf=Svgf(separate=separate, demodulate=demodulate), taa=Taa(enabled=False))
    for _ in range(3):
        radiance = bench.denoise(packet, config)["radiance"][..., :3]
    if demodulate:
        np.testing.assert_allclose(radiance, packet.radiance(), rtol=2 * HALF)
    else:
        detail = packet.radiance() - packet.emission[..., :3]
        filtered = radiance - packet.emission[..., :3]
        assert filtered.std() < 0.8 * detail.std()  # then the pattern of the surface counts as noise


def test_the_reference_is_shown_as_it_is(bench: Bench) -> None:
    reference = np.concatenate([picture(SIZE, 7, 3.0), np.ones((12, 18, 1))], 2).astype(np.float32)
    g = build(Config(), "reference", FrameTraits())
    images = bench.run(frame(SIZE), g, extra={"frame.reference": reference})
    np.testing.assert_array_equal(images["radiance"], reference)


def test_every_combination_of_optional_inputs(bench: Bench) -> None:
    direct, indirect, albedo, emission = (picture(SIZE, seed) for seed in range(4))
    packet = frame(SIZE, direct=direct, indirect=indirect, albedo=albedo, emission=emission)
    for second in (False, True):
        for modulated in (False, True):
            g = Graph()
            inputs = {"in_direct": g.import_("frame.direct", "rgba32f")}
            if second:
                inputs["in_indirect"] = g.import_("frame.indirect", "rgba32f")
            if modulated:
                inputs["in_albedo"] = g.import_("frame.albedo", "rgba32f")
            g.output("sum", g.add(Combine(), **inputs).out_color)
            light = g.import_("frame.emission", "rgba32f")
            g.output("full", g.add(Modulate(), in_emission=light, **inputs).out_radiance)
            images = bench.run(packet, g)
            expected = (direct + indirect * second) * (albedo if modulated else 1.0)
            np.testing.assert_allclose(images["sum"][..., :3], expected, rtol=1e-6)
            np.testing.assert_allclose(images["full"][..., :3], expected + emission, rtol=1e-6)


def test_encoding_agrees_with_the_writer_of_pictures(bench: Bench) -> None:
    levels = np.linspace(0.0, 1.0, 18 * 12 * 3).reshape(12, 18, 3)
    packet = frame(SIZE, emission=levels)
    g = Graph()
    g.output("bytes", g.add(Encode(), in_color=g.import_("frame.emission", "rgba32f")).out_color)
    shown = np.rint(bench.run(packet, g)["bytes"][..., :3] * 255).astype(int)
    assert np.abs(shown - to_srgb8(levels)).max() <= 1
    assert (shown != to_srgb8(levels)).mean() < 0.02
