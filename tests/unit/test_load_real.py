"""Scenes that nobody here made, where they lie beside the checkout: counts, cameras and lights against their notes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from raytrace.load import load_scene
from raytrace.scene import Scene

FOLDER = Path(__file__).parents[2].parent / "shared" / "scenes"

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="real scene files not beside the checkout")


def _dropped(scene: Scene) -> int:
    lines = [notice for notice in scene.notices if "without area" in notice]
    return int(lines[0].split()[1].replace(",", "")) if lines else 0


@pytest.mark.parametrize("name", ["cornell_bitterli", "staircase2", "classroom"])
def test_scene_agrees_with_its_notes(name: str):
    info: dict[str, Any] = json.loads((FOLDER / name / "info.json").read_text())
    scene = load_scene(FOLDER / name / "scene.glb")
    assert scene.name == name
    assert scene.triangle_count + _dropped(scene) == info["triangles"]
    assert len(scene.meshes) == info["meshes"]
    assert len(scene.textures) == info["textures"]
    camera = info["camera"]
    matrix = np.array(camera["camera_to_world_gl"])
    assert np.degrees(scene.camera.yfov) == pytest.approx(camera["yfov_deg"])
    np.testing.assert_allclose(scene.camera.position, matrix[:3, 3], atol=1e-9)
    np.testing.assert_allclose(scene.camera.basis(), [matrix[:3, 0], matrix[:3, 1], -matrix[:3, 2]], atol=1e-6)
    lights = {}
    for mesh in scene.meshes:
        emission = scene.materials[mesh.materials[0]].emission
        if max(emission) > 0.0:
            lights[mesh.name] = (emission, len(mesh.faces))
    assert set(lights) == {light["mesh"] for light in info["lights"]}
    for light in info["lights"]:
        emission, triangles = lights[light["mesh"]]
        assert emission == pytest.approx(light["radiance"])
        assert triangles == light["triangles"]
    assert (scene.sky is None) == bool(lights)


def test_cornell_box_is_the_authors():
    scene = load_scene(FOLDER / "cornell_bitterli" / "scene.glb")
    colors = {material.name: material.base_color for material in scene.materials}
    assert colors["RightWallBSDF"] == (0.14, 0.45, 0.091)
    assert colors["FloorBSDF"] == (0.725, 0.71, 0.68)
    light = next(mesh for mesh in scene.meshes if mesh.name == "Light")
    a, b, c = (light.vertices[light.faces[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 1] < 0).all()  # its front faces the floor
    assert not scene.materials[light.materials[0]].double_sided  # the author's does not shine at the ceiling
    assert not any("metallic" in notice for notice in scene.notices)


def test_water_bottle_names_what_it_simplifies():
    scene = load_scene(FOLDER / "water_bottle" / "WaterBottle.gltf")
    assert scene.triangle_count == 4510
    assert len(scene.textures) == 4
    assert scene.materials[0].specular
    for words in ("occlusion map", "framed", "sky"):
        assert any(words in notice for notice in scene.notices), words
    lower, upper = scene.bounds()
    assert upper[1] - lower[1] == pytest.approx(0.26, abs=0.005)
