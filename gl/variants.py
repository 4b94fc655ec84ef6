"""What drivers make machine code for: less than a program and more, since the textures it meets are compiled in.

Compiling and linking is only half of it. Many drivers finish a program when it first draws, for the formats of what it
reads and writes; llvmpipe, moreover, for whether the sides of the textures are powers of two. That is the larger half
there: 0.2 to 0.4 s for one iteration of à-trous.
"""

from __future__ import annotations

from collections.abc import Iterable

from gl.plan import History, Node, Plan, Tex, texture_size

Size = tuple[int, int]
Variant = tuple[object, ...]
"""Equal for two nodes exactly when they need the same machine code; hashable."""


def variant(node: Node, size: Size) -> Variant:
    """What ``node`` needs in a frame of ``size`` (width, height)."""
    read: list[Tex | History] = [*node.reads.values(), *node.prevs.values()]
    inputs = tuple((source.fmt, *_powers(texture_size(size, source.divisor))) for source in read)
    return node.program, inputs, tuple(_powers(texture_size(size, target.divisor)) for target in node.writes.values())


def variants(plan: Plan, size: Size) -> dict[Variant, Node]:
    """All that ``plan`` needs in frames of ``size``, each with a node to make it from, in the order of the passes."""
    return {variant(node, size): node for node in plan.passes}


def stand_in(size: Size, divisors: Iterable[int]) -> Size:
    """The smallest frame for whose textures, of these ``divisors``, drivers make the same code as for ``size``."""
    used = tuple(divisors)
    width = next(w for w in range(1, size[0] + 1) if _alike((w, 1), (size[0], 1), used))
    height = next(h for h in range(1, size[1] + 1) if _alike((1, h), (1, size[1]), used))
    return width, height


def _alike(one: Size, other: Size, divisors: tuple[int, ...]) -> bool:
    return all(_powers(texture_size(one, d)) == _powers(texture_size(other, d)) for d in divisors)


def _powers(size: Size) -> tuple[bool, bool]:
    """Which sides are powers of two."""
    return size[0].bit_count() == 1, size[1].bit_count() == 1
