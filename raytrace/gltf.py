"""glTF 2.0 (``.gltf``, ``.glb``) as a scene. Geometry goes through trimesh, the rest is read here.

Not drawn: points and lines, skins and morph targets (objects stay in their rest pose). Each is named in a notice.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from errors import Notices
from raytrace.gltf_animation import read_animations
from raytrace.gltf_cameras import read_cameras
from raytrace.gltf_file import GltfFile
from raytrace.gltf_geometry import TRIANGLE_STRIP, TRIANGLES, Wanted, read_parts
from raytrace.gltf_lights import read_lights
from raytrace.gltf_materials import MaterialTable, read_materials
from raytrace.gltf_nodes import Node, check_invertible, walk
from raytrace.parts import Model, Part, merged, transformed
from raytrace.repair import Repairs, check_coordinates, counted, repaired
from raytrace.scene import Mesh

_KNOWN_ELSEWHERE = {"KHR_mesh_quantization", "KHR_texture_transform", "KHR_lights_punctual", "EXT_texture_webp"}


def load_gltf(path: Path, notices: Notices) -> Model:
    """All triangles, materials, textures, lights and cameras of a file. World space is the file's own.

    What is animated has a motion, and stands otherwise where it is at time 0.

    Raises UserError for whatever cannot be read, and for transforms that flatten an object.
    """
    file = GltfFile(path)
    animations = read_animations(file, notices)
    nodes = list(walk(file, animations))
    drawn = [node for node in nodes if "mesh" in node.entry]
    wanted = _primitives(file, drawn, notices)
    table = read_materials(file, {_material(item) for item in wanted}, notices)
    repairs = Repairs()
    parts = _parts(file, wanted, table, repairs, notices)
    meshes: list[Mesh] = []
    bent = 0
    for node in drawn:
        pieces = parts.get(node.entry["mesh"], [])
        if pieces:
            check_invertible(file, node)
            placed = [transformed(piece, node.matrix) for piece in pieces]
            for piece in placed:
                check_coordinates(piece.vertices, f"{path}: node {node.name!r}, in world space")
            try:
                motion = node.motion(animations.cycle)
            except ValueError:
                motion, bent = None, bent + 1
            meshes.append(replace(merged(node.name, placed), motion=motion))
            repairs.flat_objects += any(piece.normals is None for piece in pieces)
    repairs.report(notices)
    if bent:
        notices.add(f"{counted(bent, 'animated object')} below a stretched node: not rigid, hence left standing")
    _name_the_rest(file, nodes, notices)
    cameras, lights = read_cameras(file, nodes, notices), read_lights(file, nodes, notices)
    return Model(meshes, table.materials, table.textures, cameras, lights)


# -- objects ----------------------------------------------------------------------------------------------------------


def _primitives(file: GltfFile, drawn: list[Node], notices: Notices) -> list[Wanted]:
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


# -- what is left out ------------------------------------------------------------------------------------------------


def _name_the_rest(file: GltfFile, nodes: list[Node], notices: Notices) -> None:
    """One notice for each feature of the file that does not show in the picture."""
    skinned = sum("skin" in node.entry for node in nodes)
    instanced = sum("EXT_mesh_gpu_instancing" in file.table(node.entry, "extensions", node.name) for node in nodes)
    meshes = {node.entry["mesh"] for node in nodes if "mesh" in node.entry}
    primitives = [
        p for m in meshes for p in file.tables(file.entry("meshes", m, "a node"), "primitives", f"meshes[{m}]")
    ]
    morphing = sum("targets" in p for p in primitives)
    if instanced:
        notices.add(f"{counted(instanced, 'node')} with EXT_mesh_gpu_instancing: drawn once only")
    if skinned or morphing:
        notices.add(f"{counted(skinned + morphing, 'skinned or morphing object')}: drawn in the rest pose")
    unknown = [
        name
        for name in file.names("extensionsUsed")
        if not name.startswith("KHR_materials_") and name not in _KNOWN_ELSEWHERE | {"EXT_mesh_gpu_instancing"}
    ]
    if unknown:
        notices.add(f"extensions left out: {', '.join(unknown)}")
