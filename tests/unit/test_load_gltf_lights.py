"""Lights of glTF files: KHR_lights_punctual."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from errors import UserError
from raytrace.load import load_scene
from raytrace.scene import Scene
from tests.unit.gltf_files import GltfBuilder, one_triangle


def with_light(light: dict[str, Any], **node: Any) -> GltfBuilder:
    builder = one_triangle()
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    builder.node(extensions={"KHR_lights_punctual": {"light": 0}}, **node)
    return builder


def opened(builder: GltfBuilder, folder: Path) -> Scene:
    return load_scene(builder.write_glb(folder / "a.glb"))


def test_a_light_shines_along_minus_z_of_its_node_whatever_the_scale(tmp_path: Path) -> None:
    half = math.sqrt(0.5)
    spot = {"type": "spot", "color": [1, 0.5, 0], "intensity": 4, "range": 9, "spot": {"outerConeAngle": 0.6}}
    builder = with_light(spot, translation=[1, 2, 3], rotation=[0, half, 0, half], scale=[2, 2, 2])
    scene = opened(builder, tmp_path)
    (light,) = scene.lights
    assert (light.kind, light.intensity, light.range, light.inner, light.outer) == ("spot", (4, 2, 0), 9, 0, 0.6)
    np.testing.assert_allclose(light.position, (1, 2, 3))
    np.testing.assert_allclose(light.direction, (-1, 0, 0), atol=1e-12)
    assert scene.sky is None
    assert not any("left out" in notice or "sky" in notice for notice in scene.notices)


def test_what_is_left_out_has_the_values_of_the_specification(tmp_path: Path) -> None:
    (light,) = opened(with_light({"type": "point"}, name="bulb"), tmp_path).lights
    assert (light.name, light.kind, light.intensity, light.range) == ("bulb", "point", (1, 1, 1), math.inf)
    (sun,) = opened(with_light({"type": "directional", "name": "sun"}), tmp_path).lights
    assert (sun.name, sun.direction) == ("sun", (0, 0, -1))


def test_a_light_of_no_intensity_is_none(tmp_path: Path) -> None:
    scene = opened(with_light({"type": "point", "intensity": 0}, name="bulb"), tmp_path)
    assert scene.lights == ()
    assert scene.sky == (1.0, 1.0, 1.0)
    assert "light of node 'bulb' without intensity: left out" in scene.notices


@pytest.mark.parametrize(
    ("light", "words"),
    [
        ({"type": "area"}, "is of type 'area'; point, spot, directional are known"),
        ({"type": "point", "intensity": -1}, "negative colour or intensity"),
        ({"type": "point", "color": [1, -1, 0]}, "negative colour or intensity"),
        ({"type": "point", "color": [1, 0]}, "instead of 3 finite numbers"),
        ({"type": "point", "range": 0}, "or no range"),
        ({"type": "point", "intensity": math.nan}, "instead of a finite number"),
        ({"type": "spot", "spot": {"innerConeAngle": 0.9, "outerConeAngle": 0.5}}, "cones of 0.9 and 0.5 radians"),
        ({"type": "spot", "spot": {"outerConeAngle": 2.0}}, "cones of 0 and 2 radians"),
        ({"type": "spot", "spot": []}, "is not an object"),
    ],
)
def test_broken_lights_are_refused_in_words(tmp_path: Path, light: dict[str, Any], words: str) -> None:
    with pytest.raises(UserError) as caught:
        opened(with_light(light), tmp_path)
    assert words in str(caught.value)


def test_a_light_that_is_not_there_is_refused(tmp_path: Path) -> None:
    builder = one_triangle()
    builder.node(extensions={"KHR_lights_punctual": {"light": 2}}, name="bulb")
    with pytest.raises(UserError, match=r"node 'bulb' refers to lights\[2\], but the file has 0"):
        opened(builder, tmp_path)
