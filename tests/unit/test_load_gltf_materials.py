"""glTF materials: the file's own numbers, textures with their orientation, and what is drawn in a simpler way."""

from __future__ import annotations

import base64
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from errors import UserError
from raytrace.load import load_scene
from raytrace.scene import Scene
from tests.unit.gltf_files import GltfBuilder, one_triangle, png

UVS = ((0.25, 0.1), (0.75, 0.2), (0.5, 0.9))  # glTF's, from the upper left
RED_OVER_BLUE = np.array([[(255, 0, 0)] * 3, [(0, 0, 255)] * 3], np.uint8)  # top row red


def _textured(material: dict[str, Any], **primitive: Any) -> GltfBuilder:
    builder = one_triangle(uvs=UVS, material=0, **primitive)
    builder.add("materials", material)
    return builder


def _base(index: int = 0, **extra: Any) -> dict[str, Any]:
    return {"pbrMetallicRoughness": {"baseColorTexture": {"index": index, **extra}, "metallicFactor": 0}}


def _load(builder: GltfBuilder, path: Path) -> Scene:
    return load_scene(builder.write_glb(path / "a.glb"))


def test_numbers_are_exactly_the_files(tmp_path: Path):
    """trimesh makes 0.0063 a byte (+24 %), and 17 a 1."""
    builder = one_triangle(material=0)
    builder.add(
        "materials",
        {
            "name": "lamp",
            "pbrMetallicRoughness": {"baseColorFactor": [0.0063, 0.725, 1.0, 0.3], "metallicFactor": 0},
            "emissiveFactor": [1.0, 0.705, 0.235],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 17.0}},
            "doubleSided": True,
        },
    )
    material = _load(builder, tmp_path).materials[0]
    assert material.name == "lamp"
    assert material.base_color == (0.0063, 0.725, 1.0)
    assert material.emission == (17.0, 17.0 * 0.705, 17.0 * 0.235)
    assert material.double_sided
    assert material.base_texture == material.emission_texture == -1


def test_emissive_factor_above_one_and_one_sided(tmp_path: Path):
    builder = one_triangle(material=0)
    builder.add("materials", {"emissiveFactor": [40.0, 0.0, 0.0]})
    material = _load(builder, tmp_path).materials[0]
    assert material.emission == (40.0, 0.0, 0.0)
    assert material.base_color == (1.0, 1.0, 1.0)
    assert not material.double_sided


def test_texture_and_coordinates_are_flipped_together(tmp_path: Path):
    builder = _textured(_base())
    builder.texture(png(RED_OVER_BLUE))
    scene = _load(builder, tmp_path)
    pixels = scene.textures[scene.materials[0].base_texture].pixels
    assert pixels.dtype == np.uint8
    assert pixels.shape == (2, 3, 3)
    assert tuple(pixels[0, 0]) == (0, 0, 255)  # row 0 is the bottom row
    mesh = scene.meshes[0]
    assert mesh.uvs is not None
    assert mesh.uvs.dtype == np.float32
    np.testing.assert_allclose(mesh.uvs[mesh.faces[0]], [(u, 1 - v) for u, v in UVS], rtol=1e-6)


def test_second_coordinate_set_and_transform(tmp_path: Path):
    """The extension's own example: the lower left quadrant, turned clockwise by 90 degrees."""
    transform = {"offset": [0, 1], "rotation": math.pi / 2, "scale": [0.5, 0.5], "texCoord": 1}
    builder = _textured(_base(extensions={"KHR_texture_transform": transform}))
    builder.texture(png(RED_OVER_BLUE))
    corners = np.array([(0, 0), (1, 0), (0, 1)], dtype=float)
    builder.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = builder.accessor(corners)
    mesh = _load(builder, tmp_path).meshes[0]
    assert mesh.uvs is not None
    # The unit square's upper left corner goes to the image's lower left one, and the quadrant ends at (0.5, 0.5).
    np.testing.assert_allclose(mesh.uvs[mesh.faces[0]], [(0, 0), (0, 0.5), (0.5, 0)], atol=1e-6)


def test_embedded_and_external_images(tmp_path: Path):
    data = png(RED_OVER_BLUE)
    (tmp_path / "Wall Paper.PNG").write_bytes(data)
    inline = "data:image/png;base64," + base64.b64encode(data).decode()
    for number, uri in enumerate(("Wall%20Paper.PNG", "wall paper.png", inline)):
        builder = _textured(_base())
        builder.add("images", {"uri": uri})
        builder.add("textures", {"source": 0})
        scene = load_scene(builder.write_gltf(tmp_path / f"{number}.gltf"))
        np.testing.assert_array_equal(scene.textures[0].pixels, RED_OVER_BLUE[::-1])


