"""glTF files that cannot be read: each gives one message that names the file and the entry, never a traceback."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from errors import UserError
from raytrace.load import load_scene
from tests.unit.gltf_files import GltfBuilder, one_triangle, png

Change = Callable[[GltfBuilder], object]


def _message(path: Path) -> str:
    with pytest.raises(UserError) as caught:
        load_scene(path)
    assert str(path) in str(caught.value)
    assert "\n  " in str(caught.value), "there is no hint what to do"
    return str(caught.value)


def _whole() -> GltfBuilder:
    """A file that uses most of what is looked up."""
    builder = one_triangle(indices=[0, 1, 2], normals=[(0, 0, 1)] * 3, uvs=[(0, 0)] * 3, material=0)
    texture = builder.texture(png(np.zeros((2, 2, 3), np.uint8)))
    builder.add(
        "materials",
        {
            "pbrMetallicRoughness": {"baseColorTexture": {"index": texture}, "baseColorFactor": [1, 1, 1, 1]},
            "emissiveFactor": [1, 1, 1],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 1}},
        },
    )
    builder.add("cameras", {"perspective": {"yfov": 1, "znear": 1}})
    builder.json["nodes"][0] |= {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}
    builder.node(camera=0, matrix=np.eye(4).reshape(-1).tolist(), children=[])
    builder.json["scenes"] = [{"nodes": [0, 1]}]
    builder.json["scene"] = 0
    return builder


def test_truncated_glb_at_every_length(tmp_path: Path):
    data = one_triangle().write_glb(tmp_path / "a.glb").read_bytes()
    path = tmp_path / "cut.glb"
    for length in range(0, len(data), 16):
        path.write_bytes(data[:length])
        message = _message(path)
        if length >= 20:
            assert "truncated" in message


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b'{"asset": {"version": "2.0"}, "nodes": [', "JSON is broken at line 1"),
        (b"{\x80rubbish", "is not a glTF file"),
        (b"[1, 2]", "not glTF"),
        (b"{}", "no 'asset'"),
        (b'{"asset": {"version": "1.0"}}', "glTF 1.0"),
        (b"glTF\x01\x00\x00\x00" + bytes(12), "binary glTF 1"),
        (b"glTF\x02\x00\x00\x00\x14\x00\x00\x00\xff\x00\x00\x00JSON", "damaged"),
    ],
)
def test_broken_containers(tmp_path: Path, data: bytes, expected: str):
    path = tmp_path / "a.gltf"
    path.write_bytes(data)
    assert expected in _message(path)


def test_missing_and_short_bin_file(tmp_path: Path):
    path = one_triangle().write_gltf(tmp_path / "a.gltf")
    beside = tmp_path / "my data.bin"
    beside.write_bytes(beside.read_bytes()[:20])
    assert "buffers[0] is truncated: 20 bytes are there, 36" in _message(path)
    beside.unlink()
    assert "my data.bin is not there" in _message(path)


@pytest.mark.parametrize(
    "name", ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression", "VENDOR_magic"]
)
def test_required_extensions(tmp_path: Path, name: str):
    builder = one_triangle()
    builder.json["extensionsRequired"] = builder.json["extensionsUsed"] = [name]
    message = _message(builder.write_glb(tmp_path / "a.glb"))
    assert name in message
    assert "gltf-transform" in message


def test_compression_that_is_only_declared_where_it_is_used(tmp_path: Path):
    meshopt = one_triangle()
    meshopt.json["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {}}
    assert "EXT_meshopt_compression" in _message(meshopt.write_glb(tmp_path / "a.glb"))
    draco = one_triangle(extensions={"KHR_draco_mesh_compression": {}})
    assert "KHR_draco_mesh_compression" in _message(draco.write_glb(tmp_path / "b.glb"))
    hollow = one_triangle()
    del hollow.json["accessors"][0]["bufferView"]
    hollow.json["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    assert "KHR_draco_mesh_compression" in _message(hollow.write_glb(tmp_path / "c.glb"))


def _set(*keys: str | int, value: object) -> Change:
    def change(builder: GltfBuilder) -> None:
        place = builder.json
        for key in keys[:-1]:
            place = place[key]  # type: ignore[index]
        place[keys[-1]] = value  # type: ignore[index]

    return change


PRIMITIVE = ("meshes", 0, "primitives", 0)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (_set("scene", value=3), "refers to scenes[3]"),
        (_set("scenes", 0, "nodes", value=[7]), "refers to nodes[7]"),
        (_set("scenes", 0, "nodes", value=[0, 0]), "must form a tree"),
        (_set("nodes", 1, "children", value=[1]), "must form a tree"),
        (_set("nodes", 0, "mesh", value=5), "'node 0' refers to meshes[5]"),
        (_set("nodes", 0, "mesh", value=-1), "refers to meshes[-1]"),
        (_set("nodes", 1, "camera", value=5), "refers to cameras[5]"),
        (_set("nodes", 0, "rotation", value=[0, 0, 0, 0]), "quaternion of length 0"),
        (_set("nodes", 0, "translation", value=[0, "x", 0]), "'translation' of node 'node 0'"),
        (_set("nodes", 0, "scale", value=[1, 1]), "3 finite numbers"),
        (_set(*PRIMITIVE, "material", value=9), "refers to materials[9]"),
        (_set(*PRIMITIVE, "attributes", "POSITION", value=99), "refers to accessors[99]"),
        (_set(*PRIMITIVE, "indices", value=0), "SCALAR is expected"),
        (_set("accessors", 0, "type", value="VEC2"), "VEC3 is expected"),
        (_set("accessors", 0, "componentType", value=5130), "5130"),
        (_set("accessors", 0, "count", value=1_000_000), "beyond its data"),
        (_set("accessors", 0, "count", value=-1), "'count'"),
        (_set("accessors", 1, "count", value=2), "different length (3 for POSITION, 2 for NORMAL"),
        (_set("accessors", 3, "count", value=2), "not a multiple of 3"),
        (_set("accessors", 0, "sparse", value={}), "sparse"),
        (_set("bufferViews", 0, "byteOffset", value=10_000), "after its buffer"),
        (_set("bufferViews", 0, "byteStride", value=4), "stride of 4"),
        (_set("bufferViews", 0, "buffer", value=1), "refers to buffers[1]"),
        (_set("textures", 0, "source", value=4), "refers to images[4]"),
        (_set("images", 0, value={"uri": "http://example.org/a.png"}), "address on a network"),
        (_set("images", 0, value={"uri": "data:image/png;base64,@"}), "texture"),
        (_set("images", 0, value={"bufferView": 0}), "cannot be decoded"),
        (_set("materials", 0, "emissiveFactor", value=[1e999, 0, 0]), "'emissiveFactor'"),
        (_set("materials", 0, "emissiveFactor", value="red"), "3 finite numbers"),
    ],
)
def test_wrong_entries(tmp_path: Path, change: Change, expected: str):
    builder = _whole()
    load_scene(builder.write_glb(tmp_path / "good.glb"))
    change(builder)
    assert expected in _message(builder.write_glb(tmp_path / "bad.glb"))


def _places(value: object, keys: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Every place in a JSON value; of a list of numbers only the first one."""
    if isinstance(value, list) and value and isinstance(value[0], (int, float)):
        value = value[:1]
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [place for key, inner in items for place in [(*keys, key), *_places(inner, (*keys, key))]]


