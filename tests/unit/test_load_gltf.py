"""glTF: which triangles arrive where, with which normals, and the camera."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from raytrace.load import load_scene
from raytrace.parts import normalized
from raytrace.scene import Mesh, Scene
from tests.unit.gltf_files import TRIANGLE, GltfBuilder, one_triangle

CORNERS = np.array(TRIANGLE)


def _face_normals(mesh: Mesh) -> NDArray[np.float64]:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    return normalized(n)


def _notice(scene: Scene, *words: str) -> str:
    return next(n for n in scene.notices if all(word in n for word in words))


def test_glb_gltf_and_embedded_data_are_the_same(tmp_path: Path):
    builder = one_triangle(indices=[0, 1, 2], normals=[(0, 0, 1)] * 3)
    scenes = [
        load_scene(builder.write_glb(tmp_path / "a.glb")),
        load_scene(builder.write_gltf(tmp_path / "b.gltf")),
        load_scene(builder.write_gltf(tmp_path / "c.gltf", embedded=True)),
        load_scene(builder.write_glb(tmp_path / "named_wrongly.gltf")),
    ]
    for scene in scenes:
        assert scene.meshes[0].vertices.dtype == np.float64
        np.testing.assert_array_equal(scene.meshes[0].vertices[scene.meshes[0].faces[0]], CORNERS)
        assert scene.meshes[0].normals is not None


def test_every_primitive_keeps_its_own_geometry_and_material(tmp_path: Path):
    """Several primitives per mesh, several nodes per mesh, and every name the same."""
    builder = GltfBuilder()
    for k in range(4):
        builder.add("materials", {"name": "same", "pbrMetallicRoughness": {"baseColorFactor": [k / 4, 0, 0, 1]}})
    line = builder.primitive(mode=1)
    meshes = [
        builder.mesh(
            *(
                builder.primitive(
                    np.add(CORNERS, (10 * m, k, 0)), normals=[(0, 0, 1)] * 3 if k == 0 else None, material=2 * m + k
                )
                for k in range(2)
            ),
            *([line] if m == 0 else []),
            name="same",
        )
        for m in range(2)
    ]
    for number, z in ((meshes[1], 0.0), (meshes[0], 100.0), (meshes[1], 200.0)):
        builder.node(mesh=number, translation=[0, 0, z], name="same")
    scene = load_scene(builder.write_glb(tmp_path / "a.glb"))
    assert [len(mesh.faces) for mesh in scene.meshes] == [2, 2, 2]
    for mesh, m, z in zip(scene.meshes, (1, 0, 1), (0.0, 100.0, 200.0), strict=True):
        for k in range(2):
            np.testing.assert_array_equal(mesh.vertices[mesh.faces[k]], np.add(CORNERS, (10 * m, k, z)))
            assert scene.materials[mesh.materials[k]].base_color[0] == (2 * m + k) / 4
        assert mesh.normals is not None  # a flat primitive in an object with a smooth one gets its own normals
        np.testing.assert_allclose(mesh.normals, [(0, 0, 1)] * 6)
    assert "1 primitive of points, lines" in _notice(scene, "left out")


def test_no_normals_means_flat_shading(tmp_path: Path):
    folded = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    scene = load_scene(one_triangle(positions=folded, indices=[0, 1, 2, 0, 2, 3]).write_glb(tmp_path / "a.glb"))
    assert scene.meshes[0].normals is None
    assert "1 object without normals" in _notice(scene, "flat")


@pytest.mark.parametrize("scale", [(1, 1, 1), (2, 1, 0.5), (-1, 1, 1), (-3, -1, -0.1), (1e-4, 1e-4, -1e-4)])
def test_transforms_keep_normals_outside(tmp_path: Path, scale: tuple[float, float, float]):
    """A slanted triangle under rotation, non-uniform scale and mirroring, against its own plane."""
    slanted = np.array([(1.0, 0.25, 0.125), (0.375, 1.0, 0.5), (0.125, 0.5, 1.5)])
    normal = np.cross(slanted[1] - slanted[0], slanted[2] - slanted[0])
    normal /= np.linalg.norm(normal)
    angle = 0.7
    quaternion = [0.0, math.sin(angle / 2), 0.0, math.cos(angle / 2)]
    builder = GltfBuilder()
    child = builder.node(mesh=builder.mesh(builder.primitive(slanted, normals=[normal] * 3)), scale=list(scale))
    builder.node(children=[child], rotation=quaternion, translation=[5, 6, 7])
    mesh = load_scene(builder.write_glb(tmp_path / "a.glb")).meshes[0]
    rotation = np.array(
        [[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]]
    )  # about y
    world = (slanted * scale) @ rotation.T + (5, 6, 7)
    corners = {tuple(np.round(v, 9)) for v in mesh.vertices[mesh.faces[0]]}
    assert corners == {tuple(np.round(v, 9)) for v in world}
    assert mesh.normals is not None
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-6)
    # The side that was the front stays the front: winding and vertex normals agree, and both follow the plane.
    np.testing.assert_allclose(mesh.normals[0], _face_normals(mesh)[0], atol=1e-5)
    outside = (normal / scale) @ rotation.T
    np.testing.assert_allclose(mesh.normals[0], outside / np.linalg.norm(outside), atol=1e-5)


def test_matrix_nodes_are_column_major_and_compose(tmp_path: Path):
    builder = GltfBuilder()
    child = builder.node(mesh=builder.mesh(builder.primitive()), translation=[1, 0, 0])
    matrix = np.array([[0, -1, 0, 10], [1, 0, 0, 20], [0, 0, 1, 30], [0, 0, 0, 1]], dtype=float)
    builder.node(children=[child], matrix=matrix.T.reshape(-1).tolist())
    mesh = load_scene(builder.write_glb(tmp_path / "a.glb")).meshes[0]
    np.testing.assert_allclose(mesh.vertices[mesh.faces[0]], [(10, 21, 30), (10, 22, 30), (9, 21, 30)])


def test_far_away_triangles_keep_their_shape(tmp_path: Path):
    builder = one_triangle()
    builder.json["nodes"][0]["translation"] = [4e9, 0, 0]
    mesh = load_scene(builder.write_glb(tmp_path / "a.glb")).meshes[0]
    np.testing.assert_array_equal(mesh.vertices[mesh.faces[0]] - (4e9, 0, 0), CORNERS)


def test_shown_scene_and_roots(tmp_path: Path):
    builder = GltfBuilder()
    mesh = builder.mesh(builder.primitive())
    for x in range(3):
        builder.node(mesh=mesh, translation=[x, 0, 0])
    builder.json["scenes"] = [{"nodes": [0]}, {"nodes": [1, 2]}]
    assert len(load_scene(builder.write_glb(tmp_path / "a.glb")).meshes) == 1
    builder.json["scene"] = 1
    assert len(load_scene(builder.write_glb(tmp_path / "b.glb")).meshes) == 2


def test_strips_interleaved_and_quantized_data(tmp_path: Path):
    builder = GltfBuilder()
    square = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]
    builder.node(mesh=builder.mesh(builder.primitive(square, mode=5)))
    rows = np.zeros((3, 6), "<f4")
    rows[:, :3], rows[:, 3:] = CORNERS, (0, 0, 1)
    view = builder.view(rows.tobytes(), byteStride=24)
    common = {"bufferView": view, "componentType": 5126, "count": 3, "type": "VEC3"}
    position, normal = builder.add("accessors", common), builder.add("accessors", common | {"byteOffset": 12})
    builder.node(mesh=builder.mesh({"attributes": {"POSITION": position, "NORMAL": normal}}))
    packed = builder.accessor(CORNERS * 32767, "i2", normalized=True)
    bytes4 = np.zeros((3, 4), "i1")
    bytes4[:, 2] = 127
    view = builder.view(bytes4.tobytes(), byteStride=4)
    packed_normal = builder.add(
        "accessors", {"bufferView": view, "componentType": 5120, "count": 3, "type": "VEC3", "normalized": True}
    )
    builder.node(mesh=builder.mesh({"attributes": {"POSITION": packed, "NORMAL": packed_normal}}))
    builder.json["extensionsRequired"] = builder.json["extensionsUsed"] = ["KHR_mesh_quantization"]
    strip, interleaved, quantized = load_scene(builder.write_glb(tmp_path / "a.glb")).meshes
    np.testing.assert_allclose(_face_normals(strip), [(0, 0, 1)] * 2)
    for mesh in (interleaved, quantized):
        np.testing.assert_array_equal(mesh.vertices[mesh.faces[0]], CORNERS)
        assert mesh.normals is not None
        np.testing.assert_allclose(mesh.normals, [(0, 0, 1)] * 3)


def test_shared_vertex_array_is_cut_to_what_each_primitive_uses(tmp_path: Path):
    builder = GltfBuilder()
    many = np.arange(3000, dtype=float).reshape(-1, 3) ** 1.5
    position = builder.accessor(many)
    primitives = [
        {"attributes": {"POSITION": position}, "indices": builder.accessor([k, k + 1, k + 7], "u4")} for k in (5, 900)
    ]
    builder.node(mesh=builder.mesh(*primitives))
    mesh = load_scene(builder.write_glb(tmp_path / "a.glb")).meshes[0]
    assert len(mesh.vertices) == 6
    np.testing.assert_array_equal(mesh.vertices[mesh.faces[1]], many[[900, 901, 907]].astype(np.float32))


def _camera(builder: GltfBuilder, **perspective: float) -> int:
    return builder.add("cameras", {"type": "perspective", "perspective": perspective})


def test_first_camera_of_the_scene_below_other_nodes(tmp_path: Path):
    builder = one_triangle()
    _camera(builder, yfov=0.1, znear=1)  # not in the scene
    second = _camera(builder, yfov=0.8, znear=1, aspectRatio=2.0)
    inner = builder.node(camera=second, translation=[0, 0, 3], name="view")
    half = math.sqrt(0.5)
    builder.node(children=[inner], rotation=[0, half, 0, half], scale=[2, 2, 2], translation=[1, 1, 1])
    builder.node(camera=0, name="other")
    scene = load_scene(builder.write_glb(tmp_path / "a.glb"))
    assert scene.camera.yfov == 0.8
    np.testing.assert_allclose(scene.camera.position, (7, 1, 1), atol=1e-12)
    np.testing.assert_allclose(scene.camera.forward, (-1, 0, 0), atol=1e-12)
    np.testing.assert_allclose(scene.camera.up, (0, 1, 0), atol=1e-12)
    assert "the first is used (--camera NAME takes another): 'view', 'other'" in _notice(scene, "2 cameras")
    assert [camera.name for camera in scene.cameras] == ["view", "other"]
    assert scene.cameras[0].camera == scene.camera
    assert scene.cameras[1].camera.yfov == 0.1
    assert scene.flight is None
    assert not any("framed" in notice for notice in scene.notices)


def test_mesh_below_a_camera_is_drawn(tmp_path: Path):
    builder = GltfBuilder()
    builder.node(camera=_camera(builder, yfov=1, znear=1), mesh=builder.mesh(builder.primitive()))
    assert load_scene(builder.write_glb(tmp_path / "a.glb")).triangle_count == 1


def test_orthographic_camera_is_not_used(tmp_path: Path):
    builder = one_triangle()
    builder.add("cameras", {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 9}})
    builder.node(camera=0, name="front")
    scene = load_scene(builder.write_glb(tmp_path / "a.glb"))
    assert "'front' is not a perspective camera" in _notice(scene, "not used")
    assert _notice(scene, "framed")


def test_names_what_does_not_show(tmp_path: Path):
    builder = one_triangle()
    primitive = builder.json["meshes"][0]["primitives"][0]
    primitive["targets"] = [{}]
    builder.json["extensionsUsed"] = ["KHR_lights_punctual", "VENDOR_something"]
    scene = load_scene(builder.write_glb(tmp_path / "a.glb"))
    assert _notice(scene, "1 skinned or morphing object")
    assert _notice(scene, "extensions left out: VENDOR_something")
    assert _notice(scene, "1 primitive without a material")
