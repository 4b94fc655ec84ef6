"""The pixel inspector, what the viewer knows of the graph's textures, and both drawn by Dear ImGui."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui

from config import Config, Svgf
from gl.formats import FORMATS
from gl.graph import ONE_TEXEL
from gl.passes.temporal import GUIDE, REJECTIONS, REPROJECTION
from gl.pipelines import FrameTraits, build
from gl.renderer import Renderer, read
from tests.passes.harness import DEPTH, frame, noise, with_sky
from ui.glfw_window import Cursor, MouseButton
from ui.imgui_layer import ImGuiLayer
from ui.inspector import draw_inspector, history_reading, inspect, read_texel, wanted_textures
from ui.state import PICTURE, State
from ui.status import Status
from ui.texture_controls import draw_controls
from ui.textures import REJECTION_COLORS, Part, find_subject, parts, reprojection_of

SIZE = (18, 12)
REPROJECTED = "svgf.reproject.out_reprojection"


@pytest.fixture
def renderer(ctx):
    made = Renderer(ctx)
    yield made
    made.release()


def texts(state: State, status: Status) -> dict[str, str]:
    return {reading.label: reading.text for group in inspect(state, status) for reading in group}


# --------------------------------------------------------------------------------------------------- what textures hold


def test_documentation_is_read_by_channels():
    assert parts("linear radiance") == ()
    assert parts(GUIDE)[0] == Part("r", "normal, octahedral")
    assert parts(REPROJECTION)[-1] == Part("a", "history length N, frames")
    assert parts("filtered: rgb: irradiance; a: standard deviation") == (
        Part("rgb", "irradiance"),
        Part("a", "standard deviation"),
    )
    assert parts("xyz: normal, world; w: depth: along the view") == (
        Part("rgb", "normal, world"),
        Part("a", "depth: along the view"),
    )


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("frame.direct", "rgb"),
        ("frame.albedo", "rgb"),
        ("frame.surface", "normal"),
        ("frame.prev_normal", "normal"),
        ("frame.motion", "motion"),
        ("frame.gradient", "rgb"),
        ("svgf.reproject.out_guide", "normal"),
        (REPROJECTED, "history"),
        ("svgf.direct.accumulate.out_color", "rgb"),
        ("svgf.direct.accumulate.out_moments", "rgb"),
        ("svgf.indirect.atrous0.out_color", "rgb"),
        (PICTURE, "rgb"),
    ],
)
def test_what_suits_each_texture(name, key):
    subject = find_subject(build(Config(), "svgf", FrameTraits(moving=True)).compile(), name)
    assert subject is not None
    assert subject.view("auto").key == key
    assert subject.view("a").key == ("a" if subject.tex.fmt.startswith("rgba") else subject.view("auto").key)
    assert subject.view("no such thing") == subject.view("auto")


def test_a_texture_knows_its_writer_and_its_views():
    plan = build(Config(), "svgf", FrameTraits()).compile()
    guide = find_subject(plan, "svgf.reproject.out_guide")
    assert guide is not None
    assert (guide.writer, guide.shader) == ("svgf.reproject", "temporal/reproject.frag")
    labels = {view.key: view.label for view in guide.views}
    assert labels["g"] == "g: depth"
    assert list(labels) == ["rgb", "r", "g", "b", "a", "normal", "object", "history"]
    surface = find_subject(plan, "frame.surface")
    assert surface is not None
    assert surface.writer == ""
    # Anti-aliasing reads it, too, and knows less of it.
    assert surface.doc == "xyz: shading normal, world; w: depth, scene units"
    assert find_subject(plan, "no such thing") is None


# ---------------------------------------------------------------------------------------------------- what is asked for


def test_what_is_wanted_is_kept(renderer):
    """A texture in the middle of the wavelet, over which a later one is written."""
    name = "svgf.direct.variance.out_color"
    packet = frame(SIZE, direct=noise(SIZE, 1))
    state = State(Config(), "svgf", view=name)
    plan = renderer.plan(packet, state.config, "svgf")
    assert name not in plan.final_textures()
    assert wanted_textures(state, plan) == (name,)
    state.inspect = True
    assert wanted_textures(state, plan) == (name, REPROJECTED)
    assert set(wanted_textures(state, plan)) <= set(
        renderer.plan(packet, state.config, "svgf", wanted_textures(state, plan)).final_textures()
    )
    state.view = REPROJECTED
    assert wanted_textures(state, plan) == (REPROJECTED,)
    state.view = PICTURE
    state.inspect = False
    assert wanted_textures(state, plan) == ()


def test_nothing_is_wanted_that_the_method_does_not_have(renderer):
    state = State(Config(), "none", view=REPROJECTED, inspect=True)
    plan = renderer.plan(frame(SIZE), state.config, "none")
    assert wanted_textures(state, plan) == ()
    assert reprojection_of(plan) is None
    accumulating = reprojection_of(renderer.plan(frame(SIZE), state.config, "accumulate"))
    assert accumulating is not None
    assert accumulating.name == "accumulate.reproject"


# ------------------------------------------------------------------------------------------------------ reading a pixel


@pytest.mark.parametrize("fmt", FORMATS)
def test_a_texel_is_read_exactly(ctx, frames, fmt):
    spec, rng = FORMATS[fmt], np.random.default_rng(7)
    values = rng.integers(0, 256, (3, 5, spec.components)).astype(spec.numpy)
    if spec.dtype in ("f2", "f4"):
        values /= values.dtype.type(3)
    elif spec.kind:
        values += np.iinfo(values.dtype).max - 300
    texture = frames(fmt, values).texture
    for x, y in ((0, 0), (4, 0), (3, 1), (4, 2)):
        texel = read_texel(texture, (x, y))
        assert texel.dtype == values.dtype
        np.testing.assert_array_equal(texel, values[y, x])


def test_values_are_shown_exactly(frames):
    values = np.array([[[0.1, np.nan, 1e-30, -np.inf]]], np.float32)
    seen = frames("rgba32f", values, "xyz: shading normal, world; w: depth, scene units")
    seen.status.packet, seen.status.cursor = frame((1, 1)), (0, 0)
    shown = texts(seen.state, seen.status)
    assert (shown["r"], shown["g"], shown["b"], shown["a  depth"]) == ("0.1", "nan", "1e-30", "-inf")
    seen = frames("r32ui", np.array([[[2**32 - 1]]], np.uint32))
    seen.status.packet, seen.status.cursor = frame((1, 1)), (0, 0)
    assert texts(seen.state, seen.status)["r"] == "4294967295"
    seen = frames("rgba8", np.array([[[0, 128, 255, 1]]], np.uint8))
    seen.status.packet, seen.status.cursor = frame((1, 1)), (0, 0)
    assert texts(seen.state, seen.status)["g"] == "128 / 255"


@pytest.mark.parametrize(("divisor", "texel"), [(1, (7, 5)), (2, (3, 2)), (8, (0, 0)), (ONE_TEXEL, (0, 0))])
def test_of_a_smaller_texture_the_texel_below_the_mouse_is_read(frames, divisor, texel):
    width, height = (-(-side // divisor) for side in (9, 7))
    values = np.arange(width * height, dtype=np.float32).reshape(height, width, 1)
    seen = frames("r32f", values, divisor=divisor, size=(9, 7))
    seen.status.packet, seen.status.cursor = frame((9, 7)), (7, 5)
    assert texts(seen.state, seen.status)["r"] == str(values[texel[1], texel[0], 0])


def test_the_guides_are_those_of_the_pixel(renderer):
    ids = np.arange(SIZE[0] * SIZE[1], dtype=np.float64).reshape(SIZE[1], SIZE[0])
    packet = frame(SIZE, direct=ids, indirect=0.5, albedo=(0.25, 0.5, 1.0), emission=1.0, depth=2.0 + ids,
                   shift=(3.0, -0.5), object_id=ids)  # fmt: skip
    result = renderer.run(packet, Config(), "none")
    x, y = 7, 3
    index = y * SIZE[0] + x
    state = State(Config(), "none")
    shown = texts(state, Status("", "", SIZE, packet=packet, result=result, cursor=(x, y)))
    wanted = [(index + 0.5) * albedo + 1.0 for albedo in (0.25, 0.5, 1.0)]
    assert shown["noisy radiance"] == "  ".join(f"{value:.4g}" for value in wanted)
    assert shown["albedo"] == "0.25  0.5  1"
    assert shown["normal"] == "0  0  1"
    assert shown["depth"] == f"{2 + index}"
    assert shown["motion, pixels"] == "3  -0.5"
    assert shown["object"] == str(index)
    assert shown["history"] == "this method keeps none"
    picture = read(result.outputs["display"])[y, x]
    assert shown["r"] == f"{round(picture[0] * 255)} / 255"
    assert inspect(state, Status("", "", SIZE, packet=packet, result=result, cursor=None)) == []


def test_of_a_miss_there_is_only_light(renderer):
    packet = with_sky(frame(SIZE, emission=0.5), np.ones(SIZE[::-1], bool))
    result = renderer.run(packet, Config(), "none")
    shown = texts(State(Config(), "none"), Status("", "", SIZE, packet=packet, result=result, cursor=(1, 1)))
    assert shown["noisy radiance"] == "0.5  0.5  0.5"
    assert "left the scene" in shown["object"]
    assert "normal" not in shown


@pytest.mark.parametrize("denoiser", ["svgf", "accumulate"])
def test_the_history_is_told_or_why_there_is_none(renderer, denoiser):
    still = frame(SIZE)
    keep = (f"{denoiser}.reproject.out_reprojection",)
    ids = np.zeros(SIZE[::-1])
    ids[:, 9:] = 1.0

    first = history_reading(renderer.run(still, Config(), denoiser, keep=keep), (2, 5))
    assert first.label == "no history"
    assert first.text == f"{REJECTIONS[-1]} (first use)"
    assert first.swatch == REJECTION_COLORS[-1]
    assert history_reading(renderer.run(still, Config(), denoiser, keep=keep), (2, 5)).text == "1 frame"
    assert history_reading(renderer.run(still, Config(), denoiser, keep=keep), (2, 5)).text == "2 frames"

    result = renderer.run(frame(SIZE, object_id=ids), Config(), denoiser, keep=keep)
    assert history_reading(result, (2, 5)).text == "3 frames"
    assert history_reading(result, (13, 5)).text == REJECTIONS[-4]

    result = renderer.run(frame(SIZE, object_id=ids, previous_depth=2 * DEPTH), Config(), denoiser, keep=keep)
    assert history_reading(result, (2, 5)).text == REJECTIONS[-5]
    result = renderer.run(frame(SIZE, object_id=ids), Config(), denoiser, keep=keep, reset="by key")
    assert history_reading(result, (2, 5)).text == f"{REJECTIONS[-1]} (reset: by key)"


def test_what_was_not_kept_is_not_read(renderer):
    """The frame may have been begun before the panel was opened."""
    config = Config(svgf=replace(Svgf(), variance_guided=False, separate=False))
    result = renderer.run(frame(SIZE), config, "svgf")
    plan = replace(result.plan, keep=(), slot_of={})
    shown = history_reading(replace(result, plan=plan), (1, 1))
    assert shown.text == "from the next frame on"


# ----------------------------------------------------------------------------------------------------------- with ImGui


@pytest.fixture
def layer(ctx):
    made = ImGuiLayer(ctx)
    yield made
    made.release()


WINDOW = (640, 480)


def draw(ctx, layer: ImGuiLayer, state: State, status: Status) -> np.ndarray:
    """(H, W, 4) of a window with the controls at its top left, and the inspector."""
    screen = ctx.texture(WINDOW, 4)
    target = ctx.framebuffer([screen])
    target.use()
    target.clear()
    with layer.frame(WINDOW, WINDOW, 1.0, 0.1):
        imgui.set_next_window_pos(ImVec2(0, 0))
        imgui.set_next_window_size(ImVec2(300, 470))
        imgui.begin("controls", None, imgui.WindowFlags_.no_decoration)
        draw_controls(state, status)
        imgui.end()
        draw_inspector(state, status)
    image = read(screen)
    ctx.detect_framebuffer(0).use()
    target.release()
    screen.release()
    return image


@pytest.fixture
def shown(renderer):
    """State and status of the second frame of a noisy wall, everything kept."""
    packet = frame(SIZE, direct=noise(SIZE, 3))
    state = State(Config(), "svgf")
    plan = renderer.plan(packet, state.config, "svgf")
    state.textures = tuple(tex.name for tex in (*plan.imports, *plan.slot_of, *plan.feeds))
    for _ in range(2):
        result = renderer.run(packet, state.config, "svgf", keep=state.textures)
    return state, Status("", "", SIZE, packet=packet, result=result, cursor=(4, 5))


def test_every_texture_has_controls_and_readings(ctx, layer, shown):
    state, status = shown
    layer.feed(Cursor(500.0, 100.0))
    for name in (PICTURE, *state.textures):
        state.view = name
        subject = find_subject(status.result.plan, name)
        assert subject is not None
        for key in {view.key for view in subject.views} if name in (REPROJECTED, "frame.motion") else ("auto",):
            state.look.channels = key
            before = replace(state.look)
            drawn = draw(ctx, layer, state, status)
            assert drawn[-200:, :300].std() > 0.0, (name, key)
            assert state.look == before, "nothing was touched"


def test_the_inspector_is_beside_the_mouse_and_out_of_the_way_of_panels(ctx, layer, shown):
    state, status = shown

    def seen() -> list[int]:
        """Columns beside the controls in which something is drawn."""
        draw(ctx, layer, state, status)
        return np.flatnonzero(draw(ctx, layer, state, status)[..., 301:, 3].max(0)).tolist()

    layer.feed(Cursor(310.0, 100.0))
    columns = seen()
    assert columns
    assert min(columns) + 301 > 310, "right of the mouse, where there is room"
    layer.feed(Cursor(630.0, 100.0))
    assert max(seen()) + 301 < 630
    state.look.zoom = 8
    assert max(seen()) + 301 < 630 - 8 * 8, "beside the magnifier"
    state.look.zoom = 0
    state.looking = True
    assert not seen()
    state.looking, status.cursor = False, None
    assert not seen()
    status.cursor = (4, 5)
    layer.feed(Cursor(100.0, 100.0))
    assert not seen(), "the mouse is over the controls"


def test_buttons_lead_to_the_neighbours(ctx, layer, shown):
    state, status = shown
    state.view = state.textures[4]
    padding = 12.0

    def click(x: float) -> None:
        layer.feed(Cursor(x, padding + 8.0))
        draw(ctx, layer, state, status)
        for pressed in (True, False):
            layer.feed(MouseButton(0, pressed))
            draw(ctx, layer, state, status)

    draw(ctx, layer, state, status)
    click(padding + 6.0)
    assert state.view == state.textures[3]
    click(padding + 34.0)
    assert state.view == state.textures[4]
