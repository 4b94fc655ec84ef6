"""Camera: rays and projections are each other's inverse, and degenerate poses keep a basis."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from errors import UserError
from raytrace.camera import Camera
from raytrace.camera_path import read_frames
from raytrace.guides import camera_rays
from raytrace.integrator import View
from raytrace.shot import jitter_of
from tests.tracer.scenes import placed_camera

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

SIZES = [(64, 36), (37, 53), (1, 1)]
CAMERAS = {
    "plain": Camera.look_at((0.0, 0.0, 5.0), (0.0, 0.0, 0.0)),
    "oblique": Camera.look_at((3.3, -2.1, 5.7), (0.5, 1.0, -2.0), up=(0.2, 1.0, 0.3), yfov_degrees=70.0),
    "z up": Camera.look_at((3.0, -2.0, 5.0), (0.5, 1.0, -2.0), up=(0.0, 0.0, 1.0), yfov_degrees=20.0),
    "straight down": Camera.look_at((1.0, 9.0, 2.0), (1.0, 0.0, 2.0)),
    "straight up": Camera.look_at((1.0, 0.0, 2.0), (1.0, 9.0, 2.0)),
    "along x, up as well": Camera.look_at((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), up=(1.0, 0.0, 0.0)),
}
any_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())


def rays(camera: Camera, size: tuple[int, int], origin: F64) -> tuple[F32, F32, View]:
    """Origins and directions of every pixel's ray, (n, 3) float32 each."""
    view = View.of(camera, size, origin)
    pixels = np.arange(size[0] * size[1], dtype=np.int32)
    origins, directions = np.empty((2, len(pixels), 3), np.float32)
    camera_rays(pixels, *size, view.eye, view.right, view.up, view.forward, view.jitter, origins, directions)
    return origins, directions, view


def pixel_coordinates(points: F64, matrix: NDArray[np.floating], size: tuple[int, int]) -> tuple[F64, F64]:
    """Where ``points`` (n, 3) land, in pixels (n, 2), and their w (n,)."""
    clip = points @ matrix[:, :3].astype(np.float64).T + matrix[:, 3].astype(np.float64)
    uv = 0.5 + 0.5 * clip[:, :2] / clip[:, 3:]
    return uv * np.array(size), clip[:, 3]


