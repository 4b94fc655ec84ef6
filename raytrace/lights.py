"""Choosing a point on a light and the light that arrives from it, for every kind of light, compiled.

A kernel calls :func:`sample_light` for a direction towards a light, and where a ray that it drew itself meets a light,
:func:`lamp_density` or :func:`background` for the density with which :func:`sample_light` would have drawn that
direction: what multiple importance sampling (Veach 1997, ch. 9) needs. None of them knows what the surface does with
light.

A light is drawn in proportion to its power from one alias table, in this order: emissive triangles, lights without a
surface, and last the sky or the environment.
"""

from __future__ import annotations

import math

import numpy as np

from raytrace.compilation import device, inlined
from raytrace.compiled import FACE_NORMAL, MATERIAL, OFFSET
from raytrace.punctual import (
    CONE_OFFSET,
    CONE_SCALE,
    DIRECTION,
    DIRECTIONAL,
    INTENSITY,
    INVERSE_RANGE,
    KIND,
    POSITION,
    SPOT,
)
from raytrace.sampling import sample_alias, sample_cosine, sample_triangle, sincos_turn
from raytrace.tables import interpolate, surface_color

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_HALF = np.float32(0.5)
_INV_PI, _INV_TWO_PI = np.float32(1.0 / math.pi), np.float32(0.5 / math.pi)
_TINY = np.float32(1e-7)

SHADOW_END = np.float32(1.0 - 1e-6)
"""End of a shadow ray, in parts of the way to the light, whose own point is already offset."""


@device
def find_interval(sums, value):  # type: ignore[no-untyped-def]
    """The i with sums[i] <= value < sums[i + 1]; ``sums`` rise from 0 to 1, ``value`` is in [0, 1)."""
    low, high = 0, sums.shape[0] - 1
    while high - low > 1:
        middle = (low + high) >> 1
        if sums[middle] <= value:
            low = middle
        else:
            high = middle
    return low


@device
def luminance(r, g, b):  # type: ignore[no-untyped-def]
    """Of linear Rec. 709."""
    return np.float32(0.2126) * r + np.float32(0.7152) * g + np.float32(0.0722) * b


@device
def sample_linear(u, a, b):  # type: ignore[no-untyped-def]
    """x in [0, 1] with a density that rises or falls linearly from ``a`` to ``b``, not both 0: PBR book, sec. 2.3.2."""
    rest = _ONE - u
    root = a + math.sqrt(rest * a * a + u * b * b)
    return min(u * (a + b) / root, _ONE) if root > _ZERO else math.sqrt(u)


@inlined
def environment_cell(tables, row, column, fx, fy):  # type: ignore[no-untyped-def]
    """Radiance (3) at a place inside a cell of the environment, and its density times the sine of the polar angle."""
    a, b = tables.env_texels[row, column], tables.env_texels[row, column + 1]
    c, d = tables.env_texels[row + 1, column], tables.env_texels[row + 1, column + 1]
    wa, wb, wc, wd = (_ONE - fx) * (_ONE - fy), fx * (_ONE - fy), (_ONE - fx) * fy, fx * fy
    red = wa * a[0] + wb * b[0] + wc * c[0] + wd * d[0]
    green = wa * a[1] + wb * b[1] + wc * c[1] + wd * d[1]
    blue = wa * a[2] + wb * b[2] + wc * c[2] + wd * d[2]
    return red, green, blue, a[3] * luminance(red, green, blue)


@inlined
def sample_environment(tables, u, v):  # type: ignore[no-untyped-def]
    """Direction (3), radiance (3) and density per solid angle of a direction drawn by luminance."""
    height, width = tables.env_texels.shape[0] - 2, tables.env_texels.shape[1] - 1
    row = find_interval(tables.env_rows, v)
    sums = tables.env_columns[row]
    column = find_interval(sums, u)
    u = (u - sums[column]) / (sums[column + 1] - sums[column])
    below, above = tables.env_rows[row], tables.env_rows[row + 1]
    v = (v - below) / (above - below)
    lower, upper = tables.env_texels[row], tables.env_texels[row + 1]
    a = luminance(lower[column, 0], lower[column, 1], lower[column, 2])
    b = luminance(lower[column + 1, 0], lower[column + 1, 1], lower[column + 1, 2])
    c = luminance(upper[column, 0], upper[column, 1], upper[column, 2])
    d = luminance(upper[column + 1, 0], upper[column + 1, 1], upper[column + 1, 2])
    if row == 0:  # half a cell, in which nothing changes from row to row
        fy = _HALF + _HALF * v
    elif row == height:
        fy = _HALF * v
    else:
        fy = sample_linear(v, a + b, c + d)
    fx = sample_linear(u, a + (c - a) * fy, b + (d - b) * fy)
    r, g, b, density = environment_cell(tables, row, column, fx, fy)
    turns = (np.float32(column) + fx + _HALF) / np.float32(width) - _HALF - tables.env_turn
    around, ahead = sincos_turn(turns - np.float32(math.floor(turns)))
    sine, cosine = sincos_turn((np.float32(row) + fy - _HALF) / np.float32(height) * _HALF)
    return sine * around, -cosine, -sine * ahead, r, g, b, density / max(sine, _TINY)


