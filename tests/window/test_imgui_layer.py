"""ImGui on an OpenGL context that is not its own: what it takes, draws, leaves behind."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from gl.renderer import read
from ui import theme
from ui.glfw_window import Char, Cursor, DroppedFiles, Exposed, Focus, Key, MouseButton, Wheel
from ui.imgui_layer import ImGuiLayer
from ui.present import Presenter

SIZE = (320, 240)


@pytest.fixture
def screen(ctx):
    texture = ctx.texture(SIZE, 4)
    target = ctx.framebuffer([texture])
    target.use()
    target.clear(0.0, 0.25, 0.5)
    yield texture
    ctx.detect_framebuffer(0).use()
    target.release()
    texture.release()


@pytest.fixture
def layer(ctx, screen):
    made = ImGuiLayer(ctx)
    yield made
    made.release()


class Form:
    """A window in the top left quarter, with a text to be written and a region to be scrolled."""

    def __init__(self) -> None:
        self.text = ""
        self.scroll = 0.0

    def __call__(self) -> None:
        imgui.set_next_window_pos((0, 0))
        imgui.set_next_window_size((SIZE[0] / 2, SIZE[1] / 2))
        imgui.begin("form", None, theme.FIXED | imgui.WindowFlags_.no_title_bar)
        _, self.text = imgui.input_text("##text", self.text)
        imgui.dummy((10, 1000))
        self.scroll = imgui.get_scroll_y()
        imgui.end()


INSIDE, OUTSIDE = Cursor(30.0, 18.0), Cursor(300.0, 200.0)


def frames(layer: ImGuiLayer, form: Form, count: int = 2) -> None:
    for _ in range(count):
        with layer.frame(SIZE, SIZE, 1.0, 0.1):
            form()


def feed(layer: ImGuiLayer, form: Form, *events) -> list[bool]:
    answers = []
    for event in events:
        answers.append(layer.feed(event))
        frames(layer, form)
    return answers


def test_it_draws_into_what_is_bound_and_nowhere_else(layer, screen):
    frames(layer, Form())
    picture = read(screen)[::-1, :, :3]
    difference = np.abs(picture - [0.0, 0.25, 0.5])
    assert difference[130:].max() < 2 / 255
    assert difference[:, 170:].max() < 2 / 255
    assert difference[:100, :150].mean() > 0.1


def test_it_leaves_the_context_as_it_was(ctx, layer, screen):
    picture = ctx.texture((2, 2), 4, np.random.default_rng(1).integers(0, 256, 16, dtype=np.uint8).tobytes())
    presenter, pictures = Presenter(ctx), []
    for overlay in (False, True, False):
        target = ctx.fbo
        presenter.draw(picture, target, SIZE)
        pictures.append(read(screen))
        if overlay:
            frames(layer, Form())
    for item in (presenter, picture):
        item.release()
    np.testing.assert_array_equal(pictures[2], pictures[0])
    np.testing.assert_array_equal(pictures[1], pictures[0])


def test_text_is_typed_by_characters_and_edited_by_keys(layer):
    form = Form()
    frames(layer, form)
    feed(layer, form, INSIDE, MouseButton(0, True), MouseButton(0, False))
    assert layer.wants_keyboard
    feed(layer, form, *[Char(ord(letter)) for letter in "aσb"])
    feed(layer, form, Key("LEFT", True), Key("LEFT", False), Key("BACKSPACE", True), Key("BACKSPACE", False))
    feed(layer, form, Key("ENTER", True), Key("ENTER", False))
    assert form.text == "ab"
    assert not layer.wants_keyboard


def test_shortcuts_of_text_work(layer):
    form = Form()
    frames(layer, form)
    feed(layer, form, INSIDE, MouseButton(0, True), MouseButton(0, False), *[Char(ord(letter)) for letter in "abc"])
    feed(layer, form, Key("CONTROL", True), Key("A", True), Key("A", False), Key("X", True), Key("X", False))
    feed(layer, form, Key("V", True), Key("V", False), Key("V", True), Key("V", False), Key("CONTROL", False))
    assert form.text == "abcabc"


def test_keys_belong_to_the_program_until_something_is_typed(layer):
    form = Form()
    frames(layer, form)
    assert feed(layer, form, Key("W", True), Key("W", False), Key("TAB", True), Key("TAB", False)) == [False] * 4
    feed(layer, form, INSIDE, MouseButton(0, True), MouseButton(0, False))
    assert feed(layer, form, Key("W", True), Key("F5", True)) == [True, True]
    feed(layer, form, OUTSIDE, MouseButton(0, True), MouseButton(0, False))
    assert feed(layer, form, Key("W", True)) == [False]


def test_a_lost_focus_lets_go_of_everything(layer):
    form = Form()
    frames(layer, form)
    feed(layer, form, INSIDE, MouseButton(0, True), Key("CONTROL", True))
    assert imgui.get_io().key_ctrl
    assert feed(layer, form, Focus(False)) == [False]
    assert not imgui.get_io().key_ctrl
    assert not imgui.get_io().mouse_down[0]
    assert feed(layer, form, Focus(True), OUTSIDE) == [False, False]


def test_the_wheel_scrolls_what_is_under_the_mouse(layer):
    form = Form()
    frames(layer, form)
    assert feed(layer, form, OUTSIDE, Wheel(-1.0)) == [False, False]
    assert form.scroll == 0.0
    assert feed(layer, form, INSIDE, Wheel(-1.0)) == [True, True]
    frames(layer, form, 6)
    assert form.scroll > 0.0


def test_other_events_are_for_others(layer):
    frames(layer, Form())
    layer.feed(INSIDE)
    assert not layer.feed(DroppedFiles(("scene.glb",)))
    assert not layer.feed(Exposed())


def test_nothing_is_over_the_mouse_before_it_moves_or_after_windows_are_gone(layer):
    form = Form()
    assert not layer.wants_mouse
    frames(layer, form)
    assert not layer.wants_mouse
    assert layer.feed(INSIDE)
    with layer.frame(SIZE, SIZE, 1.0, 0.1):
        pass
    assert not layer.wants_mouse


def test_no_file_is_written(ctx, screen, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    layer = ImGuiLayer(ctx)
    frames(layer, Form(), 80)  # eight seconds: ImGui would save its settings after five
    layer.release()
    assert list(tmp_path.iterdir()) == []


def test_two_layers_do_not_get_in_each_other_s_way(ctx, layer):
    other, form, idle = ImGuiLayer(ctx), Form(), Form()
    frames(layer, form)
    frames(other, idle)
    feed(layer, form, INSIDE, MouseButton(0, True), MouseButton(0, False), Char(ord("a")))
    frames(other, idle)
    assert (form.text, idle.text) == ("a", "")
    assert layer.wants_keyboard
    assert not other.wants_keyboard
    other.release()
    feed(layer, form, Char(ord("b")))
    assert form.text == "ab"


def test_text_of_a_dense_screen_is_sharp(ctx, layer):
    """Twice the pixels hold more than the same letters stretched."""
    texture = ctx.texture((2 * SIZE[0], 2 * SIZE[1]), 4)
    target = ctx.framebuffer([texture])
    target.use()
    for _ in range(3):
        target.clear()
        with layer.frame(SIZE, texture.size, 2.0, 0.1):
            imgui.set_next_window_pos((0, 0))
            imgui.begin("text", None, theme.FIXED | imgui.WindowFlags_.no_title_bar)
            imgui.text("Sharp letters")
            imgui.end()
    image = read(texture)[::-1][:80, :200, 0]
    ctx.detect_framebuffer(0).use()
    target.release()
    texture.release()
    blocks = image.reshape(40, 2, 100, 2)
    assert np.ptp(blocks, axis=(1, 3)).max() > 0.5


def test_without_opengl_there_is_an_error(ctx: moderngl.Context, monkeypatch):
    monkeypatch.setattr(imgui.backends, "opengl3_init", lambda version: False)
    with pytest.raises(RuntimeError, match="OpenGL"):
        ImGuiLayer(ctx)
