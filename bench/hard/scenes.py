"""Scenes that are far away, tiny, black, or lit by what a ray hardly hits: traced, then filtered."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Final

import numpy as np

import assets
from bench.hard.stage import EXACT, F64, SIZE, Row, Stage, deviation, number
from raytrace.camera import Camera
from raytrace.compiled import compile_scene
from raytrace.frame import FramePacket
from raytrace.integrator import Settings, Tracer
from raytrace.sampling import HASH
from raytrace.scene import Material, Mesh, Scene

Point = tuple[float, float, float]

SUN: Final = 1e-4
"""Solid angle of the sun-like light, sr."""

METHODS: Final = ("none", "svgf", "bmfr")


def measure(stage: Stage) -> list[Row]:
    """All scenes."""
    return [
        *_dark_albedo(stage),
        *(_far(stage, distance) for distance in (1e5, 1e6)),
        _tiny(stage),
        _inside(stage),
        _sun(stage),
    ]


@contextmanager
def tracing(scene: Scene) -> Iterator[Tracer]:
    """A tracer of ``scene`` that is closed afterwards."""
    tracer = Tracer(compile_scene(scene), Settings(generator=HASH))
    try:
        yield tracer
    finally:
        tracer.close()


def frames(scene: Scene, count: int = 1) -> list[FramePacket]:
    """Frames 0 to ``count`` - 1 of ``scene``, nothing moving."""
    with tracing(scene) as tracer:
        return [tracer.frame(index, scene.camera, scene.camera, SIZE) for index in range(count)]


def mesh(name: str, triangles: F64, material: int = 0) -> Mesh:
    """One object of triangles (n, 3, 3)."""
    count = len(triangles)
    faces = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    return Mesh(name, np.asarray(triangles, np.float64).reshape(-1, 3), faces, np.full(count, material, np.int32))


def quad(centre: Point, side: Point, other: Point) -> F64:
    """Two triangles (2, 3, 3) around ``centre``, half its sides given."""
    c, s, t = (np.array(v, np.float64) for v in (centre, side, other))
    corners = c - s - t, c + s - t, c + s + t, c - s + t
    return np.array([(corners[0], corners[1], corners[2]), (corners[0], corners[2], corners[3])])


def moved(scene: Scene, offset: Point) -> Scene:
    """``scene`` elsewhere."""
    shift = np.array(offset)
    x, y, z = (float(c) for c in np.array(scene.camera.position) + shift)
    meshes = tuple(replace(m, vertices=m.vertices + shift) for m in scene.meshes)
    return replace(scene, meshes=meshes, camera=replace(scene.camera, position=(x, y, z)))


# ------------------------------------------------------------------------------------------------------------- cases


def _dark_albedo(stage: Stage) -> list[Row]:
    """Surfaces that reflect nothing and next to nothing, under a sky of radiance 1: out comes albedo x 1."""
    rows = []
    with np.errstate(divide="ignore", invalid="ignore"):
        quotients = {albedo: np.float32(0.0) / np.float32(albedo) for albedo in (0.0, 1e-6)}
    for albedo in (0.0, 1e-6):
        camera = Camera.look_at((0.0, 3.0, 0.1), (0.0, 0.0, 0.0))
        floor = mesh("floor", quad((0, 0, 0), (0, 0, 9), (9, 0, 0)))
        scene = Scene("dark", (floor,), (Material("dark", (albedo,) * 3),), camera, sky=(1.0, 1.0, 1.0))
        packets = frames(scene, 3)
        found = [
            (deviation(stage.sequence(packets, method)[-1] / np.float32(albedo or 1.0), float(albedo > 0)), method)
            for method in METHODS
        ]
        error, method = max(found)
        amplified = np.float32(6e-8) / np.float32(albedo) if albedo else 0.0
        wrong = (
            f"{number(float(quotients[albedo]))}: 0 / 0" if albedo == 0.0 else f"{amplified:.1%} for a half's last bit"
        )
        rows.append(Row(f"albedo {albedo:g}", method, number(albedo), error, 0.01, wrong, finite=math.isfinite(error)))
    return rows


def _far(stage: Stage, distance: float) -> Row:
    """The Cornell box far from the world's origin: what it is near it."""
    scene = assets.build("cornell")
    offset = (distance, -distance, distance)
    near, far = frames(scene, 3), frames(moved(scene, offset), 3)
    errors = []
    for method in METHODS:
        images = [stage.sequence(packets, method)[-1].astype(np.float64) for packets in (near, far)]
        errors.append((float(np.abs(images[1] - images[0]).mean() / images[0].mean()), method))
    error, method = max(errors)
    step = float(np.spacing(np.float32(distance)))
    return Row(
        case=f"scene at {number(distance)} from the origin",
        method=method,
        exact="as at the origin",
        error=error,
        bound=0.02,
        unguarded=f"vertices off by up to {number(step / 2)} in single precision",
        measure="of the light",
        finite=math.isfinite(error),
    )


