"""Which surfaces of a loaded scene are its lamps, and from which side they shine.

Exporters mark every material double-sided, and OBJ and PLY have no notion of sides, while the area lights of the
renderers that scenes are made for emit from their front. It shows: B. Bitterli's Cornell box, whose lamp hangs 2 cm
below the ceiling, is 15 % too bright with the flag of its glTF conversion taken at its word, and exact without.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from errors import Notices
from raytrace.parts import F64, lengths
from raytrace.repair import counted
from raytrace.scene import Scene
from raytrace.textures import SRGB_TO_LINEAR

_GLOW = 0.01  # mean of an emissive texture, in linear light, below which it is a glow on an object and not a lamp
_BEFORE = 0.7  # share of the scene's surface that a lamp on a wall has before it; a screen amid a room has half
_SCENE_POINTS, _LAMP_POINTS = 2048, 256


def has_lamp(scene: Scene) -> bool:
    """Whether any triangle gives light to speak of: a logo that glows through an emissive texture lights no scene."""
    for index in _used_emitters(scene):
        texture = scene.materials[index].emission_texture
        if texture < 0 or float(SRGB_TO_LINEAR[scene.textures[texture].pixels].mean()) >= _GLOW:
            return True
    return False


def with_front_lamps(scene: Scene, notices: Notices) -> Scene:
    """``scene`` with those double-sided emitters emitting from their front only that have most of the scene before it.

    An emitter that faces away from the scene, or stands amid it, or is closed, keeps both sides: so a lamp whose
    triangles are wound the wrong way still lights its room.
    """
    doubtful = [index for index in _used_emitters(scene) if scene.materials[index].double_sided]
    if not doubtful:
        return scene
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in scene.meshes])
    numbers = np.concatenate([mesh.materials for mesh in scene.meshes])
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = lengths(cross)
    centres = corners.mean(axis=1)
    points = centres[_spread(areas, _SCENE_POINTS)]
    materials = list(scene.materials)
    changed = 0
    for index in doubtful:
        lamp = np.flatnonzero(numbers == index)
        lamp = lamp[_spread(areas[lamp], _LAMP_POINTS)]
        if _share_before(points, centres[lamp], cross[lamp] / areas[lamp, None]) >= _BEFORE:
            materials[index] = replace(materials[index], double_sided=False)
            changed += 1
    if changed:
        notices.add(
            f"{counted(changed, 'double-sided lamp material')}: only the side that faces most of the scene emits"
        )
    return replace(scene, materials=tuple(materials))


def _used_emitters(scene: Scene) -> list[int]:
    used = {int(m) for mesh in scene.meshes for m in np.flatnonzero(np.bincount(mesh.materials))}
    return [index for index in sorted(used) if scene.materials[index].emits]


def _spread(weights: F64, count: int) -> NDArray[np.int64]:
    """``count`` indices, each as often as its share of ``weights``."""
    total = np.cumsum(weights)
    indices: NDArray[np.int64] = np.searchsorted(total, (np.arange(count) + 0.5) / count * total[-1])
    return indices


def _share_before(points: F64, centres: F64, normals: F64) -> float:
    """Mean share of ``points`` (P, 3) on the front of planes (L, 3); points on a plane do not count."""
    height = points @ normals.T - np.einsum("ij,ij->i", centres, normals)
    on_plane = 1e-6 * np.abs(height).max()
    front, behind = (height > on_plane).sum(axis=0), (height < -on_plane).sum(axis=0)
    return float((front / np.maximum(front + behind, 1)).mean())
