"""Dear ImGui on our own window: events in, widgets drawn over the picture. Works without any window, too.

imgui-bundle's backend for glfw is left alone: it is linked to a libglfw of its own, which knows nothing of our window.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import moderngl
from imgui_bundle import ImVec2, imgui

from ui import theme
from ui.glfw_window import Char, Cursor, Event, Focus, Key, MouseButton, Wheel

Size = tuple[int, int]

_SHORTEST: Final = 1e-4  # seconds; ImGui refuses to draw two frames at the same time

_NAMED_KEYS: Final = {
    "TAB": imgui.Key.tab,
    "ENTER": imgui.Key.enter,
    "KP_ENTER": imgui.Key.keypad_enter,
    "ESCAPE": imgui.Key.escape,
    "SPACE": imgui.Key.space,
    "BACKSPACE": imgui.Key.backspace,
    "DELETE": imgui.Key.delete,
    "INSERT": imgui.Key.insert,
    "LEFT": imgui.Key.left_arrow,
    "RIGHT": imgui.Key.right_arrow,
    "UP": imgui.Key.up_arrow,
    "DOWN": imgui.Key.down_arrow,
    "HOME": imgui.Key.home,
    "END": imgui.Key.end,
    "PAGE_UP": imgui.Key.page_up,
    "PAGE_DOWN": imgui.Key.page_down,
}
_LETTERS: Final = {letter.upper(): getattr(imgui.Key, letter) for letter in "acvxyz"}  # copy, paste, undo
_KEYS: Final = _NAMED_KEYS | _LETTERS
_MODIFIERS: Final = {
    "CONTROL": (imgui.Key.left_ctrl, imgui.Key.mod_ctrl),
    "SHIFT": (imgui.Key.left_shift, imgui.Key.mod_shift),
    "ALT": (imgui.Key.left_alt, imgui.Key.mod_alt),
    "SUPER": (imgui.Key.left_super, imgui.Key.mod_super),
}


class ImGuiLayer:
    """A Dear ImGui of its own. Nothing is read from or written to disk, but the fonts.

    ``ctx``: the context to draw with; it must be current whenever a method is called.

    Raises:
        RuntimeError: ImGui's renderer finds no functions of OpenGL.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._context = imgui.create_context()
        self._enter()
        io = imgui.get_io()
        io.set_ini_filename(None)
        io.set_log_filename("")
        io.config_windows_move_from_title_bar_only = True
        if not imgui.backends.opengl3_init("#version 430"):
            imgui.destroy_context(self._context)
            raise RuntimeError("Dear ImGui finds no functions of OpenGL")
        theme.load_fonts(io.fonts)
        self._scale = 0.0
        self._cursor: tuple[float, float] | None = None
        self._buttons: set[int] = set()

    @property
    def wants_keyboard(self) -> bool:
        """Whether keys are for a widget: something is typed or dragged, or a list is open."""
        self._enter()
        return imgui.get_io().want_capture_keyboard or self._list_is_open

    @property
    def wants_mouse(self) -> bool:
        """Whether the mouse is over a widget, or has not let go of one."""
        self._enter()
        # ImGui tells how it was when it last drew. A click that comes with the movement before it, which on slow
        # machines is common, is judged by where the mouse is now.
        if self._buttons or self._list_is_open:
            return imgui.get_io().want_capture_mouse
        return self._over_window

    def feed(self, event: Event) -> bool:
        """Hand in what happened; returns whether it was meant for a widget and for nobody else.

        Characters are for widgets only; a button is theirs if it went down over one.
        """
        self._enter()
        io = imgui.get_io()
        match event:
            case Key(name, pressed):
                taken = self.wants_keyboard
                self._feed_key(name, pressed)
                return taken
            case Char(codepoint):
                io.add_input_character(codepoint)
                return True
            case MouseButton(button, pressed):
                taken = self.wants_mouse
                (self._buttons.add if pressed else self._buttons.discard)(button)
                io.add_mouse_button_event(button, pressed)
                return taken
            case Cursor(x, y):
                self._cursor = (x, y)
                io.add_mouse_pos_event(x, y)
                return self.wants_mouse
            case Wheel(steps, sideways):
                io.add_mouse_wheel_event(sideways, steps)
                return self.wants_mouse
            case Focus(gained):
                self._buttons.clear()
                io.add_focus_event(gained)
        return False

    @contextmanager
    def frame(self, window: Size, framebuffer: Size, content_scale: float, seconds: float) -> Iterator[None]:
        """Widgets called inside are drawn into the framebuffer that is bound at the end.

        Args:
            window: width and height in screen coordinates, the unit of :class:`ui.glfw_window.Cursor`.
            framebuffer: width and height in pixels.
            content_scale: how much larger than on an ordinary screen text must be drawn to look as large, in pixels.
            seconds: since the frame before.
        """
        self._enter()
        density = framebuffer[0] / max(window[0], 1)  # pixels in a screen coordinate
        io = imgui.get_io()
        io.display_size = ImVec2(*window)
        io.display_framebuffer_scale = ImVec2(density, framebuffer[1] / max(window[1], 1))
        io.delta_time = max(seconds, _SHORTEST)
        scale = content_scale / max(density, 1e-3)
        if scale != self._scale:
            theme.apply(scale)
            self._scale = scale
        imgui.backends.opengl3_new_frame()
        imgui.new_frame()
        yield
        imgui.render()
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())

    def release(self) -> None:
        """Free everything that was made with the context."""
        self._enter()
        imgui.backends.opengl3_shutdown()
        imgui.destroy_context(self._context)

    def _enter(self) -> None:
        imgui.set_current_context(self._context)

    @property
    def _list_is_open(self) -> bool:
        return imgui.is_popup_open("", imgui.PopupFlags_.any_popup)

    @property
    def _over_window(self) -> bool:
        """Whether the mouse is over a window as they were drawn last."""
        if self._cursor is None:
            return False
        x, y = self._cursor
        for window in self._context.windows:
            left, top = window.pos
            if (
                window.active
                and not window.hidden
                and left <= x < left + window.size.x
                and top <= y < top + window.size.y
            ):
                return True
        return False

    def _feed_key(self, name: str, pressed: bool) -> None:
        io = imgui.get_io()
        for key in _MODIFIERS.get(name, (_KEYS[name],) if name in _KEYS else ()):
            io.add_key_event(key, pressed)
