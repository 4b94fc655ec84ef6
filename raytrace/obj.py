"""Wavefront OBJ with its MTL libraries, as a model."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from errors import Notices, UserError
from raytrace.images import decode_image
from raytrace.mtl import MtlMaterial, read_mtl
from raytrace.obj_text import ObjText, read_obj_text
from raytrace.parts import I64, Model, Part, merged
from raytrace.repair import Repairs, check_coordinates, counted, repaired, unit_normals
from raytrace.resources import find_beside, read_bytes
from raytrace.scene import Material, Texture

_PLAIN = 0.8  # reflectance where the file says nothing


def load_obj(path: Path, notices: Notices) -> Model:
    """All faces of ``path``, one mesh per ``o`` (or ``g``, in files without ``o``). ``Kd`` and ``Ke`` are linear.

    Polygons become triangle fans. The format has no notion of a front face, so every surface has two sides, lamps
    included. Raises UserError for text that cannot be understood, indices out of range and missing textures.
    """
    text = read_obj_text(path)
    check_coordinates(text.positions, str(path))
    if text.lines:
        notices.add(f"{counted(text.lines, 'face')} with fewer than three corners left out")
    if text.has_colors:
        notices.add("vertex colours left out")
    table = _Materials(path, text, notices)
    repairs = Repairs()
    normals = unit_normals(text.normals, repairs)
    meshes = []
    order = np.argsort(text.objects, kind="stable")
    bounds = np.searchsorted(text.objects[order], np.arange(len(text.object_names) + 1))
    for number, name in enumerate(text.object_names):
        chosen = order[bounds[number] : bounds[number + 1]]
        smooth = (text.corners[chosen, :, 2] >= 0).all(axis=1)
        pieces = [
            repaired(_part(text, faces, normals if kind else None, table.textured), f"{path}: object {name!r}", repairs)
            for kind, faces in ((True, chosen[smooth]), (False, chosen[~smooth]))
            if len(faces)
        ]
        pieces = [piece for piece in pieces if len(piece.faces)]
        if pieces:
            meshes.append(merged(name or path.stem, pieces))
            repairs.flat_objects += any(piece.normals is None for piece in pieces)
    repairs.report(notices)
    return Model(meshes, table.materials, table.textures)


def _part(text: ObjText, faces: I64, normals: NDArray[np.float64] | None, textured: NDArray[np.bool_]) -> Part:
    corners = text.corners[faces]
    materials = text.materials[faces]
    flat = corners.reshape(-1, 3)
    has_uvs = bool(textured[materials].any()) and bool((flat[:, 1] >= 0).any())
    if normals is None and not has_uvs:
        return Part(text.positions, corners[:, :, 0], materials)
    uvs = None
    if has_uvs:
        uvs = np.where(flat[:, 1:2] >= 0, text.uvs[flat[:, 1]], 0.0)
    return Part(
        vertices=text.positions[flat[:, 0]],
        faces=np.arange(len(flat), dtype=np.int64).reshape(-1, 3),
        materials=materials,
        normals=None if normals is None else normals[flat[:, 2]],
        uvs=uvs,
    )


class _Materials:
    """Scene materials in the order of ``text.material_names``; ``textured`` (M,): which read texture coordinates."""

    def __init__(self, path: Path, text: ObjText, notices: Notices) -> None:
        self.path, self.notices = path, notices
        self.textures: list[Texture] = []
        self._numbers: dict[Path, int] = {}
        library = self._libraries(text.libraries)
        used = set(np.flatnonzero(np.bincount(text.materials)).tolist())
        self.materials = [
            self._material(library.get(name), name) if number in used else Material(name)
            for number, name in enumerate(text.material_names)
        ]
        drawn = [library[name] for number, name in enumerate(text.material_names) if number in used and name in library]
        self._report(drawn)
        lost = [name for k, name in enumerate(text.material_names) if k in used and name and name not in library]
        if lost:
            notices.add(f"{counted(len(lost), 'material')} not in any MTL file ({lost[0]!r} for one): drawn light grey")
        self.textured = np.array([max(m.base_texture, m.emission_texture) >= 0 for m in self.materials])

    def _libraries(self, written: list[str]) -> dict[str, MtlMaterial]:
        found: dict[str, MtlMaterial] = {}
        for reference in dict.fromkeys(written):
            whole = find_beside(self.path.parent, reference)  # a name may have spaces, or a line several names
            paths = (
                [(reference, whole)] if whole else [(n, find_beside(self.path.parent, n)) for n in reference.split()]
            )
            for name, path in paths:
                if path is None:
                    self.notices.add(
                        f"material library {name} is not beside {self.path.name}: its materials are light grey"
                    )
                else:
                    found |= read_mtl(path)
        return found

    def _material(self, mtl: MtlMaterial | None, name: str) -> Material:
        if mtl is None:
            return Material(name or "no material", (_PLAIN,) * 3, double_sided=True)
        white = 1.0 if mtl.diffuse_texture else _PLAIN
        base = mtl.diffuse or (white, white, white)
        emission = mtl.emission or ((1.0,) * 3 if mtl.emission_texture else (0.0,) * 3)
        return Material(
            name=name,
            base_color=(min(max(base[0], 0.0), 1.0), min(max(base[1], 0.0), 1.0), min(max(base[2], 0.0), 1.0)),
            base_texture=self._texture(mtl, mtl.diffuse_texture),
            emission=(max(emission[0], 0.0), max(emission[1], 0.0), max(emission[2], 0.0)),
            emission_texture=self._texture(mtl, mtl.emission_texture),
            double_sided=True,
        )

    def _texture(self, mtl: MtlMaterial, reference: str) -> int:
        if not reference:
            return -1
        path = find_beside(mtl.folder, reference)
        if path is None:
            raise UserError(
                f"{self.path}: texture {reference} of material {mtl.name!r} is not there",
                f"put it into {mtl.folder}, or remove the line from the MTL file",
            )
        if path not in self._numbers:
            self._numbers[path] = len(self.textures)
            user = f"material {mtl.name!r} in {self.path}"
            self.textures.append(decode_image(read_bytes(path), reference, user, self.notices))
        return self._numbers[path]

    def _report(self, drawn: list[MtlMaterial]) -> None:
        facts = Counter[str]()
        for mtl in drawn:
            facts["glossy or reflecting material{s}: drawn as diffuse with their colour Kd"] += mtl.glossy
            facts["transparent material{s}: drawn opaque"] += mtl.transparent
            facts["material{s} with a bump or normal map: drawn without it"] += mtl.bumpy
            facts["material{s} with a moved or scaled texture: drawn as if it were not"] += mtl.placed
            facts["material{s} with Kd above 1: clamped"] += max(mtl.diffuse or (0.0,)) > 1.0
        for text, count in facts.items():
            if count:
                self.notices.add(f"{count} {text.format(s='' if count == 1 else 's')}")
