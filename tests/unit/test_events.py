"""bench/events.py: what happens in its sequences, and where the error counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import assets
from bench import events
from raytrace.frame import MISS, FramePacket
from raytrace.shot import FPS


def packet(objects: np.ndarray, depth: np.ndarray, motion: tuple[float, float] = (0.0, 0.0)) -> FramePacket:
    height, width = objects.shape
    image = np.zeros((height, width, 4), np.float32)
    surface, moved = image.copy(), image.copy()
    surface[..., 3] = depth
    moved[..., 0], moved[..., 1] = motion[0] / width, motion[1] / height
    moved[..., 2], moved[..., 3] = depth, objects
    return FramePacket(0, 0.0, image, image, image, image, surface, image[..., :2], moved)


def test_what_an_object_hid_is_disoccluded():
    depth = np.full((4, 8), 5.0)
    before, now = np.zeros((4, 8)), np.zeros((4, 8))
    before[:, 2:5] = 1.0
    now[:, 3:6] = 1.0
    found = events.disoccluded(packet(now, depth), packet(before, depth))
    # Without motion vectors of its own the object is new in column 5, the wall in column 2.
    np.testing.assert_array_equal(found.all(axis=0), [False, False, True, False, False, True, False, False])


def test_what_comes_into_view_is_disoccluded_and_the_sky_is_not():
    objects, depth = np.zeros((4, 8)), np.full((4, 8), 5.0)
    found = events.disoccluded(packet(objects, depth, (2.0, 0.0)), packet(objects, depth))
    np.testing.assert_array_equal(found.all(axis=0), [False] * 6 + [True] * 2)
    objects[:] = MISS
    assert not events.disoccluded(packet(objects, depth, (2.0, 0.0)), packet(objects, depth)).any()


def test_another_depth_of_the_same_object_is_disoccluded():
    objects, depth = np.zeros((4, 8)), np.full((4, 8), 5.0)
    behind = depth.copy()
    behind[1, 1] = 5.3
    found = events.disoccluded(packet(objects, behind), packet(objects, depth))
    assert found.sum() == 1
    assert found[1, 1]


def test_a_step_to_the_side_looks_the_same_way():
    camera = assets.build("cornell").camera
    moved = events.sidestepped(camera, 0.5)
    right, _, _ = camera.basis()
    np.testing.assert_allclose(np.subtract(moved.position, camera.position), 0.5 * right, atol=1e-12)
    assert replace(moved, position=camera.position) == camera


def test_a_switched_lamp_gives_a_quarter_from_the_event_on():
    scene = events.switched(assets.build("cornell"), 16)
    (lamp,) = [material for material in scene.materials if material.emits]
    assert lamp.dimmer is not None
    assert [lamp.dimmer(index / FPS) for index in (0, 15, 16, 40)] == [1.0, 1.0, events.DIMMED, events.DIMMED]
    assert all(material.dimmer is None for material in scene.materials if not material.emits)
