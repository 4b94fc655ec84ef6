"""What turns the tracer's packets into pictures: the graph that is wanted or, while it is compiled, the last one."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace

import moderngl

from config import Config
from gl.background import Compiler
from gl.executor import Result
from gl.plan import Plan
from gl.profiler import Profiler
from gl.renderer import Renderer
from gl.shader import ShaderError
from raytrace.frame import FramePacket
from ui.inspector import wanted_textures
from ui.state import PICTURE, State


@dataclass(frozen=True)
class Graph:
    """Which graph a frame runs through: the arguments of :meth:`gl.renderer.Renderer.run`."""

    config: Config
    denoiser: str
    keep: tuple[str, ...] = ()
    split: bool = False


class Filters:
    """Runs the graph that ``state`` asks for as soon as its programs are there, and until then the one before.

    ``open_context``: makes a second context for the compiler's thread; None: everything is compiled on this one.
    ``wake``: called, from that thread, when there is something new.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        open_context: Callable[[], moderngl.Context] | None,
        wake: Callable[[], None],
    ) -> None:
        with ExitStack() as stack:
            self._renderer = Renderer(ctx)
            stack.callback(self._renderer.release)
            self._compiler = Compiler(self._renderer.executor, open_context=open_context, notify=wake)
            stack.callback(self._compiler.close)
            self._stack = stack.pop_all()
        self._profiler = Profiler(ctx)
        self._shown: Graph | None = None
        self.errors: list[str] = []
        self.profile: Profiler | None = None

    @property
    def progress(self) -> str:
        """What is being compiled, "" for nothing."""
        return self._compiler.text

    def run(self, packet: FramePacket, state: State) -> Result:
        """Filter ``packet`` and note in ``state`` which textures there are to look at."""
        self.errors = [str(error) for error in self._compiler.reload()]
        graph = self._wanted(packet, state)
        if graph != self._shown and not self._ready(packet, graph):
            # The old picture stays: it goes on with new frames. At first there is none but the noisy one.
            graph = self._shown or Graph(graph.config, "none")
        self._shown = graph
        self.profile = self._profiler if state.hud else None
        reset, state.reset = state.reset, ""
        return self._renderer.run(
            packet, graph.config, graph.denoiser, keep=graph.keep, split=graph.split, reset=reset, profiler=self.profile
        )

    def release(self) -> None:
        """Free everything."""
        self._stack.close()

    def _wanted(self, packet: FramePacket, state: State) -> Graph:
        config = state.config
        if config.display.mark_bad == "auto":
            # Where somebody reads the counters: marking costs a pass.
            display = replace(config.display, mark_bad="on" if state.hud else "off")
            config = replace(config, display=display)
        split = state.split and state.denoiser != "none"
        plan = self._renderer.plan(packet, config, state.denoiser, split=split)
        state.textures = _names(plan)
        if state.view not in (PICTURE, *state.textures):
            state.view, state.news = PICTURE, f"{state.denoiser} has no {state.view}"
        return Graph(config, state.denoiser, wanted_textures(state, plan), split)

    def _ready(self, packet: FramePacket, graph: Graph) -> bool:
        plan = self._renderer.plan(packet, graph.config, graph.denoiser, graph.keep, split=graph.split)
        try:
            return self._compiler.ready(plan, packet.size)
        except ShaderError as error:
            self.errors.append(str(error))
            return False


def _names(plan: Plan) -> tuple[str, ...]:
    """Every texture of ``plan`` in the order in which they are made, imports first."""
    made = [tex.name for node in plan.passes for tex in node.writes.values()]
    return tuple(dict.fromkeys([*(tex.name for tex in plan.imports), *made]))
