"""The two ways to Embree answer alike."""

from __future__ import annotations

import numpy as np
import pytest

from raytrace.embree import describe_backend, open_caster
from raytrace.embree_native import NativeCaster, load_library
from raytrace.embree_run import PortableCaster

native = pytest.mark.skipif(isinstance(load_library(), str), reason=f"no direct way to Embree here: {load_library()}")


def soup(count: int, seed: int) -> np.ndarray:
    """Small triangles in the unit cube, (count, 9) float32."""
    rng = np.random.default_rng(seed)
    centre = rng.uniform(0.0, 1.0, (count, 1, 3))
    return (centre + rng.normal(0.0, 0.15, (count, 3, 3))).reshape(count, 9).astype(np.float32)


def rays(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    origins = rng.uniform(-0.5, 1.5, (count, 3)).astype(np.float32)
    return origins, (rng.uniform(0.0, 1.0, (count, 3)) - origins).astype(np.float32)


def box(triangles: np.ndarray) -> np.ndarray:
    corners = triangles.reshape(-1, 3)
    return np.stack([corners.min(0) - 1e-5, corners.max(0) + 1e-5]).astype(np.float32)


def nearest(triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nearest triangle (-1 = none) and distance by Möller and Trumbore 1997 in float64, every ray against every one."""
    p = triangles.astype(np.float64).reshape(-1, 3, 3)
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    best, index = np.full(len(origins), np.inf), np.full(len(origins), -1)
    for i, (o, d) in enumerate(zip(origins.astype(np.float64), directions.astype(np.float64), strict=True)):
        h = np.cross(d, e2)
        det = (e1 * h).sum(1)
        s = o - p[:, 0]
        u = (s * h).sum(1) / det
        q = np.cross(s, e1)
        v = (q @ d) / det
        t = (e2 * q).sum(1) / det
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        if hit.any():
            index[i] = int(np.argmin(np.where(hit, t, np.inf)))
            best[i] = t[index[i]]
    return index, best


BACKENDS = ["run", pytest.param("native", marks=native)]


@pytest.mark.parametrize("moving", [0, 40])
@pytest.mark.parametrize("backend", BACKENDS)
def test_nearest_hits_and_occlusion_are_those_of_brute_force(backend: str, moving: int) -> None:
    triangles = soup(120, 1)
    caster = open_caster(triangles, len(triangles) - moving, backend)
    if moving:
        caster.move(triangles, box(triangles[-moving:]))
    origins, directions = rays(400, 2)
    expected, distance = nearest(triangles, origins, directions)
    triangle, u, v = caster.intersect(origins, directions)
    assert (triangle != expected).sum() <= 1  # an edge may be met by one arithmetic and missed by the other
    same = (triangle == expected) & (expected >= 0)
    assert same.sum() > 150
    corners = triangles.reshape(-1, 3, 3)[triangle[same]]
    w = 1.0 - u[same] - v[same]
    points = w[:, None] * corners[:, 0] + u[same][:, None] * corners[:, 1] + v[same][:, None] * corners[:, 2]
    ends = origins[same] + distance[same][:, None] * directions[same]
    np.testing.assert_allclose(points, ends, atol=2e-5)

    limits = np.where(np.isfinite(distance), distance, 2.0)
    beyond, before = (limits * 1.01).astype(np.float32), (limits * 0.99).astype(np.float32)
    assert ((caster.occluded(origins, directions, beyond) == 0) != (expected >= 0)).sum() <= 2
    assert (caster.occluded(origins, directions, before) == 0).sum() <= 1
    caster.close()


@native
@pytest.mark.parametrize("size", [(16, 8), (13, 7), (3, 2), (1, 1)])
def test_packets_find_what_single_rays_find(size: tuple[int, int]) -> None:
    """Rows of any width, the last block cut off on both sides."""
    width, height = size
    triangles = soup(300, 3)
    caster = open_caster(triangles, 260, "native")
    caster.move(triangles, box(triangles[260:]))
    x, y = np.meshgrid(np.linspace(0.1, 0.9, width), np.linspace(0.1, 0.9, height))
    directions = np.stack([x - 0.5, y - 0.5, np.ones_like(x)], axis=-1).reshape(-1, 3).astype(np.float32)
    origins = np.tile(np.array([0.5, 0.5, -1.0], np.float32), (width * height, 1))
    packets, single = caster.intersect_rows(origins, directions, width), caster.intersect(origins, directions)
    np.testing.assert_array_equal(packets[0], single[0])
    np.testing.assert_allclose(packets[1], single[1], atol=1e-5)
    np.testing.assert_allclose(packets[2], single[2], atol=1e-5)
    caster.close()


@native
def test_native_and_portable_casters_agree_on_a_large_batch() -> None:
    triangles = soup(2000, 5)
    direct, portable = open_caster(triangles, 2000, "native"), open_caster(triangles, 2000, "run")
    assert isinstance(direct, NativeCaster)
    assert isinstance(portable, PortableCaster)
    origins, directions = rays(20_000, 6)
    first, second = direct.intersect(origins, directions), portable.intersect(origins, directions)
    assert (first[0] != second[0]).mean() < 1e-3
    direct.close()


def test_the_backend_can_be_named() -> None:
    assert "Embree" in describe_backend()
