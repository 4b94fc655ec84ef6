"""Meshes of simple things: boxes, rounded boxes, cushions, prisms and the transforms that place them.

Everything is metres, y up. A :class:`Shape` is immutable; its triangles are counter-clockwise seen from outside and its
pieces are closed wherever they have an inside, so that a path tracer may shade either face. Corners that should look
sharp have a vertex per face, corners that should look round share a normal. Surfaces of revolution, tubes and cloth
are in :mod:`assets.surfaces`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from raytrace.scene import F32, F64, I32

Axis = Literal["x", "y", "z"]


@dataclass(frozen=True)
class Shape:
    """Triangles with a normal and a texture coordinate per vertex.

    ``vertices`` (V, 3) float64, ``faces`` (F, 3) int32, ``normals`` (V, 3) float32 of unit length, ``uvs`` (V, 2)
    float32.
    """

    vertices: F64
    faces: I32
    normals: F32
    uvs: F32

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Shape:
        """The shape shifted by a vector."""
        return replace(self, vertices=self.vertices + np.array([x, y, z]))

    def turned(self, axis: Axis, degrees: float) -> Shape:
        """The shape turned about an axis through the origin, by the right-hand rule."""
        matrix = rotation(axis, math.radians(degrees))
        normals = np.ascontiguousarray(self.normals @ matrix.T.astype(np.float32))
        return replace(self, vertices=self.vertices @ matrix.T, normals=normals)

    def scaled(self, factor: float) -> Shape:
        """The shape scaled uniformly about the origin; ``factor`` > 0. Texture coordinates stay."""
        return replace(self, vertices=self.vertices * factor)

    def stretched(self, x: float = 1.0, y: float = 1.0, z: float = 1.0) -> Shape:
        """The shape scaled along the axes, each factor > 0; normals go by the inverse transpose."""
        factors = np.array([x, y, z])
        normals = self.normals / factors
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return replace(self, vertices=self.vertices * factors, normals=normals.astype(np.float32))

    def mapped(self, scale: tuple[float, float] = (1.0, 1.0), shift: tuple[float, float] = (0.0, 0.0)) -> Shape:
        """The shape with texture coordinates ``uv * scale + shift``."""
        uvs = self.uvs * np.array(scale, dtype=np.float32) + np.array(shift, dtype=np.float32)
        return replace(self, uvs=uvs)


def rotation(axis: Axis, angle: float) -> F64:
    """(3, 3) rotation matrix for column vectors; ``angle`` in radians, right-hand rule."""
    c, s = math.cos(angle), math.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    return matrix


def join(shapes: Iterable[Shape]) -> Shape:
    """One shape out of several; at least one is needed."""
    parts = list(shapes)
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    return Shape(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + np.int32(start) for part, start in zip(parts, starts, strict=True)]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.uvs for part in parts]),
    )


def grid_faces(rows: int, columns: int) -> I32:
    """(2 * (rows - 1) * (columns - 1), 3) triangles of a row-major grid of points.

    The front side is the one that the cross product of the row step and the column step points to.
    """
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    down, right = corner + columns, corner + 1
    lower = np.stack([corner, down, down + 1], axis=1)
    upper = np.stack([corner, down + 1, right], axis=1)
    return np.concatenate([lower, upper]).astype(np.int32)


def quad(corners: Sequence[Sequence[float]], repeats: tuple[float, float] = (1.0, 1.0)) -> Shape:
    """A flat quadrilateral, corners counter-clockwise seen from its front; one that is nearly flat gets a mean normal.

    ``repeats``: texture coordinates run from (0, 0) at the first corner to ``repeats`` at the third.
    """
    points = np.array(corners, dtype=np.float64)
    normal = np.cross(points[2] - points[0], points[3] - points[1])
    normal /= np.linalg.norm(normal)
    u, v = repeats
    return Shape(
        points,
        np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
        np.tile(normal.astype(np.float32), (4, 1)),
        np.array([[0, 0], [u, 0], [u, v], [0, v]], dtype=np.float32),
    )


# Row and column axes and the normal's sign of the six sides of a box: row step x column step = outward normal.
_SIDES = (((1, 2), 0, 1.0), ((2, 1), 0, -1.0), ((2, 0), 1, 1.0), ((0, 2), 1, -1.0), ((0, 1), 2, 1.0), ((1, 0), 2, -1.0))


def _unit_box() -> Shape:
    """The box of side 2 about the origin, four vertices to a side; its texture coordinates are all 0."""
    sides = []
    for (row, column), normal, sign in _SIDES:
        points = np.zeros((4, 3))
        points[:, normal] = sign
        points[:, row] = [-1, -1, 1, 1]
        points[:, column] = [-1, 1, -1, 1]
        normals = np.zeros((4, 3), dtype=np.float32)
        normals[:, normal] = sign
        sides.append(Shape(points, grid_faces(2, 2), normals, np.zeros((4, 2), dtype=np.float32)))
    return join(sides)


_UNIT_BOX = _unit_box()


def box(size: tuple[float, float, float], texel_metres: float = 1.0) -> Shape:
    """A box with sharp edges, centred at the origin.

    Each side is textured from its own plane, one repeat per ``texel_metres``, v along y on upright sides and the
    grain (u) along the longer edge on the others.
    """
    half = np.array(size) / 2
    vertices = _UNIT_BOX.vertices * half
    # The coordinates that become u and v on the sides across x, y and z, eight vertices each.
    flat_u, flat_v = (0, 2) if size[0] >= size[2] else (2, 0)
    u, v = [2] * 8 + [flat_u] * 8 + [0] * 8, [1] * 8 + [flat_v] * 8 + [1] * 8
    vertex = np.arange(24)[:, None]
    uvs = ((vertices + half)[vertex, np.array([u, v]).T] / texel_metres).astype(np.float32)
    return replace(_UNIT_BOX, vertices=vertices, uvs=uvs)


def _plane_uvs(points: F64, normal: int, size: tuple[float, float, float], texel_metres: float) -> F32:
    """(V, 2) texture coordinates of points in a plane across axis ``normal``, relative to the box's lower corner."""
    u, v = {0: (2, 1), 1: (0, 2), 2: (0, 1)}[normal]
    if size[v] > size[u] and normal == 1:
        u, v = v, u
    corner = np.array(size) / 2
    return ((points + corner)[:, [u, v]] / texel_metres).astype(np.float32)


