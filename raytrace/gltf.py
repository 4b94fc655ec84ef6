"""glTF 2.0 (``.gltf``, ``.glb``): nodes, cameras and objects. Geometry goes through trimesh, the rest is read here.

Not drawn: points and lines, skins and morph targets (objects stay in their rest pose), animations, punctual lights.
Each is named in a notice.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from errors import Notices
from raytrace.camera import Camera
from raytrace.gltf_file import Entry, GltfFile
from raytrace.gltf_geometry import TRIANGLE_STRIP, TRIANGLES, Wanted, read_parts
from raytrace.gltf_materials import MaterialTable, read_materials
from raytrace.parts import F64, Model, Part, merged, transformed
from raytrace.repair import Repairs, check_coordinates, counted, repaired

_KNOWN_ELSEWHERE = {"KHR_mesh_quantization", "KHR_texture_transform", "KHR_lights_punctual", "EXT_texture_webp"}


@dataclass(frozen=True)
class _Node:
    """A node of the scene: its JSON object, its name and its (4, 4) matrix to world space, for column vectors."""

    entry: Entry
    name: str
    matrix: F64


def load_gltf(path: Path, notices: Notices) -> Model:
    """All triangles, materials, textures and the first camera of a file. World space is the file's own.

    Raises UserError for whatever cannot be read, and for transforms that flatten an object.
    """
    file = GltfFile(path)
    nodes = list(_walk(file))
    drawn = [node for node in nodes if "mesh" in node.entry]
    wanted = _primitives(file, drawn, notices)
    table = read_materials(file, {_material(item) for item in wanted}, notices)
    repairs = Repairs()
    parts = _parts(file, wanted, table, repairs, notices)
    meshes = []
    for node in drawn:
        pieces = parts.get(node.entry["mesh"], [])
        if pieces:
            _check_invertible(file, node)
            placed = [transformed(piece, node.matrix) for piece in pieces]
            for piece in placed:
                check_coordinates(piece.vertices, f"{path}: node {node.name!r}, in world space")
            meshes.append(merged(node.name, placed))
            repairs.flat_objects += any(piece.normals is None for piece in pieces)
    repairs.report(notices)
    _name_the_rest(file, nodes, notices)
    return Model(meshes, table.materials, table.textures, _camera(file, nodes, notices))


# -- nodes ------------------------------------------------------------------------------------------------------------


def _walk(file: GltfFile) -> Iterator[_Node]:
    """Nodes of the scene that is shown, parents first, children in the file's order."""
    stack = [(index, np.eye(4), "the scene") for index in reversed(_roots(file))]
    seen: set[int] = set()
    while stack:
        index, parent, user = stack.pop()
        entry = file.entry("nodes", index, user)
        assert isinstance(index, int)  # file.entry has checked it
        name = str(entry.get("name", f"node {index}"))
        if index in seen:
            raise file.error(f"node {name!r} is reached twice; nodes must form a tree")
        seen.add(index)
        matrix = parent @ _local_matrix(file, entry, f"node {name!r}")
        yield _Node(entry, name, matrix)
        stack.extend((child, matrix, f"node {name!r}") for child in reversed(_children(file, entry)))


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


def _local_matrix(file: GltfFile, entry: Entry, where: str) -> F64:
    """(4, 4) matrix to the parent's space. glTF 2.0, sec. 3.5.3."""
    if "matrix" in entry:
        return np.reshape(file.numbers(entry, "matrix", (0.0,) * 16, where), (4, 4)).T
    x, y, z, w = file.numbers(entry, "rotation", (0.0, 0.0, 0.0, 1.0), where)
    length = math.hypot(x, y, z, w)
    if length == 0.0:
        raise file.error(f"the rotation of {where} is a quaternion of length 0")
    x, y, z, w = x / length, y / length, z / length, w / length
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= file.numbers(entry, "scale", (1.0, 1.0, 1.0), where)
    matrix[:3, 3] = file.numbers(entry, "translation", (0.0, 0.0, 0.0), where)
    return matrix


def _check_invertible(file: GltfFile, node: _Node) -> None:
    lengths = np.linalg.norm(node.matrix[:3, :3], axis=0)
    if lengths.min() > 0.0 and np.isfinite(lengths).all():
        volume = abs(float(np.linalg.det(node.matrix[:3, :3] / lengths)))  # 1 for a rotation, whatever the scale
        if volume > 1e-9:
            return
    raise file.error(
        f"the transform of node {node.name!r} flattens it (it has no inverse)",
        "give the node, and those above it, a scale other than 0 in every direction",
    )


# -- objects ----------------------------------------------------------------------------------------------------------


