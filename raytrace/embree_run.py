"""Rays through ``EmbreeScene.run`` of embreex: works wherever embreex does."""

from __future__ import annotations

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from numpy.typing import NDArray

from raytrace.casting import RayCaster, meets_box
from raytrace.compilation import kernel

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]


def _build(triangles: F32) -> rtcore_scene.EmbreeScene:
    # The robust flag costs 10 to 20 % of the rays per second, and none of 300,000 rays found a gap without it.
    scene = rtcore_scene.EmbreeScene(robust=False)
    TriangleMesh(scene, np.ascontiguousarray(triangles[:, :9]).reshape(-1, 3, 3))
    return scene


@kernel
def _select_rays(origins, directions, limits, box, index):  # type: ignore[no-untyped-def]
    """Indices of the rays that meet the box; returns how many."""
    count = 0
    for i in range(origins.shape[0]):
        if meets_box(origins, directions, i, limits[i], box):
            index[count] = i
            count += 1
    return count


@kernel
def _merge_hits(index, triangle, u, v, first, out_triangle, out_u, out_v):  # type: ignore[no-untyped-def]
    """Overwrite the static hits by the moving ones, which are nearer wherever there is one."""
    for k in range(index.shape[0]):
        if triangle[k] >= 0:
            i = index[k]
            out_triangle[i] = first + triangle[k]
            out_u[i] = u[k]
            out_v[i] = v[k]


@kernel
def _merge_occlusion(index, blocked, out):  # type: ignore[no-untyped-def]
    for k in range(index.shape[0]):
        if blocked[k] == 0:
            out[index[k]] = 0


class PortableCaster(RayCaster):
    """``triangles`` (T, >= 9) float32: corners in the first nine columns; the first ``static_count`` never move."""

    name = "embreex EmbreeScene.run"

    def __init__(self, triangles: F32, static_count: int) -> None:
        super().__init__()
        self._static_count = static_count
        self._static = _build(triangles[:static_count]) if static_count else None
        self._moving: rtcore_scene.EmbreeScene | None = None
        self._box = np.zeros((2, 3), np.float32)

    def move(self, triangles: F32, box: F32) -> None:
        self._moving = _build(triangles[self._static_count :])
        self._box = box

    def intersect(self, origins: F32, directions: F32) -> tuple[I32, F32, F32]:
        count = len(origins)
        if self._static is not None:
            with self.clock.running():
                hits = self._static.run(origins, directions, output=True)
            triangle, u, v, limit = hits["primID"], hits["u"], hits["v"], hits["tfar"]
        else:
            triangle, u, v = np.full(count, -1, np.int32), np.zeros(count, np.float32), np.zeros(count, np.float32)
            limit = np.full(count, 1e37, np.float32)
        if self._moving is not None:
            index = self._select(origins, directions, limit)
            if len(index):
                with self.clock.running():
                    near = self._moving.run(origins[index], directions[index], dists=limit[index], output=True)
                _merge_hits(index, near["primID"], near["u"], near["v"], self._static_count, triangle, u, v)
        return triangle, u, v

    def occluded(self, origins: F32, directions: F32, limits: F32) -> I32:
        index = self._select(origins, directions, limits) if self._moving is not None else np.zeros(0, np.int32)
        moving_limits = limits[index]  # before `run` uses the array up
        if self._static is not None:
            with self.clock.running():
                blocked: I32 = self._static.run(origins, directions, dists=limits, query="OCCLUDED")
        else:
            blocked = np.full(len(origins), -1, np.int32)
        if self._moving is not None and len(index):
            with self.clock.running():
                also = self._moving.run(origins[index], directions[index], dists=moving_limits, query="OCCLUDED")
            _merge_occlusion(index, also, blocked)
        return blocked

    def close(self) -> None:
        self._static = self._moving = None

    def _select(self, origins: F32, directions: F32, limits: F32) -> I32:
        index = np.empty(len(origins), np.int32)
        return index[: _select_rays(origins, directions, limits, self._box, index)]
