"""A compiled frame: which passes run, where their textures lie, and both written out as text and as Graphviz.

Pure Python, no OpenGL. :meth:`gl.graph.Graph.compile` makes plans, :class:`gl.executor.Executor` runs them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from errors import did_you_mean
from gl.formats import FORMATS, INTEGER_FORMATS
from gl.ports import ONE_TEXEL, GraphError, Pass

IMPORT: Final = -1
"""``Tex.producer`` of a texture that is uploaded, not written by a pass."""


# Handles and nodes are made anew each frame and never changed; they are not frozen because that triples their cost.
@dataclass(slots=True, eq=False)
class Tex:
    """Handle of one texture of this frame; written once, by the pass at index ``producer`` of the graph."""

    name: str
    fmt: str
    divisor: int
    producer: int


@dataclass(slots=True, eq=False)
class History:
    """A texture that survives the frame: its reader gets last frame's ``source``, whichever pass wrote that."""

    name: str
    fmt: str
    divisor: int
    source: Tex | None = None


@dataclass(slots=True, eq=False)
class Node:
    """One use of a pass in a frame.

    Attributes:
        name: unique in the graph, scopes included: ``"svgf.temporal"``.
        work: the pass with its parameters.
        reads: connected ``in_`` ports; an optional one that is missing here was not connected.
        prevs: ``prev_`` ports.
        writes: ``out_`` ports.
        program: two nodes with equal keys run the same program.
    """

    name: str
    work: Pass
    reads: dict[str, Tex]
    prevs: dict[str, History]
    writes: dict[str, Tex]
    program: tuple[object, ...] = field(init=False)

    def __post_init__(self) -> None:
        # Integer inputs are part of the key because they want a usampler2D where others want a sampler2D.
        integer = [(port, tex.fmt) for port, tex in self.reads.items() if tex.fmt in INTEGER_FORMATS]
        integer += [(port, history.fmt) for port, history in self.prevs.items() if history.fmt in INTEGER_FORMATS]
        self.program = (self.work.variant, frozenset(self.reads), tuple(integer))

    def defines(self) -> dict[str, str]:
        """All ``#define``s of this node's program: the pass's own, and ``HAS_IN_X`` for every optional input."""
        optional = (name for name, port in self.work.ports.ins.items() if port.optional)
        return self.work.defines | {f"HAS_{name.upper()}": str(int(name in self.reads)) for name in optional}


class Slot(NamedTuple):
    """A texture object that several textures of a frame may use in turn; ``rank`` counts slots of the same kind."""

    fmt: str
    divisor: int
    rank: int


class Memory(NamedTuple):
    """What one texture object, or the pair of a history, takes on the GPU.

    Attributes:
        kind: ``"import"``, ``"slot"`` or ``"history"``.
        names: what lies in it: the textures that take turns in a slot, in the order in which they are written.
        size: width and height in texels.
        copies: 2 for a history, whose halves change places, otherwise 1.
        bytes: of all copies together.
    """

    kind: str
    names: tuple[str, ...]
    fmt: str
    size: tuple[int, int]
    copies: int
    bytes: int

    @staticmethod
    def of(
        kind: str, names: tuple[str, ...], fmt: str, divisor: int, frame: tuple[int, int], copies: int = 1
    ) -> Memory:
        """The row of a texture with ``divisor`` in a frame of that size."""
        return Memory(
            kind, names, fmt, texture_size(frame, divisor), copies, copies * texture_bytes(frame, fmt, divisor)
        )


