"""OBJ and MTL: what other readers lose, polygons, materials, and errors with their line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from errors import UserError
from raytrace.load import load_scene
from raytrace.scene import Mesh, Scene
from tests.unit.gltf_files import png

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def _load(tmp_path: Path, text: str, mtl: str | None = None) -> Scene:
    if mtl is not None:
        (tmp_path / "a.mtl").write_text(mtl)
        text = "mtllib a.mtl\n" + text
    (tmp_path / "a.obj").write_bytes(text.encode())
    return load_scene(tmp_path / "a.obj")


def _message(tmp_path: Path, text: str, mtl: str | None = None) -> str:
    with pytest.raises(UserError) as caught:
        _load(tmp_path, text, mtl)
    assert str(tmp_path) in str(caught.value)
    assert "\n  " in str(caught.value), "there is no hint what to do"
    return str(caught.value)


def _triangles(mesh: Mesh) -> list[list[list[float]]]:
    result: list[list[list[float]]] = mesh.vertices[mesh.faces].tolist()
    return result


PLAIN = [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]


@pytest.mark.parametrize(
    "text",
    [
        SQUARE + "f 1 2 3\nf 1 3 4\n",
        SQUARE + "f 1 2 3 4",  # a quad, and no newline at the end
        SQUARE + "f -4 -3 -2 -1\n",
        SQUARE + "f -4 -3 -2\nf 1 -2 4\nv 9 9 9\nv 8 8 8\n",  # relative to the line, not to the end of the file
        SQUARE.replace(" ", "\t").replace("v\t", "v\t  ") + "f\t1 2\t3 \t4 \n",
        SQUARE.replace("\n", "\r\n") + "f 1 2 3 4\r\n",
        "  " + SQUARE.replace("\n", "\n  ") + "f 1 2 3 4\n",
        "\ufeff" + SQUARE + "f 1 2 \\\n3 4\n",
        "# v 1 2 3\n\n" + SQUARE.replace("\n", " # corner\n") + "f 1 2 3 4 # a face\ns off\nl 1 2\n",
        SQUARE.replace("\n", " 1.0\n") + "f 1// 2// 3// 4//\n",
        SQUARE.replace("v 1 0 0", "v 1 0 0 1.0") + "f 1/ 2/ 3/ 4/\n",
        SQUARE.replace("1", "+1.0e0") + "vt 0\nvt 0.5 0.5 0\nf 1/1 2/1 3/1\nf 1 3 4\n",
    ],
)
def test_ways_to_write_the_same_square(tmp_path: Path, text: str):
    assert _triangles(_load(tmp_path, text).meshes[0]) == PLAIN


def test_a_hexagon_is_not_three_textured_corners(tmp_path: Path):
    circle = [(np.cos(a), np.sin(a), 0.0) for a in np.arange(6) * np.pi / 3]
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in circle) + "vt 0 0\n" * 6 + "f 1/1 2/2 3/3\nf 1 2 3 4 5 6\n"
    mesh = _load(tmp_path, text).meshes[0]
    assert len(mesh.faces) == 1 + 4
    a, b, c = (mesh.vertices[mesh.faces[1:, k]] for k in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(1.5 * 3**0.5)


def test_normals_per_corner_and_mixed_forms(tmp_path: Path):
    text = SQUARE + "vn 0 0 2\nvn 0 1 0\nvn 0 0 0\nf 1//1 2//2 3//3\nf 1 3 4\n"
    scene = _load(tmp_path, text)
    mesh = scene.meshes[0]
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals[mesh.faces], [[(0, 0, 1), (0, 1, 0), (0, 0, 1)], [(0, 0, 1)] * 3])
    assert "repaired: 1 normal brought to length 1" in scene.notices
    assert any("1 object without normals" in notice for notice in scene.notices)
    assert _load(tmp_path, SQUARE + "vn 0 0 1\nf 1 2 3\n").meshes[0].normals is None


def test_objects_and_materials(tmp_path: Path):
    mtl = "newmtl red wall\nKd 0.63 0.065 0.05\n newmtl lamp\n\tKd 0 0 0 # black\n Ke 17 12 4\n"
    mtl += "newmtl unused\nmap_Kd gone.png\n"
    text = (
        SQUARE
        + "f 1 2 3\no left\nusemtl red wall\nf 1 2 3\nusemtl lamp\nf 1 3 4\ng ignored\n"
        + "o right\nf 2 3 4\no left\nf 1 2 4\n"
    )
    scene = _load(tmp_path, text, mtl)
    assert [mesh.name for mesh in scene.meshes] == ["a", "left", "right"]
    names = [[scene.materials[m].name for m in mesh.materials] for mesh in scene.meshes]
    assert names == [["no material"], ["red wall", "lamp", "lamp"], ["lamp"]]
    by_name = {material.name: material for material in scene.materials}
    assert by_name["red wall"].base_color == (0.63, 0.065, 0.05)
    assert by_name["lamp"].emission == (17.0, 12.0, 4.0)
    assert by_name["lamp"].base_color == (0.0, 0.0, 0.0)
    assert by_name["no material"].base_color == (0.8, 0.8, 0.8)
    assert all(material.double_sided for material in by_name.values())
    assert scene.sky is None


def test_groups_where_there_are_no_objects(tmp_path: Path):
    scene = _load(tmp_path, SQUARE + "g one\nf 1 2 3\ng two\nf 1 3 4\n")
    assert [mesh.name for mesh in scene.meshes] == ["one", "two"]
    assert [len(mesh.vertices) for mesh in scene.meshes] == [3, 3]


def test_textures(tmp_path: Path):
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "Two Rows.PNG").write_bytes(png(np.array([[(9, 8, 7)], [(1, 2, 3)]], np.uint8)))
    mtl = "newmtl m\nmap_Kd -s 1 1 1 -bm 0.5 maps\\two rows.png\nmap_Ke -clamp on maps/Two Rows.PNG\nKe 2 2 2\n"
    text = SQUARE + "vt 0 0\nvt 1 0\nvt 1 0.75\nusemtl m\nf 1/1 2/2 3/3\nf 1 3 4\n"
    scene = _load(tmp_path, text, mtl)
    material = scene.materials[scene.meshes[0].materials[0]]
    assert (material.base_texture, material.emission_texture) == (0, 0)
    assert material.base_color == (1.0, 1.0, 1.0)
    assert scene.textures[0].pixels[:, 0].tolist() == [[1, 2, 3], [9, 8, 7]]  # bottom row first
    mesh = scene.meshes[0]
    assert mesh.uvs is not None
    np.testing.assert_array_equal(mesh.uvs[mesh.faces], [[(0, 0), (1, 0), (1, 0.75)], [(0, 0)] * 3])
    assert any("moved or scaled texture" in notice for notice in scene.notices)


def test_missing_libraries_and_materials_are_grey_and_named(tmp_path: Path):
    scene = _load(tmp_path, "mtllib gone.mtl\n" + SQUARE + "usemtl brick\nf 1 2 3 4\n")
    assert scene.materials[scene.meshes[0].materials[0]].base_color == (0.8, 0.8, 0.8)
    assert any("gone.mtl is not beside a.obj" in notice for notice in scene.notices)
    assert any("'brick'" in notice for notice in scene.notices)


def test_several_libraries_and_a_name_with_spaces(tmp_path: Path):
    (tmp_path / "my colours.mtl").write_text("newmtl a\nKd 0.1 0.1 0.1\n")
    (tmp_path / "b.mtl").write_text("newmtl b\nKd 0.2\n")
    (tmp_path / "c.mtl").write_text("newmtl c\n")
    text = "mtllib my colours.mtl\nmtllib b.mtl c.mtl\n" + SQUARE
    scene = _load(tmp_path, text + "usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\nusemtl c\nf 1 2 4\n")
    colors = [scene.materials[m].base_color[2] for m in scene.meshes[0].materials]
    assert colors == [0.1, 0.2, 0.8]


def test_simplifications_are_named(tmp_path: Path):
    mtl = "newmtl m\nKd 2 1 1\nKs 0.5 0.5 0.5\nillum 2\nd 0.5\nbump b.png\n"
    text = SQUARE.replace("\n", " 1 0 0\n") + "usemtl m\nf 1 2 3 4\nf 1 2\n"
    scene = _load(tmp_path, text, mtl)
    for words in ("1 glossy", "1 transparent", "bump", "Kd above 1", "vertex colours", "1 face with fewer than three"):
        assert any(words in notice for notice in scene.notices), words
    assert scene.materials[scene.meshes[0].materials[0]].base_color == (1.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (SQUARE + "f 1 2 9\n", "line 5: vertex 9 is not among the 4"),
        (SQUARE + "f 1 2 -5\n", "line 5: vertex -5"),
        (SQUARE + "f 0 1 2\n", "line 5: indices start at 1"),
        (SQUARE + "vt 0 0\nf 1/1 2/2 3/1\n", "line 6: texture coordinate 2"),
        (SQUARE + "f 1//1 2//1 3//1\n", "line 5: normal 1 is not among the 0"),
        (SQUARE + "f 1/1 2/2 3\n", "line 5: its corners are not written alike"),
        (SQUARE + "f 1 2 3\nf 1 two 3\n", "line 6: cannot be understood: 'f 1 two 3'"),
        (SQUARE + "f 1.5 2 3\n", "line 5: cannot be understood"),
        ("v 1 2\n" + SQUARE + "f 1 2 3\n", "line 1: 3 numbers are needed"),
        ("v 1 2\nv 3 4\n", "line 1: 3 numbers are needed"),
        ("v 1 2 three\n" + SQUARE, "line 1: cannot be understood"),
        ("v 1 2 three\nv 0 0 0 0\n" + SQUARE, "line 1: cannot be understood"),
        ("v 1 nan 3\nv inf 0 0\n" + SQUARE + "f 3 4 5\n", "2 of 6 vertices are NaN or infinite"),
        ("v 1e13 0 0\n" + SQUARE + "f 3 4 5\n", "absurd"),
        (SQUARE, "no triangle"),
        ("\x00\x01\x02 rubbish", "no triangle"),
    ],
)
def test_errors(tmp_path: Path, text: str, expected: str):
    assert expected in _message(tmp_path, text)


@pytest.mark.parametrize(
    ("mtl", "expected"),
    [
        ("newmtl m\nKd red\n", "a.mtl, line 2: 'red' is not a list of numbers"),
        ("newmtl m\nKd spectral wood.rfl\n", "line 2"),
        ("newmtl m\nKe nan 0 0\n", "line 2"),
        ("newmtl wood\nmap_Kd planks.jpg\n", "texture planks.jpg of material 'wood'"),
    ],
)
def test_library_errors(tmp_path: Path, mtl: str, expected: str):
    name = mtl.split()[1]
    assert expected in _message(tmp_path, SQUARE + f"usemtl {name}\nf 1 2 3\n", mtl)


def test_the_well_known_cornell_box_layout(tmp_path: Path):
    """Tabs behind v, relative quads after each group, light in Ke: 18 of 36 triangles are lost by a careless reader."""
    boxes = []
    for k in range(9):
        corners = [(k, 0, 0), (k + 0.5, 0, 0), (k + 0.5, 1, 0), (k, 1, 0)]
        faces = "f -4 -3 -2 -1\n" * 2
        boxes.append(f"g part{k}\n" + "".join(f"v\t{x}  {y}  {z}\n" for x, y, z in corners) + f"usemtl m{k}\n" + faces)
    mtl = "".join(f"newmtl m{k}\n\tKd 0.{k}\t0.5 0.5\n" + ("\tKe 17 12 4\n" if k == 8 else "") for k in range(9))
    scene = _load(tmp_path, "\n".join(boxes), mtl)
    assert scene.triangle_count == 36
    assert not any("area" in notice for notice in scene.notices)
    np.testing.assert_array_equal(np.stack(scene.bounds()), [(0, 0, 0), (8.5, 1, 0)])
    assert [scene.materials[m.materials[0]].emits for m in scene.meshes] == [False] * 8 + [True]