@pytest.mark.parametrize("junk", [None, "text", -3, 1e300, [], {}, [[]]], ids=repr)
def test_no_wrong_value_anywhere_gives_a_traceback(tmp_path: Path, junk: object):
    """Every value of a file replaced, one at a time: what cannot be drawn is a UserError."""
    good = _whole()
    load_scene(good.write_glb(tmp_path / "good.glb"))
    path = tmp_path / "bad.glb"
    outcomes = {"drawn": 0, "refused": 0}
    for place in _places(good.json):
        builder = copy.deepcopy(good)
        _set(*place, value=junk)(builder)
        try:
            load_scene(builder.write_glb(path))
            outcomes["drawn"] += 1
        except UserError:
            outcomes["refused"] += 1
    assert outcomes["refused"] > outcomes["drawn"] / 2


@pytest.mark.parametrize(
    ("scale", "expected"),
    [([1, 0, 1], "flattens"), ([0, 0, 0], "flattens"), ([1e20, 1e20, 1e20], "absurd")],
)
def test_transforms_that_flatten_or_explode(tmp_path: Path, scale: list[float], expected: str):
    builder = one_triangle()
    builder.json["nodes"][0] |= {"name": "lid", "scale": scale}
    message = _message(builder.write_glb(tmp_path / "a.glb"))
    assert "'lid'" in message
    assert expected in message


def test_bad_vertices_and_indices(tmp_path: Path):
    nan = one_triangle(positions=[(0, 0, 0), (np.nan, 0, 0), (0, np.inf, 0)])
    assert "2 of 3 vertices are NaN or infinite" in _message(nan.write_glb(tmp_path / "a.glb"))
    far = one_triangle(positions=[(0, 0, 0), (1e13, 0, 0), (0, 1, 0)])
    assert "absurd" in _message(far.write_glb(tmp_path / "b.glb"))
    wrong = one_triangle(indices=[0, 1, 3])
    assert "uses vertex 3, but there are 3" in _message(wrong.write_glb(tmp_path / "c.glb"))


def test_nothing_but_triangles_without_area(tmp_path: Path):
    builder = one_triangle(positions=[(0, 0, 0), (1, 1, 1), (2, 2, 2)])
    assert "no triangle" in _message(builder.write_glb(tmp_path / "a.glb"))