@dataclass(frozen=True, slots=True)
class Plan:
    """What the executor needs to run one frame. Made by :func:`compile_plan`, never changed afterwards.

    Attributes:
        passes: what runs, in order.
        culled: what does not, because no output needs it.
        imports: the uploads that are read.
        slots: the texture objects to be provided.
        slot_of: index into ``slots`` of every texture written, except those that feed a history.
        feeds: the histories that are read, by the texture that feeds them; it is written into the history's own memory.
        outputs: textures handed to the caller, by the name given to :meth:`gl.graph.Graph.output`.
        keep: textures that are left intact to be looked at.
    """

    passes: tuple[Node, ...]
    culled: tuple[Node, ...]
    imports: tuple[Tex, ...]
    slots: tuple[Slot, ...]
    slot_of: dict[Tex, int]
    feeds: dict[Tex, History]
    outputs: dict[str, Tex]
    keep: tuple[Tex, ...]

    def memory(self, size: tuple[int, int]) -> tuple[Memory, ...]:
        """The texture objects behind a frame of ``size`` (width, height): imports, then slots, then histories."""
        held: list[list[str]] = [[] for _ in self.slots]
        for tex, index in self.slot_of.items():
            held[index].append(tex.name)
        rows = [Memory.of("import", (tex.name,), tex.fmt, tex.divisor, size) for tex in self.imports]
        rows += [
            Memory.of("slot", tuple(names), slot.fmt, slot.divisor, size)
            for slot, names in zip(self.slots, held, strict=True)
        ]
        rows += [
            Memory.of("history", (history.name,), history.fmt, history.divisor, size, copies=2)
            for history in self.feeds.values()
        ]
        return tuple(rows)

    def bytes(self, size: tuple[int, int]) -> int:
        """GPU memory in bytes that the plan's textures take at ``size`` (width, height), without the imports."""
        return sum(row.bytes for row in self.memory(size) if row.kind != "import")

    def final_textures(self) -> dict[str, Tex]:
        """The textures by name that still hold their pixels after the frame: nothing was written over them."""
        last_in_slot = {slot: tex for tex, slot in self.slot_of.items()}
        intact = [*self.imports, *self.keep, *self.outputs.values(), *last_in_slot.values(), *self.feeds]
        return {tex.name: tex for tex in intact}

    def text(self) -> str:
        """The plan for people and for golden files: without parameters, so that only a change of wiring changes it."""
        lines: list[str] = []
        for node in self.passes:
            lines.append(f"{node.name}  {node.work.shader}")
            lines += [f"    {title:<8}{', '.join(items)}" for title, items in self._sections(node) if items]
        lines += [f"output  {name} <- {tex.name}" for name, tex in self.outputs.items()]
        lines += [f"keep    {tex.name}" for tex in self.keep]
        lines += [f"history {h.name} <~ {tex.name}  {_spec(h.fmt, h.divisor)}" for tex, h in self.feeds.items()]
        lines += [f"-- culled {node.name}" for node in self.culled]
        written = len(self.slot_of) + len(self.feeds)
        lines.append(
            f"-- {_count(len(self.passes), 'pass', 'passes')}, {_count(written, 'texture')},"
            f" {_count(len(self.slots), 'slot')}, {_count(len(self.feeds), 'history', 'histories')}"
        )
        return "\n".join(lines) + "\n"

    def _sections(self, node: Node) -> list[tuple[str, list[str]]]:
        reads = [f"{port}<-{node.reads[port].name if port in node.reads else 'none'}" for port in node.work.ports.ins]
        prevs = [f"{port}<~{history.name}" for port, history in node.prevs.items()]
        writes = [f"{port}:{_spec(tex.fmt, tex.divisor)}@{self._place(tex)}" for port, tex in node.writes.items()]
        defines = [f"{name}={value}" for name, value in sorted(node.work.defines.items())]
        return [("defines", defines), ("reads", reads), ("prev", prevs), ("writes", writes)]

    def _place(self, tex: Tex) -> str:
        return f"~{self.feeds[tex].name}" if tex in self.feeds else str(self.slot_of[tex])

    def dot(self) -> str:
        """The frame as a Graphviz digraph: culled passes dashed, what comes from last frame as dotted edges."""
        lines = [
            "digraph frame {",
            "  rankdir=LR; node [shape=box, fontname=monospace]; edge [fontname=monospace, fontsize=9];",
        ]
        nodes = [*self.passes, *self.culled]
        writer = {tex: node.name for node in nodes for tex in node.writes.values()}
        imports = {tex.name: None for node in nodes for tex in node.reads.values() if tex.producer == IMPORT}
        imports |= {tex.name: None for tex in self.outputs.values() if tex.producer == IMPORT}
        lines += [f'  "{name}" [shape=ellipse];' for name in imports]
        lines += [f'  "{node.name}";' for node in self.passes]
        lines += [f'  "{node.name}" [style=dashed, color=gray, fontcolor=gray];' for node in self.culled]
        for node in nodes:
            for port, tex in node.reads.items():
                lines.append(f'  "{writer.get(tex, tex.name)}" -> "{node.name}" [label="{port}"];')
            for port, history in node.prevs.items():
                assert history.source is not None  # compile_plan refuses histories that are read and not fed
                lines.append(
                    f'  "{writer[history.source]}" -> "{node.name}"'
                    f' [label="{port}\\n~{history.name}", style=dotted, constraint=false];'
                )
        for name, tex in self.outputs.items():
            lines.append(f'  "output {name}" [label="{name}", shape=doubleoctagon];')
            lines.append(f'  "{writer.get(tex, tex.name)}" -> "output {name}";')
        return "\n".join([*lines, "}"]) + "\n"


