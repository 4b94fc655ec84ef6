"""The noise-free guides against closed forms in double precision."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.frame import MISS, FramePacket
from raytrace.integrator import Tracer
from raytrace.scene import Material, Texture
from tests.tracer.conftest import OpenTracer
from tests.tracer.scenes import (
    GREY,
    WHITE,
    Point,
    box,
    cornell,
    everything,
    mesh,
    ordered_triangles,
    placed,
    points_of,
    quad,
    rigid,
    scene,
    sphere,
    still,
    view_of,
)

F64 = NDArray[np.float64]
SIZE = (48, 36)


def camera_directions(camera: Camera, size: tuple[int, int]) -> F64:
    """Directions through the pixel centres, (H, W, 3), of length 1 along the camera's forward axis."""
    width, height = size
    forward = np.array(camera.forward) / np.linalg.norm(camera.forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    x, y = np.meshgrid((np.arange(width) + 0.5) / width * 2 - 1, (np.arange(height) + 0.5) / height * 2 - 1)
    tangent = math.tan(camera.yfov / 2)
    directions: F64 = forward + x[..., None] * tangent * width / height * right + y[..., None] * tangent * up
    return directions


def plane_depth(camera: Camera, size: tuple[int, int], point: Point, normal: Point) -> F64:
    """Depth of a plane at every pixel, (H, W)."""
    n = np.array(normal)
    distance = float((np.array(point) - np.array(camera.position)) @ n)
    depth: F64 = distance / (camera_directions(camera, size) @ n)
    return depth


def floor_tracer(trace: OpenTracer, camera: Camera, half: float = 20.0) -> Tracer:
    ground = quad((-half, 0, half), (half, 0, half), (half, 0, -half), (-half, 0, -half))
    return trace(scene([mesh("ground", ground)], [GREY], camera))


OBLIQUE = Camera.look_at((1.0, 2.5, 3.0), (0.3, 0.0, 0.5), up=(0.2, 1.0, 0.1), yfov_degrees=40.0)


def test_depth_and_normal_of_a_plane(trace: OpenTracer) -> None:
    frame = still(floor_tracer(trace, OBLIQUE), SIZE)
    np.testing.assert_allclose(frame.surface[..., 3], plane_depth(OBLIQUE, SIZE, (0, 0, 0), (0, 1, 0)), rtol=3e-6)
    np.testing.assert_allclose(frame.surface[..., :3], np.broadcast_to((0, 1, 0), (36, 48, 3)), atol=1e-7)
    np.testing.assert_allclose(frame.albedo, np.broadcast_to((0.5, 0.4, 0.3, 1.0), (36, 48, 4)), rtol=1e-6)
    assert not frame.emission[..., :3].any()


def test_a_plane_seen_from_behind_shows_the_other_normal(trace: OpenTracer) -> None:
    below = Camera.look_at((1.0, -2.5, 3.0), (0.3, 0.0, 0.5))
    frame = still(floor_tracer(trace, below), SIZE)
    np.testing.assert_allclose(frame.surface[..., :3], np.broadcast_to((0, -1, 0), (36, 48, 3)), atol=1e-7)
    assert (frame.surface[..., 3] > 0.0).all()


def test_gradient_of_a_plane_is_the_derivative_of_its_depth(trace: OpenTracer) -> None:
    """Against differences of the exact depth, over a thousandth of a pixel to both sides."""
    frame = still(floor_tracer(trace, OBLIQUE), SIZE)
    n = np.array((0.0, 1.0, 0.0))
    directions = camera_directions(OBLIQUE, SIZE)
    depth = plane_depth(OBLIQUE, SIZE, (0, 0, 0), (0, 1, 0))
    for axis, gradient in ((1, frame.gradient[..., 0]), (0, frame.gradient[..., 1])):
        step = 1e-3 * (np.roll(directions, -1, axis) - directions)
        step = np.broadcast_to(np.take(step, [0], axis), directions.shape)  # the same everywhere; the roll's end is not
        change = depth * (directions @ n) * (1 / ((directions + step) @ n) - 1 / ((directions - step) @ n)) / 2e-3
        np.testing.assert_allclose(gradient, change, rtol=2e-4, atol=1e-7)


def test_gradient_predicts_the_neighbours_depth(trace: OpenTracer) -> None:
    """What the filters use it for; both sides come from the packet, so that signs and axes are those of the image."""
    frame = still(floor_tracer(trace, OBLIQUE), SIZE)
    depth = frame.surface[..., 3].astype(np.float64)
    in_x = (depth[:, 2:] - depth[:, :-2]) / 2
    in_y = (depth[2:] - depth[:-2]) / 2
    np.testing.assert_allclose(frame.gradient[:, 1:-1, 0], in_x, rtol=0.02, atol=2e-4)
    np.testing.assert_allclose(frame.gradient[1:-1, :, 1], in_y, rtol=0.02, atol=2e-4)


def test_gradient_is_held_where_a_plane_is_seen_edge_on(trace: OpenTracer) -> None:
    """Below a cosine of 0.05 the slope grows no further."""
    low = Camera.look_at((0.0, 0.02, 10.0), (0.0, 0.0, 0.0), yfov_degrees=2.0)
    frame = still(floor_tracer(trace, low), SIZE)
    seen = frame.albedo[..., 3] == 1.0
    assert 0.2 < seen.mean() < 1.0
    pixel = 2 * math.tan(low.yfov / 2) / SIZE[1]
    slope = np.abs(frame.gradient[..., 1][seen]) / (frame.surface[..., 3][seen] * pixel)
    np.testing.assert_allclose(slope, 1 / 0.05, rtol=0.01)
    unheld = math.hypot(1.0, 0.002) / 0.002
    assert unheld > 10 * slope.max()


def test_guides_of_a_faceted_and_of_a_smooth_ball(trace: OpenTracer) -> None:
    radius, centre = 0.8, np.array([0.1, -0.2, 0.3])
    triangles = sphere(radius, (0.1, -0.2, 0.3), 3)
    camera = Camera.look_at((0.5, 0.4, 3.0), (0.1, -0.2, 0.3), yfov_degrees=30.0)
    normals = (triangles - centre) / radius
    flat = still(trace(scene([mesh("ball", triangles)], [GREY], camera)), SIZE)
    smooth = still(trace(scene([mesh("ball", triangles, normals=normals)], [GREY], camera)), SIZE)
    np.testing.assert_array_equal(flat.surface[..., 3], smooth.surface[..., 3])

    directions = camera_directions(camera, SIZE)
    away = np.array(camera.position) - centre
    a, b, c = (directions**2).sum(-1), directions @ away, away @ away - radius**2
    root = b * b - a * c
    inner = root > 0.05 * root.max()  # the facets' outline lies inside the ball's
    depth = (-b - np.sqrt(np.maximum(root, 0.0))) / a
    normal = (away + depth[..., None] * directions) / radius
    assert inner.sum() > 300
    np.testing.assert_allclose(smooth.surface[inner][:, 3], depth[inner], rtol=0.01)
    np.testing.assert_allclose(smooth.surface[inner][:, :3], normal[inner], atol=0.03)
    np.testing.assert_allclose(flat.surface[inner][:, :3], normal[inner], atol=0.15)
    for frame in (flat, smooth):
        length = np.linalg.norm(frame.surface[frame.albedo[..., 3] == 1.0][:, :3], axis=-1)
        np.testing.assert_allclose(length, 1.0, atol=1e-6)


def test_normals_are_interpolated_between_the_corners(trace: OpenTracer) -> None:
    """Against the same interpolation in double precision, at the barycentrics of the hits."""
    triangles = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    tilted = np.random.default_rng(3).normal((0, 0, 2), 0.5, (2, 3, 3))
    tilted /= np.linalg.norm(tilted, axis=-1, keepdims=True)
    camera = Camera.look_at((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), yfov_degrees=35.0)
    t = trace(scene([mesh("sheet", triangles, normals=tilted)], [GREY], camera), backend="run")
    frame = still(t, SIZE)
    hits = t.primary(view_of(t, camera, SIZE), np.arange(SIZE[0] * SIZE[1], dtype=np.int32))
    u, v = hits.u.astype(np.float64)[:, None], hits.v.astype(np.float64)[:, None]
    corners = tilted[hits.triangle]
    expected = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(frame.surface[..., :3].reshape(-1, 3), expected, atol=1e-6)


def test_positions_lie_on_the_camera_rays(trace: OpenTracer) -> None:
    what = cornell()
    t = trace(what)
    frame = still(t, SIZE)
    assert frame.position is not None
    seen = frame.albedo[..., 3] == 1.0
    ray = camera_directions(what.camera, SIZE) * frame.surface[..., 3:]
    world = frame.position[..., :3] + t.scene.origin
    np.testing.assert_allclose(world[seen], (np.array(what.camera.position) + ray)[seen], atol=5e-6)
    np.testing.assert_array_equal(frame.position[..., 3], seen)


def test_object_ids_follow_the_meshes_in_view(trace: OpenTracer) -> None:
    """Two sheets side by side and a gap: left object, right object, a miss between them."""
    left, right = (
        quad((-2, -2, 0), (-0.5, -2, 0), (-0.5, 2, 0), (-2, 2, 0)),
        quad((0.5, -2, 0), (2, -2, 0), (2, 2, 0), (0.5, 2, 0)),
    )
    camera = Camera.look_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), yfov_degrees=30.0)
    for moving, ids in ((False, (0.0, 1.0)), (True, (1.0, 0.0))):  # objects that move are numbered last
        motion = rigid((0, 1, 0), 0.0, (0, 0, 0)) if moving else None
        frame = still(trace(scene([mesh("left", left, motion=motion), mesh("right", right)], [GREY], camera)), SIZE)
        expected = np.full(SIZE[0], MISS)
        x = camera_directions(camera, SIZE)[0, :, 0] * 3.0
        expected[x < -0.5], expected[x > 0.5] = ids
        assert {ids[0], ids[1], MISS} == set(expected)
        np.testing.assert_array_equal(frame.motion[..., 3], np.broadcast_to(expected, (SIZE[1], SIZE[0])))


