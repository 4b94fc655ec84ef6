"""Someone at the mouse and the keyboard of a panel that no window shows: synthetic events, real widgets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui
from numpy.typing import NDArray

from config import load
from gl.renderer import read
from ui import panel, theme, widgets
from ui.glfw_window import Char, Cursor, Event, Key, MouseButton
from ui.imgui_layer import ImGuiLayer
from ui.state import State
from ui.status import Status

Size = tuple[int, int]

TALL: Size = (1200, 1500)
"""A screen that no part of the panel has to be scrolled on."""

_WIDGETS = "slider_float slider_int checkbox button small_button begin_combo selectable collapsing_header tree_node_ex"


class Box(NamedTuple):
    """Where a widget is, in screen coordinates from the top left."""

    left: float
    top: float
    right: float
    bottom: float

    def at(self, share: float) -> tuple[float, float]:
        """A point in the middle of its height."""
        return self.left + share * (self.right - self.left), (self.top + self.bottom) / 2.0


class Hand:
    """A layer on a screen of its own, what it shows, and where the widgets of the last frame are.

    ``boxes``: by label, which in this program is unique among the widgets that are visible. ``words``: every text of
    the last frame with its colour.
    """

    def __init__(self, ctx: moderngl.Context, size: Size = TALL, scale: float = 1.0, density: float = 1.0) -> None:
        self.ctx, self.size, self.scale = ctx, size, scale
        self.pixels = round(size[0] * density), round(size[1] * density)
        self.layer = ImGuiLayer(ctx)
        self.state = State(load(), "svgf", hud=True)
        self.status = Status("cornell", "llvmpipe (LLVM 15.0.6, 256 bits)", (640, 360))
        self.body: Callable[[], None] = lambda: panel.draw(self.state, self.status)
        self.boxes: dict[str, Box] = {}
        self.words: list[tuple[str, tuple[float, ...]]] = []
        self.painting = False
        self.screen = ctx.texture(self.pixels, 4)
        self._target = ctx.framebuffer([self.screen])

    def draw(self, frames: int = 1) -> None:
        """Let time pass, a tenth of a second a frame."""
        for _ in range(frames):
            self.boxes.clear()
            self.words.clear()
            self._target.use()
            self._target.clear()
            with self.layer.frame(self.size, self.pixels, self.scale, 0.1):
                self.body()
            self.ctx.detect_framebuffer(0).use()

    def picture(self) -> NDArray[np.float32]:
        """(H, W, 3) of the screen in [0, 1], row 0 on top, after one frame more."""
        self.painting = True
        self.draw()
        self.painting = False
        return read(self.screen)[::-1, :, :3]

    def said(self, part: str) -> list[tuple[str, tuple[float, ...]]]:
        """The texts shown that hold ``part``."""
        return [(text, color) for text, color in self.words if part in text]

    def feed(self, *events: Event) -> list[bool]:
        """What the layer answers to events that come between two frames, which are drawn afterwards."""
        answers = [self.layer.feed(event) for event in events]
        self.draw(2)
        return answers

    def move(self, x: float, y: float) -> None:
        self.feed(Cursor(x, y))

    def click(self, label: str, share: float = 0.5) -> None:
        """Press and release the left button on a widget."""
        self.move(*self.boxes[label].at(share))
        self.feed(MouseButton(0, True))
        self.feed(MouseButton(0, False))

    def drag(self, label: str, start: float, end: float) -> None:
        """Take a widget at one share of its width and let go at another."""
        box = self.boxes[label]
        self.move(*box.at(start))
        self.feed(MouseButton(0, True))
        self.move(*box.at(end))
        self.feed(MouseButton(0, False))

    def type(self, text: str) -> None:
        """Keys that also make characters, then nothing more."""
        for letter in text:
            name = letter.upper()
            self.feed(Key(name, True), Char(ord(letter)), Key(name, False))

    def press(self, *keys: str) -> list[bool]:
        """One key after the other; whether each was meant for a widget."""
        answers = []
        for name in keys:
            answers += self.feed(Key(name, True))
            self.feed(Key(name, False))
        return answers

    def edit(self, label: str) -> None:
        """Ctrl-click: the number of a slider can be typed then."""
        self.feed(Key("CONTROL", True))
        self.click(label)
        self.feed(Key("CONTROL", False))

    def release(self) -> None:
        self.layer.release()
        self._target.release()
        self.screen.release()


@contextmanager
def watching(hand: Hand, monkeypatch: pytest.MonkeyPatch) -> Iterator[Hand]:
    """``hand``, with its ``boxes`` and ``words`` filled by every frame. Only :meth:`Hand.picture` costs any drawing."""
    render = imgui.backends.opengl3_render_draw_data
    with monkeypatch.context() as patch:
        patch.setattr(imgui.backends, "opengl3_render_draw_data", lambda data: hand.painting and render(data))
        for name in _WIDGETS.split():
            patch.setattr(imgui, name, _noting_boxes(hand, getattr(imgui, name)))
        patch.setattr(widgets, "text", _noting_words(hand, widgets.text, 0, 1))
        patch.setattr(widgets, "put", _noting_words(hand, widgets.put, 2, 3))
        hand.draw(3)
        yield hand


def _noting_boxes(hand: Hand, widget: Any) -> Any:
    def noting(label: str, *args: Any, **kwargs: Any) -> Any:
        answer = widget(label, *args, **kwargs)
        if not (widget.__name__ == "begin_combo" and answer):  # an open one is a window, with other items
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            hand.boxes[label] = Box(low.x, low.y, high.x, high.y)
        return answer

    return noting


def _noting_words(hand: Hand, function: Any, text: int, color: int) -> Any:
    def noting(*args: Any, **kwargs: Any) -> Any:
        shade = args[color] if len(args) > color else kwargs.get("color", theme.TEXT)
        hand.words.append((args[text], (shade.x, shade.y, shade.z)))
        return function(*args, **kwargs)

    return noting
