"""BMFR on NaN, infinity and numbers near the end of the range: gone at once, and nothing near them suffers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config import Bmfr
from gl.graph import Graph, History, Tex
from gl.passes import bmfr
from gl.passes.temporal import Guides
from raytrace.frame import STANDARD_BASIS, FramePacket
from tests.passes.bmfr_frames import MODES, SIZE, radiance, run, tilted, with_alpha
from tests.passes.harness import HALF, Bench, Poison, frame, noise

SAMPLES = "bmfr.accumulate.out_color"
BAD = {"nan": np.nan, "inf": np.inf, "-inf": -np.inf}


@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize("image", ["direct", "indirect"])
def test_a_spoilt_sample_is_gone_at_once_and_harms_nothing(bench: Bench, image: str, value: str) -> None:
    packet = frame(SIZE, direct=0.5, indirect=0.25)
    values = getattr(packet, image).copy()
    values[7, 5] = values[43, 59] = BAD[value]
    spoilt = {image: values}
    for index, bad in enumerate((False, True, False, True, True)):
        images = run(bench, replace(packet, **spoilt) if bad else packet, index)
        np.testing.assert_allclose(images["radiance"][..., :3], 0.75, rtol=2 * HALF)


@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize("image", ["surface", "motion"])
@pytest.mark.parametrize("place", [(7, 5), (26, 36)], ids=["anywhere", "middle of a block"])
def test_a_spoilt_guide_harms_only_its_pixel(bench: Bench, place: tuple[int, int], image: str, value: str) -> None:
    """Not even from the middle of a block, whose normal all others are taken relative to."""
    packet = frame(SIZE, direct=0.5)
    values = getattr(packet, image).copy()
    values[place] = BAD[value]
    spoilt = {image: values}
    for index, bad in enumerate((False, True, False, False)):
        result = run(bench, replace(packet, **spoilt) if bad else packet, index)["radiance"][..., :3]
        assert np.isfinite(result).all()
        result[place] = 0.5
        np.testing.assert_allclose(result, 0.5, rtol=2 * HALF)


@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize("channels", [slice(0, 3), slice(3, 4)], ids=["normal", "depth"])
@pytest.mark.parametrize("place", [(7, 5), (26, 36)], ids=["anywhere", "middle of a block"])
def test_a_spoilt_guide_does_not_spoil_the_fit_of_its_block(
    bench: Bench, place: tuple[int, int], channels: slice, value: str
) -> None:
    packet = replace(tilted(), direct=with_alpha(noise(SIZE, 7)))
    sound = radiance(bench, packet, 1)
    surface = packet.surface.copy()
    surface[*place, channels] = BAD[value]
    bench.restart()
    spoilt = radiance(bench, replace(packet, surface=surface), 1)
    spoilt[place] = sound[place]
    assert np.abs(spoilt - sound).max() < 0.1


def test_pixels_without_a_sample_take_no_part_in_the_fit(bench: Bench) -> None:
    """But they get what it says."""
    spoilt = frame(SIZE, direct=0.75).direct
    spoilt[::2, ::3] = np.nan
    for index in range(3):
        clean = radiance(bench, replace(frame(SIZE), direct=spoilt), index)
        np.testing.assert_allclose(clean, 0.75, rtol=HALF)


def test_a_pixel_without_a_sample_is_no_history(bench: Bench) -> None:
    """Between a texel that has one and a texel that has none, only the first counts."""
    spoilt = frame(SIZE, direct=0.75).direct
    spoilt[:, ::2] = np.nan
    run(bench, replace(frame(SIZE), direct=spoilt), 0)
    moved = run(bench, frame(SIZE, direct=0.75, shift=(0.5, 0.0)), 1, (SAMPLES,))
    np.testing.assert_allclose(moved[SAMPLES][..., :3], 0.75, rtol=HALF)


@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize("history", ["noisy", "fitted"])
def test_a_spoilt_history_is_gone_in_the_next_frame(bench: Bench, history: str, value: str) -> None:
    """What is put into a history once, in spite of all guards, does not come back."""
    poison = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
    poison[20:23, 30:35] = BAD[value]
    poison[20:23, 30:35, 3] = 1.0
    packet = frame(SIZE, direct=0.5)
    for index in range(3):
        extra = {"frame.poison": poison if index == 0 else np.zeros_like(poison)}
        images = bench.run(replace(packet, index=index), poisoned(history, packet, index), extra=extra)
        if index > 0:
            np.testing.assert_allclose(images["color"][..., :3], 0.5, rtol=2 * HALF)


class PoisonedGraph(Graph):
    """Feeds the history ``spoilt`` with what frame.poison makes of it."""

    def __init__(self, spoilt: str) -> None:
        super().__init__()
        self._spoilt = spoilt

    def feed(self, history: History, source: Tex) -> None:
        if history.name == f"bmfr.{self._spoilt}":
            poison = self.import_("frame.poison", "rgba32f")
            work = Poison(formats={"out_color": history.fmt})
            source = self.add(work, in_color=source, in_poison=poison).out_color
        super().feed(history, source)


def poisoned(spoilt: str, packet: FramePacket, index: int) -> Graph:
    """The filter with one spoilt history; output ``color``."""
    g = PoisonedGraph(spoilt)
    view = bmfr.View(STANDARD_BASIS, (0.0, 0.0), packet.pixel_size, index, 8)
    signals = {name: g.import_(f"frame.{name}", "rgba32f") for name in ("direct", "indirect")}
    g.output("color", bmfr.bmfr(g, signals, {}, Guides(g, False), Bmfr(), view))
    return g


@pytest.mark.parametrize("depth", [1e-30, 1e-12, 1e30, 3e38])
@pytest.mark.parametrize("mode", MODES)
def test_any_finite_input_gives_a_finite_picture(bench: Bench, mode: str, depth: float) -> None:
    random = np.random.default_rng(5)
    packet = tilted(pixel_size=0.5)
    surface = packet.surface.copy()
    surface[..., 3] = depth * random.uniform(0.5, 1.0, surface.shape[:2])
    surface[..., :3] *= random.choice([1e-30, 1.0, 1e30], surface.shape[:2])[..., None]
    colors = 10.0 ** random.uniform(-38, 38, (SIZE[1], SIZE[0], 3))
    for index in range(3):
        images = run(bench, replace(packet, surface=surface, direct=with_alpha(colors)), index, regularization=mode)
        assert np.isfinite(images["radiance"]).all()


def test_a_block_that_overflows_keeps_its_samples(bench: Bench) -> None:
    """Squares of such normals are infinite, and no fit is to be had."""
    packet = replace(tilted(), direct=with_alpha(noise(SIZE, 7)))
    surface = packet.surface.copy()
    surface[..., :3] *= 1e25
    kept = radiance(bench, replace(packet, surface=surface), 1)
    np.testing.assert_allclose(kept, packet.direct[..., :3], rtol=2 * HALF)