def test_a_miss_leaves_every_surface_guide_at_zero(trace: OpenTracer) -> None:
    frame = still(trace(everything()), SIZE)
    missed = frame.motion[..., 3] == MISS
    assert 0.1 < missed.mean() < 0.9
    assert frame.prev_normal is not None
    assert frame.position is not None
    assert frame.prev_position is not None
    for guide in (frame.albedo, frame.surface, frame.gradient, frame.prev_normal, frame.position, frame.prev_position):
        assert not guide[missed].any()
    assert not frame.motion[missed][:, :3].any()
    assert not frame.direct[missed][:, :3].any()
    assert not frame.indirect[missed][:, :3].any()
    np.testing.assert_allclose(
        frame.emission[missed][:, :3], np.tile((0.4, 0.6, 0.9), (int(missed.sum()), 1)), rtol=1e-6
    )
    assert (frame.surface[~missed][:, 3] > 0.0).all()


def test_without_a_sky_a_miss_is_black(trace: OpenTracer) -> None:
    frame = still(trace(cornell()), SIZE)
    missed = frame.motion[..., 3] == MISS
    assert missed.any()
    assert not frame.emission[missed][:, :3].any()


@pytest.mark.parametrize("double_sided", [False, True])
def test_emission_shows_on_the_front_and_on_the_back_of_what_is_double_sided(
    trace: OpenTracer, double_sided: bool
) -> None:
    glow = Material("glow", (0.2, 0.3, 0.4), emission=(3.0, 2.0, 1.0), double_sided=double_sided)
    sheet = quad((-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0))
    front, back = (Camera.look_at((0.0, 0.0, z), (0.0, 0.0, 0.0)) for z in (2.0, -2.0))
    t = trace(scene([mesh("sheet", sheet)], [glow], front))
    for camera, shines in ((front, True), (back, double_sided)):
        frame = t.frame(0, camera, camera, SIZE)
        np.testing.assert_allclose(
            frame.emission[..., :3], np.broadcast_to((3.0, 2.0, 1.0) if shines else (0, 0, 0), (36, 48, 3))
        )
        np.testing.assert_allclose(frame.albedo[..., :3], np.broadcast_to((0.2, 0.3, 0.4), (36, 48, 3)), rtol=1e-6)


