"""From which side lamps shine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from raytrace.load import load_scene
from raytrace.scene import Scene
from tests.unit.gltf_files import GltfBuilder

BOX = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
INSIDE = [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]
PANEL = np.array([(0.3, 0, 0.3), (0.7, 0, 0.3), (0.7, 0, 0.7), (0.3, 0, 0.7)])  # wound so that its front is below


def _room(lamp: np.ndarray, indices: list[int], path: Path, double_sided: bool = True) -> Scene:
    builder = GltfBuilder()
    builder.add("materials", {})
    builder.add("materials", {"emissiveFactor": [1, 1, 1], "doubleSided": double_sided})
    builder.node(mesh=builder.mesh(builder.primitive(BOX, indices=INSIDE, material=0)))
    builder.node(mesh=builder.mesh(builder.primitive(lamp, indices=indices, material=1)))
    return load_scene(builder.write_glb(path / "a.glb"))


DOWN, UP = [0, 1, 2, 0, 2, 3], [2, 1, 0, 3, 2, 0]


@pytest.mark.parametrize(
    ("height", "indices", "both"),
    [
        (0.98, DOWN, False),  # below the ceiling, facing the room
        (0.98, UP, True),  # the same, wound the wrong way
        (0.02, UP, False),  # on the floor
        (0.5, DOWN, True),  # amid the room
        (0.98, DOWN + UP, True),  # a closed sheet
    ],
)
def test_a_lamp_on_a_wall_shines_into_the_room_only(tmp_path: Path, height: float, indices: list[int], both: bool):
    scene = _room(np.add(PANEL, (0, height, 0)), indices, tmp_path)
    normal = np.cross(PANEL[indices[1]] - PANEL[indices[0]], PANEL[indices[2]] - PANEL[indices[0]])
    assert (normal[1] < 0) == (indices != UP)
    assert scene.materials[1].double_sided == both
    assert any("only the side that faces" in notice for notice in scene.notices) != both


def test_one_sided_lamps_are_left_alone(tmp_path: Path):
    scene = _room(np.add(PANEL, (0, 0.98, 0)), UP, tmp_path, double_sided=False)
    assert not scene.materials[1].double_sided
    assert not any("lamp" in notice for notice in scene.notices)


def test_other_double_sided_materials_are_left_alone(tmp_path: Path):
    builder = GltfBuilder()
    builder.add("materials", {"doubleSided": True})
    builder.node(mesh=builder.mesh(builder.primitive(material=0)))
    assert load_scene(builder.write_glb(tmp_path / "a.glb")).materials[0].double_sided
