"""Files that have what well-known scenes have: what the loader makes of lamps, cameras, materials and scales."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from errors import Notices
from raytrace.camera_path import read_frames
from raytrace.hdr import load_environment
from raytrace.lamps import has_lamp
from raytrace.load import load_scene
from raytrace.scene import Scene
from tests.scene_files.look_alikes import bottle, classroom, stairs
from tests.scene_files.model import SUN


def radiances(scene: Scene) -> dict[str, tuple[float, float, float]]:
    """Emission of the objects that emit, by name."""
    pairs = ((mesh.name, scene.materials[mesh.materials[0]]) for mesh in scene.meshes)
    return {name: material.emission for name, material in pairs if material.emits}


def test_stairs(tmp_path: Path) -> None:
    scene = load_scene(stairs(tmp_path).scene, animate=True)
    lamps = radiances(scene)
    assert len(lamps) == 13
    assert lamps["door"] == pytest.approx((4.575, 3.59, 1.55))
    assert scene.sky is None
    assert np.degrees(scene.camera.yfov) == pytest.approx(70.0)
    assert scene.camera.position == pytest.approx((3.5, 1.65, 2.4))
    for words in ("3 triangles without area dropped", "7 objects without normals", "transmission", "ior", "volume"):
        assert any(words in notice for notice in scene.notices), words
    ball = next(mesh for mesh in scene.meshes if mesh.name == "ball")
    assert ball.motion is not None
    moved = ball.motion(0.5) @ np.append(ball.vertices.mean(axis=0), 1.0)
    np.testing.assert_allclose(moved[:3], (0.0, 0.25, 0.6), atol=0.02)  # the poles count more often than once
    for mesh in scene.meshes:
        if mesh.name.startswith("step light"):  # mirrored by its node: its front is still the side to the room
            a, b, c = mesh.vertices[mesh.faces[0]]
            assert np.cross(b - a, c - a)[2] > 0.0
            assert not scene.materials[mesh.materials[0]].double_sided


def test_classroom(tmp_path: Path) -> None:
    what = classroom(tmp_path)
    scene = load_scene(what.scene, surrounded=True)
    assert list(radiances(scene)) == ["sign"]
    assert not has_lamp(scene)  # without the sky around it would need one
    lower, upper = scene.bounds()
    np.testing.assert_allclose(upper - lower, (222.0, 3.25, 222.0))
    assert all(mesh.normals is None for mesh in scene.meshes)
    assert what.camera is not None
    frames = read_frames(what.camera)
    assert len(frames) == 12
    assert np.degrees(frames[0].yfov) == pytest.approx(55.0)
    np.testing.assert_allclose(frames[1].position, (2.38, 1.6, 3.36))
    assert what.environment is not None
    sky = load_environment(what.environment, Notices()).pixels
    assert sky.max() == pytest.approx(SUN, rel=0.01)
    assert (sky.max(axis=2) > 10_000).sum() == 1


def test_bottle(tmp_path: Path) -> None:
    scene = load_scene(bottle(tmp_path).scene, surrounded=True)
    material = scene.materials[scene.meshes[0].materials[0]]
    maps = (material.base_texture, material.emission_texture, material.normal_texture)
    assert sorted({*maps, material.metallic_roughness_texture}) == [0, 1, 2, 3]
    assert material.specular
    assert not scene.textures[material.base_texture].linear
    assert scene.textures[material.normal_texture].linear
    lower, upper = scene.bounds()
    assert upper[1] - lower[1] == pytest.approx(0.26)
    for words in ("occlusion map", "framed"):
        assert any(words in notice for notice in scene.notices), words
