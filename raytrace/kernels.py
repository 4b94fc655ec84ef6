"""The compiled loops between the Embree calls: camera rays, guides, and the shading of both hits of a path.

Everything is single precision without fast-math: results then do not depend on how a loop was vectorised, hence not on
the tile a pixel fell into, and the motion vector of a point that did not move is exactly zero.

Each kernel exists in as many variants as there are combinations of the scene's features (:class:`Variant`); what a
scene lacks is compiled out. Variants are built on demand and cached on disk by Numba.

Estimator (Veach 1997; Schied et al. 2017, sec. 3): one camera ray, one bounce ray, one shadow ray at each of the two
hits. At the first hit the light sample and the bounce ray are combined by the balance heuristic, and what a bounce ray
finds on a light is direct light. At the second hit there is only the light sample. All results are divided by the
first hit's albedo, simply by never multiplying with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import uint32

from raytrace.compilation import device, inlined, kernel
from raytrace.compiled import FACE_NORMAL, LIGHT, MATERIAL, NORMALS, OBJECT, OFFSET, SMOOTH, CompiledScene
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
from raytrace.textures import SRGB_TO_LINEAR, level_for, lookup

_ZERO, _ONE, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
_INV_PI = np.float32(1.0 / math.pi)
_SHADOW_END = np.float32(1.0 - 1e-6)  # of the way to the light, whose own point is already offset
_BOUNCE_CONE = np.float32(0.1)  # footprint of a bounce ray's hit per unit of distance: it stands for a wide lobe
_MIN_COSINE = np.float32(0.05)  # grazing limit of the depth gradient and of texture footprints


class Tables(NamedTuple):
    """The arrays of a :class:`CompiledScene` in the form that kernels take."""

    triangles: Any
    info: Any
    uvs: Any
    uv_density: Any
    base_color: Any
    emission: Any
    material_info: Any
    texels: Any
    levels: Any
    decode: Any
    light_triangles: Any
    light_threshold: Any
    light_alias: Any
    light_pdf: Any
    light_density: Any
    sky: Any
    far: Any
    """Length of a shadow ray to the sky: out of the scene from anywhere in it, in its own units."""
    prev_triangles: Any
    static_count: int


class Variant(NamedTuple):
    """What the scene needs compiled in."""

    textured: bool
    sky: bool
    moving: bool


def tables_of(scene: CompiledScene) -> Tables:
    lights = scene.lights
    return Tables(
        scene.triangles,
        scene.triangle_info,
        scene.triangle_uvs,
        scene.uv_density,
        scene.base_color,
        scene.emission,
        scene.material_info,
        scene.textures.texels,
        scene.textures.levels,
        SRGB_TO_LINEAR,
        lights.triangles,
        lights.threshold,
        lights.alias,
        lights.pdf,
        lights.density,
        lights.sky,
        np.float32(max(1e8, 8.0 * scene.extent)),
        scene.prev_triangles,
        scene.static_count,
    )


def variant_of(scene: CompiledScene) -> Variant:
    return Variant(scene.has_textures, scene.lights.has_sky, scene.has_motion)


@device
def _interpolate(record, first, u, v):  # type: ignore[no-untyped-def]
    """Corner attributes at columns first .. first + 8 of one triangle record, at barycentrics u, v."""
    w = _ONE - u - v
    return (
        w * record[first] + u * record[first + 3] + v * record[first + 6],
        w * record[first + 1] + u * record[first + 4] + v * record[first + 7],
        w * record[first + 2] + u * record[first + 5] + v * record[first + 8],
    )


@device
def _shading_normal(record, smooth, u, v):  # type: ignore[no-untyped-def]
    """Unit shading normal; the face normal on flat triangles and where the vertex normals cancel."""
    gx, gy, gz = record[FACE_NORMAL], record[FACE_NORMAL + 1], record[FACE_NORMAL + 2]
    if smooth == 0:
        return gx, gy, gz
    x, y, z = _interpolate(record, NORMALS, u, v)
    square = x * x + y * y + z * z
    if square <= _ZERO:
        return gx, gy, gz
    scale = _ONE / math.sqrt(square)
    return x * scale, y * scale, z * scale


@inlined
def _surface_color(textured, tables, column, factor, triangle, material, u, v, footprint):  # type: ignore[no-untyped-def]
    """Factor times texture (column 0: base colour, 1: emission) for a footprint in scene units."""
    r, g, b = factor[material, 0], factor[material, 1], factor[material, 2]
    if textured:
        index = tables.material_info[material, column]
        if index >= 0:
            c = tables.uvs[triangle]
            w = _ONE - u - v
            s = w * c[0] + u * c[2] + v * c[4]
            t = w * c[1] + u * c[3] + v * c[5]
            size = math.sqrt(np.float32(tables.levels[index, 0, 1]) * np.float32(tables.levels[index, 0, 2]))
            level = level_for(footprint * tables.uv_density[triangle] * size)
            tr, tg, tb = lookup(tables.texels, tables.levels, tables.decode, index, s, t, level)
            r, g, b = r * tr, g * tg, b * tb
    return r, g, b


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
    qx, qy, qz = _interpolate(record, 0, b, c)
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
    r, g, bl = _surface_color(textured, tables, 1, tables.emission, triangle, material, b, c, _ZERO)
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


@kernel
def camera_rays(pixels, width, height, eye, right, up, forward, jitter, origins, directions):  # type: ignore[no-untyped-def]
    """Rays through ``pixels`` (n,) int32 = y·width + x, row 0 at the bottom.

    ``right``, ``up`` are scaled so that forward + x·right + y·up with x, y in [-1, 1] spans the image; directions have
    length 1 along ``forward``.
    """
    for i in range(pixels.shape[0]):
        x = np.float32(pixels[i] % width) + _HALF + jitter[0]
        y = np.float32(pixels[i] // width) + _HALF + jitter[1]
        sx = x * np.float32(2.0) / np.float32(width) - _ONE
        sy = y * np.float32(2.0) / np.float32(height) - _ONE
        for k in range(3):
            origins[i, k] = eye[k]
            directions[i, k] = forward[k] + sx * right[k] + sy * up[k]


@device
def _project(matrix, x, y, z):  # type: ignore[no-untyped-def]
    """Clip-space x, y and w of a point."""
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3],
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3],
        matrix[3, 0] * x + matrix[3, 1] * y + matrix[3, 2] * z + matrix[3, 3],
    )


@device
def _project_direction(matrix, x, y, z):  # type: ignore[no-untyped-def]
    """Clip-space x, y and w of the point at infinity in a direction: the camera's place does not enter."""
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[3, 0] * x + matrix[3, 1] * y + matrix[3, 2] * z,
    )


