"""The compiled loops between the Embree calls that shade both hits of a path.

Everything is single precision without fast-math: results then do not depend on how a loop was vectorised, hence not on
the tile a pixel fell into.

Estimator (Veach 1997; Schied et al. 2017, sec. 3): one camera ray, one bounce ray, one shadow ray at each of the two
hits. At the first hit the light sample and the bounce ray are combined by the balance heuristic, and what a bounce ray
finds on a light is direct light. At the second hit there is only the light sample. All results are divided by the
first hit's albedo, simply by never multiplying with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import uint32

from raytrace.compilation import inlined, kernel
from raytrace.compiled import FACE_NORMAL, LIGHT, MATERIAL, OFFSET, SMOOTH
from raytrace.sampling import (
    PAIR_BOUNCE,
    PAIR_LIGHT,
    PAIR_SECOND_LIGHT,
    PAIR_SELECT,
    path_key,
    random_pair,
    sample_alias,
    sample_cosine,
    sample_triangle,
)
from raytrace.tables import Variant, interpolate, shading_normal, surface_color

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_INV_PI = np.float32(1.0 / math.pi)
_SHADOW_END = np.float32(1.0 - 1e-6)  # of the way to the light, whose own point is already offset
_BOUNCE_CONE = np.float32(0.1)  # footprint of a bounce ray's hit per unit of distance: it stands for a wide lobe


@inlined
def _light_sample(textured, has_sky, tables, px, py, pz, nx, ny, nz, gx, gy, gz, offset, u, v, choice, mis):  # type: ignore[no-untyped-def]
    """One light sample at p: shadow ray direction (its length is the segment) and radiance·cos/(π·pdf).

    (gx, gy, gz): geometric normal on the same side as n. ``mis``: weight against a cosine-distributed bounce ray.
    """
    light = sample_alias(choice, tables.light_threshold, tables.light_alias)
    select = tables.light_pdf[light]
    if has_sky and light == tables.light_triangles.shape[0]:
        x, y, z, cosine = sample_cosine(nx, ny, nz, u, v)
        if x * gx + y * gy + z * gz <= _ZERO:
            return _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
        # Both techniques draw this direction with density cos/π: radiance·cos/π / (select·cos/π) · weight.
        scale = _ONE / (select + _ONE) if mis else _ONE / select
        far = tables.far
        return x * far, y * far, z * far, tables.sky[0] * scale, tables.sky[1] * scale, tables.sky[2] * scale
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
            return _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
        lx, ly, lz, facing = -lx, -ly, -lz, -facing
    cosine = dx * nx + dy * ny + dz * nz
    if cosine <= _ZERO or facing <= _ZERO or dx * gx + dy * gy + dz * gz <= _ZERO:
        return _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
    # With both cosines times the distance, and the density per area of this point, select / area: the density per solid
    # angle is density·distance²/cos at the light, and that of a bounce ray cos/π. One division serves it all.
    square = dx * dx + dy * dy + dz * dz
    bounce = cosine * facing * _INV_PI / square
    density = tables.light_density[light] * square
    scale = bounce / (density + bounce) if mis else bounce / density
    r, g, bl = surface_color(textured, tables, 1, tables.emission, triangle, material, b, c, _ZERO)
    margin = record[OFFSET]
    # Ends short of the light by the light's own offset, starts off the surface (added by the caller).
    return (
        dx + lx * margin - gx * offset,
        dy + ly * margin - gy * offset,
        dz + lz * margin - gz * offset,
        r * scale,
        g * scale,
        bl * scale,
    )


@cache
def first_hit_kernel(variant: Variant) -> Callable[..., Any]:
    """Kernel that shades first hits: returns how many shadow and bounce rays it wrote."""
    textured, has_sky = variant.textured, variant.sky

    @kernel
    def first_hit(  # type: ignore[no-untyped-def]
        tables, triangle, u, v, eye, pixel_seeds, frame_seeds, seed, generator,
        shadow_o, shadow_d, shadow_index, shadow_light, bounce_o, bounce_d, bounce_index, bounce_pdf,
    ):  # fmt: skip
        shadows, bounces = 0, 0
        lights = tables.light_pdf.shape[0] > 0
        for i in range(triangle.shape[0]):
            t = triangle[i]
            if t < 0:
                continue
            record = tables.triangles[t]
            x, y, z = interpolate(record, 0, u[i], v[i])
            gx, gy, gz = record[FACE_NORMAL], record[FACE_NORMAL + 1], record[FACE_NORMAL + 2]
            nx, ny, nz = shading_normal(record, tables.info[t, SMOOTH], u[i], v[i])
            if gx * (eye[0] - x) + gy * (eye[1] - y) + gz * (eye[2] - z) < _ZERO:
                gx, gy, gz, nx, ny, nz = -gx, -gy, -gz, -nx, -ny, -nz
            offset = record[OFFSET]
            ox, oy, oz = x + gx * offset, y + gy * offset, z + gz * offset
            key = path_key(seed, pixel_seeds[i])
            frame = uint32(frame_seeds[i])
            if lights:
                choice, _unused = random_pair(key, frame, PAIR_SELECT, generator)
                a, b = random_pair(key, frame, PAIR_LIGHT, generator)
                dx, dy, dz, r, g, bl = _light_sample(
                    textured, has_sky, tables, x, y, z, nx, ny, nz, gx, gy, gz, offset, a, b, choice, True
                )
                if r + g + bl > _ZERO:
                    shadow_o[shadows, 0], shadow_o[shadows, 1], shadow_o[shadows, 2] = ox, oy, oz
                    shadow_d[shadows, 0], shadow_d[shadows, 1], shadow_d[shadows, 2] = dx, dy, dz
                    shadow_light[shadows, 0], shadow_light[shadows, 1], shadow_light[shadows, 2] = r, g, bl
                    shadow_index[shadows] = i
                    shadows += 1
            a, b = random_pair(key, frame, PAIR_BOUNCE, generator)
            dx, dy, dz, cosine = sample_cosine(nx, ny, nz, a, b)
            if dx * gx + dy * gy + dz * gz > _ZERO and cosine > _ZERO:
                bounce_o[bounces, 0], bounce_o[bounces, 1], bounce_o[bounces, 2] = ox, oy, oz
                bounce_d[bounces, 0], bounce_d[bounces, 1], bounce_d[bounces, 2] = dx, dy, dz
                bounce_pdf[bounces] = cosine * _INV_PI
                bounce_index[bounces] = i
                bounces += 1
        return shadows, bounces

    return first_hit


@cache
def second_hit_kernel(variant: Variant) -> Callable[..., Any]:
    """Kernel that shades bounce hits: adds light found by the ray to ``direct``, writes shadow rays; returns how
    many."""
    textured, has_sky = variant.textured, variant.sky

    @kernel
    def second_hit(  # type: ignore[no-untyped-def]
        tables, triangle, u, v, bounce_o, bounce_d, bounce_index, bounce_pdf, pixel_seeds, frame_seeds, seed, generator,
        direct, shadow_o, shadow_d, shadow_index, shadow_light,
    ):  # fmt: skip
        shadows = 0
        lights = tables.light_pdf.shape[0] > 0
        for k in range(triangle.shape[0]):
            i = bounce_index[k]
            t = triangle[k]
            if t < 0:
                if has_sky:
                    weight = _ONE / (_ONE + tables.light_pdf[tables.light_pdf.shape[0] - 1])
                    for c in range(3):
                        direct[i, c] += tables.sky[c] * weight
                continue
            record = tables.triangles[t]
            x, y, z = interpolate(record, 0, u[k], v[k])
            gx, gy, gz = record[FACE_NORMAL], record[FACE_NORMAL + 1], record[FACE_NORMAL + 2]
            nx, ny, nz = shading_normal(record, tables.info[t, SMOOTH], u[k], v[k])
            dx, dy, dz = bounce_d[k, 0], bounce_d[k, 1], bounce_d[k, 2]
            front = gx * dx + gy * dy + gz * dz <= _ZERO
            if not front:
                gx, gy, gz, nx, ny, nz = -gx, -gy, -gz, -nx, -ny, -nz
            facing = -(gx * dx + gy * dy + gz * dz)
            ex, ey, ez = x - bounce_o[k, 0], y - bounce_o[k, 1], z - bounce_o[k, 2]
            square = ex * ex + ey * ey + ez * ez
            material = tables.info[t, MATERIAL]
            light = tables.info[t, LIGHT]
            if light >= 0 and (front or tables.material_info[material, 2] != 0):
                pdf = tables.light_density[light] * square / max(facing, np.float32(1e-7))
                weight = bounce_pdf[k] / (bounce_pdf[k] + pdf)
                r, g, b = surface_color(textured, tables, 1, tables.emission, t, material, u[k], v[k], _ZERO)
                direct[i, 0] += r * weight
                direct[i, 1] += g * weight
                direct[i, 2] += b * weight
            if not lights:
                continue
            key = path_key(seed, pixel_seeds[i])
            frame = uint32(frame_seeds[i])
            _unused, choice = random_pair(key, frame, PAIR_SELECT, generator)
            a, b = random_pair(key, frame, PAIR_SECOND_LIGHT, generator)
            offset = record[OFFSET]
            dx, dy, dz, r, g, bl = _light_sample(
                textured, has_sky, tables, x, y, z, nx, ny, nz, gx, gy, gz, offset, a, b, choice, False
            )
            if r + g + bl <= _ZERO:
                continue
            footprint = _BOUNCE_CONE * math.sqrt(square)
            ar, ag, ab = surface_color(textured, tables, 0, tables.base_color, t, material, u[k], v[k], footprint)
            r, g, bl = r * ar, g * ag, bl * ab
            if r + g + bl > _ZERO:
                shadow_o[shadows, 0] = x + gx * offset
                shadow_o[shadows, 1] = y + gy * offset
                shadow_o[shadows, 2] = z + gz * offset
                shadow_d[shadows, 0], shadow_d[shadows, 1], shadow_d[shadows, 2] = dx, dy, dz
                shadow_light[shadows, 0], shadow_light[shadows, 1], shadow_light[shadows, 2] = r, g, bl
                shadow_index[shadows] = i
                shadows += 1
        return shadows

    return second_hit


@kernel
def add_unoccluded(blocked, index, light, out):  # type: ignore[no-untyped-def]
    """Add the light of each shadow ray that got through (Embree's -1) to its path."""
    for k in range(blocked.shape[0]):
        if blocked[k] != 0:
            i = index[k]
            out[i, 0] += light[k, 0]
            out[i, 1] += light[k, 1]
            out[i, 2] += light[k, 2]


@kernel
def fill(values, count, value):  # type: ignore[no-untyped-def]
    for i in range(count):
        values[i] = value


SHADOW_END = _SHADOW_END
