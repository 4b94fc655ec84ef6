"""Motion vectors, previous depths, normals and positions against projections in double precision."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.frame import MISS, FramePacket
from raytrace.integrator import Tracer
from raytrace.scene import Scene
from raytrace.shot import Shot
from tests.tracer.conftest import OpenTracer
from tests.tracer.scenes import (
    GREY,
    box,
    cornell,
    everything,
    mesh,
    ordered_triangles,
    placed,
    points_of,
    rigid,
    scene,
    still,
    view_of,
)

F64 = NDArray[np.float64]
SIZE = (64, 48)
PIXELS = np.arange(SIZE[0] * SIZE[1], dtype=np.int32)
MOTION_LIMIT = 1e-4  # pixels


def project(camera: Camera, points: F64, translate: bool = True) -> tuple[F64, F64]:
    """uv (n, 2) and depth (n,) of world points, or of directions, by trigonometry alone."""
    forward = np.array(camera.forward) / np.linalg.norm(camera.forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    away = points - np.array(camera.position) if translate else points
    depth = away @ forward
    tangent = math.tan(camera.yfov / 2)
    x = away @ right / (depth * tangent * SIZE[0] / SIZE[1])
    y = away @ up / (depth * tangent)
    return np.stack([0.5 + 0.5 * x, 0.5 + 0.5 * y], axis=-1), depth


def directions_of(camera: Camera) -> F64:
    """World directions through the pixel centres, (n, 3)."""
    forward = np.array(camera.forward) / np.linalg.norm(camera.forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    x, y = (PIXELS % SIZE[0] + 0.5) / SIZE[0] * 2 - 1, (PIXELS // SIZE[0] + 0.5) / SIZE[1] * 2 - 1
    tangent = math.tan(camera.yfov / 2)
    directions: F64 = forward + x[:, None] * tangent * SIZE[0] / SIZE[1] * right + y[:, None] * tangent * up
    return directions


def in_pixels(motion: NDArray[np.floating]) -> F64:
    pixels: F64 = motion.reshape(-1, motion.shape[-1])[:, :2].astype(np.float64) * np.array(SIZE)
    return pixels


def assert_still(frame: FramePacket) -> None:
    """Not a bit of motion: not even a minus sign. The previous frame's guides are this frame's."""
    assert not np.ascontiguousarray(frame.motion[..., :2]).view(np.uint32).any()
    np.testing.assert_allclose(frame.motion[..., 2], frame.surface[..., 3], rtol=1e-6)
    if frame.prev_normal is not None:
        np.testing.assert_array_equal(frame.prev_normal[..., :3], frame.surface[..., :3])
    np.testing.assert_array_equal(frame.position, frame.prev_position)


@pytest.mark.parametrize("what", [cornell(), everything()], ids=["cornell", "everything"])
def test_what_stands_still_has_no_motion_to_the_bit(trace: OpenTracer, what: Scene) -> None:
    t = trace(what)
    assert_still(still(t, SIZE, time=0.4))
    other = Camera.look_at((0.6, 1.5, 3.0), (0.1, 0.5, 0.0), yfov_degrees=35.0)
    moved = t.frame(1, other, what.camera, SIZE, 0.5, 0.4)
    assert np.abs(in_pixels(moved.motion)).max() > 1.0
    assert_still(t.frame(2, other, other, SIZE, 0.5, 0.5))


def test_jitter_is_no_motion(trace: OpenTracer) -> None:
    camera = cornell().camera
    jittered = camera.with_jitter((0.31, -0.44))
    t = trace(cornell())
    frame = t.frame(1, jittered, camera, SIZE)
    assert not np.ascontiguousarray(frame.motion[..., :2]).view(np.uint32).any()
    assert frame.jitter == (0.31, -0.44)
    assert (frame.surface[..., 3] != still(t, SIZE).surface[..., 3]).mean() > 0.3  # other points are seen


def test_a_ray_through_a_jittered_pixel_is_the_ray_through_a_shifted_image(trace: OpenTracer) -> None:
    """A jitter of (0.25, -0.25) pixels in an image of half the size: the corners of a finer grid."""
    camera = Camera.look_at((0.0, 0.0, 2.0), (0.3, 0.2, 0.0))
    sheet = mesh("sheet", box((-9, -9, -1), (9, 9, 0)))
    t = trace(scene([sheet], [GREY], camera))
    fine = t.frame(0, camera, camera, (8, 8)).position
    for dx, dy, x, y in ((-0.25, -0.25, 0, 0), (0.25, -0.25, 1, 0), (-0.25, 0.25, 0, 1)):
        jittered = camera.with_jitter((dx, dy))
        coarse = t.frame(0, jittered, jittered, (4, 4)).position
        assert fine is not None
        assert coarse is not None
        np.testing.assert_allclose(coarse, fine[y::2, x::2], atol=2e-6)


CAMERA_MOVES = {
    "sideways": {"position": (0.3, 0.1, 3.5)},
    "forwards": {"position": (0.1, 0.05, 4.2)},
    "turned": {"forward": (0.08, -0.05, -1.0)},
    "rolled": {"up": (0.1, 1.0, 0.0)},
    "zoomed": {"yfov": 0.9},
}


@pytest.mark.parametrize("move", CAMERA_MOVES)
def test_a_moving_camera_moves_every_point_as_its_projections_do(trace: OpenTracer, move: str) -> None:
    what = cornell()
    before = replace(what.camera, **CAMERA_MOVES[move])  # type: ignore[arg-type]
    t = trace(what, backend="run")
    frame = t.frame(1, what.camera, before, SIZE)
    hits = t.primary(view_of(t, what.camera, SIZE), PIXELS)
    seen = hits.triangle >= 0
    points = points_of(what, hits)[seen]
    (uv, _), (prev_uv, prev_depth) = project(what.camera, points), project(before, points)
    expected = (prev_uv - uv) * np.array(SIZE)
    assert np.abs(expected).max() > 0.5
    np.testing.assert_allclose(in_pixels(frame.motion)[seen], expected, atol=MOTION_LIMIT)
    np.testing.assert_allclose(frame.motion.reshape(-1, 4)[seen, 2], prev_depth, rtol=1e-6)


@pytest.mark.parametrize("where", ["here", "far from the scene's centre"])
@pytest.mark.parametrize("move", ["shift only", "turn and shift"])
def test_the_sky_moves_by_its_direction_alone(trace: OpenTracer, move: str, where: str) -> None:
    """Points at infinity do not see the camera's place, however far it is from the origin of the numbers."""
    distance = 0.0 if where == "here" else 3000.0
    what = everything()
    camera = replace(what.camera, position=(distance, 5.0, 3.4 + distance))
    forward = camera.forward if move == "shift only" else (0.1, -0.3, -1.0)
    before = replace(camera, position=(distance + 2.0, 4.0, 3.0), forward=forward)
    t = trace(what)
    frame = t.frame(1, camera, before, SIZE)
    missed = frame.motion[..., 3].ravel() == MISS
    assert missed.mean() > 0.2
    directions = directions_of(camera)[missed]
    expected = (project(before, directions, False)[0] - project(camera, directions, False)[0]) * np.array(SIZE)
    np.testing.assert_allclose(in_pixels(frame.motion)[missed], expected, atol=MOTION_LIMIT)
    if move == "shift only":
        assert not frame.motion.reshape(-1, 4)[missed, :2].any()
    assert not frame.motion.reshape(-1, 4)[missed, 2].any()