class Outputs(NamedTuple):
    """Whole-frame images (N, C) float32 that the guide kernel writes at the pixels of its tile."""

    albedo: Any
    emission: Any
    surface: Any
    gradient: Any
    motion: Any
    prev_normal: Any
    position: Any
    prev_position: Any


@cache
def guide_kernel(variant: Variant, positions: bool) -> Callable[..., Any]:
    """Kernel that writes the noise-free guides of a tile; ``positions``: world positions as well."""
    textured = variant.textured
    has_sky, moving = variant.sky, variant.moving

    @kernel
    def guides(  # type: ignore[no-untyped-def]
        tables, pixels, directions, triangle, u, v, eye, right, up, forward, matrix, prev_matrix, size, out
    ):
        width, height = size
        # World size of a pixel at depth 1; `up` spans half the image.
        pixel = math.sqrt(up[0] * up[0] + up[1] * up[1] + up[2] * up[2]) * np.float32(2.0) / np.float32(height)
        sx, sy = np.float32(2.0) / np.float32(width), np.float32(2.0) / np.float32(height)
        for i in range(pixels.shape[0]):
            p = pixels[i]
            t = triangle[i]
            if t < 0:
                for k in range(4):
                    out.albedo[p, k] = _ZERO
                    out.surface[p, k] = _ZERO
                    out.emission[p, k] = _ZERO
                    if moving:
                        out.prev_normal[p, k] = _ZERO
                    if positions:
                        out.position[p, k] = _ZERO
                        out.prev_position[p, k] = _ZERO
                if has_sky:
                    for k in range(3):
                        out.emission[p, k] = tables.sky[k]
                out.gradient[p, 0] = _ZERO
                out.gradient[p, 1] = _ZERO
                # The sky moves like points at infinity.
                dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
                ax, ay, aw = _project_direction(matrix, dx, dy, dz)
                bx, by, bw = _project_direction(prev_matrix, dx, dy, dz)
                out.motion[p, 0] = _HALF * (bx / bw - ax / aw) if bw > _ZERO else np.float32(2.0)
                out.motion[p, 1] = _HALF * (by / bw - ay / aw) if bw > _ZERO else np.float32(2.0)
                out.motion[p, 2] = _ZERO
                out.motion[p, 3] = np.float32(-1.0)
                continue
            record = tables.triangles[t]
            x, y, z = _interpolate(record, 0, u[i], v[i])
            gx, gy, gz = record[FACE_NORMAL], record[FACE_NORMAL + 1], record[FACE_NORMAL + 2]
            nx, ny, nz = _shading_normal(record, tables.info[t, SMOOTH], u[i], v[i])
            dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
            front = gx * dx + gy * dy + gz * dz <= _ZERO
            if not front:
                gx, gy, gz, nx, ny, nz = -gx, -gy, -gz, -nx, -ny, -nz
            depth = (x - eye[0]) * forward[0] + (y - eye[1]) * forward[1] + (z - eye[2]) * forward[2]
            # On the plane through the point, depth along a ray of unit forward length is c / (n·d): its derivative is
            # -depth (n·∂d)/(n·d). Near grazing n·d -> 0 is held at the cosine limit, so that a wall seen edge-on does
            # not accept every depth.
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            facing = min(gx * dx + gy * dy + gz * dz, -_MIN_COSINE * length)
            scale = -depth / facing
            out.gradient[p, 0] = scale * sx * (gx * right[0] + gy * right[1] + gz * right[2])
            out.gradient[p, 1] = scale * sy * (gx * up[0] + gy * up[1] + gz * up[2])
            out.surface[p, 0] = nx
            out.surface[p, 1] = ny
            out.surface[p, 2] = nz
            out.surface[p, 3] = depth

            material = tables.info[t, MATERIAL]
            footprint = pixel * depth * math.sqrt(-length / facing)
            r, g, b = _surface_color(textured, tables, 0, tables.base_color, t, material, u[i], v[i], footprint)
            out.albedo[p, 0] = r
            out.albedo[p, 1] = g
            out.albedo[p, 2] = b
            out.albedo[p, 3] = _ONE
            if front or tables.material_info[material, 2] != 0:
                r, g, b = _surface_color(textured, tables, 1, tables.emission, t, material, u[i], v[i], footprint)
            else:
                r, g, b = _ZERO, _ZERO, _ZERO
            out.emission[p, 0] = r
            out.emission[p, 1] = g
            out.emission[p, 2] = b

            px, py, pz = x, y, z
            if moving:
                qx, qy, qz = nx, ny, nz
                if t >= tables.static_count:
                    before = tables.prev_triangles[t - tables.static_count]
                    px, py, pz = _interpolate(before, 0, u[i], v[i])
                    qx, qy, qz = _shading_normal(before, tables.info[t, SMOOTH], u[i], v[i])
                    if not front:
                        qx, qy, qz = -qx, -qy, -qz
                out.prev_normal[p, 0] = qx
                out.prev_normal[p, 1] = qy
                out.prev_normal[p, 2] = qz
                out.prev_normal[p, 3] = _ZERO
            # Both ends go through the same arithmetic, so that nothing moving gives exactly zero.
            ax, ay, aw = _project(matrix, x, y, z)
            bx, by, bw = _project(prev_matrix, px, py, pz)
            if bw > _ZERO and aw > _ZERO:
                out.motion[p, 0] = _HALF * (bx / bw - ax / aw)
                out.motion[p, 1] = _HALF * (by / bw - ay / aw)
            else:  # was behind the camera: two images away, no test accepts it
                out.motion[p, 0] = np.float32(2.0)
                out.motion[p, 1] = np.float32(2.0)
            out.motion[p, 2] = bw
            out.motion[p, 3] = np.float32(tables.info[t, OBJECT])
            if positions:
                out.position[p, 0] = x
                out.position[p, 1] = y
                out.position[p, 2] = z
                out.position[p, 3] = _ONE
                out.prev_position[p, 0] = px
                out.prev_position[p, 1] = py
                out.prev_position[p, 2] = pz
                out.prev_position[p, 3] = _ONE

    return guides


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
            x, y, z = _interpolate(record, 0, u[i], v[i])
            gx, gy, gz = record[FACE_NORMAL], record[FACE_NORMAL + 1], record[FACE_NORMAL + 2]
            nx, ny, nz = _shading_normal(record, tables.info[t, SMOOTH], u[i], v[i])
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
            x, y, z = _interpolate(record, 0, u[k], v[k])
            gx, gy, gz = record[FACE_NORMAL], record[FACE_NORMAL + 1], record[FACE_NORMAL + 2]
            nx, ny, nz = _shading_normal(record, tables.info[t, SMOOTH], u[k], v[k])
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
                r, g, b = _surface_color(textured, tables, 1, tables.emission, t, material, u[k], v[k], _ZERO)
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
            ar, ag, ab = _surface_color(textured, tables, 0, tables.base_color, t, material, u[k], v[k], footprint)
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
