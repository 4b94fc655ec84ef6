"""A point of a glossy surface as kernels see it: how it is seen, its shading frame, what it is made of."""

from __future__ import annotations

import math

import numpy as np

from raytrace.compilation import device, inlined
from raytrace.tables import surface_color

_ONE = np.float32(1.0)
_LEAST_COSINE = np.float32(1e-3)
_GRAZING = np.float32(0.05)  # limit of texture footprints, as that of the guides


@device
def seen_from(ex, ey, ez, gx, gy, gz, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Distance of the eye at (ex, ey, ez) from the point; cosines there of shading and of geometric normal."""
    distance = math.sqrt(ex * ex + ey * ey + ez * ez)
    cosine = max((ex * nx + ey * ny + ez * nz) / distance, _LEAST_COSINE)
    return distance, cosine, max((ex * gx + ey * gy + ez * gz) / distance, _GRAZING)


@device
def to_local(x, y, z, nx, ny, nz, tx, ty, tz, bx, by, bz):  # type: ignore[no-untyped-def]
    """A vector in the frame of tangent, bitangent and normal."""
    return x * tx + y * ty + z * tz, x * bx + y * by + z * bz, x * nx + y * ny + z * nz


@device
def view_in_frame(x, y, z, nx, ny, nz, tx, ty, tz, bx, by, bz):  # type: ignore[no-untyped-def]
    """Unit direction of (x, y, z) in that frame. A view from below an interpolated normal is lifted above it."""
    vx, vy, vz = to_local(x, y, z, nx, ny, nz, tx, ty, tz, bx, by, bz)
    scale = _ONE / math.sqrt(x * x + y * y + z * z)
    vx, vy, vz = vx * scale, vy * scale, vz * scale
    if vz < _LEAST_COSINE:
        vz = _LEAST_COSINE
        scale = _ONE / math.sqrt(vx * vx + vy * vy + vz * vz)
        vx, vy, vz = vx * scale, vy * scale, vz * scale
    return vx, vy, vz


@device
def footprint_of(pixel, distance, cosine):  # type: ignore[no-untyped-def]
    """Side of the square on the surface that a pixel covers; ``pixel``: its width at distance 1."""
    return pixel * distance / math.sqrt(cosine)


@inlined
def surface_gloss(textured, tables, t, material, u, v, footprint):  # type: ignore[no-untyped-def]
    """Base colour (3), metallic and roughness of a point."""
    r, g, b = surface_color(textured, tables, 0, tables.base_color, t, material, u, v, footprint)
    return r, g, b, tables.gloss[material, 0], tables.gloss[material, 1]
