"""A surface point of glTF's materials as kernels see it: how it is seen, its shading frame, what it is made of."""

from __future__ import annotations

import math

import numpy as np

from raytrace.compilation import device, inlined
from raytrace.compiled import GLOSS_TEXTURE, NORMAL_TEXTURE
from raytrace.tables import base_color, texture_at

_ZERO, _ONE, _TWO = np.float32(0.0), np.float32(1.0), np.float32(2.0)
_LEAST_COSINE = np.float32(1e-3)
_GRAZING = np.float32(0.05)  # limit of texture footprints, as that of the guides


@device
def seen_from(ex, ey, ez, gx, gy, gz):  # type: ignore[no-untyped-def]
    """Distance of the eye, which is at (ex, ey, ez) from the point, and the cosine there of the geometric normal."""
    distance = math.sqrt(ex * ex + ey * ey + ez * ez)
    return distance, (ex * gx + ey * gy + ez * gz) / distance


@device
def view_cosine(ex, ey, ez, nx, ny, nz, distance):  # type: ignore[no-untyped-def]
    """Cosine of the shading normal towards the eye, as :func:`view_in_frame` bounds it."""
    return max((ex * nx + ey * ny + ez * nz) / distance, _LEAST_COSINE)


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
    """Side of the square on the surface that a pixel covers; ``pixel``: its width at distance 1; ``cosine``: of the
    geometric normal, either side."""
    return pixel * distance / math.sqrt(max(abs(cosine), _GRAZING))


@inlined
def surface_gloss(textured, colored, glossmap, tables, t, material, u, v, footprint):  # type: ignore[no-untyped-def]
    """Base colour (3), metallic and roughness of a point. glTF 2.0, sec. 3.9.2: roughness is green, metallic blue."""
    r, g, b = base_color(textured, colored, tables, t, material, u, v, footprint)
    metallic, roughness = tables.gloss[material, 0], tables.gloss[material, 1]
    if glossmap:
        index = tables.material_info[material, GLOSS_TEXTURE]
        if index >= 0:
            _red, green, blue = texture_at(tables, tables.linear, index, t, u, v, footprint)
            metallic, roughness = metallic * blue, roughness * green
    return r, g, b, metallic, roughness


@inlined
def bumped(tables, record, t, material, u, v, footprint, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Unit normal that the normal map makes of the interpolated one, both of the front. glTF 2.0, sec. 3.9.3.

    The tangent is the triangle's own, along which the first texture coordinate grows, made orthogonal to the normal;
    glTF would have it interpolated between the vertices.
    """
    index = tables.material_info[material, NORMAL_TEXTURE]
    if index < 0:
        return nx, ny, nz
    c = tables.uvs[t]
    au, av, bu, bv = c[2] - c[0], c[3] - c[1], c[4] - c[0], c[5] - c[1]
    side = _ONE if au * bv - bu * av > _ZERO else -_ONE
    av, bv = av * side, bv * side
    tx = (record[3] - record[0]) * bv - (record[6] - record[0]) * av
    ty = (record[4] - record[1]) * bv - (record[7] - record[1]) * av
    tz = (record[5] - record[2]) * bv - (record[8] - record[2]) * av
    along = tx * nx + ty * ny + tz * nz
    tx, ty, tz = tx - along * nx, ty - along * ny, tz - along * nz
    square = tx * tx + ty * ty + tz * tz
    if not square > _ZERO:  # no texture coordinates to speak of
        return nx, ny, nz
    scale = _ONE / math.sqrt(square)
    tx, ty, tz = tx * scale, ty * scale, tz * scale
    bx, by, bz = (ny * tz - nz * ty) * side, (nz * tx - nx * tz) * side, (nx * ty - ny * tx) * side
    red, green, blue = texture_at(tables, tables.linear, index, t, u, v, footprint)
    strength = tables.gloss[material, 2]
    p, q, r = (_TWO * red - _ONE) * strength, (_TWO * green - _ONE) * strength, _TWO * blue - _ONE
    x, y, z = p * tx + q * bx + r * nx, p * ty + q * by + r * ny, p * tz + q * bz + r * nz
    square = x * x + y * y + z * z
    if not square > _ZERO:
        return nx, ny, nz
    scale = _ONE / math.sqrt(square)
    return x * scale, y * scale, z * scale
