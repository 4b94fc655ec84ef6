"""A path tracer of a page, in double precision: every ray against every triangle, nothing shared with the program.

Same paths as the program's (one bounce, one shadow ray at each hit), but by the plainest estimators: lamps by area,
bounce directions uniform over the hemisphere, light that a bounce ray finds not counted, hence no weights.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_NEAR = 1e-9  # of the scene's unit: nearer hits are the surface that the ray leaves


def nearest_hits(triangles: F64, origins: F64, directions: F64) -> tuple[I64, F64, F64, F64]:
    """Nearest of ``triangles`` (T, 3, 3) on each ray: index (n,), -1 = none, barycentrics u, v, and the distance in
    lengths of the direction. Möller and Trumbore 1997."""
    a, ab, ac = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(directions[:, None], ac)
    determinant = (ab * p).sum(-1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        away = origins[:, None] - a
        u = (away * p).sum(-1) / determinant
        q = np.cross(away, ab)
        v = (directions[:, None] * q).sum(-1) / determinant
        distance = (ac * q).sum(-1) / determinant
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > _NEAR) & (determinant != 0)
    distance = np.where(hit, distance, np.inf)
    index = distance.argmin(axis=1)
    rows = np.arange(len(origins))
    found = hit[rows, index]
    return np.where(found, index, -1), u[rows, index], v[rows, index], distance[rows, index]


@dataclass(frozen=True)
class Soup:
    """``triangles`` (T, 3, 3), ``albedo`` and one-sided ``emission`` (T, 3)."""

    triangles: F64
    albedo: F64
    emission: F64

    def normals(self) -> tuple[F64, F64]:
        """Unit normals of the fronts (T, 3) and areas (T,)."""
        t = self.triangles
        cross = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        length = np.linalg.norm(cross, axis=1)
        return cross / length[:, None], length / 2


@dataclass(frozen=True)
class Points:
    """Surface points: ``index`` of the triangle, ``point``, and the ``normal`` on the side that the ray came from."""

    index: I64
    point: F64
    normal: F64


def points_on(soup: Soup, origins: F64, directions: F64) -> Points:
    index, u, v, _ = nearest_hits(soup.triangles, origins, directions)
    corners = soup.triangles[index]
    point = (1 - u - v)[:, None] * corners[:, 0] + u[:, None] * corners[:, 1] + v[:, None] * corners[:, 2]
    normal = soup.normals()[0][index]
    normal = np.where(((normal * directions).sum(1) > 0)[:, None], -normal, normal)
    return Points(index, point, normal)


def lit(soup: Soup, at: Points, random: np.random.Generator) -> F64:
    """Light of one random lamp point at each of ``at``, times cos/π over its density, (n, 3): radiance per albedo."""
    normals, areas = soup.normals()
    lamps = np.flatnonzero(soup.emission.any(axis=1))
    chance = areas[lamps] / areas[lamps].sum()
    chosen = lamps[random.choice(len(lamps), len(at.point), p=chance)]
    r, s = np.sqrt(random.random(len(chosen))), random.random(len(chosen))
    corners = soup.triangles[chosen]
    target = (
        (1 - r)[:, None] * corners[:, 0] + (r * (1 - s))[:, None] * corners[:, 1] + (r * s)[:, None] * corners[:, 2]
    )
    away = target - at.point
    square = (away**2).sum(1)
    here, there = (away * at.normal).sum(1), -(away * normals[chosen]).sum(1)
    geometry = np.maximum(here, 0) * np.maximum(there, 0) / np.where(square > 0, square, 1) ** 2 / math.pi
    _, _, _, distance = nearest_hits(soup.triangles, at.point, away)
    free = distance > 1 - 1e-9
    light: F64 = soup.emission[chosen] * (geometry * areas[lamps].sum() * free)[:, None]
    return light


def trace_paths(soup: Soup, origins: F64, directions: F64, random: np.random.Generator) -> tuple[F64, F64]:
    """One path for each camera ray: direct and indirect light divided by the first albedo, (n, 3) each."""
    first = points_on(soup, origins, directions)
    hit = first.index >= 0
    direct, indirect = np.zeros((2, len(origins), 3))
    first = Points(first.index[hit], first.point[hit], first.normal[hit])
    direct[hit] = lit(soup, first, random)

    bounce = random.normal(size=first.point.shape)
    bounce /= np.linalg.norm(bounce, axis=1, keepdims=True)
    cosine = (bounce * first.normal).sum(1)
    bounce *= np.sign(cosine)[:, None]
    second = points_on(soup, first.point, bounce)
    found = second.index >= 0
    second = Points(second.index[found], second.point[found], second.normal[found])
    weight = 2 * np.abs(cosine[found])  # cos/π over the density 1/(2π)
    light = np.zeros((len(bounce), 3))
    light[found] = lit(soup, second, random) * soup.albedo[second.index] * weight[:, None]
    indirect[hit] = light
    return direct, indirect
