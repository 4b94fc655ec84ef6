"""Surfaces with holes, which rays of every kind pass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.cutouts import CutoutCaster
from raytrace.integrator import Tracer
from raytrace.scene import Material, Mesh, Scene, Texture
from tests.tracer.conftest import OpenTracer
from tests.tracer.scenes import mesh, quad, rigid, scene, view_of

I32 = NDArray[np.int32]

CAMERA = Camera.look_at((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), yfov_degrees=40.0)
WALL, SHEET = 0, 1
both_backends = pytest.mark.parametrize("backend", ["auto", "run"])


def sheet(z: float, material: int = SHEET) -> Mesh:
    """A square of side 2 that faces the camera, with texture coordinates from 0 to 1."""
    square = quad((-1, -1, z), (1, -1, z), (1, 1, z), (-1, 1, z))
    return mesh(f"sheet {z}", square, material, uvs=(square[..., :2] + 1) / 2)


def half_open(columns: int = 16) -> Texture:
    """Nothing on the left, white on the right."""
    alpha = np.zeros((4, columns), np.uint8)
    alpha[:, columns // 2 :] = 255
    return Texture("half", np.full((4, columns, 3), 255, np.uint8), alpha=alpha)


def with_sheets(*depths: float, **settings: float) -> Scene:
    """A wall at z = -1 behind half-open sheets at ``depths``."""
    masked = Material("sheet", (0.5, 0.5, 0.5), base_texture=0, alpha_cutoff=0.5)
    wall = mesh("wall", quad((-3, -3, -1), (3, -3, -1), (3, 3, -1), (-3, 3, -1)))
    what = scene([wall, *map(sheet, depths)], [Material("wall"), replace(masked, **settings)], CAMERA)  # type: ignore[arg-type]
    return replace(what, textures=(half_open(),))


def objects(t: Tracer, camera: Camera = CAMERA) -> I32:
    """Objects that the camera sees, (41, 41), row 0 at the bottom."""
    hits = t.primary(view_of(t, camera, (41, 41)), np.arange(41 * 41, dtype=np.int32))
    return hits.object.reshape(41, 41)


@both_backends
def test_the_camera_sees_through_holes(trace: OpenTracer, backend: str) -> None:
    """Through one sheet, and through five in a row; what is not a hole is seen as ever."""
    for depths in ((0.0,), (0.0, 0.1, 0.2, 0.3, 0.4)):
        t = trace(with_sheets(*depths), backend=backend)
        seen = objects(t)[20]
        assert (seen[5:19] == 0).all()
        assert (seen[22:33] == len(depths)).all()  # the nearest, which is the last object


@both_backends
def test_packets_of_whole_rows_see_through_holes(trace: OpenTracer, backend: str) -> None:
    t = trace(with_sheets(0.0, 0.2), backend=backend)
    view = view_of(t, CAMERA, (40, 40))
    pixels = np.arange(40 * 40, dtype=np.int32)
    hits, _ = t._camera_hits(view, pixels, whole_rows=True)
    single = t.primary(view, pixels)
    assert (hits.object == single.object).mean() > 0.999
    assert len(np.unique(hits.object)) > 1


@pytest.mark.parametrize(
    ("settings", "opens"),
    [
        ({"alpha": 1.0}, False),
        ({"alpha": 0.4}, True),
        ({"alpha": 0.4, "alpha_cutoff": 0.3}, False),
        ({"alpha": 0.0, "alpha_cutoff": None}, False),
    ],
)
def test_factor_and_cutoff(trace: OpenTracer, settings: dict[str, float], opens: bool) -> None:
    assert (objects(trace(with_sheets(0.0, **settings)))[20, 28] == 0) is np.bool_(opens)


def test_alpha_of_vertices(trace: OpenTracer) -> None:
    what = with_sheets(0.0)
    colors = np.ones((6, 4), np.float32)
    colors[:, 3] = np.where(what.meshes[1].vertices[:, 1] > 0, 1.0, 0.2)  # grows upwards
    painted = replace(what, meshes=(what.meshes[0], replace(what.meshes[1], colors=colors)))
    column = objects(trace(painted))[8:33, 28]
    assert (np.diff(column) >= 0).all()
    assert 0 < column.mean() < 1


@both_backends
def test_shadow_rays_pass_holes_and_nothing_else(trace: OpenTracer, backend: str) -> None:
    """From the wall towards a light in front of it, by way of open, closed, far and several sheets."""
    t = trace(with_sheets(0.0, 0.5, 2.0), backend=backend)
    origins = np.array([[-0.5, 0.2, -0.9], [0.5, 0.2, -0.9], [0.5, 0.2, 1.0], [-0.5, 0.2, 1.0], [2.0, 0.0, -0.9]])
    directions = np.array([[0.0, 0.0, 4.0], [0.0, 0.0, 4.0], [0.0, 0.0, 0.9], [0.0, 0.0, 4.0], [0.0, 0.0, 4.0]])
    limits = np.full(5, 1 - 1e-6, np.float32)
    # Open; closed; closed, but the light comes before it; open; beside all sheets.
    expected = [-1, 0, -1, -1, -1]
    places = (origins - t.scene.origin).astype(np.float32)
    got = t.rays.occluded(places, directions.astype(np.float32), limits)
    assert got.tolist() == expected


@both_backends
def test_what_stands_behind_a_hole_stops_a_shadow_ray(trace: OpenTracer, backend: str) -> None:
    what = with_sheets(0.0)
    blocker = mesh("blocker", quad((-1, -1, 1), (0, -1, 1), (0, 1, 1), (-1, 1, 1)))
    t = trace(replace(what, meshes=(*what.meshes, blocker)), backend=backend)
    origin = (np.array([[-0.5, 0.2, -0.9]]) - t.scene.origin).astype(np.float32)
    for length, expected in ((1.5, -1), (2.5, 0)):
        direction = np.array([[0.0, 0.0, length]], np.float32)
        assert t.rays.occluded(origin, direction, np.ones(1, np.float32)).tolist() == [expected]


@both_backends
def test_a_sheet_that_moves_takes_its_holes_along(trace: OpenTracer, backend: str) -> None:
    what = with_sheets(0.0)
    moving = replace(what.meshes[1], motion=rigid((0, 0, 1), 0.0, (1.0, 0.0, 0.0)))
    t = trace(replace(what, meshes=(what.meshes[0], moving)), backend=backend)
    edges = []
    for time in (0.0, 0.5):
        t.set_time(time, time)
        edges.append(int(np.flatnonzero(objects(t)[20] == 1)[0]))
    pixels = 0.5 / (2 * np.tan(np.radians(20)) * 4 / 41)
    assert edges[1] - edges[0] == pytest.approx(pixels, abs=1.5)


def test_only_scenes_with_cut_outs_pay(trace: OpenTracer) -> None:
    assert isinstance(trace(with_sheets(0.0)).rays, CutoutCaster)
    plain = trace(with_sheets(0.0, alpha_cutoff=None))  # type: ignore[arg-type]
    assert not isinstance(plain.rays, CutoutCaster)
    assert not plain.variant.cutout
