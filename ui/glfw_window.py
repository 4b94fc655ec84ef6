"""The window itself: glfw behind events with names, so that nobody else needs to know glfw."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any, Final

import glfw
import moderngl

from errors import Notices, UserError
from gl.context import REQUIRED_VERSION, check_version

Size = tuple[int, int]

_KEY_NAMES: Final = {
    value: name.removeprefix("KEY_").removeprefix("LEFT_").removeprefix("RIGHT_")
    for name, value in vars(glfw).items()
    if name.startswith("KEY_") and name not in ("KEY_UNKNOWN", "KEY_LAST")
} | {glfw.KEY_KP_ADD: "EQUAL", glfw.KEY_KP_SUBTRACT: "MINUS"}
_ADVICE: Final = "app.py doctor says what is missing; app.py render works without a window"


@dataclass(frozen=True)
class Key:
    """``name`` as in :class:`ui.keys.Binding`. Repetitions of a held key are no events."""

    name: str
    pressed: bool


@dataclass(frozen=True)
class Char:
    """Text typed: a Unicode code point."""

    codepoint: int


@dataclass(frozen=True)
class MouseButton:
    """``button``: 0 left, 1 right, 2 middle."""

    button: int
    pressed: bool


@dataclass(frozen=True)
class Cursor:
    """Where the mouse is: to the right and down, in screen coordinates, without bounds while it is captured."""

    x: float
    y: float


@dataclass(frozen=True)
class Wheel:
    """Steps of the mouse wheel, positive away from the hand; ``sideways``: of a second wheel, or of two fingers."""

    steps: float
    sideways: float = 0.0


@dataclass(frozen=True)
class DroppedFiles:
    """Files let go of above the window."""

    paths: tuple[str, ...]


@dataclass(frozen=True)
class Focus:
    """The keyboard came to the window, or left it: keys may then be released without an event."""

    gained: bool


@dataclass(frozen=True)
class Exposed:
    """What the window shows has to be drawn again: it was resized or uncovered."""


Event = Key | Char | MouseButton | Cursor | Wheel | DroppedFiles | Focus | Exposed


class _Loader:
    """Finds OpenGL's functions through glfw, whatever made the context: GLX, EGL, WGL. moderngl's own search could find
    another context of this process."""

    def load_opengl_function(self, name: str) -> int:
        return int(glfw.get_proc_address(name) or 0)

    def __enter__(self) -> _Loader:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def release(self) -> None:
        pass


class Window:
    """A window with an OpenGL context, hidden until :meth:`show`. ``with Window(...)`` or :meth:`close` frees both.

    ``picture``: size in pixels of what it will show; the window begins at twice that size if the monitor has room.

    Only :meth:`wake` may be called from any thread; all else belongs to the main thread.

    Raises:
        UserError: there is no display, no window, no OpenGL, or one older than 4.3.
    """

    def __init__(self, title: str, picture: Size) -> None:
        self._events: list[Event] = []
        self._problems = Notices()
        self._printed = 0
        self._captured = False
        # Callbacks only take notes: an exception in one would surface in whichever thread calls glfw next.
        glfw.set_error_callback(self._note_problem)
        if not glfw.init():
            glfw.set_error_callback(None)  # type: ignore[arg-type]  # None: glfw's own one
            raise UserError(f"no window: {self._last_problem()}", _ADVICE)
        try:
            self._handle = self._open(title, picture)
            glfw.make_context_current(self._handle)
            # The stubs know of no other loaders than moderngl's own.
            self.ctx = moderngl.create_context(require=0, context=_Loader())  # type: ignore[arg-type]
            check_version(self.ctx)
        except BaseException:
            self._terminate()
            raise
        glfw.swap_interval(1)
        self._listen()

    def __enter__(self) -> Window:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def closing(self) -> bool:
        """Whether someone closed the window by its frame."""
        return bool(glfw.window_should_close(self._handle))

    @property
    def hidden(self) -> bool:
        """Whether nothing of the window can be seen: minimised, unmapped, or without any area."""
        seen = glfw.get_window_attrib(self._handle, glfw.VISIBLE)
        return bool(not seen or glfw.get_window_attrib(self._handle, glfw.ICONIFIED) or min(self.framebuffer_size) < 1)

    @property
    def framebuffer_size(self) -> Size:
        """Width and height in pixels, which on some screens are smaller than the unit of window coordinates."""
        width, height = glfw.get_framebuffer_size(self._handle)
        return int(width), int(height)

    @property
    def size(self) -> Size:
        """Width and height in screen coordinates, the unit of :class:`Cursor`."""
        width, height = glfw.get_window_size(self._handle)
        return int(width), int(height)

    @property
    def content_scale(self) -> float:
        """How much larger than on an ordinary screen text must be drawn to look as large, in pixels."""
        return float(glfw.get_window_content_scale(self._handle)[0])

    @property
    def handle(self) -> Any:
        """glfw's own handle, for a context that shares objects with this one."""
        return self._handle

    def show(self) -> None:
        """Make the window visible."""
        glfw.show_window(self._handle)

    def set_title(self, title: str) -> None:
        glfw.set_window_title(self._handle, title)

    def capture(self, captured: bool) -> None:
        """Hide the mouse and let it move without bounds, or give it back."""
        if captured == self._captured:
            return
        self._captured = captured
        if captured and glfw.raw_mouse_motion_supported():
            glfw.set_input_mode(self._handle, glfw.RAW_MOUSE_MOTION, glfw.TRUE)
        glfw.set_input_mode(self._handle, glfw.CURSOR, glfw.CURSOR_DISABLED if captured else glfw.CURSOR_NORMAL)

    def wait(self, seconds: float) -> list[Event]:
        """What happened since the last call.

        Sleeps until something does, :meth:`wake` is called, or ``seconds`` pass.
        """
        glfw.wait_events_timeout(seconds)
        for line in self._problems.lines[self._printed :]:
            print(f"glfw: {line}", file=sys.stderr)
        self._printed = len(self._problems.lines)
        events, self._events[:] = self._events[:], []
        return events

    def wake(self) -> None:
        """End a :meth:`wait`, this one or the next. From any thread."""
        glfw.post_empty_event()

    def swap(self) -> None:
        """Show what was drawn."""
        glfw.swap_buffers(self._handle)

    def close(self) -> None:
        """Free context and window. Everything made with the context must be released before."""
        self.ctx.release()
        self._terminate()

    def _open(self, title: str, picture: Size) -> Any:  # glfw's type of windows has no public name
        handle = create_hidden(first_size(picture, _room()), title)
        if not handle:
            raise UserError(f"no window with OpenGL 4.3: {self._last_problem()}", _ADVICE)
        return handle

    def _listen(self) -> None:
        note = self._events.append
        glfw.set_key_callback(self._handle, lambda _, key, code, action, mods: self._note_key(key, action))
        glfw.set_mouse_button_callback(self._handle, lambda _, button, action, mods: self._note_button(button, action))
        glfw.set_cursor_pos_callback(self._handle, lambda _, x, y: note(Cursor(x, y)))
        glfw.set_char_callback(self._handle, lambda _, codepoint: note(Char(codepoint)))
        glfw.set_scroll_callback(self._handle, lambda _, x, y: note(Wheel(y, x)))
        # The stubs have GLFW's own three arguments, but the wrapper hands over a list.
        glfw.set_drop_callback(self._handle, lambda _, paths: note(DroppedFiles(tuple(paths))))  # type: ignore[arg-type,misc]
        glfw.set_window_focus_callback(self._handle, lambda _, focused: note(Focus(bool(focused))))
        glfw.set_window_refresh_callback(self._handle, lambda _: note(Exposed()))
        glfw.set_framebuffer_size_callback(self._handle, lambda _, width, height: note(Exposed()))

    def _note_problem(self, code: int, text: str | bytes) -> None:
        self._problems.add(text.decode(errors="replace") if isinstance(text, bytes) else text)

    def _note_key(self, key: int, action: int) -> None:
        if action != glfw.REPEAT and key in _KEY_NAMES:
            self._events.append(Key(_KEY_NAMES[key], action == glfw.PRESS))

    def _note_button(self, button: int, action: int) -> None:
        if button <= glfw.MOUSE_BUTTON_MIDDLE:
            self._events.append(MouseButton(button, action == glfw.PRESS))

    def _last_problem(self) -> str:
        return self._problems.lines[-1] if self._problems.lines else "glfw gives no reason"

    @staticmethod
    def _terminate() -> None:
        glfw.terminate()  # destroys the window as well
        glfw.set_error_callback(None)  # type: ignore[arg-type]  # None: glfw's own one


