"""A compiled scene as compiled loops take it, and what they all read from it: points, normals, colours.

Each kernel exists in as many variants as there are combinations of the scene's features (:class:`Variant`); what a
scene lacks is compiled out. Variants are built on demand and cached on disk by Numba.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from raytrace.compilation import device, inlined, prefetch
from raytrace.compiled import FACE_NORMAL, GLOSS_TEXTURE, NORMAL_TEXTURE, NORMALS, RECORD, CompiledScene
from raytrace.directional_albedo import table
from raytrace.textures import LINEAR, SRGB_TO_LINEAR, level_for, lookup

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)


class Tables(NamedTuple):
    """The arrays of a :class:`CompiledScene` in the form that kernels take."""

    triangles: Any
    info: Any
    uvs: Any
    uv_density: Any
    base_color: Any
    emission: Any
    material_info: Any
    gloss: Any
    colors: Any
    reflectance: Any
    """Table of :mod:`raytrace.directional_albedo`, or one of a single entry where nothing is specular."""
    texels: Any
    levels: Any
    decode: Any
    linear: Any
    light_triangles: Any
    light_threshold: Any
    light_alias: Any
    light_pdf: Any
    light_density: Any
    sky: Any
    punctual: Any
    env_texels: Any
    env_rows: Any
    env_columns: Any
    env_turn: Any
    far: Any
    """Length of a shadow ray to the sky: out of the scene from anywhere in it, in its own units."""
    prev_triangles: Any
    static_count: int


class Variant(NamedTuple):
    """What the scene needs compiled in."""

    textured: bool
    sky: bool
    moving: bool
    lamps: bool
    """Triangles that emit."""
    punctual: bool
    """Lights without a surface."""
    environment: bool
    specular: bool
    """Metals and gloss."""
    glossmap: bool
    """Textures of metallic and roughness."""
    bumps: bool
    """Normal maps."""
    colored: bool
    """Colours of vertices."""
    cutout: bool
    """Surfaces with holes."""


def _white(scene: CompiledScene) -> Any:
    """Colours of vertices for kernels that ask for them although the scene has none."""
    return np.ones((len(scene.triangles), 9), np.float32)


def tables_of(scene: CompiledScene, variant: Variant) -> Tables:
    lights = scene.lights
    return Tables(
        scene.triangles,
        scene.triangle_info,
        scene.triangle_uvs,
        scene.uv_density,
        scene.base_color,
        scene.emission,
        scene.material_info,
        scene.gloss,
        scene.colors if len(scene.colors) == len(scene.triangles) or not variant.colored else _white(scene),
        table() if scene.has_specular else np.zeros((1, 1, 2), np.float32),
        scene.textures.texels,
        scene.textures.levels,
        SRGB_TO_LINEAR,
        LINEAR,
        lights.triangles,
        lights.threshold,
        lights.alias,
        lights.pdf,
        lights.density,
        lights.sky,
        lights.punctual,
        lights.environment.texels,
        lights.environment.rows,
        lights.environment.columns,
        np.float32(lights.environment.turn),
        np.float32(max(1e8, 8.0 * scene.extent)),
        scene.prev_triangles,
        scene.static_count,
    )


def variant_of(scene: CompiledScene) -> Variant:
    return Variant(
        textured=scene.has_textures,
        sky=scene.lights.has_sky,
        moving=scene.has_motion,
        lamps=len(scene.lights.triangles) > 0,
        specular=scene.has_specular,
        glossmap=scene.has(GLOSS_TEXTURE),
        bumps=scene.has(NORMAL_TEXTURE),
        colored=len(scene.colors) == len(scene.triangles),
        cutout=scene.has_cutout,
        punctual=len(scene.scene.lights) > 0,
        environment=scene.scene.environment is not None,
    )


AHEAD = 8
"""Hits between asking for what is known of one and shading it."""


@inlined
def prefetch_hit(textured, tables, triangles, i):  # type: ignore[no-untyped-def]
    """Ask for what shading the hit :data:`AHEAD` places behind number ``i`` of ``triangles`` will read.

    Rays that bounced hit triangles that are in no cache: shading waited for memory a third of its time.
    """
    t = triangles[min(i + AHEAD, triangles.shape[0] - 1)]
    if t >= 0:
        prefetch(tables.triangles, t, 0)
        prefetch(tables.triangles, t, RECORD - 1)
        prefetch(tables.info, t, 0)
        if textured:
            prefetch(tables.uvs, t, 0)
            prefetch(tables.uv_density, t, 0)


@device
def interpolate(record, first, u, v):  # type: ignore[no-untyped-def]
    """Corner attributes at columns first .. first + 8 of one triangle record, at barycentrics u, v."""
    w = _ONE - u - v
    return (
        w * record[first] + u * record[first + 3] + v * record[first + 6],
        w * record[first + 1] + u * record[first + 4] + v * record[first + 7],
        w * record[first + 2] + u * record[first + 5] + v * record[first + 8],
    )


@device
def shading_normal(record, smooth, u, v):  # type: ignore[no-untyped-def]
    """Unit shading normal; the face normal on flat triangles and where the vertex normals cancel."""
    gx, gy, gz = record[FACE_NORMAL], record[FACE_NORMAL + 1], record[FACE_NORMAL + 2]
    if smooth == 0:
        return gx, gy, gz
    x, y, z = interpolate(record, NORMALS, u, v)
    square = x * x + y * y + z * z
    if square <= _ZERO:
        return gx, gy, gz
    scale = _ONE / math.sqrt(square)
    return x * scale, y * scale, z * scale


@inlined
def texture_at(tables, decode, index, triangle, u, v, footprint):  # type: ignore[no-untyped-def]
    """A texture at a point of a triangle, three float32, for a footprint in scene units."""
    c = tables.uvs[triangle]
    w = _ONE - u - v
    s = w * c[0] + u * c[2] + v * c[4]
    t = w * c[1] + u * c[3] + v * c[5]
    size = math.sqrt(np.float32(tables.levels[index, 0, 1]) * np.float32(tables.levels[index, 0, 2]))
    level = level_for(footprint * tables.uv_density[triangle] * size)
    return lookup(tables.texels, tables.levels, decode, index, s, t, level)


@inlined
def surface_color(textured, tables, column, factor, triangle, material, u, v, footprint):  # type: ignore[no-untyped-def]
    """Factor times texture (column 0: base colour, 1: emission) for a footprint in scene units."""
    r, g, b = factor[material, 0], factor[material, 1], factor[material, 2]
    if textured:
        index = tables.material_info[material, column]
        if index >= 0:
            tr, tg, tb = texture_at(tables, tables.decode, index, triangle, u, v, footprint)
            r, g, b = r * tr, g * tg, b * tb
    return r, g, b


@inlined
def base_color(textured, colored, tables, triangle, material, u, v, footprint):  # type: ignore[no-untyped-def]
    """Base colour of a point: factor, texture, and the vertices' colours."""
    r, g, b = surface_color(textured, tables, 0, tables.base_color, triangle, material, u, v, footprint)
    if colored:
        vr, vg, vb = interpolate(tables.colors[triangle], 0, u, v)
        r, g, b = r * vr, g * vg, b * vb
    return r, g, b
