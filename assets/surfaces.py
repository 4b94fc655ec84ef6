"""Curved surfaces: smooth curves, surfaces of revolution, tubes, and cloth-like sheets with thickness.

Same conventions as :mod:`assets.shapes`, which has the flat and rounded solids.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from assets.shapes import Shape, crease_normals, grid_faces, join
from raytrace.scene import F64


def curve(controls: Sequence[Sequence[float]], samples: int) -> F64:
    """``samples`` points, (samples, d), on the uniform Catmull-Rom spline through the control points."""
    points = np.array(controls, dtype=np.float64)
    padded = np.concatenate([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    position = np.linspace(0.0, len(points) - 1, samples)
    index = np.minimum(position.astype(np.int64), len(points) - 2)
    t = (position - index)[:, None]
    a, b, c, d = (padded[index + k] for k in range(4))
    result: F64 = 0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
    return result


def lathe(profile: Sequence[Sequence[float]] | F64, segments: int = 48, crease_degrees: float = 40.0) -> Shape:
    """Surface of revolution about the y axis.

    ``profile``: points (radius, y). It goes up on the outside; a solid starts and ends on the axis (radius 0). Corners
    sharper than ``crease_degrees`` stay sharp. u runs once around, to the right as seen from outside; v from 0 to 1
    along the profile.
    """
    line = np.maximum(np.array(profile, dtype=np.float64), [0.0, -np.inf])
    steps = np.diff(line, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    outward = np.stack([steps[:, 1], -steps[:, 0]], axis=1) / lengths[:, None]
    starts, ends = crease_normals(outward, crease_degrees, closed=False)
    for row, end in ((starts, 0), (ends, -1)):  # on the axis a soft end meets its own mirror image
        if line[end, 0] == 0.0 and abs(row[end, 1]) > math.cos(math.radians(crease_degrees / 2)):
            row[end] = 0.0, math.copysign(1.0, row[end, 1])
    # Two rows of points per step of the profile, so that neighbouring steps may differ in their normals.
    rows = np.stack([line[:-1], line[1:]], axis=1).reshape(-1, 2)
    row_normals = np.stack([starts, ends], axis=1).reshape(-1, 2)
    along = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
    row_v = np.stack([along[:-1], along[1:]], axis=1).ravel()

    turn = np.linspace(0.0, 2 * math.pi, segments + 1)
    turn[-1] = 0.0  # the seam's two columns are equal to the bit
    direction = np.stack([np.cos(turn), np.zeros_like(turn), np.sin(turn)], axis=1)
    up = np.array([0.0, 1.0, 0.0])

    def around(pairs: F64) -> F64:
        swept: F64 = pairs[:, :1, None] * direction + pairs[:, 1:, None] * up
        return swept.reshape(-1, 3)

    u, v = np.meshgrid(np.linspace(1.0, 0.0, segments + 1), row_v)
    count = len(rows)
    faces = grid_faces(count, segments + 1).reshape(2, count - 1, segments, 3)[:, ::2]  # rows 1-2, 3-4, ... coincide
    pole = rows[:, 0] == 0.0
    faces = np.concatenate([faces[0][~pole[1::2]].reshape(-1, 3), faces[1][~pole[::2]].reshape(-1, 3)])
    return Shape(
        around(rows),
        faces,
        around(row_normals).astype(np.float32),
        np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32),
    )


def ball(radius: float, segments: int = 32) -> Shape:
    """A sphere about the origin; u runs once eastwards, v from the south pole (0) to the north pole (1)."""
    latitude = np.linspace(-math.pi / 2, math.pi / 2, segments // 2 + 1)
    profile = radius * np.stack([np.cos(latitude), np.sin(latitude)], axis=1)
    profile[[0, -1], 0] = 0.0
    return lathe(profile, segments)


def rod(radius: float, length: float, segments: int = 16) -> Shape:
    """A cylinder from y = 0 to ``length``."""
    return lathe([(0.0, 0.0), (radius, 0.0), (radius, length), (0.0, length)], segments)


def ring(radius: float, thickness: float, segments: int = 64, sides: int = 12) -> Shape:
    """A torus in the xz plane: ``radius`` to the middle of its tube, which is ``thickness`` wide."""
    turn = np.linspace(0.0, 2 * math.pi, sides + 1)
    turn[-1] = 0.0
    profile = np.stack([radius + thickness / 2 * np.cos(turn), thickness / 2 * np.sin(turn)], axis=1)
    return lathe(profile, segments, 180.0)


def tube(path: F64, radius: float | F64, sides: int = 12) -> Shape:
    """A round tube along a path of points (n, 3), closed with flat ends.

    ``radius``: one for all, or one per point (n,), > 0. Frames are carried along without twist (parallel transport).
    u runs once around, v once along.
    """
    tangents = np.gradient(path, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    side = np.cross(tangents[0], [0.0, 0.0, 1.0] if abs(tangents[0, 2]) < 0.9 else [1.0, 0.0, 0.0])
    frames = np.empty((len(path), 2, 3))
    for i, tangent in enumerate(tangents):
        side = side - tangent * (side @ tangent)
        side /= np.linalg.norm(side)
        frames[i] = side, np.cross(tangent, side)
    turn = np.linspace(0.0, 2 * math.pi, sides + 1)
    turn[-1] = 0.0
    spokes = np.cos(turn)[:, None] * frames[:, :1] + np.sin(turn)[:, None] * frames[:, 1:]  # (n, sides + 1, 3)
    radii = np.broadcast_to(np.asarray(radius, dtype=np.float64), (len(path),))
    points = path[:, None] + radii[:, None, None] * spokes
    u, v = np.meshgrid(np.linspace(0.0, 1.0, sides + 1), np.linspace(0.0, 1.0, len(path)))
    mantle = Shape(
        points.reshape(-1, 3),
        grid_faces(len(path), sides + 1)[:, ::-1].copy(),
        spokes.reshape(-1, 3).astype(np.float32),
        np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32),
    )
    return join([mantle, _disc(points[0, :-1], path[0], -tangents[0]), _disc(points[-1, :-1], path[-1], tangents[-1])])


def _disc(rim: F64, centre: F64, normal: F64) -> Shape:
    """A fan from ``centre`` to a ring of points (n, 3), facing ``normal``."""
    count = len(rim)
    index = np.arange(count)
    following = (index + 1) % count
    if np.cross(rim[0] - centre, rim[1] - centre) @ normal < 0.0:
        index, following = following, index
    return Shape(
        np.concatenate([rim, centre[None]]),
        np.stack([np.full(count, count), index, following], axis=1).astype(np.int32),
        np.tile(normal.astype(np.float32), (count + 1, 1)),
        np.zeros((count + 1, 2), dtype=np.float32),
    )


def sheet(points: F64, thickness: float, repeats: tuple[float, float] = (1.0, 1.0)) -> Shape:
    """Cloth, a leaf, paper: a grid of points (rows, columns, 3) given a thickness, closed all round.

    ``repeats``: texture coordinates run from 0 to these along the columns (u) and along the rows (v).
    """
    rows, columns = points.shape[:2]
    normals = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    front, back = points + thickness / 2 * normals, points - thickness / 2 * normals
    u, v = np.meshgrid(np.linspace(0.0, repeats[0], columns), np.linspace(0.0, repeats[1], rows))
    uvs = np.stack([u, v], axis=-1)
    faces = grid_faces(rows, columns)
    flat_uvs = uvs.reshape(-1, 2).astype(np.float32)
    sides = [
        Shape(front.reshape(-1, 3), faces, normals.reshape(-1, 3).astype(np.float32), flat_uvs),
        Shape(back.reshape(-1, 3), faces[:, ::-1].copy(), -normals.reshape(-1, 3).astype(np.float32), flat_uvs),
    ]
    # The rim, walked so that the front lies on the left: down the first column, along the last row, up, and back.
    down, along = np.arange(rows), np.arange(columns)
    row = np.concatenate([down[:-1], np.full(columns - 1, rows - 1), down[:0:-1], np.zeros(columns, dtype=np.int64)])
    column = np.concatenate(
        [np.zeros(rows - 1, dtype=np.int64), along[:-1], np.full(rows - 1, columns - 1), along[::-1]]
    )
    return join([*sides, _hem(front[row, column], back[row, column], uvs[row, column])])


def _hem(front: F64, back: F64, uvs: F64) -> Shape:
    """Flat-shaded strip that joins the front edge (n, 3) of a sheet with its back edge."""
    corners = np.stack([back[:-1], back[1:], front[1:], front[:-1]], axis=1)  # (n - 1, 4, 3)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    first = 4 * np.arange(len(corners))[:, None]
    faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    corner_uvs = np.stack([uvs[:-1], uvs[1:], uvs[1:], uvs[:-1]], axis=1)
    return Shape(
        corners.reshape(-1, 3),
        faces.astype(np.int32),
        np.repeat(normals, 4, axis=0).astype(np.float32),
        corner_uvs.reshape(-1, 2).astype(np.float32),
    )