def test_image_shared_by_materials_is_decoded_once_and_unused_ones_never(tmp_path: Path):
    builder = GltfBuilder()
    first, second = builder.texture(png(RED_OVER_BLUE)), builder.texture(b"not an image")
    builder.json["textures"].append({"source": 0})
    builder.add("materials", _base(first) | {"normalTexture": {"index": second}})
    builder.add("materials", _base(2))
    builder.node(mesh=builder.mesh(*(builder.primitive(uvs=UVS, material=k) for k in range(2))))
    scene = _load(builder, tmp_path)
    assert len(scene.textures) == 1
    assert [m.base_texture for m in scene.materials] == [0, 0]


def test_missing_texture_names_file_and_material(tmp_path: Path):
    builder = _textured(_base() | {"name": "oak"})
    builder.add("images", {"uri": "planks.jpg"})
    builder.add("textures", {"source": 0})
    with pytest.raises(UserError, match=r"oak.*planks\.jpg is not there"):
        load_scene(builder.write_gltf(tmp_path / "a.gltf"))


def test_unreadable_texture_sources(tmp_path: Path):
    builder = _textured(_base() | {"name": "oak"})
    builder.add("textures", {"extensions": {"KHR_texture_basisu": {"source": 0}}})
    with pytest.raises(UserError, match=r"oak.*KHR_texture_basisu"):
        _load(builder, tmp_path)


def test_emission_texture_and_webp(tmp_path: Path):
    builder = _textured({"emissiveFactor": [2, 2, 2], "emissiveTexture": {"index": 0}})
    builder.texture(png(RED_OVER_BLUE))
    builder.json["textures"][0] = {"extensions": {"EXT_texture_webp": {"source": 0}}}
    material = _load(builder, tmp_path).materials[0]
    assert (material.base_texture, material.emission_texture) == (-1, 0)
    assert material.emission == (2.0, 2.0, 2.0)


def test_specular_glossiness_gives_its_diffuse_colour(tmp_path: Path):
    builder = _textured(
        {
            "extensions": {
                "KHR_materials_pbrSpecularGlossiness": {
                    "diffuseFactor": [0.1, 0.2, 0.3, 1],
                    "diffuseTexture": {"index": 0},
                }
            }
        }
    )
    builder.texture(png(RED_OVER_BLUE))
    material = _load(builder, tmp_path).materials[0]
    assert material.base_color == (0.1, 0.2, 0.3)
    assert material.base_texture == 0


def test_simplifications_are_counted_once_each(tmp_path: Path):
    builder = GltfBuilder()
    texture = builder.texture(png(RED_OVER_BLUE))
    matte = {"metallicFactor": 0, "roughnessFactor": 1}
    materials: list[dict[str, Any]] = [
        {},  # glTF's default is metallic
        {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.4}},
        {"pbrMetallicRoughness": matte, "normalTexture": {"index": texture}, "alphaMode": "MASK"},
        {"pbrMetallicRoughness": matte, "extensions": {"KHR_materials_transmission": {}, "KHR_materials_ior": {}}},
        {"pbrMetallicRoughness": matte | {"baseColorFactor": [1.5, -1, 0, 1]}, "alphaMode": "BLEND"},
        {"pbrMetallicRoughness": matte},
        {"normalTexture": {"index": texture}},  # not used by any primitive
    ]
    for material in materials:
        builder.add("materials", material)
    builder.node(mesh=builder.mesh(*(builder.primitive(material=k) for k in range(6))))
    scene = _load(builder, tmp_path)
    assert "2 metallic or glossy materials: drawn as diffuse with their base colour" in scene.notices
    assert "1 material with a normal map: drawn without it" in scene.notices
    assert "2 cut-out or blended materials (alphaMode): drawn opaque" in scene.notices
    assert "1 see-through material (transmission): drawn opaque" in scene.notices
    assert "1 material with KHR_materials_ior: drawn without it" in scene.notices
    assert "1 material with a base colour outside [0, 1]: clamped" in scene.notices
    assert scene.materials[4].base_color == (1.0, 0.0, 0.0)


def test_texture_without_coordinates_and_two_layouts_are_named(tmp_path: Path):
    builder = one_triangle(material=0)
    material = _base() | {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0, "texCoord": 1}}
    builder.add("materials", material)
    builder.texture(png(RED_OVER_BLUE))
    scene = _load(builder, tmp_path)
    assert any("without texture coordinates" in notice for notice in scene.notices)
    assert any("emissive texture laid out differently" in notice for notice in scene.notices)


def test_no_material_is_light_grey(tmp_path: Path):
    scene = _load(one_triangle(), tmp_path)
    assert scene.materials[scene.meshes[0].materials[0]].base_color == (0.8, 0.8, 0.8)
