"""The texture viewer: every format, channel, range and decoded meaning, pixel by pixel."""

from __future__ import annotations

import numpy as np
import pytest

from gl.formats import FORMATS
from gl.graph import ONE_TEXEL
from gl.passes.temporal import GUIDE, REJECTIONS, REPROJECTION
from images import to_srgb8, value_range
from tests.window.looking import eight_bits
from ui.present import BORDER, letterbox
from ui.texture_view import LENS_TEXELS, RANGE_EVERY, TextureView
from ui.textures import (
    FULL_MOTION,
    INFINITE_COLOR,
    NAN_COLOR,
    NEGATIVE_INFINITE_COLOR,
    RAMP,
    RAMP_END,
    REJECTION_COLORS,
)

SHAPE = (5, 7)
FLOATS = "rgba32f"


@pytest.fixture
def view(ctx):
    made = TextureView(ctx)
    yield made
    made.release()


def values_of(fmt: str, seed: int = 1) -> np.ndarray:
    """(5, 7, C) of ``fmt``'s own type; integers up to 200, negative where there are such, others in [-0.5, 2]."""
    spec, rng = FORMATS[fmt], np.random.default_rng(seed)
    shape = (*SHAPE, spec.components)
    if spec.dtype == "f1":
        return rng.integers(0, 256, shape, dtype=np.uint8)
    if spec.kind:
        return rng.integers(-200 if spec.kind == "i" else 0, 200, shape).astype(spec.numpy)
    return rng.uniform(-0.5, 2.0, shape).astype(spec.numpy)


def floats(*pixels: tuple[float, ...]) -> np.ndarray:
    """(1, N, 4) float32, missing channels 0."""
    return np.array([[(*pixel, *[0.0] * (4 - len(pixel))) for pixel in pixels]], np.float32)


def as_color(values: np.ndarray) -> np.ndarray:
    """(H, W, 3): one channel grey, of two the blue is 0."""
    channels = [values[..., min(c, values.shape[2] - 1)] for c in range(3)]
    if values.shape[2] == 2:
        channels[2] = np.zeros_like(channels[0])
    return np.stack(channels, -1).astype(np.float64)


# ----------------------------------------------------------------------------------- formats, channels, range, exposure


@pytest.mark.parametrize("fmt", FORMATS)
def test_every_channel_of_every_format(frames, view, fmt):
    values = values_of(fmt)
    frame = frames(fmt, values)
    low, high = (0.1, 0.9) if FORMATS[fmt].dtype == "f1" else (-20.0, 150.0) if FORMATS[fmt].kind else (-0.25, 1.5)
    numbers = values / 255.0 if FORMATS[fmt].dtype == "f1" else values
    choices = {channel: np.repeat(numbers[..., [i]], 3, 2) for i, channel in enumerate("rgba"[: values.shape[2]])}
    for channels, expected in (*choices.items(), ("rgb", as_color(numbers)), ("auto", as_color(numbers))):
        frame.look(channels=channels, low=low, high=high, exposure=0.5)
        light = (expected.astype(np.float64) - low) / (high - low) * 2**0.5
        # Eight bits are sRGB already.
        wanted = np.rint(np.clip(light, 0, 1) * 255) if FORMATS[fmt].dtype == "f1" else to_srgb8(light)
        np.testing.assert_allclose(frame.draw(view).astype(int), wanted, atol=1, err_msg=channels)


def test_exposure_counts_in_stops(frames, view):
    frame = frames(FLOATS, floats((0.1, 0.2, 0.04)))
    for exposure in (-1.0, 0.0, 2.0):
        frame.look(exposure=exposure)
        np.testing.assert_array_equal(frame.draw(view), to_srgb8(floats((0.1, 0.2, 0.04))[..., :3] * 2**exposure))


def test_an_empty_range_shows_black_and_white(frames, view):
    frame = frames(FLOATS, floats((0.5, 1.0, 2.0)))
    frame.look(low=1.0, high=1.0)
    assert frame.draw(view).tolist() == [[[0, 0, 255]]]


