"""NaN and infinity on the screen in red, and in numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from config import Config, Display
from gl.pipelines import DENOISERS
from gl.renderer import Renderer, count_bad, read
from raytrace.frame import FramePacket
from tests.passes.harness import SIZES, Size, frame

SIZE = (70, 37)  # tiles of 32: whole ones, and parts of one on both sides
AT = [(0, 0), (5, 31), (5, 32), (36, 69), (33, 2)]
"""(y, x): in a corner, on both sides of an edge between tiles, in the last pixel, in another tile."""

BRIGHT = (255, 0, 0)
DARK = (124, 0, 0)

MARKED = Config(display=Display(mark_bad="on"))


@pytest.fixture
def renderer(ctx: moderngl.Context) -> Iterator[Renderer]:
    renderer = Renderer(ctx)
    yield renderer
    renderer.release()


def spoil(packet: FramePacket, image: str, value: float, at: list[tuple[int, int]], channel: int = 1) -> FramePacket:
    values = getattr(packet, image).copy()
    for y, x in at:
        values[y, x, channel] = value
    return replace(packet, **{image: values})


def wall(size: Size = SIZE) -> FramePacket:
    return frame(size, direct=1.0, indirect=0.5, albedo=0.5, emission=0.25)


def picture(texture: moderngl.Texture) -> NDArray[np.uint8]:
    return np.rint(read(texture)[..., :3] * 255).astype(np.uint8)


def where(pixels: NDArray[np.uint8], color: tuple[int, int, int]) -> list[tuple[int, int]]:
    return [(int(y), int(x)) for y, x in np.argwhere((pixels == color).all(axis=2))]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf], ids=str)
@pytest.mark.parametrize("image", ["direct", "indirect"])
def test_a_sample_that_a_filter_replaced_is_dark_red(renderer: Renderer, image: str, value: float) -> None:
    for _ in range(2):
        clean = picture(renderer.run(wall(), MARKED, "svgf").outputs["display"])
    result = renderer.run(spoil(wall(), image, value, AT), MARKED, "svgf")
    shown = picture(result.outputs["display"])
    assert sorted(where(shown, DARK)) == sorted(AT)
    rest = (shown != DARK).any(axis=2)
    np.testing.assert_array_equal(shown[rest], clean[rest])
    assert count_bad(result) == (len(AT), 0)
    after = renderer.run(wall(), MARKED, "svgf")
    assert count_bad(after) == (0, 0)
    np.testing.assert_array_equal(picture(after.outputs["display"]), clean)  # no red in the history of the picture


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf], ids=str)
@pytest.mark.parametrize("image", ["albedo", "emission"])
def test_radiance_that_is_bad_is_bright_red(renderer: Renderer, image: str, value: float) -> None:
    packet = spoil(spoil(wall(), image, value, AT[:3]), "direct", value, AT[2:])
    result = renderer.run(packet, MARKED, "svgf")
    shown = picture(result.outputs["display"])
    assert sorted(where(shown, BRIGHT)) == sorted(AT[:3])
    assert sorted(where(shown, DARK)) == sorted(AT[3:])
    assert count_bad(result) == (3, 3)  # one pixel is both


def test_what_nothing_filters_is_bad_at_both_ends(renderer: Renderer) -> None:
    result = renderer.run(spoil(wall(), "direct", np.nan, AT), MARKED, "none")
    assert sorted(where(picture(result.outputs["display"]), BRIGHT)) == sorted(AT)
    assert count_bad(result) == (len(AT), len(AT))


def test_a_reference_is_not_made_of_this_frame_s_samples(renderer: Renderer) -> None:
    reference = np.ones((SIZE[1], SIZE[0], 4), np.float32)
    reference[3, 4, 0] = np.nan
    result = renderer.run(spoil(wall(), "direct", np.nan, AT), MARKED, "reference", reference)
    assert where(picture(result.outputs["display"]), BRIGHT) == [(3, 4)]
    assert count_bad(result) == (0, 1)


@pytest.mark.parametrize("size", SIZES)
def test_all_pixels_of_any_size_are_counted(renderer: Renderer, size: Size) -> None:
    packet = replace(wall(size), direct=np.full((size[1], size[0], 4), np.nan, np.float32))
    result = renderer.run(packet, MARKED, "none")
    assert count_bad(result) == (size[0] * size[1],) * 2
    assert (picture(result.outputs["display"]) == BRIGHT).all()


@pytest.mark.parametrize("denoiser", [name for name in DENOISERS if name != "reference"])
def test_without_bad_pixels_the_picture_is_the_same(renderer: Renderer, denoiser: str) -> None:
    pictures = []
    for display in (Display(mark_bad="off"), Display(mark_bad="on"), Display(mark_bad="auto")):
        result = renderer.run(replace(wall(), cut=True), Config(display=display), denoiser)
        assert ("bad" in result.outputs) == (display.mark_bad == "on")
        assert count_bad(result) == ((0, 0) if display.mark_bad == "on" else None)
        pictures.append(picture(result.outputs["display"]))
    np.testing.assert_array_equal(pictures[0], pictures[1])
    np.testing.assert_array_equal(pictures[0], pictures[2])


def test_the_noisy_half_shows_the_bad_sample_itself(renderer: Renderer) -> None:
    result = renderer.run(spoil(wall(), "direct", np.inf, AT), MARKED, "svgf", split=True)
    assert sorted(where(picture(result.outputs["display"]), DARK)) == sorted(AT)
    assert sorted(where(picture(result.outputs["noisy"]), BRIGHT)) == sorted(AT)
    assert count_bad(result) == (len(AT), 0)  # of the picture on display, not of both


@pytest.mark.parametrize("image", ["surface", "motion", "gradient"])
def test_a_guide_is_no_sample(renderer: Renderer, image: str) -> None:
    """Filters take a pixel without geometry for one of another surface; its light is what it is."""
    result = renderer.run(spoil(wall(), image, np.nan, AT), MARKED, "svgf")
    assert count_bad(result) == (0, 0)
