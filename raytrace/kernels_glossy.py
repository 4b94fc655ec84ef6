"""The loops of :mod:`raytrace.kernels` for scenes in which something is metallic or glossy, or has a normal map.

The estimator is the same, with two lobes at both hits. One bounce ray serves both signals: it follows the specular lobe
or the diffuse one, chosen at random, and whichever it was, its light counts for both, divided by the density with which
the two together draw its direction (Veach 1997, ch. 9). Diffuse light is divided by the diffuse albedo and goes to
``direct`` and ``indirect``; specular light of either kind is divided by the lobe's and goes to ``specular``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from raytrace.brdf import alpha_of, evaluate, regularized, sample_lobe
from raytrace.compilation import device, kernel
from raytrace.compiled import DOUBLE_SIDED, FACE_NORMAL, LIGHT, MATERIAL, OFFSET, SMOOTH, SPECULAR
from raytrace.directional_albedo import look_up
from raytrace.kernels import BOUNCE_CONE
from raytrace.lights import background, lamp_density, sample_light
from raytrace.reflectance import albedos, base_share, head_on, lobe_probability
from raytrace.sampling import (
    PAIR_BOUNCE,
    PAIR_LIGHT,
    PAIR_LOBE,
    PAIR_SECOND_LIGHT,
    PAIR_SELECT,
    sample_cosine,
    tangent_frame,
)
from raytrace.surface import bumped, footprint_of, seen_from, surface_gloss, to_local, view_cosine, view_in_frame
from raytrace.tables import Variant, interpolate, prefetch_hit, shading_normal, surface_color

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_INV_PI = np.float32(1.0 / math.pi)


@device
def put(rows, i, x, y, z):  # type: ignore[no-untyped-def]
    rows[i, 0], rows[i, 1], rows[i, 2] = x, y, z


@device
def scattered(glossy, separable, vx, vy, vz, lx, ly, lz, alpha, share):  # type: ignore[no-untyped-def]
    """What of light from l goes to v: diffuse over albedo, D V cos of the lobe, Schlick's weight, density of bounces.

    ``share``: how often a bounce follows the lobe.
    """
    cosine = lz * _INV_PI
    if not glossy:
        return cosine, _ZERO, _ZERO, cosine
    lobe, white, density = evaluate(vx, vy, vz, lx, ly, lz, alpha, separable)
    return cosine, lobe, white, share * density + (_ONE - share) * cosine


@cache
def first_hit_kernel(variant: Variant, separable: bool) -> Callable[..., Any]:
    """Kernel that shades first hits: returns how many shadow and bounce rays it wrote."""
    textured, lamps, punctual = variant.textured, variant.lamps, variant.punctual
    has_sky, environment = variant.sky, variant.environment
    specular, glossmap, bumps, colored = variant.specular, variant.glossmap, variant.bumps, variant.colored

    @kernel
    def first_hit(  # type: ignore[no-untyped-def]
        tables, triangle, u, v, eye, pixel, numbers,
        shadow_o, shadow_d, shadow_index, shadow_light, shadow_gloss,
        bounce_o, bounce_d, bounce_index, bounce_pdf, bounce_cosine, bounce_weight,
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
            material = tables.info[t, MATERIAL]
            ex, ey, ez = eye[0] - x, eye[1] - y, eye[2] - z
            distance, facing = seen_from(ex, ey, ez, gx, gy, gz)
            footprint = footprint_of(pixel, distance, facing)
            if bumps:
                nx, ny, nz = bumped(tables, record, t, material, u[i], v[i], footprint, nx, ny, nz)
            if facing < _ZERO:
                gx, gy, gz, nx, ny, nz = -gx, -gy, -gz, -nx, -ny, -nz
            offset = record[OFFSET]
            ox, oy, oz = x + gx * offset, y + gy * offset, z + gz * offset
            glossy = specular and tables.material_info[material, SPECULAR] != 0
            tx, ty, tz, bx, by, bz = tangent_frame(nx, ny, nz)
            vx, vy, vz, alpha, share = _ZERO, _ZERO, _ONE, _ONE, _ZERO
            # F / E, the lobe's Fresnel term over its albedo, is p + q (1 - v·h)^5 in each channel.
            pr, pg, pb, qr, qg, qb = _ZERO, _ZERO, _ZERO, _ZERO, _ZERO, _ZERO
            if glossy:
                cosine = view_cosine(ex, ey, ez, nx, ny, nz, distance)
                vx, vy, vz = view_in_frame(ex, ey, ez, nx, ny, nz, tx, ty, tz, bx, by, bz)
                r, g, bl, metallic, roughness = surface_gloss(
                    textured, colored, glossmap, tables, t, material, u[i], v[i], footprint
                )
                alpha = alpha_of(roughness)
                dr, dg, db, sr, sg, sb = albedos(tables.reflectance, r, g, bl, metallic, roughness, cosine)
                share = lobe_probability(dr, dg, db, sr, sg, sb)
                fr, fg, fb = head_on(r, metallic), head_on(g, metallic), head_on(bl, metallic)
                pr, pg, pb = fr / sr, fg / sg, fb / sb
                qr, qg, qb = (_ONE - fr) / sr, (_ONE - fg) / sg, (_ONE - fb) / sb
            if lights:
                choice = numbers[PAIR_SELECT, 0, i]
                a, b = numbers[PAIR_LIGHT, 0, i], numbers[PAIR_LIGHT, 1, i]
                wx, wy, wz, dx, dy, dz, r, g, bl, density = sample_light(
                    textured, lamps, punctual, has_sky, environment,
                    tables, x, y, z, nx, ny, nz, gx, gy, gz, offset, a, b, choice,
                )  # fmt: skip
                if density != _ZERO and r + g + bl > _ZERO:
                    lx, ly, lz = to_local(wx, wy, wz, nx, ny, nz, tx, ty, tz, bx, by, bz)
                    diffuse, lobe, white, bounce = scattered(glossy, separable, vx, vy, vz, lx, ly, lz, alpha, share)
                    # Both techniques at once: the balance heuristic's weight over this one's density. A negative one
                    # says that no bounce finds this light.
                    scale = _ONE / (density + bounce) if density > _ZERO else -_ONE / density
                    diffuse, lobe = diffuse * scale, lobe * scale
                    put(shadow_o, shadows, ox, oy, oz)
                    put(shadow_d, shadows, dx, dy, dz)
                    put(shadow_light, shadows, r * diffuse, g * diffuse, bl * diffuse)
                    if specular:
                        r, g, bl = r * (pr + qr * white), g * (pg + qg * white), bl * (pb + qb * white)
                        put(shadow_gloss, shadows, r * lobe, g * lobe, bl * lobe)
                    shadow_index[shadows] = i
                    shadows += 1
            a, b = numbers[PAIR_BOUNCE, 0, i], numbers[PAIR_BOUNCE, 1, i]
            follow = numbers[PAIR_LOBE, 0, i]
            if follow < share:
                lx, ly, lz = sample_lobe(vx, vy, vz, alpha, a, b)
                dx, dy, dz = lx * tx + ly * bx + lz * nx, lx * ty + ly * by + lz * ny, lx * tz + ly * bz + lz * nz
            else:
                dx, dy, dz, lz = sample_cosine(nx, ny, nz, a, b)
                lx, ly, _lz = to_local(dx, dy, dz, nx, ny, nz, tx, ty, tz, bx, by, bz)
            if lz > _ZERO and dx * gx + dy * gy + dz * gz > _ZERO:
                diffuse, lobe, white, bounce = scattered(glossy, separable, vx, vy, vz, lx, ly, lz, alpha, share)
                lobe = lobe / bounce
                put(bounce_o, bounces, ox, oy, oz)
                put(bounce_d, bounces, dx, dy, dz)
                bounce_pdf[bounces], bounce_cosine[bounces] = bounce, lz
                put(
                    bounce_weight, bounces, lobe * (pr + qr * white), lobe * (pg + qg * white), lobe * (pb + qb * white)
                )
                bounce_weight[bounces, 3] = diffuse / bounce
                bounce_index[bounces] = i
                bounces += 1
        return shadows, bounces

    return first_hit


@cache
def second_hit_kernel(variant: Variant, separable: bool) -> Callable[..., Any]:
    """Kernel that shades bounce hits: adds light found by the ray to ``direct`` and ``gloss``, writes shadow rays;
    returns how many."""
    textured, lamps, punctual = variant.textured, variant.lamps, variant.punctual
    has_sky, environment = variant.sky, variant.environment
    specular, glossmap, bumps, colored = variant.specular, variant.glossmap, variant.bumps, variant.colored

    @kernel
    def second_hit(  # type: ignore[no-untyped-def]
        tables, triangle, u, v, bounce_o, bounce_d, bounce_index, bounce_pdf, bounce_cosine, bounce_weight,
        numbers, regularize,
        direct, gloss, shadow_o, shadow_d, shadow_index, shadow_light, shadow_gloss,
    ):  # fmt: skip
        shadows = 0
        lights = lamps or punctual or has_sky or environment
        for k in range(triangle.shape[0]):
            prefetch_hit(textured, tables, triangle, k)
            i = bounce_index[k]
            t = triangle[k]
            weight = bounce_weight[k]
            dx, dy, dz = bounce_d[k, 0], bounce_d[k, 1], bounce_d[k, 2]
            if t < 0:
                if has_sky or environment:
                    r, g, bl, density = background(has_sky, environment, tables, dx, dy, dz, bounce_cosine[k])
                    scale = bounce_pdf[k] / (bounce_pdf[k] + density)
                    add_found(specular, direct, gloss, i, weight, r * scale, g * scale, bl * scale)
                continue
            record = tables.triangles[t]
            x, y, z = interpolate(record, 0, u[k], v[k])
            gx, gy, gz = record[FACE_NORMAL], record[FACE_NORMAL + 1], record[FACE_NORMAL + 2]
            nx, ny, nz = shading_normal(record, tables.info[t, SMOOTH], u[k], v[k])
            material = tables.info[t, MATERIAL]
            ex, ey, ez = x - bounce_o[k, 0], y - bounce_o[k, 1], z - bounce_o[k, 2]
            square = ex * ex + ey * ey + ez * ez
            # A bounce stands for a solid angle of 1 / density, a diffuse one on average for pi.
            footprint = min(BOUNCE_CONE, BOUNCE_CONE * math.sqrt(_INV_PI / bounce_pdf[k])) * math.sqrt(square)
            if bumps:
                nx, ny, nz = bumped(tables, record, t, material, u[k], v[k], footprint, nx, ny, nz)
            front = gx * dx + gy * dy + gz * dz <= _ZERO
            if not front:
                gx, gy, gz, nx, ny, nz = -gx, -gy, -gz, -nx, -ny, -nz
            light = tables.info[t, LIGHT]
            if lamps and light >= 0 and (front or tables.material_info[material, DOUBLE_SIDED] != 0):
                density = lamp_density(tables.light_density[light], square, -(gx * dx + gy * dy + gz * dz))
                scale = bounce_pdf[k] / (bounce_pdf[k] + density)
                r, g, bl = surface_color(textured, tables, 1, tables.emission, t, material, u[k], v[k], _ZERO)
                add_found(specular, direct, gloss, i, weight, r * scale, g * scale, bl * scale)
            if not lights:
                continue
            choice = numbers[PAIR_SELECT, 1, i]
            a, b = numbers[PAIR_SECOND_LIGHT, 0, i], numbers[PAIR_SECOND_LIGHT, 1, i]
            offset = record[OFFSET]
            wx, wy, wz, sx, sy, sz, r, g, bl, density = sample_light(
                textured, lamps, punctual, has_sky, environment,
                tables, x, y, z, nx, ny, nz, gx, gy, gz, offset, a, b, choice,
            )  # fmt: skip
            if density == _ZERO or r + g + bl <= _ZERO:
                continue
            ar, ag, ab, metallic, roughness = surface_gloss(
                textured, colored, glossmap, tables, t, material, u[k], v[k], footprint
            )
            diffuse = (wx * nx + wy * ny + wz * nz) * _INV_PI
            if specular and tables.material_info[material, SPECULAR] != 0:
                tx, ty, tz, bx, by, bz = tangent_frame(nx, ny, nz)
                vx, vy, vz = view_in_frame(-dx, -dy, -dz, nx, ny, nz, tx, ty, tz, bx, by, bz)
                lx, ly, lz = to_local(wx, wy, wz, nx, ny, nz, tx, ty, tz, bx, by, bz)
                alpha = alpha_of(roughness)
                if regularize:
                    alpha = regularized(alpha)
                lobe, white, _density = evaluate(vx, vy, vz, lx, ly, lz, alpha, separable)
                fx, fy = look_up(tables.reflectance, vz, roughness)
                diffuse *= base_share(metallic, fx, fy)
                fr, fg, fb = head_on(ar, metallic), head_on(ag, metallic), head_on(ab, metallic)
                ar = ar * diffuse + lobe * (fr + (_ONE - fr) * white)
                ag = ag * diffuse + lobe * (fg + (_ONE - fg) * white)
                ab = ab * diffuse + lobe * (fb + (_ONE - fb) * white)
            else:
                ar, ag, ab = ar * diffuse, ag * diffuse, ab * diffuse
            scale = _ONE / abs(density)
            r, g, bl = r * ar * scale, g * ag * scale, bl * ab * scale
            if r + g + bl > _ZERO:
                put(shadow_o, shadows, x + gx * offset, y + gy * offset, z + gz * offset)
                put(shadow_d, shadows, sx, sy, sz)
                put(shadow_light, shadows, r * weight[3], g * weight[3], bl * weight[3])
                if specular:
                    put(shadow_gloss, shadows, r * weight[0], g * weight[1], bl * weight[2])
                shadow_index[shadows] = i
                shadows += 1
        return shadows

    return second_hit


@device
def add_found(specular, direct, gloss, i, weight, r, g, b):  # type: ignore[no-untyped-def]
    """Add the light that a bounce ray found to both signals of path i."""
    direct[i, 0] += r * weight[3]
    direct[i, 1] += g * weight[3]
    direct[i, 2] += b * weight[3]
    if specular:
        gloss[i, 0] += r * weight[0]
        gloss[i, 1] += g * weight[1]
        gloss[i, 2] += b * weight[2]