@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (50.0, 0.0), (2.0, -1.0), (1e-3, -5e-4)])
def test_the_automatic_range_is_that_of_all_texels(frames, view, scale, offset):
    values = (np.random.default_rng(2).random((9, 16, 4)) * scale + offset).astype(np.float32)
    values[0, 0] = np.nan, np.inf, -np.inf, 1e30
    frame = frames(FLOATS, values)
    look = frame.look(automatic=True)
    frame.draw(view)
    assert (look.low, look.high) == pytest.approx(value_range(values[..., :3]), rel=1e-6)
    if (scale, offset) == (1.0, 0.0):
        assert (look.low, look.high) == (0.0, 1.0), "what fits stays as it is"
    frame.look(channels="a", automatic=True)
    frame.draw(view)
    assert frame.state.look.low == pytest.approx(value_range(values[..., 3])[0], rel=1e-6)


def test_the_automatic_range_of_a_large_texture_is_nearly_that_of_all(frames, view):
    values = np.random.default_rng(3).exponential(5.0, (300, 500, 4)).astype(np.float32)
    values *= (
        np.linspace(0.0, 1.0, 500, dtype=np.float32)[:, None]
        * np.linspace(0.0, 1.0, 300, dtype=np.float32)[:, None, None]
    )
    frame = frames(FLOATS, values)
    look = frame.look(automatic=True)
    frame.draw(view)
    assert look.high == pytest.approx(value_range(values[..., :3])[1], rel=0.1)


def test_the_range_is_looked_for_now_and_then(frames, view):
    """Each time waits for the GPU."""
    frame = frames(FLOATS, floats((8.0, 8.0, 8.0)))
    look = frame.look(automatic=True)
    frame.draw(view)
    assert look.high == 8.0
    frame.texture.write(floats((2.0, 2.0, 2.0)))
    for _ in range(RANGE_EVERY - 1):
        frame.draw(view)
    assert look.high == 8.0
    frame.draw(view)
    assert look.high == 2.0
    frame.texture.write(floats((4.0, 4.0, 4.0, 9.0)))
    look.channels = "a"
    frame.draw(view)
    assert look.high == 9.0, "other channels, another range"
    look.automatic, look.high = False, 3.0
    for _ in range(RANGE_EVERY + 1):
        frame.draw(view)
    assert look.high == 3.0


def test_what_is_no_number_has_colors_of_its_own(frames, view):
    nan, inf = np.nan, np.inf
    pixels = ((nan, 0, 0), (0, inf, 0), (0, 0, -inf), (nan, inf, -inf), (inf, -inf, 0), (0, 0, 0, nan), (65000.0, 0, 0))
    special = [NAN_COLOR, INFINITE_COLOR, NEGATIVE_INFINITE_COLOR, NAN_COLOR, INFINITE_COLOR]
    expected = [eight_bits(color) for color in special]
    for fmt in ("rgba32f", "rgba16f"):
        frame = frames(fmt, floats(*pixels).astype(FORMATS[fmt].numpy))
        frame.look()
        drawn = frame.draw(view)[0].tolist()
        assert drawn[:5] == expected
        assert drawn[5:] == [[0, 0, 0], [255, 0, 0]], "alpha is not shown, and large is not infinite"
        frame.look(channels="a")
        assert frame.draw(view)[0, 5].tolist() == expected[0]


# ----------------------------------------------------------------------------------------------------- sizes and places


