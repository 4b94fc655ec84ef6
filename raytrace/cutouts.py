"""Surfaces with holes: rays go on where the coverage of what they hit is below its material's cutoff.

glTF 2.0, sec. 3.9.4 (alphaMode MASK). A ray that meets a hole is traced again from behind it, until it meets something
or nothing; a shadow ray that something stops is traced hit by hit to see whether that has a hole there. Only scenes
with cut-outs pay, and Embree is asked by the same calls as ever, whichever way to it there is.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytrace.casting import RayCaster
from raytrace.compilation import device, inlined, kernel
from raytrace.compiled import FACE_NORMAL, MATERIAL, OFFSET, CompiledScene

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]

MOST_HOLES = 256
"""Holes one behind the other that a ray may pass; the next one stops it."""

_ZERO, _ONE, _HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)


class Cutouts(NamedTuple):
    """Coverage as kernels read it.

    ``triangles``, ``info``, ``uvs``: of the compiled scene. ``alphas`` (T, 3) float32: the corners' factors, (1, 3)
    where no vertex has any. ``factor``, ``cutoff`` (M,) float32, a cutoff of 0 or less for materials without holes;
    ``texture`` (M,) int32, -1 for none. ``texels`` (n,) uint8, row by row; ``sizes`` (k, 3) int64: first texel, width
    and height of each texture.
    """

    triangles: Any
    info: Any
    uvs: Any
    alphas: Any
    factor: Any
    cutoff: Any
    texture: Any
    texels: Any
    sizes: Any


def cutouts_of(compiled: CompiledScene) -> Cutouts:
    """What the rays of a scene must know of its holes."""
    scene = compiled.scene
    used = set(np.unique(compiled.triangle_info[:, MATERIAL]).tolist())
    masked = [m.alpha_cutoff is not None and k in used for k, m in enumerate(scene.materials)]
    numbers: dict[int, int] = {}
    texels: list[NDArray[np.uint8]] = []
    sizes: list[tuple[int, int, int]] = []
    first = 0
    for material, is_masked in zip(scene.materials, masked, strict=True):
        index = material.base_texture
        alpha = scene.textures[index].alpha if is_masked and index >= 0 else None
        if alpha is not None and index not in numbers:
            numbers[index] = len(sizes)
            sizes.append((first, alpha.shape[1], alpha.shape[0]))
            texels.append(alpha.reshape(-1))
            first += alpha.size
    chosen = [
        (m.alpha_cutoff or 0.0, numbers.get(m.base_texture, -1)) if is_masked else (0.0, -1)
        for m, is_masked in zip(scene.materials, masked, strict=True)
    ]
    return Cutouts(
        triangles=compiled.triangles,
        info=compiled.triangle_info,
        uvs=compiled.triangle_uvs,
        alphas=_corner_alphas(compiled),
        factor=np.array([m.alpha for m in scene.materials], np.float32),
        cutoff=np.array([cutoff for cutoff, _ in chosen], np.float32),
        texture=np.array([texture for _, texture in chosen], np.int32),
        texels=np.concatenate(texels) if texels else np.zeros(1, np.uint8),
        sizes=np.array(sizes or [(0, 1, 1)], np.int64),
    )


def _corner_alphas(compiled: CompiledScene) -> F32:
    meshes = compiled.ordered_meshes
    if all(mesh.colors is None or (mesh.colors[:, 3] == 1.0).all() for mesh in meshes):
        return np.ones((1, 3), np.float32)
    parts = [np.ones((len(m.faces), 3)) if m.colors is None else m.colors[m.faces][..., 3] for m in meshes]
    return np.ascontiguousarray(np.concatenate(parts), dtype=np.float32)


@device
def coverage(texels, first, width, height, s, t):  # type: ignore[no-untyped-def]
    """Bilinear, repeated lookup of a coverage in [0, 1]."""
    x = (s - np.float32(math.floor(s))) * np.float32(width) - _HALF
    y = (t - np.float32(math.floor(t))) * np.float32(height) - _HALF
    x0, y0 = math.floor(x), math.floor(y)
    fx, fy = x - np.float32(x0), y - np.float32(y0)
    x1 = x0 + 1 if x0 + 1 < width else x0 + 1 - width
    y1 = y0 + 1 if y0 + 1 < height else y0 + 1 - height
    if x0 < 0:
        x0 += width
    if y0 < 0:
        y0 += height
    low = (_ONE - fx) * np.float32(texels[first + y0 * width + x0]) + fx * np.float32(texels[first + y0 * width + x1])
    high = (_ONE - fx) * np.float32(texels[first + y1 * width + x0]) + fx * np.float32(texels[first + y1 * width + x1])
    return ((_ONE - fy) * low + fy * high) / np.float32(255.0)


@inlined
def is_hole(holes, triangle, u, v):  # type: ignore[no-untyped-def]
    """Whether nothing is there at a point of a triangle."""
    material = holes.info[triangle, MATERIAL]
    cutoff = holes.cutoff[material]
    if not cutoff > _ZERO:
        return False
    w = _ONE - u - v
    alpha = holes.factor[material]
    if holes.alphas.shape[0] > 1:
        corners = holes.alphas[triangle]
        alpha *= w * corners[0] + u * corners[1] + v * corners[2]
    index = holes.texture[material]
    if index >= 0:
        c = holes.uvs[triangle]
        s, t = w * c[0] + u * c[2] + v * c[4], w * c[1] + u * c[3] + v * c[5]
        alpha *= coverage(holes.texels, holes.sizes[index, 0], holes.sizes[index, 1], holes.sizes[index, 2], s, t)
    return alpha < cutoff


@kernel
def _first_holes(holes, triangle, u, v, index):  # type: ignore[no-untyped-def]
    """Rays that ended at a hole: how many, and which."""
    count = 0
    for i in range(triangle.shape[0]):
        if triangle[i] >= 0 and is_hole(holes, triangle[i], u[i], v[i]):
            index[count] = i
            count += 1
    return count


@kernel
def _step(holes, origins, directions, triangle, u, v, out):  # type: ignore[no-untyped-def]
    """Origins of the same rays from behind the triangles that they hit."""
    for k in range(origins.shape[0]):
        record = holes.triangles[triangle[k]]
        w = _ONE - u[k] - v[k]
        side = _ZERO
        for axis in range(3):
            side += record[FACE_NORMAL + axis] * directions[k, axis]
        offset = record[OFFSET] if side > _ZERO else -record[OFFSET]
        for axis in range(3):
            point = w * record[axis] + u[k] * record[3 + axis] + v[k] * record[6 + axis]
            out[k, axis] = point + offset * record[FACE_NORMAL + axis]


@kernel
def _still_blocked(holes, origins, directions, limits, triangle, u, v, blocked, index):  # type: ignore[no-untyped-def]
    """Decide shadow rays by their next hits: free, stopped, or at a hole; how many of those, kept in front.

    ``index``: which ray of ``blocked`` each one is; ``limits`` shrink by the way that is done.
    """
    count = 0
    for k in range(triangle.shape[0]):
        t = triangle[k]
        if t < 0:
            blocked[index[k]] = -1
            continue
        record = holes.triangles[t]
        w = _ONE - u[k] - v[k]
        along, square = _ZERO, _ZERO
        for axis in range(3):
            point = w * record[axis] + u[k] * record[3 + axis] + v[k] * record[6 + axis]
            along += (point - origins[k, axis]) * directions[k, axis]
            square += directions[k, axis] * directions[k, axis]
        way = along / square
        if way >= limits[k]:
            blocked[index[k]] = -1
        elif is_hole(holes, t, u[k], v[k]):
            limits[count] = limits[k] - way
            index[count] = index[k]
            triangle[count], u[count], v[count] = t, u[k], v[k]
            for axis in range(3):
                origins[count, axis] = origins[k, axis]
                directions[count, axis] = directions[k, axis]
            count += 1
    return count


class CutoutCaster(RayCaster):
    """``inner``, with holes."""

    def __init__(self, inner: RayCaster, holes: Cutouts) -> None:
        self.inner, self.holes = inner, holes
        self.clock = inner.clock
        self.name = f"{inner.name}, cut-outs"

    def move(self, triangles: F32, box: F32) -> None:
        self.inner.move(triangles, box)

    def intersect(self, origins: F32, directions: F32) -> tuple[I32, F32, F32]:
        return self._through(origins, directions, self.inner.intersect(origins, directions))

    def intersect_rows(self, origins: F32, directions: F32, width: int) -> tuple[I32, F32, F32]:
        return self._through(origins, directions, self.inner.intersect_rows(origins, directions, width))

    def _through(self, origins: F32, directions: F32, found: tuple[I32, F32, F32]) -> tuple[I32, F32, F32]:
        triangle, u, v = found
        index = np.empty(len(triangle), np.int32)
        pending = index[: _first_holes(self.holes, triangle, u, v, index)].copy()
        for _ in range(MOST_HOLES):
            if len(pending) == 0:
                break
            way = np.ascontiguousarray(directions[pending])
            behind = np.empty_like(way)
            _step(self.holes, way, way, triangle[pending], u[pending], v[pending], behind)
            triangle[pending], u[pending], v[pending] = self.inner.intersect(behind, way)
            count = _first_holes(self.holes, triangle[pending], u[pending], v[pending], index)
            pending = pending[index[:count]]
        return triangle, u, v

    def occluded(self, origins: F32, directions: F32, limits: F32) -> I32:
        ends = limits.copy()  # the caster may use them up
        blocked = self.inner.occluded(origins, directions, limits)
        index = np.flatnonzero(blocked == 0).astype(np.int32)
        origins, directions, ends = origins[index], directions[index], ends[index]
        for _ in range(MOST_HOLES):
            if len(index) == 0:
                break
            triangle, u, v = self.inner.intersect(origins, directions)
            count = _still_blocked(self.holes, origins, directions, ends, triangle, u, v, blocked, index)
            index, ends, directions = index[:count], ends[:count], np.ascontiguousarray(directions[:count])
            behind = np.empty_like(directions)
            _step(self.holes, directions, directions, triangle[:count], u[:count], v[:count], behind)
            origins = behind
        return blocked

    def close(self) -> None:
        self.inner.close()
