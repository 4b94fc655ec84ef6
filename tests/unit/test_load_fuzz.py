"""Damaged scene files: whatever is wrong with one, it opens or is refused in one message, and never fails otherwise.

The examples are the same in every run.
"""

from __future__ import annotations

import copy
import json
import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from errors import UserError
from raytrace.compiled import CompiledScene, compile_scene
from raytrace.load import load_scene
from raytrace.scene import Scene
from tests.unit.gltf_files import GltfBuilder, png

SQUARE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], dtype=np.float64)
fuzz = settings(
    derandomize=True, deadline=None, max_examples=120, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def whole_file() -> GltfBuilder:
    """A scene with everything that is read."""
    builder = GltfBuilder()
    pixels = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    texture = builder.texture(png(pixels))
    builder.add(
        "materials",
        {
            "name": "paint",
            "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.2, 1], "baseColorTexture": {"index": texture}},
            "emissiveFactor": [0.1, 0, 0],
            "emissiveTexture": {"index": texture, "texCoord": 0},
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3}},
        },
    )
    uvs, normals = SQUARE[:, :2], np.tile((0.0, 0.0, 1.0), (4, 1))
    mesh = builder.mesh(
        builder.primitive(SQUARE, [0, 1, 2, 0, 2, 3], normals, uvs, material=0), builder.primitive(), name="board"
    )
    builder.add("cameras", {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}})
    builder.json["extensions"] = {
        "KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {"outerConeAngle": 0.5}, "range": 4.0}]}
    }
    child = builder.node(mesh=mesh, translation=[1, 2, 3], rotation=[0, 0, 0, 1], scale=[1, 1, 2], name="board")
    lamp = builder.node(extensions={"KHR_lights_punctual": {"light": 0}})
    eye = builder.node(camera=0, matrix=np.eye(4).reshape(-1).tolist())
    builder.node(children=[child, lamp, eye])
    sampler = {"input": builder.accessor([0.0, 1.0]), "output": builder.accessor([(0, 0, 0), (1, 0, 0)])}
    channel = {"sampler": 0, "target": {"node": child, "path": "translation"}}
    builder.add("animations", {"samplers": [sampler], "channels": [channel]})
    return builder


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Ways to every value in a JSON document, the document itself left out."""
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, entry in entries:
        yield (*path, key)
        yield from places(entry, (*path, key))


def changed(builder: GltfBuilder, *way: Any, value: Any) -> GltfBuilder:
    result = copy.deepcopy(builder)
    *keys, last = way
    parent = result.json
    for key in keys:
        parent = parent[key]
    parent[last] = value
    return result


WHOLE = whole_file()
PRIMITIVE = ("meshes", 0, "primitives", 0)
PLACES = list(places(WHOLE.json))
NOTHING = object()
ODD: list[Any] = [
    NOTHING, None, True, -1, 0, 1, 2, 3, 7, 255, 5121, 10**6, 2**31, 2**63, 10**400, -0.5, 1e-320, 1e13, 1e300,
    math.nan, math.inf, "", "x", "POSITION", [], [0], [0, 0, 0], [0, 0, 0, 0], [1e20, 0, 0], {},
    {"index": 0}, [[]], [{}],
]  # fmt: skip


def opens_or_is_refused(path: Path) -> Scene | None:
    """The scene, compiled and moved once; None where it was refused in words that name the file."""
    try:
        scene = load_scene(path, animate=True)
        compiled = compile_scene(scene)
    except UserError as error:
        refusal = str(error)
    else:
        return _moved(scene, compiled)
    assert path.name in refusal
    return None


def _moved(scene: Scene, compiled: CompiledScene) -> Scene:
    compiled.move_to(0.5, 0.4)
    assert np.isfinite(compiled.triangles).all()
    assert np.isfinite(compiled.lights.punctual).all()
    assert np.isfinite(scene.camera.basis()).all()
    return scene


def test_the_whole_file_opens(tmp_path: Path) -> None:
    scene = opens_or_is_refused(WHOLE.write_glb(tmp_path / "whole.glb"))
    assert scene is not None
    assert (scene.triangle_count, len(scene.lights), len(scene.cameras), len(scene.textures)) == (3, 1, 1, 1)
    assert scene.animated
    assert {notice for notice in scene.notices if "left out" in notice} == set()


@fuzz
@given(
    changes=st.lists(st.tuples(st.integers(0, len(PLACES) - 1), st.integers(0, len(ODD) - 1)), min_size=1, max_size=3)
)
def test_odd_values_anywhere(tmp_path: Path, changes: list[tuple[int, int]]) -> None:
    builder = copy.deepcopy(WHOLE)
    for place, odd in changes:
        *way, last = PLACES[place]
        parent = builder.json
        try:
            for key in way:
                parent = parent[key]
            if ODD[odd] is NOTHING:
                del parent[last]
            else:
                parent[last] = copy.deepcopy(ODD[odd])
        except (KeyError, IndexError, TypeError):
            continue  # another change has taken the place away
    opens_or_is_refused(builder.write_glb(tmp_path / "odd.glb"))


def test_every_place_without_its_value_and_with_one_that_is_too_large(tmp_path: Path) -> None:
    """One by one, so that nothing depends on luck."""
    opened = 0
    for place in PLACES:
        for odd in (NOTHING, 10**6, "x"):
            builder = copy.deepcopy(WHOLE)
            *way, last = place
            parent = builder.json
            for key in way:
                parent = parent[key]
            if odd is NOTHING:
                del parent[last]
            else:
                parent[last] = odd
            opened += opens_or_is_refused(builder.write_glb(tmp_path / "odd.glb")) is not None
    assert 0.05 < opened / (3 * len(PLACES)) < 0.8


@fuzz
@given(cut=st.integers(0, 3000), at=st.integers(0, 3000), value=st.integers(0, 255), flip=st.booleans())
@example(cut=0, at=0, value=0, flip=False)
def test_bytes_that_are_missing_or_wrong(tmp_path: Path, cut: int, at: int, value: int, flip: bool) -> None:
    path = WHOLE.write_glb(tmp_path / "damaged.glb")
    data = bytearray(path.read_bytes())
    if flip:
        data[at % len(data)] = value
    path.write_bytes(data[: len(data) - (0 if flip else cut % len(data))])
    opens_or_is_refused(path)


TEXTS = {
    ".obj": "mtllib a.mtl\no board\nusemtl paint\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvn 0 0 1\n"
    "f 1/1/1 2/2/1 3/1/1\n",
    ".ply": "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
}  # fmt: skip


@fuzz
@given(
    ending=st.sampled_from(sorted(TEXTS)),
    at=st.integers(0, 400),
    length=st.integers(0, 12),
    put=st.sampled_from(
        ["", "nan", "-1", "1e400", "99999999999", "\0", " ", "\n", "é", "f 1 2", "v 1 2", "0/0/0", "x"]
    ),
)
def test_text_that_is_missing_or_wrong(tmp_path: Path, ending: str, at: int, length: int, put: str) -> None:
    text = TEXTS[ending]
    at %= len(text)
    path = tmp_path / f"text{ending}"
    path.write_text(text[:at] + put + text[at + length :], encoding="utf-8")
    opens_or_is_refused(path)


def with_positions(values: Any) -> GltfBuilder:
    builder = copy.deepcopy(WHOLE)
    builder.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = builder.accessor(values)
    return builder


def with_huge_image() -> GltfBuilder:
    """The header of a PNG that would be 65,536 pixels wide and high: 12 GB when decoded."""
    builder = copy.deepcopy(WHOLE)
    image = png(np.zeros((2, 2, 3), np.uint8))
    side = struct.pack(">I", 65536)
    header = b"IHDR" + side + side + image[24:29]
    data = image[:12] + header + struct.pack(">I", zlib.crc32(header)) + image[33:]
    builder.json["images"][0] = {"bufferView": builder.view(data)}
    return builder


@pytest.mark.parametrize(
    ("words", "builder"),
    [
        ("a coordinate of 1e+20 is absurd", with_positions(SQUARE * 1e20)),
        ("4 of 4 vertices are NaN or infinite", with_positions(SQUARE * math.nan)),
        ("attributes of different length", with_positions(SQUARE[:3])),
        ("the transform of node 'board' flattens it", changed(WHOLE, "nodes", 0, "scale", value=[1, 0, 1])),
        ("refers to accessors[999]", changed(WHOLE, *PRIMITIVE, "attributes", "POSITION", value=999)),
        ("refers to materials[9]", changed(WHOLE, *PRIMITIVE, "material", value=9)),
        ("a triangle uses vertex 3, but there are 3", changed(WHOLE, *PRIMITIVE, "attributes", value={"POSITION": 4})),
        ("bytes after its buffer", changed(WHOLE, "bufferViews", 1, "byteLength", value=10**9)),
        ("is too large to decode", with_huge_image()),
        ("there is no triangle in this file", changed(WHOLE, "meshes", 0, "primitives", value=[])),
    ],
)
def test_common_kinds_of_damage_have_a_message_of_their_own(tmp_path: Path, words: str, builder: GltfBuilder) -> None:
    with pytest.raises(UserError) as caught:
        load_scene(builder.write_glb(tmp_path / "a.glb"))
    assert words in str(caught.value)
    assert str(caught.value).count("\n") <= 1


def test_a_file_that_a_scene_refers_to_is_missing(tmp_path: Path) -> None:
    WHOLE.write_gltf(tmp_path / "a.gltf")
    (tmp_path / "my data.bin").unlink()
    with pytest.raises(UserError, match=r"my data\.bin is not there"):
        load_scene(tmp_path / "a.gltf")
    document = json.loads((tmp_path / "a.gltf").read_text())
    document["images"] = [{"uri": "wood.png"}]
    WHOLE.write_gltf(tmp_path / "a.gltf")
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    with pytest.raises(UserError, match=r"wood\.png is not there"):
        load_scene(tmp_path / "a.gltf")


def test_faces_without_area_and_twice_the_same_are_no_obstacle(tmp_path: Path) -> None:
    builder = GltfBuilder()
    indices = [0, 1, 2, 0, 1, 2, 2, 1, 0, 0, 0, 1, 3, 3, 3]
    builder.node(mesh=builder.mesh(builder.primitive(SQUARE, indices)))
    scene = opens_or_is_refused(builder.write_glb(tmp_path / "a.glb"))
    assert scene is not None
    assert scene.triangle_count == 3
    assert "repaired: 2 triangles without area dropped" in scene.notices
