"""The compiled loops of what a frame shows without noise: camera rays, and the guides of the points they find.

Everything is single precision without fast-math: the motion vector of a point that did not move is exactly zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from raytrace.compilation import device, inlined, kernel
from raytrace.compiled import FACE_NORMAL, MATERIAL, OBJECT, SMOOTH, SPECULAR
from raytrace.lights import environment_at
from raytrace.reflectance import albedos
from raytrace.surface import bumped, footprint_of, seen_from, surface_gloss, view_cosine
from raytrace.tables import Variant, base_color, interpolate, prefetch_hit, shading_normal, surface_color

_ZERO, _ONE, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
MIN_COSINE = np.float32(0.05)  # grazing limit of the depth gradient and of texture footprints


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
    specular_albedo: Any


@inlined
def _write_albedos(textured, colored, glossmap, tables, out, p, t, material, u, v, footprint, cosine):  # type: ignore[no-untyped-def]
    """Both albedos and the roughness of a point seen at ``cosine`` in a scene with specular surfaces.

    By the same arithmetic as the sample that is divided by them; a diffuse surface has roughness 1 and no specular.
    """
    r, g, b, metallic, roughness = surface_gloss(textured, colored, glossmap, tables, t, material, u, v, footprint)
    sr, sg, sb = _ZERO, _ZERO, _ZERO
    if tables.material_info[material, SPECULAR] != 0:
        r, g, b, sr, sg, sb = albedos(tables.reflectance, r, g, b, metallic, roughness, cosine)
    else:
        roughness = _ONE
    out.albedo[p, 0], out.albedo[p, 1], out.albedo[p, 2], out.albedo[p, 3] = r, g, b, _ONE
    out.specular_albedo[p, 0], out.specular_albedo[p, 1], out.specular_albedo[p, 2] = sr, sg, sb
    out.specular_albedo[p, 3] = roughness


@cache
def guide_kernel(variant: Variant, positions: bool) -> Callable[..., Any]:
    """Kernel that writes the noise-free guides of a tile; ``positions``: world positions as well."""
    textured = variant.textured
    has_sky, environment = variant.sky, variant.environment
    moving, specular, glossmap = variant.moving, variant.specular, variant.glossmap
    bumps, colored = variant.bumps, variant.colored

    @kernel
    def guides(  # type: ignore[no-untyped-def]
        tables, pixels, directions, triangle, u, v, eye, right, up, forward, matrix, prev_matrix, size, out
    ):
        width, height = size
        # World size of a pixel at depth 1; `up` spans half the image.
        pixel = math.sqrt(up[0] * up[0] + up[1] * up[1] + up[2] * up[2]) * np.float32(2.0) / np.float32(height)
        sx, sy = np.float32(2.0) / np.float32(width), np.float32(2.0) / np.float32(height)
        for i in range(pixels.shape[0]):
            prefetch_hit(textured, tables, triangle, i)
            p = pixels[i]
            t = triangle[i]
            if t < 0:
                for k in range(4):
                    out.albedo[p, k] = _ZERO
                    out.surface[p, k] = _ZERO
                    out.emission[p, k] = _ZERO
                    if moving:
                        out.prev_normal[p, k] = _ZERO
                    if specular:
                        out.specular_albedo[p, k] = _ZERO
                    if positions:
                        out.position[p, k] = _ZERO
                        out.prev_position[p, k] = _ZERO
                if has_sky:
                    for k in range(3):
                        out.emission[p, k] = tables.sky[k]
                if environment:
                    r, g, b, _ = environment_at(tables, directions[i, 0], directions[i, 1], directions[i, 2])
                    out.emission[p, 0] = r
                    out.emission[p, 1] = g
                    out.emission[p, 2] = b
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
            x, y, z = interpolate(record, 0, u[i], v[i])
            gx, gy, gz = record[FACE_NORMAL], record[FACE_NORMAL + 1], record[FACE_NORMAL + 2]
            nx, ny, nz = shading_normal(record, tables.info[t, SMOOTH], u[i], v[i])
            material = tables.info[t, MATERIAL]
            if specular or bumps:  # as the sample that is divided by the albedo has it
                ex, ey, ez = eye[0] - x, eye[1] - y, eye[2] - z
                distance, facing = seen_from(ex, ey, ez, gx, gy, gz)
                near = footprint_of(pixel, distance, facing)
            if bumps:
                nx, ny, nz = bumped(tables, record, t, material, u[i], v[i], near, nx, ny, nz)
            dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
            front = gx * dx + gy * dy + gz * dz <= _ZERO
            if not front:
                gx, gy, gz, nx, ny, nz = -gx, -gy, -gz, -nx, -ny, -nz
            depth = (x - eye[0]) * forward[0] + (y - eye[1]) * forward[1] + (z - eye[2]) * forward[2]
            # On the plane through the point, depth along a ray of unit forward length is c / (n·d): its derivative is
            # -depth (n·∂d)/(n·d). Near grazing n·d -> 0 is held at the cosine limit, so that a wall seen edge-on does
            # not accept every depth.
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            facing = min(gx * dx + gy * dy + gz * dz, -MIN_COSINE * length)
            scale = -depth / facing
            out.gradient[p, 0] = scale * sx * (gx * right[0] + gy * right[1] + gz * right[2])
            out.gradient[p, 1] = scale * sy * (gx * up[0] + gy * up[1] + gz * up[2])
            out.surface[p, 0] = nx
            out.surface[p, 1] = ny
            out.surface[p, 2] = nz
            out.surface[p, 3] = depth

            footprint = pixel * depth * math.sqrt(-length / facing)
            if specular:
                cosine = view_cosine(ex, ey, ez, nx, ny, nz, distance)
                _write_albedos(textured, colored, glossmap, tables, out, p, t, material, u[i], v[i], near, cosine)
            else:
                r, g, b = base_color(textured, colored, tables, t, material, u[i], v[i], footprint)
                out.albedo[p, 0] = r
                out.albedo[p, 1] = g
                out.albedo[p, 2] = b
                out.albedo[p, 3] = _ONE
            if front or tables.material_info[material, 2] != 0:
                r, g, b = surface_color(textured, tables, 1, tables.emission, t, material, u[i], v[i], footprint)
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
                    px, py, pz = interpolate(before, 0, u[i], v[i])
                    qx, qy, qz = shading_normal(before, tables.info[t, SMOOTH], u[i], v[i])
                    if bumps:
                        qx, qy, qz = bumped(tables, before, t, material, u[i], v[i], near, qx, qy, qz)
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
