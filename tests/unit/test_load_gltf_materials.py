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
    builder.add("materials", _base(first) | {"occlusionTexture": {"index": second}})
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
        {"occlusionTexture": {"index": texture}},
        {"extensions": {"KHR_materials_pbrSpecularGlossiness": {}}},
        {"pbrMetallicRoughness": matte, "alphaMode": "BLEND"},
        {"pbrMetallicRoughness": matte, "extensions": {"KHR_materials_transmission": {}, "KHR_materials_ior": {}}},
        {"pbrMetallicRoughness": matte | {"baseColorFactor": [1.5, -1, 0, 1]}, "alphaMode": "BLEND"},
        {"pbrMetallicRoughness": matte},
        {"occlusionTexture": {"index": texture}},  # not used by any primitive
    ]
    for material in materials:
        builder.add("materials", material)
    builder.node(mesh=builder.mesh(*(builder.primitive(material=k) for k in range(6))))
    scene = _load(builder, tmp_path)
    assert "1 material with an occlusion map: left out, the tracer finds occlusion itself" in scene.notices
    assert "1 material with specular and glossiness, an old model: drawn as diffuse" in scene.notices
    assert "2 blended materials (alphaMode): cut out where less than half there" in scene.notices
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
    assert any("textures laid out differently" in notice for notice in scene.notices)


def test_metallic_roughness_and_its_textures(tmp_path: Path):
    """glTF 2.0, sec. 3.9.2: the defaults are a rough metal; roughness is green, metallic blue, both linear."""
    builder = one_triangle(uvs=UVS, material=0)
    shared = builder.texture(png(RED_OVER_BLUE))
    gloss = {"index": shared}
    builder.add(
        "materials",
        {
            "pbrMetallicRoughness": {
                "baseColorTexture": {"index": shared},
                "roughnessFactor": 0.25,
                "metallicRoughnessTexture": gloss,
            },
            "normalTexture": gloss | {"scale": 0.5},
        },
    )
    scene = _load(builder, tmp_path)
    material = scene.materials[0]
    assert material.specular
    assert (material.metallic, material.roughness, material.normal_scale) == (1.0, 0.25, 0.5)
    assert material.metallic_roughness_texture == material.normal_texture != material.base_texture
    assert scene.textures[material.normal_texture].linear
    assert not scene.textures[material.base_texture].linear


@pytest.mark.parametrize(
    ("factors", "specular"),
    [
        ({}, True),
        ({"metallicFactor": 0}, False),
        ({"metallicFactor": 0, "roughnessFactor": 0.9}, True),
        ({"metallicFactor": 0.1, "roughnessFactor": 1}, True),
        ({"metallicFactor": 0, "metallicRoughnessTexture": {"index": 0}}, True),
    ],
)
def test_what_is_rough_and_no_metal_is_diffuse(tmp_path: Path, factors: dict[str, Any], specular: bool):
    builder = _textured({"pbrMetallicRoughness": factors})
    builder.texture(png(RED_OVER_BLUE))
    assert _load(builder, tmp_path).materials[0].specular is specular


def test_alpha_mode_and_coverage(tmp_path: Path):
    """The texture's alpha is kept where it cuts something out, and only there."""
    holes = np.dstack([RED_OVER_BLUE, np.array([[255] * 3, [0, 100, 200]], np.uint8)])
    builder = GltfBuilder()
    builder.texture(png(holes))
    base = _base()["pbrMetallicRoughness"] | {"baseColorFactor": [1, 1, 1, 0.75]}
    modes: list[dict[str, Any]] = [{}, {"alphaMode": "MASK"}, {"alphaMode": "MASK", "alphaCutoff": 0.3}]
    for mode in [*modes, {"alphaMode": "BLEND"}]:
        builder.add("materials", {"pbrMetallicRoughness": base} | mode)
    builder.node(mesh=builder.mesh(*(builder.primitive(uvs=UVS, material=k) for k in range(4))))
    scene = _load(builder, tmp_path)
    assert [m.alpha_cutoff for m in scene.materials] == [None, 0.5, 0.3, 0.5]
    assert {m.alpha for m in scene.materials} == {0.75}
    opaque, cut = (scene.textures[m.base_texture] for m in scene.materials[:2])
    assert opaque.alpha is None
    assert cut.alpha is not None
    np.testing.assert_array_equal(cut.alpha, holes[::-1, :, 3])
    np.testing.assert_array_equal(cut.pixels, opaque.pixels)


def test_vertex_colors_are_read_in_every_form(tmp_path: Path):
    builder = GltfBuilder()
    colors = np.array([(0.2, 0.4, 0.6, 0.8), (1.0, 0.0, 0.6, 0.4), (0.0, 0.2, 1.0, 1.0)])
    plain, rgb = builder.primitive(), builder.primitive()
    stored = [builder.primitive(), rgb, plain]
    stored[0]["attributes"]["COLOR_0"] = builder.accessor(np.rint(colors * 255), "u1", normalized=True)
    rgb["attributes"]["COLOR_0"] = builder.accessor(colors[:, :3])
    builder.node(mesh=builder.mesh(*stored))
    mesh = _load(builder, tmp_path).meshes[0]
    assert mesh.colors is not None
    assert mesh.colors.dtype == np.float32
    opaque = np.column_stack([colors[:, :3], np.ones(3)])
    np.testing.assert_allclose(mesh.colors, np.concatenate([colors, opaque, np.ones((3, 4))]), atol=1e-6)


def test_no_material_is_light_grey(tmp_path: Path):
    scene = _load(one_triangle(), tmp_path)
    assert scene.materials[scene.meshes[0].materials[0]].base_color == (0.8, 0.8, 0.8)