@any_camera
@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (2.0, -1.0, 3.0)], ids=str)
def test_a_point_on_a_ray_projects_to_its_pixel(
    camera: Camera, size: tuple[int, int], origin: tuple[float, float, float]
) -> None:
    origins, directions, view = rays(camera, size, np.array(origin))
    pixels = np.arange(size[0] * size[1])
    centres = np.stack([pixels % size[0] + 0.5, pixels // size[0] + 0.5], axis=1)
    for depth in (0.5, 7.0, 200.0):
        points = origins.astype(np.float64) + depth * directions.astype(np.float64)
        where, w = pixel_coordinates(points, view.matrix, size)
        np.testing.assert_allclose(where, centres, atol=1e-4)
        np.testing.assert_allclose(w, depth, rtol=1e-5, atol=2e-6)


def test_rows_count_from_the_bottom_and_columns_from_the_left() -> None:
    _, directions, _ = rays(CAMERAS["plain"], (4, 2), np.zeros(3))
    grid = directions.reshape(2, 4, 3)
    assert (np.diff(grid[..., 0], axis=1) > 0).all()
    assert (np.diff(grid[..., 1], axis=0) > 0).all()
    np.testing.assert_array_equal(grid[..., 2], -1.0)


def test_the_vertical_field_of_view_is_that_of_the_image() -> None:
    """From border to border, whatever the aspect ratio; and pixels are square."""
    camera = Camera.look_at((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), yfov_degrees=60.0)
    for size in ((40, 20), (20, 40)):
        _, directions, _ = rays(camera, size, np.zeros(3))
        grid = directions.reshape(size[1], size[0], 3)
        step = 2 * math.tan(math.radians(30)) / size[1]
        np.testing.assert_allclose(np.diff(grid[..., 1], axis=0), step, rtol=1e-4)
        np.testing.assert_allclose(np.diff(grid[..., 0], axis=1), step, rtol=1e-4)
        assert camera.pixel_size(size[1]) == pytest.approx(step)
        assert grid[-1, 0, 1] + step / 2 == pytest.approx(math.tan(math.radians(30)), rel=1e-5)


def test_jitter_moves_the_ray_within_its_pixel_and_leaves_the_projection_alone() -> None:
    camera, size = CAMERAS["oblique"], (37, 53)
    jittered = camera.with_jitter((0.25, -0.4))
    origins, directions, view = rays(jittered, size, np.zeros(3))
    np.testing.assert_array_equal(view.matrix, View.of(camera, size, np.zeros(3)).matrix)
    where, _ = pixel_coordinates(origins + 3.0 * directions.astype(np.float64), view.matrix, size)
    pixels = np.arange(size[0] * size[1])
    expected = np.stack([pixels % size[0] + 0.75, pixels // size[0] + 0.1], axis=1)
    np.testing.assert_allclose(where, expected, atol=1e-4)


@any_camera
def test_the_basis_is_orthonormal_and_right_handed(camera: Camera) -> None:
    right, up, forward = camera.basis()
    np.testing.assert_allclose(np.stack([right, up, forward]) @ np.stack([right, up, forward]).T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(right, up), -forward, atol=1e-12)
    assert up @ np.array(camera.up) >= -1e-12


def test_a_flight_over_the_zenith_keeps_its_basis_up_to_the_pole() -> None:
    """Within a millionth of `up` the basis is a fixed one; next to it, it is that of `up`."""
    near = replace(CAMERAS["plain"], forward=(0.0, -1.0, 1e-4))
    np.testing.assert_allclose(near.basis()[0], (-1, 0, 0), atol=1e-9)
    at = replace(CAMERAS["plain"], forward=(1e-9, -1.0, 0.0))
    np.testing.assert_allclose(at.basis()[0], CAMERAS["straight down"].basis()[0], atol=1e-6)


def test_a_camera_far_from_the_origin_loses_nothing() -> None:
    """Only the difference to the scene's origin becomes single precision."""
    camera = CAMERAS["oblique"]
    shift = np.array([1e6, -2e6, 3e6])
    there = placed_camera(camera, 1.0, (1e6, -2e6, 3e6))
    matrix, moved = camera.view_projection(1.5, np.zeros(3)), there.view_projection(1.5, shift)
    np.testing.assert_allclose(moved, matrix, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(View.of(there, (4, 4), shift).eye, camera.position, atol=1e-6)


def test_look_at_puts_the_target_in_the_middle_and_up_upwards() -> None:
    position, target = (3.3, -2.1, 5.7), (0.5, 1.0, -2.0)
    camera = Camera.look_at(position, target, up=(0.2, 1.0, 0.3), yfov_degrees=70.0)
    assert math.degrees(camera.yfov) == pytest.approx(70.0)
    assert math.hypot(*camera.forward) == pytest.approx(1.0)
    matrix = camera.view_projection(1.5, np.zeros(3))
    where, depth = pixel_coordinates(np.array([target, np.add(target, (0.02, 0.1, 0.03))]), matrix, (2, 2))
    np.testing.assert_allclose(where[0], (1.0, 1.0), atol=1e-5)
    assert depth[0] == pytest.approx(math.dist(position, target), rel=1e-5)
    assert where[1, 1] > 1.0
    assert where[1, 0] == pytest.approx(1.0, abs=1e-5)


def test_look_at_and_a_matrix_describe_the_same_camera() -> None:
    camera = CAMERAS["oblique"]
    right, up, forward = camera.basis()
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = right, up, -forward, camera.position
    same = Camera.from_matrix(matrix, camera.yfov)
    np.testing.assert_allclose(
        same.view_projection(1.0, np.zeros(3)), camera.view_projection(1.0, np.zeros(3)), rtol=1e-6
    )
    scaled = matrix @ np.diag([3.0, 3.0, 3.0, 1.0])
    np.testing.assert_allclose(Camera.from_matrix(scaled, camera.yfov).forward, same.forward, atol=1e-12)


# ------------------------------------------------------------------------------------------------ jitter, camera paths


def test_sixteen_jitters_cover_the_pixel_evenly() -> None:
    """Centred, inside, all different, and balanced in quarters; then the cycle starts again."""
    points = np.array([jitter_of(index) for index in range(16)])
    assert np.abs(points).max() < 0.5
    assert len(np.unique(points, axis=0)) == 16
    assert np.abs(points.mean(0)).max() < 0.05
    quarters = np.histogram(points[:, 0], 4, (-0.5, 0.5))[0]
    assert quarters.min() >= 3
    np.testing.assert_array_equal(points[:3], np.array([jitter_of(index) for index in range(16, 19)]))


def write_path(folder: Path, frames: object) -> Path:
    path = folder / "path.json"
    path.write_text(json.dumps(frames))
    return path


def test_a_camera_path_is_read_frame_by_frame(tmp_path: Path) -> None:
    first, second = np.eye(4), np.eye(4)
    second[:3, 3] = (1, 2, 3)
    frames = [{"camera_to_world_gl": m.tolist(), "yfov_deg": y} for m, y in ((first, 30), (second, 45.5))]
    cameras = read_frames(write_path(tmp_path, {"frames": frames}))
    assert len(cameras) == 2
    assert cameras[1].position == (1.0, 2.0, 3.0)
    assert cameras[0].forward == (0.0, 0.0, -1.0)
    assert math.degrees(cameras[1].yfov) == pytest.approx(45.5)


GOOD = {"camera_to_world_gl": np.eye(4).tolist(), "yfov_deg": 45}
BROKEN: dict[str, tuple[object, str]] = {
    "no frame": ({"frames": []}, "no frame"),
    "no frames at all": ({}, "KeyError"),
    "a list": ([1, 2], "is not a camera path"),
    "a number for a frame": ({"frames": [GOOD, 3]}, "is not a camera path"),
    "no matrix": ({"frames": [{"yfov_deg": 45}]}, "camera_to_world_gl"),
    "a small matrix": ({"frames": [{**GOOD, "camera_to_world_gl": np.eye(3).tolist()}]}, "frame 0"),
    "a ragged matrix": ({"frames": [{**GOOD, "camera_to_world_gl": [[1, 2], [3]]}]}, "is not a camera path"),
    "text in the matrix": ({"frames": [{**GOOD, "camera_to_world_gl": [["a"] * 4] * 4}]}, "is not a camera path"),
    "an axis of nothing": ({"frames": [GOOD, {**GOOD, "camera_to_world_gl": np.zeros((4, 4)).tolist()}]}, "frame 1"),
    "infinite": ({"frames": [{**GOOD, "camera_to_world_gl": np.full((4, 4), np.inf).tolist()}]}, "frame 0"),
    "no angle": ({"frames": [{**GOOD, "yfov_deg": 0}]}, "yfov_deg < 180"),
    "too wide": ({"frames": [{**GOOD, "yfov_deg": 180}]}, "yfov_deg < 180"),
    "no number": ({"frames": [{**GOOD, "yfov_deg": math.nan}]}, "yfov_deg < 180"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_camera_path_is_refused_in_words(tmp_path: Path, name: str) -> None:
    content, words = BROKEN[name]
    with pytest.raises(UserError, match=words) as caught:
        read_frames(write_path(tmp_path, content))
    assert "path.json" in str(caught.value)


def test_a_camera_path_that_is_no_json_or_no_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_bytes(b'{"frames": [\xff')
    for name, words in (
        ("broken.json", "is not a camera path"),
        ("missing.json", "cannot be read"),
        (".", "cannot be read"),
    ):
        with pytest.raises(UserError, match=words):
            read_frames(tmp_path / name)


def test_a_step_leads_from_one_camera_s_space_to_the_other_s() -> None:
    before = Camera.look_at((1e5, 2.0, 3.0), (1e5 + 1.0, 2.5, -4.0))
    now = Camera.look_at((1e5 + 0.3, 2.2, 2.5), (1e5 + 2.0, 2.0, -4.0))
    point = np.array([1e5 + 1.5, 3.0, -7.0])
    spaces = [np.array(camera.basis()) @ (point - np.array(camera.position)) for camera in (now, before)]
    turn, shift = now.step_from(before)
    np.testing.assert_allclose(np.array(turn) @ spaces[0] + shift, spaces[1], atol=1e-9)
    turn, shift = now.step_from(now)
    np.testing.assert_allclose(turn, np.eye(3), atol=1e-15)
    assert shift == (0.0, 0.0, 0.0)
