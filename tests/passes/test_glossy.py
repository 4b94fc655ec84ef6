"""Specular light in every denoiser: a signal of its own, over an albedo of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from config import load
from raytrace.frame import FramePacket
from tests.passes.harness import HALF, Bench, Images, frame, noise

F32 = NDArray[np.float32]

SIZE = (50, 38)
METHODS: list[tuple[str, tuple[str, ...]]] = [
    ("none", ()),
    ("accumulate", ()),
    ("svgf", ()),
    ("svgf", ("svgf.separate=false",)),
    ("svgf", ("svgf.demodulate=false",)),
    ("svgf", ("svgf.separate=false", "svgf.demodulate=false")),
    ("bmfr", ()),
    ("bmfr", ("bmfr.separate=true",)),
    ("bmfr", ("bmfr.demodulate=false",)),
    ("bmfr", ('bmfr.features="1,n,w,roughness"',)),
]
every_method = pytest.mark.parametrize(("denoiser", "settings"), METHODS, ids=[" ".join((a, *b)) for a, b in METHODS])


def glossy(packet: FramePacket, specular: ArrayLike, albedo: ArrayLike, roughness: ArrayLike = 0.3) -> FramePacket:
    """``packet`` with specular light, grey or (H, W, 3), over the albedo of the lobe."""
    height, width = packet.direct.shape[:2]

    def image(values: ArrayLike, last: ArrayLike) -> F32:
        colors = np.asarray(values, np.float32)
        colors = colors[..., None] if colors.shape in ((), (height, width)) else colors
        alpha = np.broadcast_to(np.asarray(last, np.float32), (height, width))[..., None]
        return np.concatenate([np.broadcast_to(colors, (height, width, 3)), alpha], axis=2).astype(np.float32)

    return replace(packet, specular=image(specular, 1.0), specular_albedo=image(albedo, roughness))


def denoised(bench: Bench, *packets: FramePacket, denoiser: str, settings: tuple[str, ...] = ()) -> Images:
    """Outputs of the last of ``packets``, filtered one after the other, without what the test filtered before."""
    config = load(None, settings)
    for index, packet in enumerate(packets):
        outputs = bench.denoise(packet, config, denoiser, reset="" if index else "another sequence")
    return outputs


@every_method
def test_constant_light_comes_out_as_it_went_in(bench: Bench, denoiser: str, settings: tuple[str, ...]) -> None:
    """Light · albedo of each kind, added; whatever the filter took together and divided by."""
    packet = frame(SIZE, direct=2.0, indirect=1.0, albedo=(0.5, 0.25, 0.0), emission=0.125)
    packet = glossy(packet, 8.0, (0.25, 0.5, 0.75))
    expected = 3.0 * np.array([0.5, 0.25, 0.0]) + 8.0 * np.array([0.25, 0.5, 0.75]) + 0.125
    np.testing.assert_allclose(packet.radiance(), np.broadcast_to(expected, (SIZE[1], SIZE[0], 3)), rtol=1e-6)
    radiance = denoised(bench, *[packet] * 3, denoiser=denoiser, settings=settings)["radiance"]
    np.testing.assert_allclose(radiance[..., :3], packet.radiance(), rtol=4 * HALF)


@every_method
def test_a_black_surface_stays_black(bench: Bench, denoiser: str, settings: tuple[str, ...]) -> None:
    """Nothing divides by 0: half of the wall reflects nothing at all."""
    dark = np.zeros((SIZE[1], SIZE[0], 3))
    dark[:, SIZE[0] // 2 :] = 0.5
    packet = glossy(frame(SIZE, direct=1.0, albedo=dark), 1.0, dark)
    radiance = denoised(bench, packet, packet, denoiser=denoiser, settings=settings)["radiance"][..., :3]
    assert np.isfinite(radiance).all()
    if "demodulate=false" not in "".join(settings):  # else the filter mixes both halves
        assert not radiance[:, : SIZE[0] // 2].any()


@every_method
def test_without_gloss_the_picture_is_that_of_a_diffuse_frame(
    bench: Bench, denoiser: str, settings: tuple[str, ...]
) -> None:
    """A scene with one metal: where there is none of it, nothing changes."""
    packet = frame(SIZE, direct=noise(SIZE, 1), indirect=noise(SIZE, 2), albedo=(0.5, 0.25, 0.125))
    diffuse = denoised(bench, packet, denoiser=denoiser, settings=settings)["radiance"]
    shining = denoised(bench, glossy(packet, 0.0, 0.0, 1.0), denoiser=denoiser, settings=settings)["radiance"]
    # One feature more is one random number more in every row of the fit.
    np.testing.assert_allclose(shining, diffuse, rtol=0.02 if "roughness" in "".join(settings) else 4 * HALF, atol=1e-6)


@pytest.mark.parametrize("settings", [(), ("svgf.temporal=false",)], ids=["in time", "in space"])
def test_specular_light_does_not_cross_into_another_roughness(bench: Bench, settings: tuple[str, ...]) -> None:
    """Two polished fields of one wall under equal noise, one ten times as bright; and a matte one beside them, whose
    specular signal is 0 because it has no lobe."""
    width = SIZE[0] // 3
    field = np.minimum(np.arange(SIZE[0]) // width, 2) * np.ones((SIZE[1], 1), int)
    mean = np.array([0.0, 1.0, 10.0])[field]
    roughness, albedo = np.array([1.0, 0.1, 0.9])[field], np.array([0.0, 0.5, 0.5])[field]
    packets = [glossy(frame(SIZE), noise(SIZE, k) * mean[..., None], albedo, roughness) for k in range(4)]
    loose = ("svgf.sigma_l=1000", "svgf.reach=1000000", *settings)
    kept = denoised(bench, *packets, denoiser="svgf", settings=loose)["radiance"][..., 0]
    mixed = denoised(bench, *packets, denoiser="svgf", settings=(*loose, "svgf.sigma_r=100"))["radiance"][..., 0]
    column = slice(width, width + 4)
    assert kept[:, column].mean() == pytest.approx(0.5, rel=0.2)
    assert mixed[:, width + 8 : 2 * width].mean() > 1.2 * kept[:, width + 8 : 2 * width].mean()


def test_a_narrow_lobe_is_averaged_over_fewer_pixels(bench: Bench) -> None:
    """The noise left by the filter in space falls with the roughness, from all of it to next to nothing."""
    left = []
    for roughness in (0.05, 0.3, 1.0):
        packet = glossy(frame(SIZE), noise(SIZE, 3), 0.5, roughness)
        settings = ("svgf.temporal=false", "svgf.sigma_l=1000")
        left.append(float(denoised(bench, packet, denoiser="svgf", settings=settings)["radiance"][8:-8, 8:-8, 0].std()))
    assert left[0] > 0.3  # of 0.5
    assert left[0] > 2 * left[1] > 4 * left[2]


def test_roughness_is_a_feature_of_the_fit(bench: Bench) -> None:
    """Light that follows a texture of roughness, without noise: the fit finds it if it is told of it."""
    stripes = np.where(np.arange(SIZE[0]) // 3 % 2 == 0, 0.2, 0.8) * np.ones((SIZE[1], 1))
    packet = glossy(frame(SIZE), 3.0 * stripes, 0.5, stripes)
    error = {}
    for features in ("1,n,w,w2", "1,n,w,w2,roughness"):
        settings = (f'bmfr.features="{features}"', "bmfr.regularization=rank", "bmfr.separate=true")
        radiance = denoised(bench, packet, denoiser="bmfr", settings=settings)["radiance"][..., :3]
        error[features] = float(np.abs(radiance - packet.radiance()).max())
    assert error["1,n,w,w2"] > 0.2
    assert error["1,n,w,w2,roughness"] < 0.01


@pytest.mark.parametrize("denoiser", ["svgf", "bmfr", "accumulate"])
@pytest.mark.parametrize("bad", [np.nan, np.inf], ids=["NaN", "infinity"])
def test_a_bad_specular_sample_is_replaced(bench: Bench, denoiser: str, bad: float) -> None:
    packet = glossy(frame(SIZE, direct=1.0, albedo=0.5), 1.0, 0.5)
    assert packet.specular is not None
    spoilt = packet.specular.copy()
    spoilt[10, 20, 1] = bad
    wrong = replace(packet, specular=spoilt)
    outputs = denoised(bench, packet, wrong, packet, denoiser=denoiser, settings=("display.mark_bad=on",))
    np.testing.assert_allclose(outputs["radiance"][..., :3], 1.0, rtol=0.01)


def test_a_bad_specular_sample_is_counted(bench: Bench) -> None:
    packet = glossy(frame(SIZE), 1.0, 0.5)
    assert packet.specular is not None
    packet.specular[3, 4, 0] = np.nan
    outputs = denoised(bench, packet, denoiser="svgf", settings=("display.mark_bad=on",))
    assert outputs["bad"][..., 0].sum() == 1
    assert outputs["bad"][..., 1].sum() == 0
