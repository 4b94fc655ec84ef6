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

from raytrace.compilation import kernel
from raytrace.compiled import FACE_NORMAL, LIGHT, MATERIAL, OBJECT, OFFSET, SMOOTH
from raytrace.lights import background, lamp_density, sample_light
from raytrace.sampling import (
    PAIR_BOUNCE,
    PAIR_LIGHT,
    PAIR_SECOND_LIGHT,
    PAIR_SELECT,
    sample_cosine,
)
from raytrace.tables import Variant, base_color, interpolate, prefetch_hit, shading_normal, surface_color

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_PI, _INV_PI = np.float32(math.pi), np.float32(1.0 / math.pi)
BOUNCE_CONE = np.float32(0.1)  # footprint of a bounce ray's hit per unit of distance: it stands for a wide lobe


@cache
def first_hit_kernel(variant: Variant) -> Callable[..., Any]:
    """Kernel that shades first hits: returns how many shadow and bounce rays it wrote."""
    textured, lamps, punctual = variant.textured, variant.lamps, variant.punctual
    has_sky, environment = variant.sky, variant.environment

    @kernel
    def first_hit(  # type: ignore[no-untyped-def]
        tables, triangle, u, v, eye, numbers,
        shadow_o, shadow_d, shadow_index, shadow_light, bounce_o, bounce_d, bounce_index, bounce_pdf,
    ):  # fmt: skip
        shadows, bounces = 0, 0
        lights = lamps or punctual or has_sky or environment
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
            if lights:
                choice = numbers[PAIR_SELECT, 0, i]
                a, b = numbers[PAIR_LIGHT, 0, i], numbers[PAIR_LIGHT, 1, i]
                wx, wy, wz, dx, dy, dz, r, g, bl, density = sample_light(
                    textured, lamps, punctual, has_sky, environment,
                    tables, x, y, z, nx, ny, nz, gx, gy, gz, offset, a, b, choice,
                )  # fmt: skip
                if density != _ZERO and r + g + bl > _ZERO:
                    # Also the density with which the bounce ray draws this direction.
                    diffuse = (wx * nx + wy * ny + wz * nz) * _INV_PI
                    scale = diffuse / (density + diffuse) if density > _ZERO else -diffuse / density
                    r, g, bl = r * scale, g * scale, bl * scale
                    shadow_o[shadows, 0], shadow_o[shadows, 1], shadow_o[shadows, 2] = ox, oy, oz
                    shadow_d[shadows, 0], shadow_d[shadows, 1], shadow_d[shadows, 2] = dx, dy, dz
                    shadow_light[shadows, 0], shadow_light[shadows, 1], shadow_light[shadows, 2] = r, g, bl
                    shadow_index[shadows] = i
                    shadows += 1
            a, b = numbers[PAIR_BOUNCE, 0, i], numbers[PAIR_BOUNCE, 1, i]
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
    textured, lamps, punctual = variant.textured, variant.lamps, variant.punctual
    has_sky, environment, colored = variant.sky, variant.environment, variant.colored

    @kernel
    def second_hit(  # type: ignore[no-untyped-def]
        tables, triangle, u, v, bounce_o, bounce_d, bounce_index, bounce_pdf, numbers,
        direct, shadow_o, shadow_d, shadow_index, shadow_light,
    ):  # fmt: skip
        shadows = 0
        lights = lamps or punctual or has_sky or environment
        for k in range(triangle.shape[0]):
            prefetch_hit(textured, tables, triangle, k)
            i = bounce_index[k]
            t = triangle[k]
            if t < 0:
                if has_sky or environment:
                    dx, dy, dz = bounce_d[k, 0], bounce_d[k, 1], bounce_d[k, 2]
                    r, g, bl, density = background(has_sky, environment, tables, dx, dy, dz, bounce_pdf[k] * _PI)
                    weight = bounce_pdf[k] / (bounce_pdf[k] + density)
                    direct[i, 0] += r * weight
                    direct[i, 1] += g * weight
                    direct[i, 2] += bl * weight
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
            if lamps and light >= 0 and (front or tables.material_info[material, 2] != 0):
                pdf = lamp_density(tables.light_density[light], square, facing)
                weight = bounce_pdf[k] / (bounce_pdf[k] + pdf)
                r, g, b = surface_color(textured, tables, 1, tables.emission, t, material, u[k], v[k], _ZERO)
                direct[i, 0] += r * weight
                direct[i, 1] += g * weight
                direct[i, 2] += b * weight
            if not lights:
                continue
            choice = numbers[PAIR_SELECT, 1, i]
            a, b = numbers[PAIR_SECOND_LIGHT, 0, i], numbers[PAIR_SECOND_LIGHT, 1, i]
            offset = record[OFFSET]
            wx, wy, wz, dx, dy, dz, r, g, bl, density = sample_light(
                textured, lamps, punctual, has_sky, environment,
                tables, x, y, z, nx, ny, nz, gx, gy, gz, offset, a, b, choice,
            )  # fmt: skip
            if density == _ZERO or r + g + bl <= _ZERO:
                continue
            scale = (wx * nx + wy * ny + wz * nz) * _INV_PI / abs(density)
            r, g, bl = r * scale, g * scale, bl * scale
            footprint = BOUNCE_CONE * math.sqrt(square)
            ar, ag, ab = base_color(textured, colored, tables, t, material, u[k], v[k], footprint)
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
def clear(image):  # type: ignore[no-untyped-def]
    """Zero in the first three channels and 1 in a fourth; NumPy takes three times as long over rows of four."""
    alpha = image.shape[1] > 3
    for i in range(image.shape[0]):
        image[i, 0] = _ZERO
        image[i, 1] = _ZERO
        image[i, 2] = _ZERO
        if alpha:
            image[i, 3] = _ONE


@kernel
def objects_of(triangle, info, objects):  # type: ignore[no-untyped-def]
    """The object of each triangle, -1 where there is none."""
    for i in range(triangle.shape[0]):
        t = triangle[i]
        objects[i] = info[t, OBJECT] if t >= 0 else -1


@kernel
def fill(values, count, value):  # type: ignore[no-untyped-def]
    for i in range(count):
        values[i] = value
