"""Triangles on their way from a file to a :class:`~raytrace.scene.Mesh`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from raytrace.camera import NamedCamera
from raytrace.punctual import PunctualLight
from raytrace.scene import Material, Mesh, Texture

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True)
class Part:
    """Triangles of one object that have the same kinds of vertex data.

    ``vertices`` (V, 3) float64, ``faces`` (F, 3) int64, ``materials`` (F,) int64; ``normals`` (V, 3) float64 or None
    for flat shading, ``uvs`` (V, 2) float64 or None, origin at the lower left; ``colors`` (V, 4) float64, linear, or
    None for white.
    """

    vertices: F64
    faces: I64
    materials: I64
    normals: F64 | None = None
    uvs: F64 | None = None
    colors: F64 | None = None


@dataclass
class Model:
    """What a file holds, before it gets a name, a camera and a sky where it has none."""

    meshes: list[Mesh]
    materials: list[Material]
    textures: list[Texture] = field(default_factory=list)
    cameras: list[NamedCamera] = field(default_factory=list)
    lights: list[PunctualLight] = field(default_factory=list)


def face_normals(vertices: F64, faces: I64) -> F64:
    """Unit normals of triangles that have an area, (F, 3) float64, towards the side seen counterclockwise."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    # Edges are scaled to the length 1 first, so that their product neither under- nor overflows.
    first, second = normalized(b - a), normalized(c - a)
    return normalized(np.cross(first, second))


def normalized(vectors: F64) -> F64:
    """``vectors`` (..., 3) at length 1; a zero vector stays zero."""
    largest = longest_component(vectors)
    scaled = vectors / np.where(largest > 0.0, largest, 1.0)[..., None]
    scaled /= np.maximum(lengths(scaled), 1.0)[..., None]  # which is at least 1 where not zero
    return scaled


def longest_component(vectors: F64) -> F64:
    """Largest absolute component of ``vectors`` (..., 3); NumPy's own reduction over so short an axis is slow."""
    x, y, z = (np.abs(vectors[..., k]) for k in range(3))
    return np.maximum(np.maximum(x, y), z)


def lengths(vectors: F64) -> F64:
    """Euclidean lengths of ``vectors`` (..., 3)."""
    squares: F64 = np.einsum("...i,...i->...", vectors, vectors)
    return np.sqrt(squares)


def compacted(part: Part) -> Part:
    """Without the vertices that no triangle uses: files often share one large array between many parts."""
    if part.faces.size * 4 < len(part.vertices):
        used, faces = np.unique(part.faces, return_inverse=True)
        faces = faces.reshape(-1, 3)
    else:
        mask = np.zeros(len(part.vertices), dtype=bool)
        mask[part.faces] = True
        if mask.all():
            return part
        used = np.flatnonzero(mask)
        faces = (np.cumsum(mask) - 1)[part.faces]
    return replace(
        part,
        vertices=part.vertices[used],
        faces=faces,
        normals=None if part.normals is None else part.normals[used],
        uvs=None if part.uvs is None else part.uvs[used],
        colors=None if part.colors is None else part.colors[used],
    )


def transformed(part: Part, matrix: F64) -> Part:
    """In the space that ``matrix``, (4, 4) invertible for column vectors, leads to.

    Normals go by the inverse transpose. A mirroring turns counterclockwise triangles clockwise; glTF 2.0, sec. 3.7.4
    wants them back.
    """
    linear = matrix[:3, :3]
    mirrored = np.linalg.det(linear) < 0.0
    return replace(
        part,
        vertices=part.vertices @ linear.T + matrix[:3, 3],
        faces=part.faces[:, ::-1] if mirrored else part.faces,
        normals=None if part.normals is None else normalized(part.normals @ np.linalg.inv(linear)),
    )


def _with_corner_normals(part: Part) -> Part:
    """The same look without ``normals`` being None: three vertices of its own for each triangle."""
    corners = part.faces.reshape(-1)
    return replace(
        part,
        vertices=part.vertices[corners],
        faces=np.arange(len(corners), dtype=np.int64).reshape(-1, 3),
        normals=np.repeat(face_normals(part.vertices, part.faces), 3, axis=0),
        uvs=None if part.uvs is None else part.uvs[corners],
        colors=None if part.colors is None else part.colors[corners],
    )


def merged(name: str, parts: Sequence[Part]) -> Mesh:
    """One object of all ``parts``. Flat and smooth ones, with and without texture coordinates or colours, mix."""
    if any(part.normals is not None for part in parts):
        parts = [part if part.normals is not None else _with_corner_normals(part) for part in parts]
    first_vertex = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = [part.faces + first for part, first in zip(parts, first_vertex, strict=False)]
    normals = [part.normals for part in parts if part.normals is not None]
    uvs = None
    if any(part.uvs is not None for part in parts):
        uvs = [np.zeros((len(part.vertices), 2)) if part.uvs is None else part.uvs for part in parts]
    colors = None
    if any(part.colors is not None for part in parts):
        colors = [np.ones((len(part.vertices), 4)) if part.colors is None else part.colors for part in parts]
        if all((color == 1.0).all() for color in colors):
            colors = None
    return Mesh(
        name=name,
        vertices=np.concatenate([part.vertices for part in parts]),
        faces=np.concatenate(faces).astype(np.int32),
        materials=np.concatenate([part.materials for part in parts]).astype(np.int32),
        normals=np.concatenate(normals).astype(np.float32) if normals else None,
        uvs=None if uvs is None else np.concatenate(uvs).astype(np.float32),
        colors=None if colors is None else np.concatenate(colors).astype(np.float32),
    )
