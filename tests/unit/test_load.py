"""What holds for every format: dispatch, naming, framing, sky, and errors about the file as such."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from errors import UserError
from raytrace.load import load_scene
from tests.unit.gltf_files import TRIANGLE, GltfBuilder, one_triangle, png


def test_name_is_the_stem_or_the_folder_of_a_scene_file(tmp_path: Path):
    (tmp_path / "kitchen").mkdir()
    assert load_scene(one_triangle().write_glb(tmp_path / "mug.glb")).name == "mug"
    assert load_scene(str(one_triangle().write_glb(tmp_path / "kitchen" / "scene.glb"))).name == "kitchen"


@pytest.mark.parametrize("scale", [1e-3, 1.0, 500.0])
@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (1e6, -2e6, 3e6)])
def test_framing_sees_the_whole_bounding_sphere(tmp_path: Path, scale: float, offset: tuple[float, float, float]):
    builder = one_triangle()
    builder.json["nodes"][0] |= {"scale": [scale] * 3, "translation": list(offset)}
    scene = load_scene(builder.write_glb(tmp_path / "a.glb"))
    lower, upper = scene.bounds()
    centre, radius = (lower + upper) / 2, float(np.linalg.norm(upper - lower)) / 2
    eye = np.array(scene.camera.position)
    distance = float(np.linalg.norm(centre - eye))
    right, up, forward = scene.camera.basis()
    assert (centre - eye) / distance @ forward == pytest.approx(1.0, abs=1e-9)
    assert math.asin(radius / distance) < scene.camera.yfov / 2  # inside the frustum's cone at aspect 1
    assert math.asin(radius / distance) > scene.camera.yfov / 2 * 0.9  # and not a dot in the distance
    assert eye[1] > centre[1]
    assert up[1] > 0.5
    assert right[1] == pytest.approx(0.0, abs=1e-12)
    assert any("framed" in notice for notice in scene.notices)


def _glowing(texel: int) -> GltfBuilder:
    builder = one_triangle(uvs=((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)), material=0)
    texture = builder.texture(png(np.full((4, 4, 3), texel, np.uint8)))
    builder.add("materials", {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": texture}})
    return builder


def test_sky_only_where_nothing_lights_the_scene(tmp_path: Path):
    lamp = one_triangle(material=0)
    lamp.add("materials", {"emissiveFactor": [0, 0.5, 0]})
    unused = one_triangle(material=0)
    unused.add("materials", {})
    unused.add("materials", {"emissiveFactor": [1, 1, 1]})
    cases = ((lamp, None), (unused, (1.0, 1.0, 1.0)), (_glowing(200), None), (_glowing(3), (1.0, 1.0, 1.0)))
    for number, (builder, sky) in enumerate(cases):
        scene = load_scene(builder.write_glb(tmp_path / f"{number}.glb"))
        assert scene.sky == sky
        assert any("sky" in notice for notice in scene.notices) == (sky is not None)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("room.gbl", ["no such file"]),
        ("rom.glb", ["no such file", "did you mean 'room.glb'"]),
        ("model.fbx", [".fbx files cannot be read", ".glb, .gltf, .obj, .ply"]),
        ("model", ["without an ending", ".ply"]),
        ("folder", ["is a folder", "inside.obj"]),
        ("nowhere/room.glb", ["no such file"]),
    ],
)
def test_paths_that_are_no_scene(tmp_path: Path, name: str, expected: list[str]):
    one_triangle().write_glb(tmp_path / "room.glb")
    (tmp_path / "model.fbx").write_bytes(b"x")
    (tmp_path / "model").write_bytes(b"x")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "inside.obj").write_bytes(b"x")
    with pytest.raises(UserError) as caught:
        load_scene(tmp_path / name)
    assert str(tmp_path) in str(caught.value)
    for text in expected:
        assert text in str(caught.value)


def test_ending_may_be_in_capitals(tmp_path: Path):
    assert load_scene(one_triangle().write_glb(tmp_path / "MUG.GLB")).triangle_count == 1


def test_empty_files_of_every_format(tmp_path: Path):
    for ending in ("glb", "gltf", "obj", "ply"):
        path = tmp_path / f"empty.{ending}"
        path.write_bytes(b"")
        with pytest.raises(UserError, match="empty"):
            load_scene(path)


def test_file_without_triangles(tmp_path: Path):
    builder = GltfBuilder()
    builder.mesh(builder.primitive(TRIANGLE))
    builder.node(name="shows nothing")
    with pytest.raises(UserError, match="no triangle"):
        load_scene(builder.write_glb(tmp_path / "a.glb"))