def block(lower: tuple[float, float, float], upper: tuple[float, float, float], texel_metres: float = 1.0) -> Shape:
    """The :func:`box` between two opposite corners."""
    a, b = np.array(lower), np.array(upper)
    x, y, z = (float(c) for c in b - a)
    return box((x, y, z), texel_metres).moved(*(float(c) for c in (a + b) / 2))


def _rounded_steps(half: float, radius: float, segments: int, inner: int) -> F64:
    """Coordinates across one side of a rounded box: the curved margin in equal angles, the flat part in ``inner``."""
    margin = radius * np.tan(np.linspace(math.pi / 4, 0.0, segments + 1))[:-1]
    flat = half - radius
    return np.concatenate([-flat - margin, np.linspace(-flat, flat, inner + 1), flat + margin[::-1]])


def rounded_box(
    size: tuple[float, float, float],
    radius: float,
    segments: int = 3,
    inner: int = 1,
    texel_metres: float = 1.0,
) -> Shape:
    """A box whose edges and corners are rounded with ``radius`` (< half of every side), centred at the origin.

    ``segments``: steps over each half of a rounded edge; ``inner``: steps over the flat part of each side.
    """
    half = np.array(size) / 2
    sides = []
    for (row, column), normal, sign in _SIDES:
        rows = _rounded_steps(half[row], radius, segments, inner)
        columns = _rounded_steps(half[column], radius, segments, inner)
        on_cube = np.empty((len(rows) * len(columns), 3))
        on_cube[:, row], on_cube[:, column] = np.repeat(rows, len(columns)), np.tile(columns, len(rows))
        on_cube[:, normal] = sign * half[normal]
        core = np.clip(on_cube, radius - half, half - radius)
        normals = on_cube - core
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        uvs = _plane_uvs(on_cube, normal, size, texel_metres)
        sides.append(
            Shape(core + radius * normals, grid_faces(len(rows), len(columns)), normals.astype(np.float32), uvs)
        )
    return join(sides)


