"""Scenes and images at the edge of what there is: nothing breaks, nothing is NaN."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from raytrace.camera import Camera
from raytrace.frame import MISS, FramePacket
from raytrace.scene import Material, Scene
from tests.tracer.conftest import OpenTracer
from tests.tracer.scenes import GREY, box, cornell, everything, mesh, quad, rigid, scene, sphere, still

CAMERA = Camera.look_at((0.0, 0.5, 3.0), (0.0, 0.0, 0.0))
LAMP = Material("lamp", (0.5, 0.5, 0.5), emission=(4.0, 2.0, 1.0))


def assert_finite(frame: FramePacket) -> None:
    for values in vars(frame).values():
        if isinstance(values, np.ndarray):
            assert np.isfinite(values).all()
    for light in (frame.direct, frame.indirect, frame.albedo, frame.emission):
        assert (light >= 0.0).all()


def test_without_any_light_everything_is_black(trace: OpenTracer) -> None:
    frame = still(trace(scene([mesh("box", box((-1, -1, -1), (1, 1, 1)))], [GREY], CAMERA)), (16, 12))
    assert_finite(frame)
    assert (frame.albedo[..., 3] == 1.0).any()
    assert not frame.radiance().any()


def test_a_black_sky_is_no_light(trace: OpenTracer) -> None:
    t = trace(scene([mesh("box", box((-1, -1, -1), (1, 1, 1)))], [GREY], CAMERA, (0.0, 0.0, 0.0)))
    assert not t.scene.lights.has_sky
    assert not still(t, (16, 12)).radiance().any()


@pytest.mark.parametrize("what", [cornell(), everything()], ids=["cornell", "everything"])
def test_a_camera_that_looks_away_sees_only_misses(trace: OpenTracer, what: Scene) -> None:
    away = replace(what.camera, forward=(0.0, 0.4, 1.0), position=(0.0, 5.0, 50.0))
    frame = trace(what).frame(0, away, away, (16, 12))
    assert_finite(frame)
    assert (frame.motion[..., 3] == MISS).all()
    assert not frame.direct[..., :3].any()
    assert not frame.indirect[..., :3].any()


@pytest.mark.parametrize("backend", ["auto", "run"])
@pytest.mark.parametrize("size", [(1, 1), (31, 33), (1, 9), (9, 1), (3, 2), (64, 5)], ids=str)
def test_images_of_any_shape(trace: OpenTracer, size: tuple[int, int], backend: str) -> None:
    """Each pixel is that of the rays through it: an image twice as fine holds no other picture."""
    t = trace(everything(), backend=backend, threads=2, tile=64)
    frame = still(t, size)
    assert frame.size == size
    assert frame.direct.shape == (size[1], size[0], 4)
    assert_finite(frame)
    camera = everything().camera
    view_height = 3 * size[1]  # a third of the pixel: its middle pixel has the same centre
    fine = t.frame(0, camera, camera, (3 * size[0], view_height))
    np.testing.assert_allclose(fine.surface[1::3, 1::3, 3], frame.surface[..., 3], atol=1e-3)
    np.testing.assert_array_equal(fine.motion[1::3, 1::3, 3], frame.motion[..., 3])


def degenerate() -> np.ndarray:
    """A point, a line, and three corners on a line, all in view."""
    return np.array(
        [
            [(0.1, 0.2, 1.5)] * 3,
            [(-0.5, 0.0, 1.5), (0.5, 0.1, 1.5), (0.5, 0.1, 1.5)],
            [(-0.5, 0.3, 1.5), (0.0, 0.3, 1.5), (0.5, 0.3, 1.5)],
        ]
    )


@pytest.mark.parametrize("emits", [False, True])
def test_triangles_without_area_neither_show_nor_shine(trace: OpenTracer, emits: bool) -> None:
    whole = cornell()
    lamp = len(whole.materials) - 1
    broken = replace(whole, meshes=(*whole.meshes, mesh("broken", degenerate(), lamp if emits else 0)))
    expected, got = (still(trace(what), (24, 24)) for what in (whole, broken))
    assert_finite(got)
    np.testing.assert_array_equal(got.motion[..., 3], expected.motion[..., 3])
    np.testing.assert_allclose(got.surface, expected.surface, atol=1e-5)
    assert got.direct[..., :3].mean() == pytest.approx(expected.direct[..., :3].mean(), rel=0.15)


def test_vertex_normals_that_cancel_fall_back_to_the_face(trace: OpenTracer) -> None:
    """On the line where interpolated normals vanish, and everywhere where they are all zero."""
    sheet = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    t = trace(scene([mesh("sheet", sheet, normals=np.zeros((2, 3, 3)))], [GREY], CAMERA, (1.0, 1.0, 1.0)))
    frame = still(t, (16, 12))
    assert_finite(frame)
    seen = frame.albedo[..., 3] == 1.0
    np.testing.assert_allclose(frame.surface[seen][:, :3], np.tile((0, 0, 1), (int(seen.sum()), 1)), atol=1e-6)
    np.testing.assert_allclose(frame.direct[seen][:, :3], 1.0, rtol=1e-6)


@pytest.mark.parametrize("backend", ["auto", "run"])
def test_a_scene_of_moving_things_only(trace: OpenTracer, backend: str) -> None:
    """Inside a ball that shines and travels."""
    motion = rigid((0, 1, 0), 1.0, (0.2, 0, 0))
    what = scene([mesh("ball", sphere(4.0, inward=True), motion=motion)], [LAMP], CAMERA)
    frame = still(trace(what, backend=backend), (24, 18), time=0.5)
    assert (frame.motion[..., 3] == 0.0).all()
    np.testing.assert_allclose(frame.direct[..., :3].mean((0, 1)), LAMP.emission, rtol=0.05)


def test_a_motion_far_out_of_the_scene_and_back(trace: OpenTracer) -> None:
    """The bounds are those at time 0; what leaves them is still traced."""
    motion = rigid((0, 1, 0), 0.0, (0.0, 0.0, -100.0))
    sheet = quad((-999, -999, 0), (999, -999, 0), (999, 999, 0), (-999, 999, 0))
    t = trace(scene([mesh("sheet", sheet, motion=motion)], [GREY], CAMERA))
    for time in (0.0, 5.0, 0.0):
        frame = still(t, (8, 6), time=time)
        assert (frame.motion[..., 3] == 0.0).all()
        assert frame.surface[3, 4, 3] == pytest.approx(np.hypot(3.0, 0.5) * (1 + time * 100 / 3), rel=0.1)


def test_a_lamp_alone_lights_itself_not(trace: OpenTracer) -> None:
    frame = still(trace(scene([mesh("lamp", box((-1, -1, -1), (1, 1, 1)))], [LAMP], CAMERA)), (16, 12))
    assert_finite(frame)
    assert not frame.direct[..., :3].any()
    assert not frame.indirect[..., :3].any()
    assert frame.emission[..., 0].max() == 4.0


def test_a_black_surface_shows_only_what_it_emits(trace: OpenTracer) -> None:
    black = Material("black", (0.0, 0.0, 0.0))
    frame = still(trace(scene([mesh("box", box((-1, -1, -1), (1, 1, 1)))], [black], CAMERA, (1.0, 1.0, 1.0))), (16, 12))
    seen = frame.albedo[..., 3] == 1.0
    assert not frame.radiance()[seen].any()
    np.testing.assert_allclose(frame.direct[seen][:, :3], 1.0, rtol=2e-6)  # demodulated light is there all the same


def test_an_eye_inside_a_wall_or_on_it(trace: OpenTracer) -> None:
    inside = Camera.look_at((1.0, 0.0, 0.0), (-1.0, 0.2, 0.3))
    frame = still(trace(replace(cornell(), camera=inside)), (16, 12))
    assert_finite(frame)


def test_threads_end_with_the_tracer(trace: OpenTracer) -> None:
    t = trace(cornell(), threads=2, tile=64)
    still(t, (16, 16))
    t.close()
    with pytest.raises(RuntimeError):
        still(t, (16, 16))
