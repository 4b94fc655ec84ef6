"""Flying: how far, which way, and when the camera leaves the path."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from raytrace.camera import Camera
from ui.camera_control import DIRECTIONS, FAST, FAST_FACTOR, LONGEST, TAP, CameraControl, FlyCamera, HeldKeys

LEVEL = Camera.look_at((0.0, 1.0, 0.0), (0.0, 1.0, -1.0))
EXTENT = 8.0  # one unit per second


def fly_camera(camera: Camera = LEVEL) -> FlyCamera:
    return FlyCamera(camera, EXTENT)


@pytest.mark.parametrize(
    ("direction", "expected"),
    [
        ("forward", (0, 1, -1)),
        ("back", (0, 1, 1)),
        ("left", (-1, 1, 0)),
        ("right", (1, 1, 0)),
        ("up", (0, 2, 0)),
        ("down", (0, 0, 0)),
    ],
)
def test_each_direction(direction, expected):
    fly = fly_camera()
    fly.fly({direction: 1.0})
    np.testing.assert_allclose(fly.camera.position, expected, atol=1e-12)
    assert fly.camera.forward == LEVEL.forward


def test_the_speed_follows_the_scene_the_wheel_and_shift():
    lengths = []
    for extent, steps, held in (
        (8.0, 0, {}),
        (80.0, 0, {}),
        (8.0, 2, {}),
        (8.0, -1, {}),
        (8.0, 0, {FAST: 0.01}),
        (8.0, 100, {}),
        (8.0, -100, {}),
    ):
        fly = FlyCamera(LEVEL, extent)
        fly.change_speed(steps)
        fly.fly({"forward": 1.0, **held})
        lengths.append(-fly.camera.position[2])
    np.testing.assert_allclose(lengths, [1, 10, 1.25**2, 1 / 1.25, FAST_FACTOR, 1024, 1 / 1024])


def test_two_keys_are_not_faster_than_one_and_opposite_ones_cancel():
    fly = fly_camera()
    fly.fly({"forward": 1.0, "right": 1.0})
    assert np.linalg.norm(np.subtract(fly.camera.position, LEVEL.position)) == pytest.approx(1.0)
    fly = fly_camera()
    fly.fly({"forward": 1.0, "back": 1.0})
    np.testing.assert_allclose(fly.camera.position, LEVEL.position)


def test_the_distance_does_not_depend_on_the_frame_rate():
    ends = []
    for frame_times in (np.linspace(0.0, 1.0, 5), np.linspace(0.0, 1.0, 101), [0.0, 0.11, 0.13, 0.3, 0.52, 0.7, 0.95]):
        fly, held = fly_camera(), HeldKeys()
        held.press("forward", 0.0)
        for now in frame_times:
            fly.fly(held.drain(float(now)))
        held.release("forward", 1.0)
        fly.fly(held.drain(1.0))
        fly.fly(held.drain(2.0))
        ends.append(fly.camera.position[2])
    np.testing.assert_allclose(ends, -1.0)


def test_a_tap_between_two_frames_counts():
    held = HeldKeys()
    held.press("up", 5.0)
    held.release("up", 5.001)
    assert held.drain(6.0) == {"up": TAP}
    assert held.drain(7.0) == {}


def test_a_stall_is_no_leap_and_a_lost_release_ends_with_the_focus():
    held = HeldKeys()
    held.press("up", 0.0)
    held.press("up", 1.0)  # repeated by the keyboard
    assert held.drain(30.0) == {"up": LONGEST}
    held.clear()
    assert held.drain(31.0) == {}
    held.release("up", 32.0)
    assert held.drain(33.0) == {}


def test_looking_turns_about_the_worlds_up_and_stops_before_the_zenith():
    fly = fly_camera()
    fly.look(600.0, 0.0)  # 90 degrees
    np.testing.assert_allclose(fly.camera.forward, (1, 0, 0), atol=1e-12)
    fly.look(0.0, -200.0)
    np.testing.assert_allclose(fly.camera.forward[1], math.sin(math.radians(30.0)))
    for _ in range(100):
        fly.look(3.0, -50.0)
    right, up, forward = fly.camera.basis()
    assert math.radians(80) < math.asin(forward[1]) < math.radians(89.01)
    assert up[1] > 0.0, "not upside down"
    assert abs(right[1]) < 1e-9, "no roll"
    fly.look(0.0, 300.0)
    assert fly.camera.forward[1] < forward[1], "the way back is open"


def test_up_is_the_files_own_up():
    fly = fly_camera(Camera.look_at((0.0, 0.0, 1.0), (0.0, 5.0, 0.0), up=(0.0, 0.0, 1.0)))
    fly.fly({"up": 1.0})
    np.testing.assert_allclose(fly.camera.position, (0, 0, 2))


def test_a_roll_stays_and_taking_over_moves_nothing():
    rolled = replace(LEVEL, up=(math.sin(0.3), math.cos(0.3), 0.0))
    fly = fly_camera(rolled)
    fly.look(0.0, 0.0)
    for one, other in zip(rolled.basis(), fly.camera.basis(), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def path(frame: int) -> Camera:
    return replace(LEVEL, position=(float(frame), 1.0, 0.0))


def test_the_path_is_followed_until_someone_steers_and_flying_goes_on_from_there():
    control = CameraControl(path, follow=True, extent=EXTENT)
    assert [control.next({}).position[0] for _ in range(3)] == [0.0, 1.0, 2.0]
    assert control.next({FAST: 0.1}).position[0] == 3.0, "Shift alone does not steer"
    camera = control.next({"forward": 0.25})
    np.testing.assert_allclose(camera.position, (3.0, 1.0, -0.25))
    assert not control.following
    assert control.next({}) == camera


def test_looking_takes_over_as_well():
    control = CameraControl(path, follow=True, extent=EXTENT)
    control.next({})
    control.next({})
    assert control.next({}, look=(600.0, 0.0)).position == (1.0, 1.0, 0.0)
    np.testing.assert_allclose(control.next({}).forward, (1, 0, 0), atol=1e-12)


@pytest.mark.parametrize("follow", [True, False])
def test_home_begins_again(follow):
    control = CameraControl(path, follow=follow, extent=EXTENT)
    for _ in range(3):
        control.next({"left": 0.2})
    control.home()
    assert control.following == follow
    assert [control.next({}).position[0] for _ in range(2)] == ([0.0, 1.0] if follow else [0.0, 0.0])


def test_directions_come_in_opposite_pairs():
    assert np.sum(list(DIRECTIONS.values()), axis=0).tolist() == [0, 0, 0]
    assert len(set(DIRECTIONS.values())) == 6