def test_textures_stand_upright_and_are_filtered_when_small(trace: OpenTracer) -> None:
    """Texture row 0 is the bottom one. From near single texels, from far their mean."""
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1] = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)
    material = Material("tiles", (1.0, 0.5, 1.0), base_texture=0)
    corner = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=np.float64)
    uvs = np.stack([corner[[0, 1, 2]], corner[[0, 2, 3]]])
    sheet = mesh("sheet", quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)), uvs=uvs)
    # Everything on, so that no further kernel has to be compiled for this scene.
    other = mesh("other", box((8, 8, 8), (9, 9, 9)), 1, motion=rigid((0, 1, 0), 0.0, (0, 0, 0)))
    near = Camera.look_at((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), yfov_degrees=90.0)
    what = scene([sheet, other], [material, WHITE], near, (1.0, 1.0, 1.0))
    t = trace(type(what)(**{**what.__dict__, "textures": (Texture("tiles", pixels),)}))
    albedo = still(t, (20, 20)).albedo
    for x, y, expected in ((5, 5, (1, 0, 0)), (15, 5, (0, 0.5, 0)), (5, 15, (0, 0, 1)), (15, 15, (1, 0.5, 1))):
        mean = albedo[y - 1 : y + 1, x - 1 : x + 1, :3].mean((0, 1))
        np.testing.assert_allclose(mean, expected, atol=0.1)
    far = Camera.look_at((0.0, 0.0, 500.0), (0.0, 0.0, 0.0), yfov_degrees=1.4)
    distant = t.frame(0, far, far, (3, 3))  # one pixel is twice as wide as the sheet
    np.testing.assert_allclose(distant.albedo[1, 1, :3], (0.5, 0.25, 0.5), rtol=0.02)


