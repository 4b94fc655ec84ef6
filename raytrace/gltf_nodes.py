"""Nodes of a glTF file: the tree, and where each node is, at rest and over time. glTF 2.0, sec. 3.5."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from raytrace.gltf_animation import Animations
from raytrace.gltf_file import Entry, GltfFile
from raytrace.parts import F64

_NOT_RIGID = 1e-4  # of a transform that should keep lengths and angles
_PROBES = 24  # times at which a motion is tried


@dataclass(frozen=True)
class Node:
    """A node of the scene: its JSON object, its name and its (4, 4) matrix to world space, for column vectors.

    ``matrix`` is that of time 0 of the animations. ``world``: the matrix at a time in seconds, None where it stays.
    """

    entry: Entry
    name: str
    matrix: F64
    world: Callable[[float], F64] | None = None

    def motion(self, cycle: float) -> Callable[[float], F64] | None:
        """What carries the node's points in world space at time 0 to where they are at another; None for none.

        Raises ValueError where that is not rigid: parents that stretch what turns below them.
        """
        if self.world is None:
            return None
        world, back = self.world, np.linalg.inv(self.matrix)
        for time in np.linspace(0.0, cycle, _PROBES, endpoint=False):
            linear = (world(float(time)) @ back)[:3, :3]
            if np.abs(linear @ linear.T - np.eye(3)).max() > _NOT_RIGID:
                raise ValueError(self.name)

        def motion(time: float) -> F64:
            moved: F64 = world(time) @ back
            moved[3] = (0.0, 0.0, 0.0, 1.0)
            return moved

        return motion


def walk(file: GltfFile, animations: Animations) -> Iterator[Node]:
    """Nodes of the scene that is shown, parents first, children in the file's order.

    Raises UserError for what is no tree and for transforms that are no numbers.
    """
    root = Node({}, "the scene", np.eye(4))
    stack: list[tuple[object, Node]] = [(index, root) for index in reversed(_roots(file))]
    seen: set[int] = set()
    while stack:
        index, parent = stack.pop()
        user = "the scene" if parent is root else f"node {parent.name!r}"
        entry = file.entry("nodes", index, user)
        assert isinstance(index, int)  # file.entry has checked it
        name = str(entry.get("name", f"node {index}"))
        if index in seen:
            raise file.error(f"node {name!r} is reached twice; nodes must form a tree")
        seen.add(index)
        local = _local(file, entry, index, f"node {name!r}", animations)
        world = None
        if parent.world is not None or animations.moves(index):
            world = _below(parent, local)
        node = Node(entry, name, parent.matrix @ local(0.0), world)
        yield node
        stack.extend((child, node) for child in reversed(_children(file, entry)))


def _below(parent: Node, local: Callable[[float], F64]) -> Callable[[float], F64]:
    above = parent.world or (lambda _: parent.matrix)
    return lambda time: above(time) @ local(time)


def _roots(file: GltfFile) -> list[object]:
    """Root nodes of the default scene, of the first one, or, without scenes, all nodes that are nobody's child."""
    if file.size("scenes"):
        scene = file.entry("scenes", file.json.get("scene", 0), "the file")
        roots = scene.get("nodes", [])
        if not isinstance(roots, list):
            raise file.error("the scene's nodes are not a list")
        return roots
    entries = file.tables(file.json, "nodes", "the file")
    children = [child for entry in entries for child in _children(file, entry)]
    return [index for index in range(len(entries)) if index not in children]


def _children(file: GltfFile, entry: Entry) -> list[object]:
    children = entry.get("children", [])
    if not isinstance(children, list):
        raise file.error("the children of a node are not a list")
    return children


def _local(file: GltfFile, entry: Entry, index: int, where: str, animations: Animations) -> Callable[[float], F64]:
    """(4, 4) matrix to the parent's space at a time."""
    if "matrix" in entry:  # which the specification does not let be animated
        matrix = np.reshape(file.numbers(entry, "matrix", (0.0,) * 16, where), (4, 4)).T
        return lambda _: matrix
    rotation = file.numbers(entry, "rotation", (0.0, 0.0, 0.0, 1.0), where)
    scale = file.numbers(entry, "scale", (1.0, 1.0, 1.0), where)
    translation = file.numbers(entry, "translation", (0.0, 0.0, 0.0), where)
    if math.hypot(*rotation) == 0.0:
        raise file.error(f"the rotation of {where} is a quaternion of length 0")

    def local(time: float) -> F64:
        turn = animations.value(index, "rotation", time, rotation)
        shift = animations.value(index, "translation", time, translation)
        return _composed(shift, turn, scale)

    return local


def _composed(translation: tuple[float, ...], rotation: tuple[float, ...], scale: tuple[float, ...]) -> F64:
    length = math.hypot(*rotation)
    x, y, z, w = (part / length for part in rotation)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= scale
    matrix[:3, 3] = translation
    return matrix


def check_invertible(file: GltfFile, node: Node) -> None:
    """Raises UserError where the node's transform flattens what it is applied to."""
    lengths = np.linalg.norm(node.matrix[:3, :3], axis=0)
    if lengths.min() > 0.0 and np.isfinite(lengths).all():
        volume = abs(float(np.linalg.det(node.matrix[:3, :3] / lengths)))  # 1 for a rotation, whatever the scale
        if volume > 1e-9:
            return
    raise file.error(
        f"the transform of node {node.name!r} flattens it (it has no inverse)",
        "give the node, and those above it, a scale other than 0 in every direction",
    )
