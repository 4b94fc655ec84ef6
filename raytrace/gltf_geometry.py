"""Triangles of glTF primitives, read by trimesh.

trimesh decodes buffers, strides and strips. What it does with names, materials and nodes loses information, so it is
handed a document of our own instead of the file's: one mesh per primitive, named after its place in the file, with
normals and texture coordinates under names that it passes through unchanged. Whether a primitive has normals of its own
is then no question, and nothing can be mixed up however the file names its meshes.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trimesh.exchange.gltf import load_gltf

from raytrace.gltf_file import Entry, GltfFile
from raytrace.parts import F64, Part

TRIANGLES, TRIANGLE_STRIP = 4, 5

_NORMALS, _UVS, _COLORS = "_NORMAL", "_UV", "_COLOR"  # trimesh keeps attributes with a leading underscore as they are


@dataclass(frozen=True)
class Wanted:
    """A primitive to read: number ``index`` of mesh ``mesh``, with texture coordinate set ``uv_set`` or none."""

    mesh: int
    index: int
    name: str
    primitive: Entry
    uv_set: int | None = None

    @property
    def key(self) -> tuple[int, int]:
        return self.mesh, self.index


@dataclass
class _Document:
    """The reduced glTF document that trimesh gets. ``views`` are its buffers by name, not copied from the file's."""

    file: GltfFile
    views: dict[str, memoryview] = field(default_factory=dict)
    accessors: list[Entry] = field(default_factory=list)
    meshes: list[Entry] = field(default_factory=list)
    _accessor_numbers: dict[int, int] = field(default_factory=dict)
    _view_entries: list[Entry] = field(default_factory=list)
    _view_numbers: dict[int, int] = field(default_factory=dict)

    def add_accessor(self, index: Any, kind: str, user: str) -> int:
        """Number of the file's accessor ``index`` in this document."""
        entry = self.file.accessor(index, kind, user)
        if index not in self._accessor_numbers:
            self._accessor_numbers[index] = len(self.accessors)
            kept = {key: entry[key] for key in ("byteOffset", "componentType", "count", "type") if key in entry}
            self.accessors.append(kept | {"bufferView": self._add_view(entry["bufferView"], user)})
        return self._accessor_numbers[index]

    def _add_view(self, index: int, user: str) -> int:
        if index not in self._view_numbers:
            data = self.file.view(index, user)
            entry: Entry = {"buffer": len(self._view_entries), "byteLength": len(data)}
            stride = self.file.whole(
                self.file.entry("bufferViews", index, user), "byteStride", 0, f"bufferViews[{index}]"
            )
            if stride:
                entry["byteStride"] = stride
            self._view_numbers[index] = len(self._view_entries)
            self._view_entries.append(entry)
            self.views[str(self._view_numbers[index])] = data
        return self._view_numbers[index]

    def encoded(self) -> bytes:
        tree = {
            "asset": {"version": "2.0"},
            "buffers": [{"uri": name, "byteLength": len(data)} for name, data in self.views.items()],
            "bufferViews": self._view_entries,
            "accessors": self.accessors,
            "meshes": self.meshes,
        }
        return json.dumps(tree).encode()


def read_parts(file: GltfFile, wanted: Iterable[Wanted]) -> dict[tuple[int, int], Part]:
    """Triangles of each wanted primitive in its mesh's own space, by ``Wanted.key``; materials are all 0.

    Primitives without elements are left out. Texture coordinates have glTF's origin, at the upper left, still.
    Raises UserError for attributes that are missing, of the wrong type or length, or damaged.
    """
    document = _Document(file)
    listed = [item for item in wanted if _add_primitive(document, item)]
    if not listed:
        return {}
    try:
        with np.errstate(all="ignore"):
            loaded = load_gltf(io.BytesIO(document.encoded()), resolver=document.views, skip_materials=True)
    except Exception as error:  # trimesh raises whatever NumPy or json raised
        raise file.error(
            f"trimesh cannot read the triangles ({type(error).__name__}: {error})", "export the file again"
        ) from error
    geometry = loaded["geometry"]
    return {item.key: _part(file, item, geometry[_name(item)]) for item in listed}


