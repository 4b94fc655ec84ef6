"""What turns the tracer's packets into pictures: the graph that is wanted or, while it is compiled, the last one."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace

import moderngl

from config import Config
from gl.background import Compiler
from gl.executor import Result
from gl.plan import Plan
from gl.profiler import Profiler
from gl.renderer import Renderer
from gl.shader import ShaderError
from gl.variants import Variant, variants
from raytrace.frame import FramePacket
from ui.inspector import wanted_textures
from ui.keys import METHODS_ON_KEYS
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
        self._waiting = False
        self._prepared: tuple[object, ...] = ()
        self._shown: Graph | None = None
        self._packet: FramePacket | None = None
        self._seen: set[Variant] = set()  # what has been drawn with, compiled in the background or not
        self.errors: list[str] = []
        self.profile: Profiler | None = None

    @property
    def progress(self) -> str:
        """What is being compiled before the graph that is wanted can be shown, "" for nothing."""
        return self._compiler.text if self._waiting else ""

    def run(self, packet: FramePacket, state: State) -> Result | None:
        """Filter ``packet`` and note in ``state`` which textures there are to look at.

        None: no graph's programs are there for a frame like this, so the picture that is shown stays.
        """
        self.errors = [str(error) for error in self._compiler.reload()]
        wanted = self._wanted(packet, state)
        graph = self._choose(packet, wanted)
        self._waiting = graph != wanted
        if graph is None:
            return None
        if not self._waiting:
            self._prepare_neighbours(packet, wanted)
        self._shown = graph
        self.profile = self._profiler if state.hud else None
        reset, state.reset = state.reset, ""
        again, self._packet = packet is self._packet, packet
        result = self._renderer.run(
            packet,
            graph.config,
            graph.denoiser,
            keep=graph.keep,
            split=graph.split,
            reset=reset,
            profiler=self.profile,
            again=again,
        )
        self._seen.update(variants(result.plan, packet.size))
        return result

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

    def _choose(self, packet: FramePacket, wanted: Graph) -> Graph | None:
        """The graph wanted if ``packet`` can run through it without compiling anything, else what can."""
        # Asked for every frame: another size or scene may need other programs of the same graph.
        try:
            if self._compiler.ready(self._plan(packet, wanted), packet.size):
                return wanted
        except ShaderError as error:
            self.errors.append(str(error))
        if self._shown is None:
            # There is no old picture yet: the noisy frame's few shaders are waited for.
            return Graph(wanted.config, "none")
        missing = self._renderer.executor.unprepared(variants(self._plan(packet, self._shown), packet.size))
        return self._shown if self._seen.issuperset(missing) else None

    def _prepare_neighbours(self, packet: FramePacket, shown: Graph) -> None:
        """Let the other methods' programs be compiled while nobody waits for them, so that keys act at once."""
        now = (shown.config, shown.split, packet.size, packet.scene_id)
        if now == self._prepared:
            return
        for denoiser in METHODS_ON_KEYS:
            plan = self._plan(packet, replace(shown, denoiser=denoiser, keep=()))
            with suppress(ShaderError):  # told when that method is shown
                if not self._compiler.ready(plan, packet.size):
                    return
        self._prepared = now

    def _plan(self, packet: FramePacket, graph: Graph) -> Plan:
        return self._renderer.plan(packet, graph.config, graph.denoiser, graph.keep, split=graph.split)


def _names(plan: Plan) -> tuple[str, ...]:
    """Every texture of ``plan`` in the order in which they are made, imports first."""
    made = [tex.name for node in plan.passes for tex in node.writes.values()]
    return tuple(dict.fromkeys([*(tex.name for tex in plan.imports), *made]))