def _tiny(stage: Stage) -> Row:
    """A ball of 1 mm in a world of 1 km under a sky of radiance 1: convex, so it does not shade itself."""
    radius, centre = 0.0005, (300.0, 20.0, -200.0)
    ball = mesh("ball", _sphere(radius) + np.array(centre))
    corners = [mesh("corner", quad((s * 500.0, 0.0, s * 500.0), (1, 0, 0), (0, 0, 1)), 1) for s in (-1, 1)]
    camera = Camera.look_at((centre[0], centre[1], centre[2] + 6 * radius), centre)
    materials = (Material("white", (1.0, 1.0, 1.0)), Material("black", (0.0, 0.0, 0.0)))
    packet = frames(Scene("tiny", (ball, *corners), materials, camera, sky=(1.0, 1.0, 1.0)))[0]
    seen = packet.motion[..., 3] == 0.0
    direct = packet.direct[seen][:, :3].astype(np.float64)
    share = float(seen.mean())
    expected = math.pi * math.asin(1 / 6) ** 2 / (packet.pixel_size**2 * SIZE[0] * SIZE[1])
    step = float(np.spacing(np.float32(max(map(abs, centre)))))
    return Row(
        case="1 mm in a world of 1 km",
        method="traced",
        exact="1",
        error=max(float(np.abs(direct - 1.0).max()), abs(share / expected - 1.0)),
        bound=0.1,
        unguarded=f"hidden by an offset of 1 mm; vertices off by {number(step / 2 / radius)} of the radius",
        finite=bool(np.isfinite(direct).all()),
    )


def _sphere(radius: float, rings: int = 12, sectors: int = 24) -> F64:
    """Triangles (n, 3, 3) of a ball around 0, fronts outside."""
    theta, phi = np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, sectors + 1)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    points = radius * np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], -1)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    triangles = np.concatenate([np.stack([a, b, c], -2).reshape(-1, 3, 3), np.stack([a, c, d], -2).reshape(-1, 3, 3)])
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    return np.asarray(triangles[area > 1e-12 * radius**2])


def _inside(stage: Stage) -> Row:
    """The eye inside a closed ball, in a bright world: no light gets in."""
    ball = mesh("ball", _sphere(1.0))
    camera = Camera.look_at((0.1, 0.0, 0.2), (1.0, 0.3, 0.0))
    scene = Scene("inside", (ball,), (Material("grey", (0.5, 0.5, 0.5)),), camera, sky=(5.0, 5.0, 5.0))
    packets = frames(scene, 3)
    found = [(deviation(stage.sequence(packets, method)[-1], 0.0), method) for method in METHODS]
    error, method = max(found)
    return Row("eye inside of geometry", method, "0", error, EXACT, "5: rays that start behind the faces", "absolute",
               math.isfinite(error))  # fmt: skip


def _sun(stage: Stage) -> Row:
    """A light of 1e-4 sr above a floor: irradiance is radiance x solid angle x cosine, here divided by pi."""
    height, radiance = 1000.0, 1e5
    half = height * math.sqrt(SUN) / 2
    lamp = mesh("sun", quad((0, height, 0), (half, 0, 0), (0, 0, half)), 1)  # its front looks down
    floor = mesh("floor", quad((0, 0, 0), (0, 0, 3), (3, 0, 0)))
    camera = Camera.look_at((0.0, 3.0, 0.1), (0.0, 0.0, 0.0))
    materials = Material("white", (1.0, 1.0, 1.0)), Material("sun", (0.0, 0.0, 0.0), emission=(radiance,) * 3)
    packets = frames(Scene("sun", (floor, lamp), materials, camera), 4)
    exact = radiance * _solid_angle(half, height) / math.pi
    found = [(deviation(stage.sequence(packets, method)[-1], exact), method) for method in METHODS]
    error, method = max(found)
    chance = SUN / math.pi
    return Row(
        case=f"light of {SUN:g} sr",
        method=method,
        exact=number(exact),
        error=error,
        bound=0.01,
        unguarded=f"±{number(math.sqrt(1 / chance))} a path by bounce rays, which hit one time in {1 / chance:,.0f}",
        finite=math.isfinite(error),
    )


def _solid_angle(half: float, height: float) -> float:
    """Of a square, ``half`` its side, seen from ``height`` below its middle; small enough to be taken as flat."""
    return 4 * half * half / (height * height)
