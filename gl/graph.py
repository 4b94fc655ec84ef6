"""The render graph that denoisers are written with. Pure Python, no OpenGL.

::

    class Temporal(FragmentPass):
        shader = "svgf/temporal.frag"
        in_color = In("demodulated irradiance, linear Rec.709")
        prev_color = Prev("the same, accumulated")
        out_color = Out("rgba16f", "accumulated irradiance")
        u_alpha = Uniform("float", "[0;1] weight of the new sample")

    graph = Graph()
    history = graph.history("svgf.color", "rgba16f")
    temporal = graph.add(Temporal(u_alpha=0.2), in_color=graph.import_("noisy", "rgba32f"), prev_color=history)
    graph.feed(history, temporal.out_color)
    graph.output("display", temporal.out_color)
    plan = graph.compile()

The graph is built anew every frame: parameters are plain numbers, and switching something off is a Python ``if``.
Passes run in the order in which they are added. What no output needs is culled. No pass owns a texture.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache

from errors import did_you_mean
from gl.formats import lookup
from gl.plan import IMPORT, History, Node, Plan, Tex, compile_plan
from gl.ports import ONE_TEXEL, ComputePass, FragmentPass, GraphError, In, Out, Pass, Prev, Uniform

__all__ = [
    "ONE_TEXEL",
    "ComputePass",
    "FragmentPass",
    "Graph",
    "GraphError",
    "History",
    "In",
    "Out",
    "Outputs",
    "Pass",
    "Plan",
    "Prev",
    "Tex",
    "Uniform",
]


class Outputs:
    """The textures an added pass writes, as attributes: ``added.out_color``."""

    __slots__ = ("_node",)

    def __init__(self, node: Node) -> None:
        self._node = node

    def __getattr__(self, name: str) -> Tex:
        try:
            return self._node.writes[name]
        except KeyError:
            known = self._node.writes
            raise AttributeError(f"{self._node.name} has no output {name!r}{did_you_mean(name, known)}") from None


class Graph:
    """One frame in the making."""

    def __init__(self) -> None:
        self._nodes: list[Node] = []
        self._names: set[str] = set()
        self._scope = ""
        self._textures: dict[str, Tex] = {}
        self._histories: dict[str, History] = {}
        self._fed: dict[Tex, History] = {}
        self._outputs: dict[str, Tex] = {}

    def import_(self, name: str, fmt: str, divisor: int = 1) -> Tex:
        """A texture that is uploaded before the frame. Asking again for ``name`` returns the same handle.

        Args:
            divisor: its size is the frame's divided by this, rounded up.

        Raises:
            GraphError: unknown format, another format than before, or a pass already writes a texture of this name.
        """
        _check_format(f"import {name!r}", fmt)
        tex = self._textures.get(name)
        if tex is None:
            return self._texture(name, fmt, divisor, IMPORT)
        if tex.producer != IMPORT or tex.fmt != fmt:
            owner = "an import" if tex.producer == IMPORT else f"written by {self._nodes[tex.producer].name!r}"
            raise GraphError(f"import {name!r} as {fmt}: a texture of that name is already there ({owner}, {tex.fmt})")
        return tex

    def history(self, name: str, fmt: str, divisor: int = 1) -> History:
        """A texture that lasts from one frame to the next. Asking again for ``name`` returns the same history.

        The executor keeps histories by name, so one survives every rebuild of the graph that names it again.

        Raises:
            GraphError: unknown format, or another format or divisor than before.
        """
        _check_format(f"history {name!r}", fmt)
        history = self._histories.get(name)
        if history is None:
            history = self._histories[name] = History(name, fmt, divisor)
        elif (history.fmt, history.divisor) != (fmt, divisor):
            raise GraphError(
                f"history {name!r} is {history.fmt} with divisor {history.divisor},"
                f" asked for {fmt} with divisor {divisor}"
            )
        return history

    @contextmanager
    def scope(self, name: str) -> Iterator[None]:
        """Prefix the names of the passes added inside: ``"temporal"`` becomes ``"svgf.temporal"``. Scopes nest."""
        outer = self._scope
        self._scope = f"{outer}{name}."
        try:
            yield
        finally:
            self._scope = outer

    def add(self, work: Pass, name: str | None = None, /, **inputs: Tex | History) -> Outputs:
        """Let a pass run after those added before.

        Args:
            work: the pass with its parameters.
            name: unique in its scope; by default the class's name in snake case, numbered from 2 when repeated.
            inputs: a texture for each ``in_`` port, optional ones excepted, and a history for each ``prev_`` port.

        Returns:
            The textures it writes, named ``"<pass>.<port>"``.

        Raises:
            GraphError: a name is taken, an input is missing, unknown, of the wrong kind, or of another graph.
        """
        full = self._pass_name(work, name)
        ports = work.ports
        reads: dict[str, Tex] = {}
        prevs: dict[str, History] = {}
        for port, source in inputs.items():
            if isinstance(source, Tex) and port in ports.ins and self._textures.get(source.name) is source:
                reads[port] = source
            elif isinstance(source, History) and port in ports.prevs and self._histories.get(source.name) is source:
                prevs[port] = source
            else:
                raise self._bad_input(full, work, port, source)
        if len(inputs) < len(ports.samplers):
            _check_connected(full, work, inputs)
        index = len(self._nodes)
        writes = {
            port: self._texture(f"{full}.{port}", fmt, ports.outs[port].divisor, index)
            for port, fmt in work.formats.items()
        }
        node = Node(full, work, reads, prevs, writes)
        self._nodes.append(node)
        self._names.add(full)
        return Outputs(node)

    def feed(self, history: History, source: Tex) -> None:
        """Let ``source`` be what readers of ``history`` get next frame. Nothing is copied: it is written in place.

        Raises:
            GraphError: ``history`` is fed already, ``source`` feeds another one, is an import, or has another format.
        """
        self._own(history, "feed")
        self._own(source, f"history {history.name!r}")
        if history.source is not None:
            raise GraphError(
                f"history {history.name!r} is already fed by {history.source.name!r}, not also by {source.name!r}"
            )
        if source.producer == IMPORT:
            raise GraphError(
                f"history {history.name!r} cannot be fed by import {source.name!r}:"
                " uploads are not the graph's to keep, feed what a pass makes of it"
            )
        if source in self._fed:
            raise GraphError(
                f"{source.name!r} already feeds history {self._fed[source].name!r}, it cannot also feed"
                f" {history.name!r}: read the first history in both places"
            )
        if (history.fmt, history.divisor) != (source.fmt, source.divisor):
            raise GraphError(
                f"history {history.name!r} is {history.fmt} with divisor {history.divisor},"
                f" but {source.name!r} is {source.fmt} with divisor {source.divisor}"
            )
        history.source = source
        self._fed[source] = history

    def output(self, name: str, source: Tex) -> None:
        """Hand ``source`` to the caller as ``name``; all that it needs will run.

        Raises:
            GraphError: there is an output of that name.
        """
        self._own(source, f"output {name!r}")
        if name in self._outputs:
            raise GraphError(f"there are two outputs {name!r}: {self._outputs[name].name!r} and {source.name!r}")
        self._outputs[name] = source

    def compile(self, keep: Iterable[str] = (), alias: bool = True) -> Plan:
        """Cull and lay out; see :func:`gl.plan.compile_plan` for the errors.

        Args:
            keep: names of textures (``"svgf.temporal.out_color"``) to leave intact to the end of the frame.
            alias: let textures share memory when they are not needed at the same time.
        """
        return compile_plan(self._nodes, self._textures, self._outputs, keep, alias)

    def _texture(self, name: str, fmt: str, divisor: int, producer: int) -> Tex:
        if name in self._textures:
            raise GraphError(f"there are two textures {name!r}")
        tex = self._textures[name] = Tex(name, fmt, divisor, producer)
        return tex

    def _pass_name(self, work: Pass, name: str | None) -> str:
        if name is not None:
            full = self._scope + name
            if full in self._names:
                raise GraphError(f"there are two passes {full!r}")
            return full
        stem = full = self._scope + _snake_case(type(work).__name__)
        number = 1
        while full in self._names:
            number += 1
            full = f"{stem}{number}"
        return full

    def _bad_input(self, name: str, work: Pass, port: str, source: object) -> GraphError:
        """Why ``source`` cannot be connected to ``port``; told apart only here, because every frame passes by."""
        ports = work.ports
        if port not in ports.samplers:
            there = ", ".join(ports.samplers) or "none"
            return GraphError(f"{name} has no input {port!r}{did_you_mean(port, ports.samplers)} (inputs: {there})")
        if isinstance(source, Tex if port in ports.ins else History):
            return GraphError(f"{name}.{port}: {_describe(source)} belongs to another graph")
        wanted = "a texture of this frame" if port in ports.ins else "a history"
        return GraphError(f"{name}.{port} reads {wanted}, got {_describe(source)}")

    def _own(self, handle: Tex | History, user: str) -> None:
        """Refuse handles kept from another graph: they name textures that this frame does not have."""
        known = self._textures if isinstance(handle, Tex) else self._histories
        if known.get(handle.name) is not handle:
            raise GraphError(f"{user}: {_describe(handle)} belongs to another graph")


def _check_connected(name: str, work: Pass, inputs: Mapping[str, object]) -> None:
    for port, declared in (work.ports.ins | work.ports.prevs).items():
        if port not in inputs and not (isinstance(declared, In) and declared.optional):
            raise GraphError(f"{name}.{port} ({declared.doc}) is not connected")


@cache
def _snake_case(name: str) -> str:
    """``"ATrousFilter"`` -> ``"a_trous_filter"``, ``"TAA"`` -> ``"taa"``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()


def _describe(handle: object) -> str:
    if isinstance(handle, Tex):
        return f"texture {handle.name!r}"
    if isinstance(handle, History):
        return f"history {handle.name!r}"
    return repr(handle)


def _check_format(user: str, fmt: str) -> None:
    try:
        lookup(fmt)
    except ValueError as error:
        raise GraphError(f"{user}: {error}") from None