def texture_size(size: tuple[int, int], divisor: int) -> tuple[int, int]:
    """Width and height in texels of a texture with ``divisor`` in a frame of ``size``: divided and rounded up."""
    return -(-size[0] // divisor), -(-size[1] // divisor)


def texture_bytes(size: tuple[int, int], fmt: str, divisor: int = 1) -> int:
    """GPU memory in bytes of one texture with ``divisor`` in a frame of ``size``; a history has two."""
    width, height = texture_size(size, divisor)
    return width * height * FORMATS[fmt].bytes_per_pixel


def compile_plan(
    nodes: Sequence[Node],
    textures: Mapping[str, Tex],
    outputs: Mapping[str, Tex],
    keep: Iterable[str],
    alias: bool,
) -> Plan:
    """Cull what no output needs and lay the remaining textures out in slots.

    Args:
        nodes: all passes; a handle must exist to be read, so this order is already an order of execution.
        textures: every texture of the graph by name.
        outputs: textures wanted by the caller, by output name.
        keep: names of textures that must survive the frame.
        alias: let textures with disjoint lifetimes share a slot.

    Raises:
        GraphError: nothing is an output, a history is read and never fed, or ``keep`` names a texture that is not made.
    """
    if not outputs:
        raise GraphError("the graph has no output: name one with Graph.output, or everything is culled")
    for node in nodes:
        for port, history in node.prevs.items():
            if history.source is None:
                raise GraphError(f"{node.name}.{port} reads history {history.name!r}, which nothing feeds")
    live = _live(nodes, outputs)
    passes = tuple(node for i, node in enumerate(nodes) if i in live)
    kept = tuple(_keep(name, nodes, live, textures) for name in dict.fromkeys(keep))

    # A history that no live pass reads is left alone: what feeds it is then a texture like any other.
    read = {history for node in passes for history in node.prevs.values()}
    feeds = {tex: h for h in sorted(read, key=lambda h: h.name) if (tex := h.source) is not None}
    pinned = {*outputs.values(), *kept, *feeds}
    slots, slot_of = _assign_slots(passes, feeds, pinned, alias)
    check_no_feedback(passes, slot_of)

    used = {tex for node in passes for tex in node.reads.values()} | pinned
    return Plan(
        passes=passes,
        culled=tuple(node for i, node in enumerate(nodes) if i not in live),
        imports=tuple(tex for tex in textures.values() if tex.producer == IMPORT and tex in used),
        slots=slots,
        slot_of=slot_of,
        feeds=feeds,
        outputs=dict(outputs),
        keep=kept,
    )


def _live(nodes: Sequence[Node], outputs: Mapping[str, Tex]) -> set[int]:
    """Indices of the passes that outputs need; a history keeps its feeder alive, but says nothing about order."""
    live: set[int] = set()
    pending = [tex.producer for tex in outputs.values()]
    while pending:
        index = pending.pop()
        if index == IMPORT or index in live:
            continue
        live.add(index)
        pending += [tex.producer for tex in nodes[index].reads.values()]
        pending += [history.source.producer for history in nodes[index].prevs.values() if history.source is not None]
    return live


def _keep(name: str, nodes: Sequence[Node], live: set[int], textures: Mapping[str, Tex]) -> Tex:
    made = [tex.name for tex in textures.values() if tex.producer == IMPORT or tex.producer in live]
    tex = textures.get(name)
    if tex is None:
        raise GraphError(
            f"cannot keep {name!r}: no such texture{did_you_mean(name, made)} (there are: {', '.join(made)})"
        )
    if tex.producer != IMPORT and tex.producer not in live:
        raise GraphError(
            f"cannot keep {name!r}: no output needs pass {nodes[tex.producer].name!r}, so it does not run"
            f"{did_you_mean(name, made)} (there are: {', '.join(made)})"
        )
    return tex


def _assign_slots(
    passes: Sequence[Node], feeds: Mapping[Tex, History], pinned: set[Tex], alias: bool
) -> tuple[tuple[Slot, ...], dict[Tex, int]]:
    """Give each texture a slot, from its writer until after its last reader; a pinned one keeps it to the end."""
    last_use: dict[Tex, int] = {}
    for i, node in enumerate(passes):
        for tex in (*node.reads.values(), *node.writes.values()):
            last_use[tex] = i
    expiring: list[list[Tex]] = [[] for _ in passes]
    if alias:
        for tex, i in last_use.items():
            if tex.producer != IMPORT and tex not in pinned:
                expiring[i].append(tex)
    slots: list[Slot] = []
    slot_of: dict[Tex, int] = {}
    count: dict[tuple[str, int], int] = {}
    free: dict[tuple[str, int], list[int]] = {}
    for i, node in enumerate(passes):
        for tex in node.writes.values():
            if tex in feeds:
                continue
            spec = (tex.fmt, tex.divisor)
            if unused := free.get(spec):
                slot_of[tex] = unused.pop()
            else:
                slot_of[tex] = len(slots)
                slots.append(Slot(*spec, count.get(spec, 0)))
                count[spec] = slots[-1].rank + 1
        # Only now are inputs given back, so an output of this pass cannot have taken the place of one.
        for tex in expiring[i]:
            free.setdefault((tex.fmt, tex.divisor), []).append(slot_of[tex])
    return tuple(slots), slot_of


def check_no_feedback(passes: Sequence[Node], slot_of: Mapping[Tex, int]) -> None:
    """Prove that no pass writes a texture object that it reads, which OpenGL leaves undefined.

    Histories need no proof: reader and feeder use different halves of the pair. Imports are never written.

    Raises:
        GraphError: a pass would.
    """
    for node in passes:
        targets = [slot_of[tex] for tex in node.writes.values() if tex in slot_of]
        if len(set(targets)) != len(targets):
            raise GraphError(f"{node.name} writes two outputs to one slot: {targets}")
        for port, tex in node.reads.items():
            if slot_of.get(tex) in targets:
                raise GraphError(f"{node.name} reads {port}<-{tex.name} from slot {slot_of[tex]}, which it also writes")


def _spec(fmt: str, divisor: int) -> str:
    if divisor == ONE_TEXEL:
        return f"{fmt}(1x1)"
    return fmt if divisor == 1 else f"{fmt}/{divisor}"


def _count(number: int, singular: str, plural: str = "") -> str:
    return f"{number} {singular if number == 1 else plural or singular + 's'}"