@pytest.mark.parametrize(("size", "divisor"), [((16, 10), 1), ((17, 11), 2), ((33, 9), 8), ((6, 4), ONE_TEXEL)])
def test_smaller_textures_lie_under_the_pixels_they_belong_to(frames, view, size, divisor):
    width, height = (-(-side // divisor) for side in size)
    values = np.random.default_rng(4).random((height, width, 1)).astype(np.float32)
    frame = frames("r32f", values, divisor=divisor, size=size)
    frame.look()
    y, x = np.mgrid[: size[1], : size[0]]
    expected = to_srgb8(np.repeat(values[y // divisor, x // divisor], 3, 2))
    np.testing.assert_array_equal(frame.draw(view), expected)


@pytest.mark.parametrize("window", [(28, 20), (70, 20), (20, 70), (9, 6), (3, 2)])
def test_the_picture_keeps_its_shape_and_texels_stay_sharp(frames, view, window):
    values = values_of("r32f")
    frame = frames("r32f", values)
    frame.look()
    drawn = frame.draw(view, window)
    left, bottom, width, height = letterbox((7, 5), window)
    rows, columns = ((np.arange(n) + 0.5) * side // n for n, side in ((height, 5), (width, 7)))
    picture = values[rows.astype(int)][:, columns.astype(int)]
    expected = np.full((window[1], window[0], 3), eight_bits(BORDER), np.uint8)
    expected[bottom : bottom + height, left : left + width] = to_srgb8(np.repeat(picture, 3, 2))
    np.testing.assert_array_equal(drawn, expected)


def test_what_the_frame_does_not_have_is_not_drawn(ctx, frames, view):
    frame = frames("r32f", values_of("r32f"))
    screen = ctx.texture((4, 4), 4, b"\x07" * 64)
    target = ctx.framebuffer([screen])
    frame.state.view = "missing"
    assert not view.draw(frame.state, frame.status, target, (4, 4))
    frame.state.view, frame.status.result = "seen", None
    assert not view.draw(frame.state, frame.status, target, (4, 4))
    assert screen.read() == b"\x07" * 64
    target.release()
    screen.release()


# ------------------------------------------------------------------------------------------------------------- decoders


def shown(frames, view, doc: str, *pixels: tuple[float, ...], key: str = "auto", **look: float) -> list[list[int]]:
    """The colours of ``pixels`` in a texture that is documented so."""
    frame = frames(FLOATS, floats(*pixels), doc)
    frame.look(channels=key, **look)
    colors: list[list[int]] = frame.draw(view)[0].tolist()
    return colors


def test_normals_are_mapped_to_colors(frames, view):
    doc = "xyz: shading normal, world; w: depth, scene units"
    drawn = shown(frames, view, doc, (1, 0, 0, 5), (0, -1, 0, 5), (0, 0, 1, 5), (0, 0, 0, 0))
    assert drawn == [[255, 128, 128], [128, 0, 128], [128, 128, 255], [0, 0, 0]]
    assert shown(frames, view, doc, (1, 0, 0, 0.5), key="a") == [[188, 188, 188]]


def test_octahedral_normals_are_decoded(frames, view):
    def code(x: float, y: float) -> float:
        return float(round((x * 0.5 + 0.5) * 4095) * 4096 + round((y * 0.5 + 0.5) * 4095))

    # The square's middle is +z, the middles of its sides are x and y, its corners are -z.
    drawn = shown(frames, view, GUIDE, (code(0, 0),), (code(1, 0),), (code(0, -1),), (code(1, 1),))
    expected = [[128, 128, 255], [255, 128, 128], [128, 0, 128], [128, 128, 0]]
    np.testing.assert_allclose(drawn, expected, atol=1)


MOTION = "xy: previous uv - uv; z: expected previous depth, scene units; w: object id, -1 = miss"


def test_motion_has_hue_by_direction_and_brightness_by_length(frames, view):
    n = 6  # pixels of the picture in x, 1 in y
    full = FULL_MOTION / n
    pixels = ((0, 0), (full, 0), (-full, 0), (0, FULL_MOTION), (full / 4, 0), (9 * full, 0))
    still, right, left, up, slow, fast = shown(frames, view, MOTION, *pixels)
    assert still == [0, 0, 0]
    assert right[0] == 255
    assert right[1] == right[2] < 64
    assert left[1] == left[2] == 255
    assert left[0] < 64
    assert right != up != left
    assert max(slow) == round(255 * np.log2(1 + FULL_MOTION / 4) / np.log2(1 + FULL_MOTION))
    assert fast == right
    brighter = shown(frames, view, MOTION, *pixels, exposure=2.0)
    np.testing.assert_allclose(brighter[4], right, atol=1)


def test_the_length_of_the_history_is_a_ramp_and_its_lack_a_reason(frames, view):
    ends = ((0, 0, 15, 1), (0, 0, 15, RAMP_END), (0, 0, 15, 16), (0, 0, 15, 4000))
    drawn = shown(frames, view, REPROJECTION, *ends)
    assert drawn == [eight_bits(RAMP[index]) for index in (0, -1, len(RAMP) // 2, -1)]
    assert set(REJECTION_COLORS) == set(REJECTIONS)
    drawn = shown(frames, view, REPROJECTION, *((3, 3, reason, 0) for reason in REJECTIONS))
    np.testing.assert_allclose(drawn, [eight_bits(REJECTION_COLORS[reason]) for reason in REJECTIONS], atol=1)
    # The guide keeps a length, too, with the cosine as its fraction, and no reason.
    first, longer = shown(frames, view, GUIDE, (0, 0, -7, 1.0), (0, 0, -7, 16.5), key="history")
    assert first == eight_bits(RAMP[0])
    np.testing.assert_allclose(longer, eight_bits(RAMP[len(RAMP) // 2]), atol=3)


def test_objects_have_distinct_colors(frames, view):
    ids = [(0, 0, 0, float(i)) for i in range(64)]
    drawn = shown(frames, view, MOTION, *ids, (0, 0, 0, 1e6), (0, 0, 0, 1e6 + 1), (0, 0, 0, -1), key="object")
    assert len({tuple(color) for color in drawn}) == len(drawn)
    assert max(drawn[-1]) < 16 < min(max(color) for color in drawn[:-1])
    neighbours = np.abs(np.diff(np.array(drawn[:64], int), axis=0)).max(1)
    assert neighbours.min() > 40


# ------------------------------------------------------------------------------------------------------------ magnifier


def test_the_magnifier_repeats_texels_around_the_mouse(frames, view):
    zoom, size, window = 12, (40, 30), (400, 300)
    values = np.random.default_rng(5).random((30, 40, 4)).astype(np.float32)
    frame = frames(FLOATS, values)
    frame.status.cursor = (21, 14)
    frame.look(zoom=zoom)
    drawn = frame.draw(view, window)
    frame.look(zoom=0)
    plain = frame.draw(view, window)
    middle_x, middle_y = round(21.5 * 10), round(14.5 * 10)
    for dx, dy in ((0, 0), (3, 0), (0, -5), (-8, 8), (8, -8)):
        x, y = middle_x + dx * zoom, middle_y + dy * zoom
        expected = to_srgb8(values[None, None, 14 + dy, 21 + dx, :3])[0, 0]
        # Between the lines: all of the texel but its frame.
        assert (drawn[y - 3 : y + 3, x - 3 : x + 3] == expected).all(), (dx, dy)
    # The texel in the middle is framed black and white; the others have grey lines between them.
    frame_line = drawn[middle_y - 6 : middle_y + 6, middle_x]
    assert frame_line[[0, -1]].max() == 0
    assert frame_line[[1, -2]].min() == 255
    line = drawn[middle_y + 26, middle_x - 6 + 3 * zoom]
    inside = drawn[middle_y + 26, middle_x + 3 * zoom]
    assert (np.abs(line.astype(int) - 127) < np.abs(inside.astype(int) - 127)).any()
    assert (line != inside).any()
    # Beyond its frame nothing has changed.
    reach = LENS_TEXELS * zoom // 2 + 4
    outside = np.ones(window[::-1], bool)
    outside[max(middle_y - reach, 0) : middle_y + reach, max(middle_x - reach, 0) : middle_x + reach] = False
    np.testing.assert_array_equal(drawn[outside], plain[outside])
    assert size == frame.status.size


def test_the_magnifier_at_the_edge_shows_nothing_beyond_it(frames, view):
    frame = frames("r32f", np.ones((30, 40, 1), np.float32))
    frame.status.cursor = (0, 0)
    frame.look(zoom=8)
    drawn = frame.draw(view, (400, 300))
    assert drawn[5 + 3 * 8, 5 + 3 * 8].tolist() == [255] * 3
    assert drawn[1, 1].tolist() != [255] * 3, "left of the first texel, though inside of the picture"


def test_the_magnifier_shows_the_texel_of_a_small_texture(frames, view):
    values = np.random.default_rng(6).random((5, 5, 1)).astype(np.float32)
    frame = frames("r32f", values, divisor=8, size=(40, 40))
    frame.status.cursor = (17, 30)
    frame.look(zoom=10)
    drawn = frame.draw(view, (400, 400))
    assert (drawn[305, 175] == to_srgb8(np.full((1, 1, 3), values[3, 2]))[0, 0]).all()


def test_without_a_mouse_there_is_no_magnifier(frames, view):
    frame = frames("r32f", values_of("r32f"))
    frame.look()
    plain = frame.draw(view, (70, 50))
    frame.look(zoom=10)
    np.testing.assert_array_equal(frame.draw(view, (70, 50)), plain)
