"""Everything that Dear ImGui draws over the picture."""

from __future__ import annotations

import time

import moderngl

from ui import help, panel
from ui.glfw_window import Cursor, Event, Focus
from ui.imgui_layer import ImGuiLayer, Size
from ui.inspector import draw_inspector
from ui.state import State
from ui.status import Status


class Overlay:
    """Panel, list of keys, controls of the texture viewer, inspector: whatever of them ``state`` has switched on."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._layer = ImGuiLayer(ctx)
        self._drawn = time.perf_counter()

    def feed(self, event: Event) -> bool:
        """Hand in what happened; returns whether it was meant for a widget and for nobody else."""
        return self._layer.feed(event)

    def resume(self, cursor: Cursor) -> None:
        """Drawn again after a while in which nothing was handed in: no key is held, and the mouse is at ``cursor``."""
        for event in (Focus(False), Focus(True), cursor):
            self._layer.feed(event)

    def draw(self, window: Size, framebuffer: Size, content_scale: float, state: State, status: Status) -> None:
        """Draw over the framebuffer that is bound; arguments as of :meth:`ui.imgui_layer.ImGuiLayer.frame`."""
        now, before = time.perf_counter(), self._drawn
        self._drawn = now
        with self._layer.frame(window, framebuffer, content_scale, now - before):
            if state.help:
                help.draw()
            if state.hud:
                panel.draw(state, status)
            if state.inspect:
                draw_inspector(state, status)

    def release(self) -> None:
        self._layer.release()