@inlined
def environment_at(tables, x, y, z):  # type: ignore[no-untyped-def]
    """Radiance (3) of the environment in a direction of any length, and :func:`sample_environment`'s density there."""
    height, width = tables.env_texels.shape[0] - 2, tables.env_texels.shape[1] - 1
    across = math.sqrt(x * x + z * z)
    turns = _HALF + math.atan2(x, -z) * _INV_TWO_PI + tables.env_turn - _HALF / np.float32(width)
    s = (turns - np.float32(math.floor(turns))) * np.float32(width)
    t = math.atan2(across, -y) * _INV_PI * np.float32(height) + _HALF
    column, row = min(int(s), width - 1), min(int(t), height)
    r, g, b, density = environment_cell(tables, row, column, s - np.float32(column), t - np.float32(row))
    sine = across / math.sqrt(x * x + y * y + z * z)
    return r, g, b, density / max(sine, _TINY)


@inlined
def sample_punctual(tables, index, select, px, py, pz):  # type: ignore[no-untyped-def]
    """As :func:`sample_light`, from a light without a surface, which hides nothing: the shadow ray ends at it."""
    light = tables.punctual[index]
    r, g, b = light[INTENSITY], light[INTENSITY + 1], light[INTENSITY + 2]
    ax, ay, az = light[DIRECTION], light[DIRECTION + 1], light[DIRECTION + 2]
    if light[KIND] == DIRECTIONAL:
        far = tables.far
        return -ax, -ay, -az, -ax * far, -ay * far, -az * far, r, g, b, -select
    dx, dy, dz = light[POSITION] - px, light[POSITION + 1] - py, light[POSITION + 2] - pz
    square = dx * dx + dy * dy + dz * dz
    if square <= _ZERO:
        return _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
    scale = _ONE / math.sqrt(square)
    wx, wy, wz = dx * scale, dy * scale, dz * scale
    part = square * light[INVERSE_RANGE] * light[INVERSE_RANGE]  # KHR_lights_punctual, "Range Property"
    fade = max(_ZERO, _ONE - part * part) / square
    if light[KIND] == SPOT:
        ramp = -(wx * ax + wy * ay + wz * az) * light[CONE_SCALE] + light[CONE_OFFSET]
        ramp = min(max(ramp, _ZERO), _ONE)
        fade *= ramp * ramp
    return wx, wy, wz, dx, dy, dz, r * fade, g * fade, b * fade, -select


@inlined
def _sample_lamp(textured, tables, light, px, py, pz, nx, ny, nz, gx, gy, gz, offset, u, v):  # type: ignore[no-untyped-def]
    """As :func:`sample_light`, from emissive triangle number ``light``."""
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


@inlined
def sample_light(  # type: ignore[no-untyped-def]
    textured, lamps, punctual, has_sky, environment, tables, px, py, pz, nx, ny, nz, gx, gy, gz, offset, u, v, choice
):  # fmt: skip
    """One light seen from p: unit direction (3), shadow ray (3), radiance (3), density.

    The first five say what there is, as in :class:`raytrace.tables.Variant`; they must be constants.
    (nx, ny, nz), (gx, gy, gz): shading and geometric normal on the side that is lit; directions below either have
    density 0, as has anything else that brings nothing. The shadow ray begins ``offset`` off the surface along g, and
    its length is the way to go. ``density``: per solid angle, the choice of the light included. Where no other ray can
    meet the light it is minus the probability of that choice, and the radiance is what arrives per unit area that
    faces it: the same division gives the estimate, with no other technique to share it with.
    """
    light = sample_alias(choice, tables.light_threshold, tables.light_alias)
    select = tables.light_pdf[light]
    triangles = tables.light_triangles.shape[0] if lamps else 0
    if lamps and light < triangles:
        return _sample_lamp(textured, tables, light, px, py, pz, nx, ny, nz, gx, gy, gz, offset, u, v)
    last = not punctual or light == tables.light_pdf.shape[0] - 1
    if has_sky and last:
        wx, wy, wz, cosine = sample_cosine(nx, ny, nz, u, v)
        far = tables.far
        dx, dy, dz = wx * far, wy * far, wz * far
        r, g, b, density = tables.sky[0], tables.sky[1], tables.sky[2], select * cosine * _INV_PI
    elif environment and last:
        wx, wy, wz, r, g, b, density = sample_environment(tables, u, v)
        far = tables.far
        dx, dy, dz = wx * far, wy * far, wz * far
        density *= select
    else:
        wx, wy, wz, dx, dy, dz, r, g, b, density = sample_punctual(tables, light - triangles, select, px, py, pz)
        dx, dy, dz = dx - gx * offset, dy - gy * offset, dz - gz * offset
    if wx * gx + wy * gy + wz * gz <= _ZERO or wx * nx + wy * ny + wz * nz <= _ZERO:
        density = _ZERO
    return wx, wy, wz, dx, dy, dz, r, g, b, density


@device
def lamp_density(density, square, facing):  # type: ignore[no-untyped-def]
    """Density per solid angle with which :func:`sample_light` draws a point of a lamp.

    ``density``: its entry in the tables' ``light_density``; ``square``: squared distance; ``facing``: cosine at the
    lamp, at least 0.
    """
    return density * square / max(facing, _TINY)


@inlined
def background(has_sky, environment, tables, x, y, z, cosine):  # type: ignore[no-untyped-def]
    """What a ray along (x, y, z) brings that leaves the scene: radiance (3), and the density of :func:`sample_light`.

    ``cosine``: between the direction and the shading normal where the ray began.
    """
    if has_sky:
        density = tables.light_pdf[tables.light_pdf.shape[0] - 1] * cosine * _INV_PI
        return tables.sky[0], tables.sky[1], tables.sky[2], density
    if environment:
        r, g, b, density = environment_at(tables, x, y, z)
        return r, g, b, density * tables.light_pdf[tables.light_pdf.shape[0] - 1]
    return _ZERO, _ZERO, _ZERO, _ZERO