def test_what_was_behind_the_camera_is_sent_two_images_away(trace: OpenTracer) -> None:
    what = everything()
    turned = Camera.look_at(what.camera.position, (0.8, 2.0, 6.8))
    frame = trace(what).frame(1, what.camera, turned, SIZE)
    np.testing.assert_array_equal(frame.motion[..., :2], 2.0)
    surface = frame.motion[..., 3] != MISS
    assert (frame.motion[surface][:, 2] <= 0.0).all()


MOVING = cornell(motion=rigid((0.2, 1.0, 0.3), 2.0, (0.3, 0.4, -0.5), pivot=(0.45, -0.75, 0.25)))


def moved_frame(t: Tracer, now: float, previous: float, before: Camera | None = None) -> FramePacket:
    camera = t.scene.scene.camera
    return t.frame(1, camera, before or camera, SIZE, now, previous)


@pytest.mark.parametrize("what", [MOVING, placed(MOVING, 1.0, (1e5, 2e5, -1e5))], ids=["here", "far"])
def test_a_moving_object_carries_its_points_along(trace: OpenTracer, what: Scene) -> None:
    t = trace(what, backend="run")
    now, previous = 0.25, 0.2
    before = replace(what.camera, forward=(0.03, 0.02, -1.0))
    frame = moved_frame(t, now, previous, before)
    hits = t.primary(view_of(t, what.camera, SIZE), PIXELS)
    seen = hits.triangle >= 0
    moving = hits.triangle >= t.scene.static_count
    assert moving.sum() > 100
    points, prev_points = points_of(what, hits, now)[seen], points_of(what, hits, previous)[seen]
    (uv, _), (prev_uv, prev_depth) = project(what.camera, points), project(before, prev_points)
    np.testing.assert_allclose(in_pixels(frame.motion)[seen], (prev_uv - uv) * np.array(SIZE), atol=MOTION_LIMIT)
    np.testing.assert_allclose(frame.motion.reshape(-1, 4)[seen, 2], prev_depth, rtol=1e-6)
    assert frame.prev_position is not None
    np.testing.assert_allclose(frame.prev_position.reshape(-1, 4)[seen, :3] + t.scene.origin, prev_points, atol=2e-6)
    assert np.abs((points - prev_points)[moving[seen]]).max() > 0.01

    corners = ordered_triangles(what, previous)[hits.triangle[seen]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert frame.prev_normal is not None
    got = frame.prev_normal.reshape(-1, 4)[seen]
    # The box stands open towards the camera: every surface shows its front.
    np.testing.assert_allclose(got[:, :3], normal, atol=1e-6)
    assert not got[:, 3].any()


def test_what_does_not_move_in_a_moving_scene_has_no_motion_to_the_bit(trace: OpenTracer) -> None:
    t = trace(MOVING)
    frame = moved_frame(t, 0.25, 0.2)
    static = frame.motion[..., 3] != 5.0
    assert not np.ascontiguousarray(frame.motion[static][:, :2]).view(np.uint32).any()
    assert np.abs(in_pixels(frame.motion)[~static.ravel()]).max() > 0.5
    assert frame.prev_normal is not None
    np.testing.assert_array_equal(frame.prev_normal[static][:, :3], frame.surface[static][:, :3])


def test_a_back_face_keeps_its_side_in_the_previous_frame(trace: OpenTracer) -> None:
    """Seen from inside, a turning box: previous normals are on the same side as present ones."""
    motion = rigid((0, 1, 0), 1.0, (0, 0, 0))
    camera = Camera.look_at((0.2, 0.1, 0.3), (1.0, 0.3, -2.0), yfov_degrees=80.0)
    what = scene([mesh("box", box((-1, -1, -1), (1, 1, 1)), motion=motion)], [GREY], camera)
    frame = moved_frame(trace(what), 0.1, 0.0)
    assert frame.prev_normal is not None
    dot = (frame.prev_normal[..., :3] * frame.surface[..., :3]).sum(-1)
    vertical = np.abs(frame.surface[..., 1]) > 0.5
    np.testing.assert_allclose(dot[vertical], 1.0, atol=1e-6)
    np.testing.assert_allclose(dot[~vertical], math.cos(0.1), atol=1e-6)


def test_time_runs_backwards_as_well(trace: OpenTracer) -> None:
    """Frames in any order: each is traced from the times it is given, not from the frame before it."""
    t = trace(MOVING)
    first = moved_frame(t, 0.25, 0.2)
    moved_frame(t, 0.9, 0.8)
    again = moved_frame(t, 0.25, 0.2)
    np.testing.assert_array_equal(first.motion, again.motion)
    np.testing.assert_array_equal(first.surface, again.surface)


def test_a_shot_gives_each_frame_the_camera_and_the_time_of_the_one_before(trace: OpenTracer) -> None:
    def flight(time: float) -> Camera:
        return replace(MOVING.camera, position=(0.1 + time, 0.05, 3.6))

    t = trace(replace(MOVING, flight=flight))
    shot = Shot(t.scene, t, SIZE, "flight", animate=True)
    expected = t.frame(3, flight(3 / 30), flight(2 / 30), SIZE, 3 / 30, 2 / 30)
    got = shot.frame(3)
    for name in ("motion", "direct", "prev_position", "surface"):
        np.testing.assert_array_equal(getattr(got, name), getattr(expected, name))
    assert not got.cut
    first = shot.frame(0)
    assert first.cut
    assert not first.motion[..., :2].any()