FAR_AWAY = (1e5, -2e5, 1.5e5)


def guides(frame: FramePacket) -> dict[str, NDArray[np.float32]]:
    assert frame.position is not None
    assert frame.prev_position is not None
    result = {"albedo": frame.albedo, "emission": frame.emission, "surface": frame.surface, "gradient": frame.gradient}
    result |= {"motion": frame.motion, "position": frame.position, "prev_position": frame.prev_position}
    if frame.prev_normal is not None:
        result["prev_normal"] = frame.prev_normal
    return result


def test_a_scene_far_from_the_origin_gives_the_same_guides(trace: OpenTracer) -> None:
    """Only the rounding of the moved coordinates in double precision, 3e-11 here, may differ."""
    here, there = everything(), placed(everything(), 1.0, FAR_AWAY)
    frames = []
    for what in (here, there):
        before = Camera(what.camera.position, (0.1, -0.2, -1.0))
        t = trace(what)
        frames.append(t.frame(3, what.camera, before, SIZE, 0.2, 0.1))
    same = frames[0].motion[..., 3] == frames[1].motion[..., 3]
    assert same.mean() > 0.995  # a ray along an edge may fall to either side
    for name, values in guides(frames[0]).items():
        np.testing.assert_allclose(values[same], guides(frames[1])[name][same], rtol=2e-5, atol=2e-5, err_msg=name)


def test_points_of_agrees_with_the_positions(trace: OpenTracer) -> None:
    """The tests' own interpolation in double precision, which the motion tests rely on."""
    what = everything()
    t = trace(what, backend="run")
    frame = still(t, SIZE, time=0.3)
    assert frame.position is not None
    hits = t.primary(view_of(t, what.camera, SIZE), np.arange(SIZE[0] * SIZE[1], dtype=np.int32))
    points = points_of(what, hits, 0.3)
    seen = hits.triangle >= 0
    assert len(ordered_triangles(what)) == len(t.scene.triangles)
    np.testing.assert_allclose(frame.position.reshape(-1, 4)[seen, :3] + t.scene.origin, points[seen], atol=2e-6)