def _name(item: Wanted) -> str:
    return f"{item.mesh}/{item.index}"


def _add_primitive(document: _Document, item: Wanted) -> bool:
    """Add one primitive; False where it has no elements."""
    file, where = document.file, f"mesh {item.name!r}, primitive {item.index}"
    attributes = file.table(item.primitive, "attributes", where)
    kinds = {"POSITION": ("POSITION", "VEC3"), "NORMAL": (_NORMALS, "VEC3")}
    if item.uv_set is not None:
        kinds[f"TEXCOORD_{item.uv_set}"] = (_UVS, "VEC2")
    if "COLOR_0" in attributes:
        kind = file.entry("accessors", attributes["COLOR_0"], f"COLOR_0 of {where}").get("type")
        kinds["COLOR_0"] = (_COLORS, "VEC3" if kind == "VEC3" else "VEC4")
    if "KHR_draco_mesh_compression" in file.table(item.primitive, "extensions", where):
        raise file.compression_error("KHR_draco_mesh_compression")
    numbers: dict[str, int] = {}
    counts: dict[str, int] = {}
    for source, (target, kind) in kinds.items():
        if source in attributes:
            numbers[target] = document.add_accessor(attributes[source], kind, f"{source} of {where}")
            counts[source] = document.accessors[numbers[target]]["count"]
    if len(set(counts.values())) > 1:
        listing = ", ".join(f"{count} for {name}" for name, count in counts.items())
        raise file.error(f"{where} has attributes of different length ({listing})")
    result: Entry = {"attributes": numbers, "mode": item.primitive.get("mode", TRIANGLES)}
    elements = counts["POSITION"]
    if "indices" in item.primitive:
        result["indices"] = document.add_accessor(item.primitive["indices"], "SCALAR", f"the indices of {where}")
        accessor = document.accessors[result["indices"]]
        if accessor["componentType"] not in (5121, 5123, 5125):
            raise file.error(f"{where} has indices of type {accessor['componentType']}; they must be unsigned")
        elements = accessor["count"]
    if elements == 0:
        return False
    if result["mode"] == TRIANGLES and elements % 3:
        raise file.error(f"{where} has {elements} corners, which is not a multiple of 3")
    if result["mode"] == TRIANGLE_STRIP and elements < 3:
        return False
    document.meshes.append({"name": _name(item), "primitives": [result]})
    return True


def _part(file: GltfFile, item: Wanted, loaded: Mapping[str, Any]) -> Part:
    attributes = file.table(item.primitive, "attributes", item.name)
    extra: Mapping[str, NDArray[Any]] = loaded.get("vertex_attributes", {})
    faces = np.asarray(loaded["faces"], dtype=np.int64)

    def floats(array: NDArray[Any], source: str) -> F64:
        return _floats(array, file.entry("accessors", attributes[source], item.name).get("normalized") is True)

    return Part(
        vertices=floats(loaded["vertices"], "POSITION"),
        faces=faces,
        materials=np.zeros(len(faces), dtype=np.int64),
        normals=floats(extra[_NORMALS], "NORMAL") if _NORMALS in extra else None,
        uvs=floats(extra[_UVS], f"TEXCOORD_{item.uv_set}") if _UVS in extra else None,
        colors=_with_alpha(floats(extra[_COLORS], "COLOR_0")) if _COLORS in extra else None,
    )


def _with_alpha(colors: F64) -> F64:
    """(V, 4) in [0, 1] from (V, 3) or (V, 4) linear colours; what is no number is white."""
    whole = np.ones((len(colors), 4))
    whole[:, : colors.shape[1]] = colors
    return np.clip(np.where(np.isfinite(whole), whole, 1.0), 0.0, 1.0)


def _floats(array: NDArray[Any], is_normalized: bool) -> F64:
    """float64 values; normalised integers are fractions of the largest (glTF 2.0, sec. 3.6.2.2)."""
    values = array.astype(np.float64)
    if is_normalized and array.dtype.kind in "iu":
        values = np.maximum(values / np.iinfo(array.dtype).max, -1.0)
    return values
