"""Cameras of a glTF file. glTF 2.0, sec. 3.10."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from errors import Notices
from raytrace.camera import Camera, NamedCamera
from raytrace.gltf_file import GltfFile
from raytrace.gltf_nodes import Node, check_invertible
from raytrace.parts import F64
from raytrace.repair import check_coordinates


def read_cameras(file: GltfFile, nodes: Sequence[Node], notices: Notices) -> list[NamedCamera]:
    """The perspective cameras that the scene reaches, under the names of their nodes, made different where they are
    not; a vertical field of view holds for any aspect ratio."""
    found: list[NamedCamera] = []
    names: set[str] = set()
    for node in nodes:
        if "camera" not in node.entry:
            continue
        entry = file.entry("cameras", node.entry["camera"], f"node {node.name!r}")
        where = f"the camera of node {node.name!r}"
        perspective = file.table(entry, "perspective", where)
        yfov = file.number(perspective, "yfov", 0.0, where)
        if not 0.0 < yfov < math.pi:
            notices.add(f"{where} is not a perspective camera: not used")
            continue
        check_invertible(file, node)
        check_coordinates(node.matrix[None, :3, 3], f"{file.path}: {where}, in world space")
        name, number = node.name, 2
        while name in names:
            name, number = f"{node.name} {number}", number + 1
        names.add(name)
        flight = None if node.world is None else _flight(node.world, yfov)
        found.append(NamedCamera(name, Camera.from_matrix(node.matrix, yfov), flight))
    if len(found) > 1:
        listing = ", ".join(repr(camera.name) for camera in found)
        notices.add(f"{len(found)} cameras, the first is used (--camera NAME takes another): {listing}")
    return found


def _flight(world: Callable[[float], F64], yfov: float) -> Callable[[float], Camera]:
    return lambda time: Camera.from_matrix(world(time), yfov)
