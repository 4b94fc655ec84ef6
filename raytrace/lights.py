"""Choosing a point on a light and the light that arrives from it, for every kind of light, compiled.

A kernel calls :func:`sample_light` for a direction towards a light, and where a ray that it drew itself meets a light,
:func:`lamp_density` or :func:`background` for the density with which :func:`sample_light` would have drawn that
direction: what multiple importance sampling (Veach 1997, ch. 9) needs. None of them knows what the surface does with
light.

A light is drawn in proportion to its power from one alias table, in this order: emissive triangles, the sky.
"""

from __future__ import annotations

import math

import numpy as np

from raytrace.compilation import device, inlined
from raytrace.compiled import FACE_NORMAL, MATERIAL, OFFSET
from raytrace.sampling import sample_alias, sample_cosine, sample_triangle
from raytrace.tables import interpolate, surface_color

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_INV_PI = np.float32(1.0 / math.pi)
_TINY = np.float32(1e-7)

SHADOW_END = np.float32(1.0 - 1e-6)
"""End of a shadow ray, in parts of the way to the light, whose own point is already offset."""


@inlined
def sample_light(textured, lamps, has_sky, tables, px, py, pz, nx, ny, nz, gx, gy, gz, offset, u, v, choice):  # type: ignore[no-untyped-def]
    """One light seen from p: unit direction (3), shadow ray (3), radiance (3), density.

    (nx, ny, nz), (gx, gy, gz): shading and geometric normal on the side that is lit; directions below either have
    density 0, as has anything else that brings nothing. The shadow ray begins ``offset`` off the surface along g, and
    its length is the way to go. ``density``: per solid angle, the choice of the light included.
    """
    light = sample_alias(choice, tables.light_threshold, tables.light_alias)
    select = tables.light_pdf[light]
    if has_sky and (not lamps or light == tables.light_triangles.shape[0]):
        x, y, z, cosine = sample_cosine(nx, ny, nz, u, v)
        if x * gx + y * gy + z * gz <= _ZERO:
            return _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
        far, density = tables.far, select * cosine * _INV_PI
        return x, y, z, x * far, y * far, z * far, tables.sky[0], tables.sky[1], tables.sky[2], density
    triangle = tables.light_triangles[light]
    record = tables.triangles[triangle]
    b, c = sample_triangle(u, v)
    qx, qy, qz = interpolate(record, 0, b, c)
    lx, ly, lz = record[FACE_NORMAL], record[FACE_NORMAL + 1], record[FACE_NORMAL + 2]
    material = tables.info[triangle, MATERIAL]
    dx, dy, dz = qx - px, qy - py, qz - pz
    facing = -(dx * lx + dy * ly + dz * lz)
    if facing <= _ZERO:
        if tables.material_info[material, 2] == 0:
            return _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
        lx, ly, lz, facing = -lx, -ly, -lz, -facing
    if facing <= _ZERO or dx * nx + dy * ny + dz * nz <= _ZERO or dx * gx + dy * gy + dz * gz <= _ZERO:
        return _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
    square = dx * dx + dy * dy + dz * dz
    length = math.sqrt(square)
    scale = _ONE / length
    # Per area, select / area, times distance² / cosine at the light; `facing` is that cosine times the distance.
    density = tables.light_density[light] * square * length / facing
    r, g, bl = surface_color(textured, tables, 1, tables.emission, triangle, material, b, c, _ZERO)
    margin = record[OFFSET]
    # Ends short of the light by the light's own offset, starts off the surface.
    return (
        dx * scale,
        dy * scale,
        dz * scale,
        dx + lx * margin - gx * offset,
        dy + ly * margin - gy * offset,
        dz + lz * margin - gz * offset,
        r,
        g,
        bl,
        density,
    )


@device
def lamp_density(density, square, facing):  # type: ignore[no-untyped-def]
    """Density per solid angle with which :func:`sample_light` draws a point of a lamp.

    ``density``: its entry in the tables' ``light_density``; ``square``: squared distance; ``facing``: cosine at the
    lamp, at least 0.
    """
    return density * square / max(facing, _TINY)


@inlined
def background(has_sky, tables, cosine):  # type: ignore[no-untyped-def]
    """What a ray brings that leaves the scene: radiance (3), and the density of :func:`sample_light` for its direction.

    ``cosine``: between the direction and the shading normal where the ray began.
    """
    if has_sky:
        density = tables.light_pdf[tables.light_pdf.shape[0] - 1] * cosine * _INV_PI
        return tables.sky[0], tables.sky[1], tables.sky[2], density
    return _ZERO, _ZERO, _ZERO, _ZERO
