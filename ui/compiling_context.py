"""A second OpenGL context of the window's driver, for the thread that compiles shaders (:mod:`gl.background`)."""

from __future__ import annotations

import glfw
import moderngl

from errors import UserError
from gl.unlocked import UnlockedLoader
from ui.glfw_window import create_hidden


class CompilingContext:
    """A context behind a window that is never shown. ``with CompilingContext()`` or :meth:`close` frees both.

    It shares no objects with the window's context: nothing of what it makes is used there, and drivers guard every call
    by locks where contexts share. Made and closed on the main thread, while a :class:`ui.glfw_window.Window` is open.

    Raises:
        UserError: there can be no second window; all can be compiled in the first context as well.
    """

    def __init__(self) -> None:
        self._handle = create_hidden((1, 1), "shaders")
        if not self._handle:
            raise UserError("no second OpenGL context: shaders are compiled between frames")

    def __enter__(self) -> CompilingContext:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def open(self) -> moderngl.Context:
        """Make the context current on the calling thread; released there, it belongs to no thread again."""
        glfw.make_context_current(self._handle)
        loader = UnlockedLoader(lambda name: int(glfw.get_proc_address(name) or 0), end=_let_go)
        return moderngl.create_context(require=0, context=loader)  # type: ignore[arg-type]  # as in ui.glfw_window

    def close(self) -> None:
        """Free the window; the thread that had the context must have released it."""
        glfw.destroy_window(self._handle)


def _let_go() -> None:
    glfw.make_context_current(None)  # type: ignore[arg-type]  # None: no context
