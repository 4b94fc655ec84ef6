"""PLY through trimesh: ASCII and binary, with or without normals and texture coordinates."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trimesh.exchange.ply import load_ply as trimesh_load_ply
from trimesh.geometry import triangulate_quads

from errors import Notices, UserError
from raytrace.images import decode_image
from raytrace.parts import F64, I64, Model, Part, merged
from raytrace.repair import Repairs, repaired
from raytrace.resources import find_beside, read_bytes
from raytrace.scene import Material, Texture

_UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
_INDEX_NAMES = ("vertex_index", "vertex_indices")
_CORNER_UV_NAMES = ("texcoord",)  # a face's list of u, v per corner, as MeshLab writes it
_HEADER_LIMIT = 1 << 16


def load_ply(path: Path, notices: Notices) -> Model:
    """One mesh of one light grey material that has two sides, textured where the header names a ``TextureFile``.

    Raises UserError for a file that is damaged or has no faces, and for a missing texture.
    """
    data = read_bytes(path)
    if data[:3] != b"ply":
        raise UserError(f"{path}: is not a PLY file (it does not start with 'ply')", "is it the right file?")
    textures = _textures(path, data[:_HEADER_LIMIT], notices)
    part = _part(path, data, bool(textures), notices)
    repairs = Repairs()
    part = repaired(part, str(path), repairs)
    repairs.flat_objects = int(part.normals is None)
    repairs.report(notices)
    material = Material(path.stem, (1.0,) * 3 if textures else (0.8,) * 3, 0 if textures else -1, double_sided=True)
    return Model([merged(path.stem, [part])] if len(part.faces) else [], [material], textures)


def _textures(path: Path, header: bytes, notices: Notices) -> list[Texture]:
    names = [
        line.split(None, 2)[2].strip()
        for line in header.partition(b"end_header")[0].decode("utf-8", errors="replace").splitlines()
        if line.lower().startswith("comment texturefile ") and len(line.split()) > 2
    ]
    if len(names) > 1:
        notices.add(f"{len(names)} textures: only the first, {names[0]}, is used")
    textures = []
    for name in names[:1]:
        found = find_beside(path.parent, name)
        if found is None:
            raise UserError(f"{path}: texture {name} is not there", f"put it into {path.parent}")
        textures.append(decode_image(read_bytes(found), name, str(path), notices))
    return textures


def _part(path: Path, data: bytes, textured: bool, notices: Notices) -> Part:
    try:
        with np.errstate(all="ignore"):
            # fix_texture would split vertices and forget their normals; texture coordinates are read below instead.
            loaded: Mapping[str, Any] = trimesh_load_ply(io.BytesIO(data), fix_texture=False, skip_materials=True)
            faces = None if loaded.get("faces") is None else _triangles(loaded["faces"])
            vertices, normals = _vectors(loaded, "vertices"), _vectors(loaded, "vertex_normals")
    except Exception as error:  # trimesh raises whatever NumPy raised
        raise UserError(
            f"{path}: trimesh cannot read this file ({type(error).__name__}: {error})",
            "it may be cut short, or mix triangles with other polygons: export it again, with triangles only",
        ) from error
    if faces is None or len(faces) == 0 or vertices is None:
        raise UserError(f"{path}: has no faces", "a cloud of points cannot be drawn: make a surface of it first")
    elements = loaded["metadata"]["_ply_raw"]
    for kind in ("vertex", "face"):
        _check_complete(path, kind, elements[kind])
    if loaded.get("vertex_colors") is not None or loaded.get("face_colors") is not None:
        notices.add("vertex and face colours left out")
    part = Part(
        vertices=vertices,
        faces=faces,
        materials=np.zeros(len(faces), dtype=np.int64),
        normals=normals,
    )
    return _with_uvs(part, elements, notices) if textured else part


def _vectors(loaded: Mapping[str, Any], name: str) -> F64 | None:
    """(V, 3), None where there is none. Raises ValueError for anything else, such as lists of different length."""
    return np.asarray(loaded[name], dtype=np.float64).reshape(-1, 3) if name in loaded else None


def _triangles(faces: Any) -> I64:
    return np.asarray(triangulate_quads(faces), dtype=np.int64).reshape(-1, 3)


def _check_complete(path: Path, kind: str, element: Mapping[str, Any]) -> None:
    """trimesh reads a text file that ends too early without a word."""
    data, promised = element["data"], int(element["length"])
    there = len(data) if isinstance(data, np.ndarray) else min(len(column) for column in data.values())
    if there < promised:
        raise UserError(
            f"{path}: is truncated: {there:,} of {promised:,} entries of {kind!r} are there", "copy or export it again"
        )


def _with_uvs(part: Part, elements: Mapping[str, Any], notices: Notices) -> Part:
    vertex = elements["vertex"]["data"]
    for pair in _UV_NAMES:
        if all(name in elements["vertex"]["properties"] for name in pair):
            return replace(part, uvs=np.column_stack([np.asarray(vertex[name], dtype=np.float64) for name in pair]))
    indices, uvs = (_list_property(elements["face"], names) for names in (_INDEX_NAMES, _CORNER_UV_NAMES))
    in_range = part.faces.min() >= 0 and part.faces.max() < len(part.vertices)  # if not, the repair says so
    if indices is None or uvs is None or uvs.size != indices.size * 2 or not in_range:
        notices.add("a texture without texture coordinates: drawn in the texture's corner colour")
        return part
    # A vertex has different texture coordinates in different faces: each corner becomes a vertex.
    corners = indices.astype(np.int64).reshape(-1)
    return replace(
        part,
        vertices=part.vertices[corners],
        faces=_triangles(np.arange(len(corners)).reshape(indices.shape)),
        normals=None if part.normals is None else part.normals[corners],
        uvs=uvs.astype(np.float64).reshape(-1, 2),
    )


def _list_property(element: Mapping[str, Any], names: Sequence[str]) -> NDArray[Any] | None:
    """A list of numbers per face as (F, n), None where there is none or its lengths differ."""
    data = element["data"]
    for name in names:
        if name in element["properties"]:
            column: NDArray[Any] = data[name]["f1"] if isinstance(data, np.ndarray) else data[name]
            return column if column.ndim == 2 else None
    return None
