"""Tiny scenes for the tracer's tests, and the few steps by which a test gets numbers out of a tracer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.compiled import compile_scene
from raytrace.frame import FramePacket
from raytrace.integrator import Hits, Seeds, Settings, Tracer, View
from raytrace.sampling import HASH
from raytrace.scene import Material, Mesh, Motion, Scene, Texture

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

Point = tuple[float, float, float]

WHITE = Material("white", (1.0, 1.0, 1.0))
GREY = Material("grey", (0.5, 0.4, 0.3))

# ---------------------------------------------------------------------------------------------------------- triangles


def quad(a: Point, b: Point, c: Point, d: Point) -> F64:
    """Two triangles (2, 3, 3) whose front is where the corners go counter-clockwise."""
    return np.array([(a, b, c), (a, c, d)], dtype=np.float64)


def box(lower: Point, upper: Point, inward: bool = False) -> F64:
    """The twelve triangles of an axis-aligned box, fronts outside, or inside where ``inward``."""
    (x0, y0, z0), (x1, y1, z1) = lower, upper
    sides = [
        quad((x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)),
        quad((x1, y0, z0), (x0, y0, z0), (x0, y1, z0), (x1, y1, z0)),
        quad((x1, y0, z1), (x1, y0, z0), (x1, y1, z0), (x1, y1, z1)),
        quad((x0, y0, z0), (x0, y0, z1), (x0, y1, z1), (x0, y1, z0)),
        quad((x0, y1, z1), (x1, y1, z1), (x1, y1, z0), (x0, y1, z0)),
        quad((x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)),
    ]
    triangles = np.concatenate(sides)
    return triangles[:, ::-1] if inward else triangles


def sphere(radius: float = 1.0, centre: Point = (0.0, 0.0, 0.0), splits: int = 2, inward: bool = False) -> F64:
    """An icosahedron split ``splits`` times, corners on the sphere: 20 * 4^splits triangles."""
    g = (1.0 + math.sqrt(5.0)) / 2.0
    golden = np.array([(0, s, t * g) for s in (-1, 1) for t in (-1, 1)], dtype=np.float64)
    points = np.concatenate([np.roll(golden, k, axis=1) for k in range(3)])
    edge = 2.0 * (1.0 + 1e-9)
    near = np.linalg.norm(points[:, None] - points[None], axis=2) <= edge
    indices = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]
    ]
    triangles = points[np.array(indices)]
    turned = np.linalg.det(triangles) < 0.0
    triangles[turned] = triangles[turned][:, ::-1]
    for _ in range(splits):
        a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
        triangles /= np.linalg.norm(triangles, axis=2, keepdims=True)
    unit: F64 = triangles / np.linalg.norm(triangles, axis=2, keepdims=True)
    corners: F64 = unit * radius + np.array(centre)
    return corners[:, ::-1] if inward else corners


def mesh(
    name: str,
    triangles: F64,
    material: int = 0,
    *,
    motion: Motion | None = None,
    normals: F64 | None = None,
    uvs: F64 | None = None,
) -> Mesh:
    """One object of triangles (n, 3, 3) that share no vertex; ``normals`` (n, 3, 3), ``uvs`` (n, 3, 2)."""
    count = len(triangles)
    return Mesh(
        name,
        np.ascontiguousarray(triangles, dtype=np.float64).reshape(-1, 3),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        np.full(count, material, np.int32),
        None if normals is None else normals.reshape(-1, 3).astype(np.float32),
        None if uvs is None else uvs.reshape(-1, 2).astype(np.float32),
        motion,
    )


def rigid(axis: Point, turn: float, shift: Point, pivot: Point = (0.0, 0.0, 0.0)) -> Motion:
    """Turning by ``turn`` radians per second about ``axis`` through ``pivot``, and moving by ``shift`` per second."""
    unit = np.array(axis) / np.linalg.norm(axis)
    cross = np.cross(np.eye(3), -unit)

    def at(time: float) -> F64:
        angle = turn * time
        matrix = np.eye(4)
        matrix[:3, :3] += math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
        matrix[:3, 3] = np.array(pivot) - matrix[:3, :3] @ np.array(pivot) + np.array(shift) * time
        return matrix

    return at


# ------------------------------------------------------------------------------------------------------------- scenes


def scene(meshes: Sequence[Mesh], materials: Sequence[Material], camera: Camera, sky: Point | None = None) -> Scene:
    return Scene("test", tuple(meshes), tuple(materials), camera, sky=sky)


def placed(original: Scene, scale: float = 1.0, offset: Point = (0.0, 0.0, 0.0)) -> Scene:
    """The same scene in other units and elsewhere: every point p becomes scale * p + offset."""
    shift = np.array(offset)

    def move_motion(motion: Motion) -> Motion:
        def at(time: float) -> F64:
            matrix = np.array(motion(time))
            matrix[:3, 3] = matrix[:3, 3] * scale + shift
            return matrix

        return at

    meshes = tuple(
        replace(m, vertices=m.vertices * scale + shift)
        if m.motion is None
        else replace(m, vertices=m.vertices * scale, motion=move_motion(m.motion))
        for m in original.meshes
    )
    return replace(original, meshes=meshes, camera=placed_camera(original.camera, scale, offset))


def placed_camera(camera: Camera, scale: float, offset: Point) -> Camera:
    """``camera`` at scale * position + offset."""
    x, y, z = (float(c) for c in np.array(camera.position) * scale + np.array(offset))
    return replace(camera, position=(x, y, z))


def cornell(motion: Motion | None = None, sky: Point | None = None) -> Scene:
    """A Cornell-like box of side 2 open towards +z, two blocks, a one-sided lamp; one block has ``motion``."""
    white, red, green = (
        Material("white", (0.7, 0.7, 0.7)),
        Material("red", (0.6, 0.1, 0.1)),
        Material("green", (0.1, 0.5, 0.1)),
    )
    lamp = Material("lamp", (0.5, 0.5, 0.5), emission=(8.0, 6.0, 3.0))
    room = np.concatenate(
        [
            quad((-1, -1, 1), (1, -1, 1), (1, -1, -1), (-1, -1, -1)),
            quad((-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1)),
            quad((-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)),
        ]
    )
    meshes = [
        mesh("room", room, 0),
        mesh("left", quad((-1, -1, 1), (-1, -1, -1), (-1, 1, -1), (-1, 1, 1)), 1),
        mesh("right", quad((1, -1, -1), (1, -1, 1), (1, 1, 1), (1, 1, -1)), 2),
        mesh("tall", box((-0.6, -0.999, -0.6), (-0.1, 0.2, -0.1)), 0),
        mesh("short", box((0.2, -0.999, 0.0), (0.7, -0.5, 0.5)), 0, motion=motion),
        mesh("lamp", quad((-0.4, 0.9, -0.4), (0.4, 0.9, -0.4), (0.4, 0.9, 0.4), (-0.4, 0.9, 0.4)), 3),
    ]
    camera = Camera.look_at((0.1, 0.05, 3.6), (0.0, 0.0, 0.0), yfov_degrees=42.0)
    return scene(meshes, [white, red, green, lamp], camera, sky)


def everything() -> Scene:
    """Textures, a sky, a moving and a smooth object, a lamp with a texture, misses: every feature there is."""
    random = np.random.default_rng(7)
    pixels = (random.random((9, 14, 3)) * 255).astype(np.uint8)
    glow = (128 + random.random((4, 4, 3)) * 127).astype(np.uint8)
    materials = [
        Material("tiles", (0.9, 0.8, 0.7), base_texture=0),
        Material("plain", (0.6, 0.5, 0.4)),
        Material("lamp", (0.5, 0.5, 0.5), emission=(5.0, 4.0, 3.0), emission_texture=1, double_sided=True),
    ]
    corner = np.array([(0, 0), (4, 0), (4, 4), (0, 4)], dtype=np.float64)
    square_uvs = np.stack([corner[[0, 1, 2]], corner[[0, 2, 3]]])
    ball = sphere(0.5, (0.5, 0.5, 0.0), 2)
    floor = quad((-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2))
    meshes = [
        mesh("floor", floor, 0, uvs=square_uvs),
        mesh("ball", ball, 1, normals=(ball - np.array([0.5, 0.5, 0.0])) / 0.5),
        mesh(
            "block",
            box((-1.0, 0.1, -0.3), (-0.4, 0.7, 0.3)),
            1,
            motion=rigid((0.3, 1.0, 0.2), 1.5, (0.4, 0.1, -0.2), pivot=(-0.7, 0.4, 0.0)),
        ),
        mesh(
            "lamp", quad((-0.3, 1.8, -0.3), (0.3, 1.8, -0.3), (0.3, 1.8, 0.3), (-0.3, 1.8, 0.3)), 2, uvs=square_uvs / 4
        ),
    ]
    camera = Camera.look_at((0.4, 1.3, 3.4), (0.0, 0.6, 0.0), yfov_degrees=50.0)
    textures = (Texture("tiles", pixels), Texture("glow", glow))
    return replace(scene(meshes, materials, camera, (0.4, 0.6, 0.9)), textures=textures)


def glossy() -> Scene:
    """A metal ball, a varnished and textured floor, a diffuse block, a sky, a lamp: both lobes at both hits."""
    tiles = (np.random.default_rng(7).random((9, 14, 3)) * 255).astype(np.uint8)
    materials = [
        Material("varnish", (0.9, 0.8, 0.7), base_texture=0, specular=True, roughness=0.2),
        Material("copper", (0.9, 0.6, 0.4), specular=True, metallic=1.0, roughness=0.4),
        Material("plain", (0.6, 0.5, 0.4)),
        Material("lamp", (0.5, 0.5, 0.5), emission=(5.0, 4.0, 3.0)),
    ]
    corner = np.array([(0, 0), (4, 0), (4, 4), (0, 4)], dtype=np.float64)
    ball = sphere(0.5, (0.5, 0.5, 0.0), 2)
    meshes = [
        mesh("floor", quad((-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)), 0, uvs=corner[[[0, 1, 2], [0, 2, 3]]]),
        mesh("ball", ball, 1, normals=(ball - np.array([0.5, 0.5, 0.0])) / 0.5),
        mesh("block", box((-1.0, 0.1, -0.3), (-0.4, 0.7, 0.3)), 2),
        mesh("lamp", quad((-0.3, 1.8, -0.3), (0.3, 1.8, -0.3), (0.3, 1.8, 0.3), (-0.3, 1.8, 0.3)), 3),
    ]
    camera = Camera.look_at((0.4, 1.3, 3.4), (0.0, 0.6, 0.0), yfov_degrees=50.0)
    what = replace(scene(meshes, materials, camera, (0.4, 0.6, 0.9)), textures=(Texture("tiles", tiles),))
    return with_every_material(what)


def with_every_material(what: Scene) -> Scene:
    """``what`` and, far below it, a small patch that has all features of a material, a dim lamp, a hint of a sky.

    Scenes of all tests then need the same kernels, which take long to compile.
    """
    first, textures = len(what.materials), len(what.textures)
    grey = np.full((2, 2, 3), 128, np.uint8)
    patch = Material(
        "patch",
        specular=True,
        base_texture=textures,
        metallic_roughness_texture=textures + 1,
        normal_texture=textures + 1,
    )
    lamp = Material("dim", emission=(1e-4, 1e-4, 1e-4))
    below = quad((-0.1, -90, 0.1), (0.1, -90, 0.1), (0.1, -90, -0.1), (-0.1, -90, -0.1))
    added = mesh("patch", below, first, uvs=below[..., ::2] * 5)
    return replace(
        what,
        meshes=(
            *what.meshes,
            replace(added, colors=np.ones((6, 4), np.float32)),
            mesh("dim", below[:, ::-1] - np.array([0.0, 1.0, 0.0]), first + 1),
        ),
        materials=(*what.materials, patch, lamp),
        textures=(*what.textures, Texture("grey", grey), Texture("plain", grey, linear=True)),
        sky=what.sky or (1e-6, 1e-6, 1e-6),
    )


# ------------------------------------------------------------------------------------------------------------ tracing


def tracer(what: Scene, **settings: int | str) -> Tracer:
    """A tracer of ``what`` on one thread that uses the hash generator and returns positions, unless told otherwise."""
    options: dict[str, int | str] = {"generator": HASH, "threads": 1, **settings}
    return Tracer(compile_scene(what), Settings(positions=True, **options))  # type: ignore[arg-type]


def still(t: Tracer, size: tuple[int, int], index: int = 0, time: float = 0.0) -> FramePacket:
    """A frame in which neither the camera nor any object moves."""
    camera = t.scene.scene.camera
    return t.frame(index, camera, camera, size, time, time)


def view_of(t: Tracer, camera: Camera, size: tuple[int, int]) -> View:
    return View.of(camera, size, t.scene.origin)


def selected(hits: Hits, indices: NDArray[np.integer]) -> Hits:
    """Those of ``hits``, in that order."""
    return Hits(hits.triangle[indices], hits.u[indices], hits.v[indices], hits.object[indices])


def repeated(hits: Hits, chosen: int, count: int) -> Hits:
    """One of ``hits``, ``count`` times."""
    return selected(hits, np.full(count, chosen))


def shade(t: Tracer, hits: Hits, seeds: Seeds, eye: F32) -> tuple[F32, F32]:
    """Direct and indirect, (n, 3) float32 each, filled with NaN before they are written."""
    direct, indirect = np.full((2, len(hits.triangle), 3), np.nan, np.float32)
    t.shade(hits, seeds, eye, direct, indirect)
    return direct, indirect


def seeds_of(count: int, frame: int = 0) -> Seeds:
    return Seeds(np.arange(count, dtype=np.uint32), np.full(count, frame, np.uint32))


@dataclass(frozen=True)
class PointLight:
    """``count`` independent estimates of the light at one surface point, (count, 3) float64 each."""

    direct: F64
    indirect: F64


def light_at(t: Tracer, target: Point, eye: Point, count: int, frame: int = 0) -> PointLight:
    """Estimates at the first surface on the way from ``eye`` to ``target``, both in world units."""
    view = view_of(t, Camera.look_at(eye, target, up=(0.3, 0.9, 0.4), yfov_degrees=1.0), (1, 1))
    hits = t.primary(view, np.zeros(1, np.int32))
    assert hits.triangle[0] >= 0, "there is no surface"
    direct, indirect = shade(t, repeated(hits, 0, count), seeds_of(count, frame), view.eye)
    return PointLight(direct.astype(np.float64), indirect.astype(np.float64))


def points_of(what: Scene, hits: Hits, time: float = 0.0) -> F64:
    """Hits in world space from the scene's own vertices in float64, (n, 3); NaN for a miss."""
    corners = ordered_triangles(what, time)[hits.triangle]
    u, v = hits.u.astype(np.float64)[:, None], hits.v.astype(np.float64)[:, None]
    points: F64 = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    points[hits.triangle < 0] = np.nan
    return points


def ordered_triangles(what: Scene, time: float = 0.0) -> F64:
    """All triangles in the tracer's order, meshes that move last, world space, (T, 3, 3) float64."""
    parts = []
    for m in sorted(what.meshes, key=lambda m: m.motion is not None):
        matrix = np.eye(4) if m.motion is None else m.motion(time)
        parts.append((m.vertices @ matrix[:3, :3].T + matrix[:3, 3])[m.faces])
    return np.concatenate(parts)
