"""Lights of a glTF file: the extension KHR_lights_punctual."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from errors import Notices
from raytrace.gltf_file import Entry, GltfFile
from raytrace.gltf_nodes import Node
from raytrace.parts import F64, normalized
from raytrace.punctual import KINDS, Kind, PunctualLight, Vector
from raytrace.repair import check_coordinates

EXTENSION = "KHR_lights_punctual"


def read_lights(file: GltfFile, nodes: Iterable[Node], notices: Notices) -> list[PunctualLight]:
    """One light for each node that has one. They shine along the node's -z; scales do not count.

    Raises UserError for colours, intensities and angles that cannot be; lights of no intensity are left out.
    """
    found = []
    for node in nodes:
        where = f"node {node.name!r}"
        use = file.extension(node.entry, EXTENSION, where)
        if use is None or "light" not in use:
            continue
        light = _light(file, _entry(file, use["light"], where), node)
        if max(light.intensity) > 0.0:
            found.append(light)
        else:
            notices.add(f"light of node {node.name!r} without intensity: left out")
    return found


def _entry(file: GltfFile, index: object, where: str) -> Entry:
    root = file.extension(file.json, EXTENSION, "the file") or {}
    lights = file.tables(root, "lights", EXTENSION)
    if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(lights):
        raise file.error(f"{where} refers to lights[{index}], but the file has {len(lights)}")
    return lights[index]


def _light(file: GltfFile, entry: Entry, node: Node) -> PunctualLight:
    name = str(entry.get("name", node.name))
    where = f"light {name!r}"
    kind: Kind | None = next((known for known in KINDS if known == entry.get("type")), None)
    if kind is None:
        raise file.error(f"{where} is of type {entry.get('type')!r}; {', '.join(KINDS)} are known")
    color = file.numbers(entry, "color", (1.0, 1.0, 1.0), where)
    intensity = file.number(entry, "intensity", 1.0, where)
    distance = file.number(entry, "range", 1e29, where)
    spot = file.table(entry, "spot", where)
    inner = file.number(spot, "innerConeAngle", 0.0, where)
    outer = file.number(spot, "outerConeAngle", math.pi / 4, where)
    if min(color) < 0.0 or intensity < 0.0 or distance <= 0.0:
        raise file.error(f"{where} has a negative colour or intensity, or no range")
    if kind == "spot" and not 0.0 <= inner <= outer <= math.pi / 2 + 1e-6:
        raise file.error(f"{where} has cones of {inner:.4g} and {outer:.4g} radians; 0 <= inner < outer <= pi / 2")
    r, g, b = (c * intensity for c in color)
    position, direction = _placed(node.matrix)
    check_coordinates(np.array([position]), f"{file.path}: {where}, in world space")
    return PunctualLight(
        name,
        kind,
        position,
        direction,
        (r, g, b),
        inner,
        outer,
        math.inf if "range" not in entry else distance,
        None if node.world is None else _motion(node.world),
    )


def _motion(world: Callable[[float], F64]) -> Callable[[float], tuple[Vector, Vector]]:
    return lambda time: _placed(world(time))


def _placed(matrix: F64) -> tuple[Vector, Vector]:
    """Position and direction."""
    ahead = normalized(-matrix[:3, 2])
    if not ahead.any():
        ahead = np.array([0.0, 0.0, -1.0])
    (px, py, pz), (dx, dy, dz) = matrix[:3, 3].tolist(), ahead.tolist()
    return (px, py, pz), (dx, dy, dz)