def _primitives(file: GltfFile, drawn: list[_Node], notices: Notices) -> list[Wanted]:
    """Primitives with triangles of all meshes that a node shows."""
    result = []
    left_out = 0
    names: dict[int, str] = {}
    for node in drawn:
        index = node.entry["mesh"]
        mesh = file.entry("meshes", index, f"node {node.name!r}")
        names.setdefault(index, str(mesh.get("name", f"mesh {index}")))
    for index, name in names.items():
        mesh = file.entry("meshes", index, "a node")
        for k, primitive in enumerate(file.tables(mesh, "primitives", f"mesh {name!r}")):
            if "material" in primitive:
                file.entry("materials", primitive["material"], f"mesh {name!r}, primitive {k}")
            has_triangles = primitive.get("mode", TRIANGLES) in (TRIANGLES, TRIANGLE_STRIP)
            if has_triangles and "POSITION" in file.table(primitive, "attributes", f"mesh {name!r}"):
                result.append(Wanted(index, k, name, primitive))
            else:
                left_out += 1
    if left_out:
        notices.add(f"{counted(left_out, 'primitive')} of points, lines or triangle fans left out")
    return result


def _material(item: Wanted) -> int | None:
    index: int | None = item.primitive.get("material")
    return index


def _parts(
    file: GltfFile, wanted: list[Wanted], table: MaterialTable, repairs: Repairs, notices: Notices
) -> dict[int, list[Part]]:
    """Repaired triangles by mesh, in its own space, with the scene's material numbers and texture coordinates."""
    mappings = {item.key: table.mappings.get(_material(item)) for item in wanted}
    asked = [replace(item, uv_set=None if (m := mappings[item.key]) is None else m.uv_set) for item in wanted]
    raw = read_parts(file, asked)
    result: dict[int, list[Part]] = {}
    bare = 0
    for item in wanted:
        if item.key not in raw:
            continue
        part, mapping = raw[item.key], mappings[item.key]
        bare += mapping is not None and part.uvs is None
        part = repaired(part, f"{file.path}: mesh {item.name!r}, primitive {item.index}", repairs)
        if mapping is not None and part.uvs is not None:
            part = replace(part, uvs=mapping.apply(part.uvs))
        if len(part.faces):
            part = replace(part, materials=np.full(len(part.faces), table.numbers[_material(item)]))
            result.setdefault(item.mesh, []).append(part)
    if bare:
        notices.add(
            f"{counted(bare, 'textured primitive')} without texture coordinates: drawn in the texture's corner colour"
        )
    if None in table.numbers:
        count = sum(_material(item) is None for item in wanted)
        notices.add(f"{counted(count, 'primitive')} without a material: drawn light grey")
    return result


# -- cameras, and what is left out -----------------------------------------------------------------------------------


def _camera(file: GltfFile, nodes: list[_Node], notices: Notices) -> Camera | None:
    """The first perspective camera that the scene reaches; its vertical field of view holds for any aspect ratio."""
    with_camera = [node for node in nodes if "camera" in node.entry]
    for node in with_camera:
        entry = file.entry("cameras", node.entry["camera"], f"node {node.name!r}")
        where = f"the camera of node {node.name!r}"
        perspective = file.table(entry, "perspective", where)
        yfov = file.number(perspective, "yfov", 0.0, where)
        if not 0.0 < yfov < math.pi:
            notices.add(f"{where} is not a perspective camera: not used")
            continue
        _check_invertible(file, node)
        if len(with_camera) > 1:
            notices.add(f"{len(with_camera)} cameras: {node.name!r} is used")
        return Camera.from_matrix(node.matrix, yfov)
    return None


def _name_the_rest(file: GltfFile, nodes: list[_Node], notices: Notices) -> None:
    """One notice for each feature of the file that does not show in the picture."""
    lights = sum("KHR_lights_punctual" in file.table(node.entry, "extensions", node.name) for node in nodes)
    skinned = sum("skin" in node.entry for node in nodes)
    instanced = sum("EXT_mesh_gpu_instancing" in file.table(node.entry, "extensions", node.name) for node in nodes)
    meshes = {node.entry["mesh"] for node in nodes if "mesh" in node.entry}
    primitives = [
        p for m in meshes for p in file.tables(file.entry("meshes", m, "a node"), "primitives", f"meshes[{m}]")
    ]
    morphing = sum("targets" in p for p in primitives)
    animations = file.size("animations")
    if lights:
        notices.add(f"{counted(lights, 'point, spot or sun light')} left out: only surfaces that emit give light")
    if instanced:
        notices.add(f"{counted(instanced, 'node')} with EXT_mesh_gpu_instancing: drawn once only")
    if skinned or morphing:
        notices.add(f"{counted(skinned + morphing, 'skinned or morphing object')}: drawn in the rest pose")
    if animations:
        notices.add(f"{counted(animations, 'animation')} left out: the scene stands still")
    unknown = [
        name
        for name in file.names("extensionsUsed")
        if not name.startswith("KHR_materials_") and name not in _KNOWN_ELSEWHERE | {"EXT_mesh_gpu_instancing"}
    ]
    if unknown:
        notices.add(f"extensions left out: {', '.join(unknown)}")
