"""What is wrong with triangles in real files: refused where nothing sensible can be drawn, else mended and counted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from errors import Notices, UserError
from raytrace.parts import F64, I64, Part, compacted, face_normals, lengths, longest_component, normalized

Mask = NDArray[np.bool_]

MAX_COORDINATE = 1e12
"""Largest coordinate in scene units: beyond it, squares of products leave float32."""

_MAX_UV = 1e6
_FLAT = 1e-12  # height over longest edge at which a triangle counts as a line
_NO_DIRECTION = 1e-9
_UNIT = 1e-2  # a normal stored in bytes may be this far from length 1 without being wrong


@dataclass
class Repairs:
    """How much was mended, over all objects of a file."""

    degenerate: int = 0
    rescaled_normals: int = 0
    replaced_normals: int = 0
    texture_coordinates: int = 0
    flat_objects: int = 0

    def report(self, notices: Notices) -> None:
        """One line for each kind."""
        if self.degenerate:
            notices.add(f"repaired: {counted(self.degenerate, 'triangle')} without area dropped")
        if self.rescaled_normals:
            notices.add(f"repaired: {counted(self.rescaled_normals, 'normal')} brought to length 1")
        if self.replaced_normals:
            notices.add(
                f"repaired: {counted(self.replaced_normals, 'zero or NaN normal')} replaced by the triangle's own"
            )
        if self.texture_coordinates:
            notices.add(f"repaired: {counted(self.texture_coordinates, 'unusable texture coordinate')} set to 0")
        if self.flat_objects:
            notices.add(f"{counted(self.flat_objects, 'object')} without normals: shaded flat")


def counted(n: int, noun: str, plural: str = "") -> str:
    """``"1 object"``, ``"12,345 objects"``."""
    return f"{n:,} {noun if n == 1 else plural or noun + 's'}"


def repaired(part: Part, where: str, repairs: Repairs) -> Part:
    """``part`` without triangles that have no area, with unit normals and finite texture coordinates.

    ``where`` names the file and the object. Raises UserError for an index out of range and for vertices that are NaN,
    infinite or absurdly far away.
    """
    _check_indices(part, where)
    part = compacted(part)
    check_coordinates(part.vertices, where)
    flat = without_area(part.vertices, part.faces)
    if flat.any():
        repairs.degenerate += int(flat.sum())
        part = compacted(replace(part, faces=part.faces[~flat], materials=part.materials[~flat]))
    if part.uvs is not None:
        good = np.abs(part.uvs) <= _MAX_UV
        bad = ~(good[:, 0] & good[:, 1])
        repairs.texture_coordinates += int(bad.sum())
        part = replace(part, uvs=np.where(bad[:, None], 0.0, part.uvs))
    return _with_unit_normals(part, repairs)


def _check_indices(part: Part, where: str) -> None:
    if part.faces.size == 0:
        return
    for index in (int(part.faces.min()), int(part.faces.max())):
        if not 0 <= index < len(part.vertices):
            raise UserError(
                f"{where}: a triangle uses vertex {index}, but there are {len(part.vertices)}",
                "the file is damaged or was cut short: export it again",
            )


def check_coordinates(vertices: F64, where: str) -> None:
    """Raises UserError unless all ``vertices`` (V, 3) are finite and within MAX_COORDINATE."""
    largest = longest_component(vertices)
    broken = int((~np.isfinite(largest)).sum())
    if broken:
        raise UserError(
            f"{where}: {broken:,} of {counted(len(vertices), 'vertex', 'vertices')} {'is' if broken == 1 else 'are'} "
            "NaN or infinite",
            "repair the object in the program that made it, and export it again",
        )
    farthest = float(largest.max(initial=0.0))
    if farthest > MAX_COORDINATE:
        raise UserError(
            f"{where}: a coordinate of {farthest:.3g} is absurd (the limit is {MAX_COORDINATE:.0e})",
            "scale the object, or check its transform",
        )


def without_area(vertices: F64, faces: I64) -> Mask:
    """Which triangles are points or lines, (F,) bool: height over longest edge at most 1e-12."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    first, second = b - a, c - b
    longest = np.maximum(np.maximum(longest_component(first), longest_component(second)), longest_component(c - a))
    scale = np.where(longest > 0.0, longest, 1.0)[:, None]  # keeps the products clear of underflow
    height = lengths(np.cross(first / scale, second / scale))
    result: Mask = (height <= _FLAT) | (longest == 0.0)
    return result


def unit_normals(normals: F64, repairs: Repairs) -> F64:
    """``normals`` (V, 3) at length 1, and 0 where there is no direction; counts those that were of another length."""
    largest = longest_component(normals)
    lost = ~((largest >= _NO_DIRECTION) & np.isfinite(largest))
    normals = np.where(lost[:, None], 0.0, normals)
    off = np.abs(lengths(np.clip(normals, -2.0, 2.0)) - 1.0) > _UNIT
    repairs.rescaled_normals += int((off & ~lost).sum())
    return normalized(normals)


def _with_unit_normals(part: Part, repairs: Repairs) -> Part:
    if part.normals is None or len(part.faces) == 0:
        return part
    normals = unit_normals(part.normals, repairs)
    lost = longest_component(normals) == 0.0
    if lost.any():
        repairs.replaced_normals += int(lost.sum())
        own = np.zeros_like(normals)
        own[part.faces] = face_normals(part.vertices, part.faces)[:, None]  # of any triangle that uses the vertex
        normals[lost] = own[lost]
    return replace(part, normals=normals)
