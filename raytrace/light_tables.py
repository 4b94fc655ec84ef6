"""The lights of a scene as the kernels choose among them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raytrace.environment import EnvironmentTables, build_environment, no_environment
from raytrace.punctual import ROW, punctual_rows
from raytrace.sampling import build_alias
from raytrace.textures import MAX_LEVELS, sample_bilinear

if TYPE_CHECKING:
    from raytrace.compiled import CompiledScene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


@dataclass(frozen=True)
class Lights:
    """Everything that shines, chosen in proportion to its power.

    ``triangles`` (L,) int32; ``threshold``, ``alias``, ``pdf`` the alias table over the L triangles, then the P lights
    without a surface, and one last entry for the sky or the environment where there is either. ``density`` (L,)
    float32: pdf per area of a point on the triangle. ``punctual``: see :func:`punctual_rows`. ``sky`` (3,) float32.
    """

    triangles: I32
    density: F32
    threshold: F32
    alias: I32
    pdf: F32
    punctual: F32
    sky: F32
    has_sky: bool
    environment: EnvironmentTables


def no_lights() -> Lights:
    none, index = np.zeros(0, np.float32), np.zeros(0, np.int32)
    sky, rows = np.zeros(3, np.float32), np.zeros((1, ROW), np.float32)
    return Lights(index, none, none, index, none, rows, sky, False, no_environment())


_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_SKY_SHARE = 0.5  # of all light samples: by power alone the sky outside would starve the lamps of a closed room


def collect_lights(compiled: CompiledScene, materials: I32) -> Lights:
    """The lights of a scene with their selection probabilities. ``materials`` (T,) int32: material of each triangle."""
    emits = np.array([m.emits for m in compiled.scene.materials])
    triangles = np.flatnonzero(emits[materials]).astype(np.int32)
    corners = compiled.triangles[triangles, :9].reshape(-1, 3, 3).astype(np.float64)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    mean = _mean_emission(compiled, triangles, materials[triangles])
    sides = 1.0 + compiled.material_info[materials[triangles], 2]
    power = np.pi * areas * sides * (mean @ _LUMINANCE)
    keep = power > 0.0  # a triangle under a black part of an emissive texture is no light
    triangles, areas, power = triangles[keep], areas[keep], power[keep]
    scene, radius = compiled.scene, compiled.extent / 2
    power = np.append(power, [light.power(radius) for light in scene.lights])
    sky = np.array(scene.sky or (0.0, 0.0, 0.0))
    has_sky = scene.environment is None and float(sky.max()) > 0.0
    around = no_environment() if scene.environment is None else build_environment(scene.environment)
    if has_sky or scene.environment is not None:
        # The power that a sphere around the scene receives, pi R^2 times the radiance times pi.
        around_power = np.pi**2 * radius**2 * (float(sky @ _LUMINANCE) if has_sky else around.mean)
        total = power.sum()
        power = np.append(power, min(around_power, total * _SKY_SHARE / (1 - _SKY_SHARE)) if total > 0 else 1.0)
    threshold, alias, pdf = build_alias(power) if len(power) else (np.zeros(0, np.float32),) * 3
    return Lights(
        triangles,
        (pdf[: len(triangles)] / np.maximum(areas, 1e-30)).astype(np.float32),
        threshold,
        np.asarray(alias, np.int32),
        pdf,
        punctual_rows(scene.lights, compiled.origin),
        sky.astype(np.float32),
        has_sky,
        around,
    )


_PROBES = 8  # along an edge
_CELLS = [(i, j) for i in range(_PROBES) for j in range(_PROBES - i)]
_STRATA = [((i + 0.5) / _PROBES, (j + 0.5) / _PROBES) for i, j in _CELLS]
_SHARES = [1.0 if i + j < _PROBES - 1 else 0.5 for i, j in _CELLS]  # the long side halves the cells that it crosses


def _mean_emission(compiled: CompiledScene, triangles: I32, materials: I32) -> F64:
    """Mean radiance over each of ``triangles`` (n,), of ``materials`` (n,): (n, 3) float64; textured ones are probed.

    Probes read the mip level whose texels are as far apart as they are: a small lamp in a large texture must not fall
    between them, for a triangle whose mean is 0 is taken for no light at all.
    """
    radiance: F64 = compiled.emission[materials].astype(np.float64)
    textures = compiled.material_info[materials, 1] if len(materials) else np.zeros(0, np.int32)
    for index in np.unique(textures[textures >= 0]):
        chosen = np.flatnonzero(textures == index)
        uvs = compiled.triangle_uvs[triangles[chosen]].reshape(-1, 3, 2).astype(np.float64)
        texels_apart = (np.ptp(uvs, axis=1) * compiled.textures.levels[index, 0, 1:]).max(axis=1) / _PROBES
        levels = np.clip(np.ceil(np.log2(np.maximum(texels_apart, 1.0))), 0, MAX_LEVELS - 1).astype(np.int64)
        for level in np.unique(levels):
            a, b, c = uvs[levels == level].transpose(1, 0, 2)
            probes = [(1 - s - t) * a + s * b + t * c for s, t in _STRATA]
            colors = [sample_bilinear(compiled.textures, int(index), probe, int(level)) for probe in probes]
            radiance[chosen[levels == level]] *= np.average(colors, axis=0, weights=_SHARES)
    return radiance