def create_hidden(size: Size, title: str) -> Any:
    """glfw's handle of a window that is not shown, with OpenGL as this program needs it; false if there can be none."""
    glfw.default_window_hints()
    for hint, value in (
        (glfw.VISIBLE, glfw.FALSE),
        (glfw.CONTEXT_VERSION_MAJOR, REQUIRED_VERSION // 100),
        (glfw.CONTEXT_VERSION_MINOR, REQUIRED_VERSION // 10 % 10),
        (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
        (glfw.DEPTH_BITS, 0),
        (glfw.STENCIL_BITS, 0),
    ):
        glfw.window_hint(hint, value)
    return glfw.create_window(*size, title, None, None)


def _room() -> Size:
    """Size of the part of the main monitor that windows may cover, in screen coordinates; (0, 0) without a monitor."""
    monitor = glfw.get_primary_monitor()
    if not monitor:
        return 0, 0
    _, _, width, height = glfw.get_monitor_workarea(monitor)
    return int(width), int(height)


def first_size(picture: Size, room: Size) -> Size:
    """Window size to begin with: twice the picture's if that fits, else its own, shrunk if even that does not fit."""
    if 2 * picture[0] <= room[0] and 2 * picture[1] <= room[1]:
        return 2 * picture[0], 2 * picture[1]
    if min(room) < 1:
        return picture
    scale = min(1.0, room[0] / picture[0], room[1] / picture[1])
    return max(1, round(picture[0] * scale)), max(1, round(picture[1] * scale))