def cushion(
    size: tuple[float, float, float], radius: float, bulge: float, inner: int = 5, texel_metres: float = 0.5
) -> Shape:
    """A rounded box whose top and bottom swell by ``bulge`` towards the middle: upholstery, and thin ones are pillows.

    y' = y (1 + b(x, z) / h) with b = bulge (1 - (x/X)²)(1 - (z/Z)²); normals by the inverse transpose of its Jacobian.
    """
    shape = rounded_box(size, radius, 2, inner, texel_metres)
    x, y, z = shape.vertices.T
    half_x, half_y, half_z = (side / 2 for side in size)
    across_x, across_z = 1 - (x / half_x) ** 2, 1 - (z / half_z) ** 2
    stretch = 1 + bulge * across_x * across_z / half_y
    slope_x = y / half_y * bulge * across_z * (-2 * x / half_x**2)
    slope_z = y / half_y * bulge * across_x * (-2 * z / half_z**2)
    up = shape.normals[:, 1] / stretch
    normals = np.stack([shape.normals[:, 0] - slope_x * up, up, shape.normals[:, 2] - slope_z * up], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return replace(shape, vertices=np.stack([x, y * stretch, z], axis=1), normals=normals.astype(np.float32))


def prism(
    outline: Sequence[Sequence[float]] | F64, depth: float, crease_degrees: float = 35.0, texel_metres: float = 1.0
) -> Shape:
    """An outline in the xy plane, counter-clockwise and star-shaped about its mean, drawn out from z = 0 to ``depth``.

    Corners flatter than ``crease_degrees`` are shaded round. Raises ValueError where the mean does not see every edge
    from its left.
    """
    ring = np.array(outline, dtype=np.float64)
    count = len(ring)
    steps = np.roll(ring, -1, axis=0) - ring
    spokes = ring.mean(0) - ring
    if (steps[:, 0] * spokes[:, 1] <= steps[:, 1] * spokes[:, 0]).any():
        raise ValueError("the outline must be counter-clockwise and star-shaped about its mean")
    lengths = np.linalg.norm(steps, axis=1)
    starts, ends = crease_normals(
        np.stack([steps[:, 1], -steps[:, 0]], axis=1) / lengths[:, None], crease_degrees, True
    )
    along = np.concatenate([[0.0], np.cumsum(lengths)])

    points = np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)  # (count, 2 ends, 2)
    side = np.zeros((count, 2, 2, 3))  # edge, end of the edge, near or far
    side[..., :2] = points[:, :, None, :]
    side[:, :, 1, 2] = depth
    normals = np.zeros_like(side)
    normals[..., :2] = np.stack([starts, ends], axis=1)[:, :, None, :]
    uvs = np.zeros((count, 2, 2, 2))
    uvs[..., 1] = np.stack([along[:-1], along[1:]], axis=1)[:, :, None]
    uvs[..., 0] = np.array([0.0, depth])
    faces = np.concatenate([grid_faces(2, 2) + 4 * edge for edge in range(count)])
    walls = Shape(side.reshape(-1, 3), faces, normals.reshape(-1, 3).astype(np.float32), _metres(uvs, texel_metres))
    return join([walls, _fan(ring, 0.0, -1.0, texel_metres), _fan(ring, depth, 1.0, texel_metres)])


def _metres(uvs: F64, texel_metres: float) -> F32:
    return (uvs.reshape(-1, 2) / texel_metres).astype(np.float32)


def _fan(ring: F64, z: float, sign: float, texel_metres: float) -> Shape:
    """Triangles from the mean of a counter-clockwise ring to its edges, in the plane ``z``, facing ``sign`` z."""
    flat = np.concatenate([ring, ring.mean(0, keepdims=True)])
    count = len(ring)
    index = np.arange(count)
    following = (index + 1) % count
    faces = np.stack(
        [np.full(count, count), index, following] if sign > 0 else [np.full(count, count), following, index]
    )
    vertices = np.concatenate([flat, np.full((count + 1, 1), z)], axis=1)
    normals = np.tile(np.array([0.0, 0.0, sign], dtype=np.float32), (count + 1, 1))
    return Shape(vertices, np.ascontiguousarray(faces.T, dtype=np.int32), normals, _metres(flat, texel_metres))


def crease_normals(edge_normals: F64, crease_degrees: float, closed: bool) -> tuple[F64, F64]:
    """Normals at the start and at the end of each edge of a polyline, (E, 2) each.

    Where two edges meet at less than ``crease_degrees`` both get their mean, elsewhere each keeps its own.
    """
    before, after = np.roll(edge_normals, 1, axis=0), np.roll(edge_normals, -1, axis=0)
    limit = math.cos(math.radians(crease_degrees))

    def blend(other: F64) -> F64:
        mean = edge_normals + other
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        round_corner = np.sum(edge_normals * other, axis=1, keepdims=True) > limit
        return np.where(round_corner, mean / np.maximum(length, 1e-12), edge_normals)

    starts, ends = blend(before), blend(after)
    if not closed:
        starts[0], ends[-1] = edge_normals[0], edge_normals[-1]
    return starts, ends
