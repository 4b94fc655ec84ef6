"""NaN and infinity: in the samples, in the guides, in a history. They are gone at once, and nothing near them suffers.

What they would do unguarded: a recursive filter keeps a NaN for ever, since a·NaN + (1 - a)·x is NaN for every a; a
spatial one spreads it over its whole window, even where its weight is 0.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Config, Firefly, Svgf, Taa
from gl.graph import Graph
from gl.passes.temporal import Accumulate, Guides, reproject
from raytrace.frame import FramePacket
from tests.passes.harness import PIXEL_SIZE, Bench, Poison, anti_aliasing, frame, noise

SIZE = (31, 33)
SPOILED = ((5, 7), (5, 8), (20, 0), (32, 30))
"""(y, x): two side by side, one at an edge, a corner."""

BAD = {"nan": np.nan, "inf": np.inf, "-inf": -np.inf}


def svgf(**changes: object) -> Config:
    return Config(svgf=replace(Svgf(), **changes))  # type: ignore[arg-type]


FILTERS = {
    "paper": svgf(),
    "joint": svgf(separate=False),
    "in space only": svgf(temporal=False),
    "unguided": svgf(variance_guided=False),
    "in space, unguided": svgf(temporal=False, variance_guided=False),
    "no iterations": svgf(iterations=0),
    "unfiltered feedback": svgf(feedback_level=-1),
    "late feedback": svgf(feedback_level=4),
    "with albedo": svgf(demodulate=False),
    "prefiltered": svgf(prefilter=True),
    "prefiltered in space only": svgf(prefilter=True, temporal=False),
    "clamped": svgf(color_clamp=True),
    "without fireflies": Config(firefly=Firefly(mode="variance")),
    "bounded": Config(firefly=Firefly(mode="clamp")),
}


def sample(index: int, shift: tuple[float, float] = (0.0, 0.0)) -> FramePacket:
    return frame(SIZE, direct=noise(SIZE, index), indirect=noise(SIZE, 50 + index), albedo=0.5, shift=shift)


def spoil(packet: FramePacket, image: str, value: float, channels: slice = slice(None)) -> FramePacket:
    values = getattr(packet, image).copy()
    for y, x in SPOILED:
        values[y, x, channels] = value
    return replace(packet, **{image: values})


def test_the_unguarded_recursion_keeps_a_nan_and_the_unguarded_window_spreads_it() -> None:
    history = np.float32(np.nan)
    for _ in range(100):
        history = np.float32(0.2) * np.float32(1.0) + np.float32(0.8) * history
    assert np.isnan(history)
    with np.errstate(invalid="ignore"):
        assert np.isnan(np.sum(np.array([1.0, 0.0]) * np.array([1.0, np.inf])))  # a weight of 0 does not help


@pytest.mark.parametrize("value", BAD.values(), ids=BAD)
@pytest.mark.parametrize("config", FILTERS.values(), ids=FILTERS)
def test_in_the_samples(bench: Bench, config: Config, value: float) -> None:
    def sequence(dirty: bool) -> list[NDArray[np.float32]]:
        bench.restart()
        shown = []
        for index in range(6):
            packet = sample(index, shift=(0.25, 0.5))
            if dirty and index == 3:
                packet = spoil(spoil(packet, "direct", value), "indirect", value, slice(1, 2))
            shown.append(bench.denoise(packet, config)["radiance"][..., :3])
        return shown

    clean, dirty = sequence(False), sequence(True)
    for before, after in zip(clean, dirty, strict=True):
        assert np.isfinite(after).all()
        # Four of a thousand samples are missing: only their neighbours notice, and take their places.
        assert np.abs(after - before).mean() < 0.02 * before.mean()
    np.testing.assert_array_equal(clean[2], dirty[2])
    assert np.abs(dirty[3] - clean[3]).max() > 0.0


@pytest.mark.parametrize("value", BAD.values(), ids=BAD)
def test_a_sample_that_is_missing_leaves_the_history_as_it_is(bench: Bench, value: float) -> None:
    config = svgf(separate=False, iterations=0)
    keep = ["svgf.both.accumulate.out_color"]
    for index in range(3):
        before = bench.denoise(sample(index), config, keep=keep)[keep[0]]
    after = bench.denoise(spoil(sample(3), "direct", value), config, keep=keep)[keep[0]]
    for y, x in SPOILED:
        np.testing.assert_array_equal(after[y, x], before[y, x])


@pytest.mark.parametrize("denoiser", ["none", "accumulate", "svgf"])
@pytest.mark.parametrize("clip", [True, False])
@pytest.mark.parametrize("value", BAD.values(), ids=BAD)
def test_on_the_screen(bench: Bench, denoiser: str, clip: bool, value: float) -> None:
    """Samples, albedo or emission of one frame spoiled: black at worst, and gone in the next frame."""
    config = Config(taa=Taa(clip=clip))
    still = frame(SIZE, direct=1.0, albedo=0.5, emission=0.25)
    for image in ("direct", "albedo", "emission"):
        bench.restart()
        for _ in range(3):
            clean = bench.denoise(still, config, denoiser)["display"][..., :3]
        during = bench.denoise(spoil(still, image, value), config, denoiser)["display"][..., :3]
        elsewhere = np.ones(during.shape[:2], bool)
        for y, x in SPOILED:
            elsewhere[y, x] = False
        np.testing.assert_allclose(during[elsewhere], clean[elsewhere], atol=1.5 / 255)
        for _ in range(2):
            after = bench.denoise(still, config, denoiser)
        assert np.isfinite(after["radiance"]).all()
        np.testing.assert_allclose(after["radiance"][..., :3], 0.75, rtol=1e-3)


GUIDES = {
    "depth": ("surface", slice(3, 4)),
    "normal": ("surface", slice(0, 3)),
    "one axis of the normal": ("surface", slice(1, 2)),
    "gradient": ("gradient", slice(0, 1)),
    "motion": ("motion", slice(0, 2)),
    "previous depth": ("motion", slice(2, 3)),
    "object id": ("motion", slice(3, 4)),
    "everything": ("surface", slice(0, 4)),
}


@pytest.mark.parametrize("value", [np.nan, np.inf], ids=["nan", "inf"])
@pytest.mark.parametrize(("image", "channels"), GUIDES.values(), ids=GUIDES)
@pytest.mark.parametrize("name", ["paper", "in space only", "unguided", "no iterations"])
def test_in_the_guides(bench: Bench, name: str, image: str, channels: slice, value: float) -> None:
    """The pixel itself is not filtered; all others are, as if it belonged to another surface."""
    config = FILTERS[name]
    level = 2.0
    still = frame(SIZE, direct=level, indirect=level / 2)
    noisy_elsewhere = replace(still, direct=sample(0).direct)
    for index in range(6):
        packet = spoil(still, image, value, channels) if index == 3 else still
        images = bench.denoise(packet, config)
        np.testing.assert_allclose(images["radiance"][..., :3], 1.5 * level, rtol=2e-3)
        assert np.ptp(images["display"][..., :3]) <= 1 / 255
    if config.svgf.iterations:
        clean = bench.denoise(noisy_elsewhere, config, reset="again")["radiance"][..., 0]
        dirty = bench.denoise(spoil(noisy_elsewhere, image, value, channels), config, reset="again")["radiance"][..., 0]
        assert np.isfinite(dirty).all()
        away = np.ones(dirty.shape, bool)
        for y, x in SPOILED:
            away[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2] = False
        noise_left = clean[away].std()
        assert dirty[away].std() < 1.5 * noise_left  # still filtered
        assert np.abs(dirty - clean)[away].mean() < noise_left


def poisoned(moments_too: bool) -> Graph:
    """Accumulation whose histories pass through :class:`Poison`; output ``color``."""
    p = Svgf(alpha=0.0, alpha_moments=0.0)
    g = Graph()
    found = reproject(g, Guides(g, False), "poisoned", p, PIXEL_SIZE)
    color, moments = g.history("poisoned.color", "rgba32f"), g.history("poisoned.moments", "rg32f")
    work = Accumulate(u_alpha=0.0, u_alpha_moments=0.0, formats={"out_color": "rgba32f"}, defines={"HALF": 0})
    blended = g.add(
        work,
        in_color=g.import_("frame.direct", "rgba32f"),
        in_reprojection=found,
        prev_color=color,
        prev_moments=moments,
    )
    poison = g.import_("frame.poison", "rgba32f")
    g.feed(color, g.add(Poison(), in_color=blended.out_color, in_poison=poison).out_color)
    spoiled = Poison(formats={"out_color": "rg32f"})
    none = g.import_("frame.no_poison", "rgba32f")
    g.feed(moments, g.add(spoiled, in_color=blended.out_moments, in_poison=poison if moments_too else none).out_color)
    g.output("color", blended.out_color)
    g.output("moments", blended.out_moments)
    return g


def poison(value: float, everywhere: bool = False) -> dict[str, NDArray[np.float32]]:
    image = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
    if everywhere:
        image[:] = value
    for y, x in SPOILED:
        image[y, x] = value
    return {"frame.poison": image, "frame.no_poison": np.zeros_like(image)}


@pytest.mark.parametrize("value", BAD.values(), ids=BAD)
@pytest.mark.parametrize("moments_too", [True, False])
def test_in_the_history(bench: Bench, value: float, moments_too: bool) -> None:
    """One texel of the four is bad: the other three count. All are: the history is not used."""
    graph = poisoned(moments_too)
    for shift in ((0.0, 0.0), (0.5, 0.5)):
        bench.restart()
        for _ in range(4):
            bench.run(frame(SIZE, direct=3.0), graph, extra=poison(0.0))
        bench.run(frame(SIZE, direct=3.0), graph, extra=poison(value))
        images = bench.run(frame(SIZE, direct=3.0, shift=shift), graph, extra=poison(0.0))
        np.testing.assert_allclose(images["color"][..., :3], 3.0, rtol=1e-6)
        np.testing.assert_allclose(images["moments"], np.broadcast_to((3.0, 9.0), (33, 31, 2)), rtol=1e-5)
        if shift == (0.0, 0.0):
            bench.run(frame(SIZE, direct=3.0), graph, extra=poison(value, everywhere=True))
            images = bench.run(frame(SIZE, direct=5.0), graph, extra=poison(0.0))
            np.testing.assert_array_equal(images["color"][..., :3], 5.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30, -7.0])
def test_what_an_invalid_history_holds_does_not_matter(bench: Bench, value: float) -> None:
    """First frame, cut, resize: whatever is in the texture, the result is the input."""
    graph = poisoned(True)
    bench.run(frame(SIZE, direct=3.0), graph, extra=poison(value, everywhere=True))
    picture = noise(SIZE, 9)
    images = bench.run(frame(SIZE, direct=picture), graph, extra=poison(0.0), reset="cut")
    np.testing.assert_array_equal(images["color"][..., :3], picture)
    with np.errstate(all="ignore"):  # a frame number of 0 would not have told, and the blend would have kept it
        assert not np.allclose(0.2 * picture + 0.8 * np.float32(value), picture)


@pytest.mark.parametrize("value", BAD.values(), ids=BAD)
def test_in_the_picture_before_anti_aliasing(bench: Bench, value: float) -> None:
    """The tone map lets none through; if one came all the same, it would be gone with the next frame."""
    p = Taa(alpha=0.1, clip=False)
    good = np.full((33, 31, 4), 0.5, np.float32)
    bad = good.copy()
    for y, x in SPOILED:
        bad[y, x, :3] = value
    for index in range(5):
        images = bench.run(frame(SIZE), anti_aliasing(p), extra={"frame.color": bad if index == 2 else good})
    np.testing.assert_allclose(images["color"][..., :3], 0.5, rtol=1e-3)


@pytest.mark.parametrize("first", [True, False], ids=["without a history", "with one"])
def test_a_colour_that_there_is_not_leaves_no_trace(bench: Bench, first: bool) -> None:
    """The tone map makes black of it, with alpha 0: the history is shown, or what comes next is taken whole."""
    p = Taa(alpha=0.1, clip=False)
    good = np.ones((33, 31, 4), np.float32)
    good[..., :3] = 0.5
    none = good.copy()
    for y, x in SPOILED:
        none[y, x] = 0.0
    for index in range(1 if first else 3):
        bench.run(frame(SIZE), anti_aliasing(p), extra={"frame.color": none if index == 0 and first else good})
    during = bench.run(frame(SIZE), anti_aliasing(p), extra={"frame.color": none})["color"]
    after = bench.run(frame(SIZE), anti_aliasing(p), extra={"frame.color": good})["color"]
    np.testing.assert_array_equal(during[5, 7], (0.0,) * 4 if first else (0.5, 0.5, 0.5, 1.0))
    np.testing.assert_allclose(after, good, rtol=1e-3)
