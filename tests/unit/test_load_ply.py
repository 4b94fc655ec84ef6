"""PLY, ASCII and binary."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from errors import UserError
from raytrace.load import load_scene
from raytrace.scene import Scene
from tests.unit.gltf_files import png

CORNERS = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
XYZ, NORMAL, UV = ("x", "y", "z"), ("nx", "ny", "nz"), ("s", "t")


def _ply(
    vertices: Sequence[tuple[float, ...]],
    faces: list[list[int]],
    properties: tuple[str, ...] = XYZ,
    kind: str = "ascii",
    comment: str = "",
) -> bytes:
    header = f"ply\nformat {kind} 1.0\n{comment}element vertex {len(vertices)}\n"
    header += "".join(f"property float {name}\n" for name in properties)
    header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    if kind == "ascii":
        rows = [list(map(str, v)) for v in vertices] + [list(map(str, (len(f), *f))) for f in faces]
        return (header + "".join(" ".join(row) + "\n" for row in rows)).encode()
    order = "<" if "little" in kind else ">"
    body = b"".join(struct.pack(f"{order}{len(v)}f", *v) for v in vertices)
    return header.encode() + body + b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in faces)


def _load(tmp_path: Path, data: bytes) -> Scene:
    (tmp_path / "a.ply").write_bytes(data)
    return load_scene(tmp_path / "a.ply")


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("faces", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3]]])
def test_positions_only(tmp_path: Path, kind: str, faces: list[list[int]]):
    scene = _load(tmp_path, _ply(CORNERS, faces, kind=kind))
    mesh = scene.meshes[0]
    assert mesh.name == "a"
    assert mesh.normals is None
    assert mesh.uvs is None
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    np.testing.assert_allclose(np.cross(b - a, c - a), [(0, 0, 1)] * 2)
    assert scene.materials[0].double_sided
    assert scene.materials[0].base_color == (0.8, 0.8, 0.8)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_normals_and_texture_coordinates_together(tmp_path: Path, kind: str):
    (tmp_path / "Wood Grain.png").write_bytes(png(np.array([[(9, 9, 9)], [(1, 2, 3)]], np.uint8)))
    vertices = [(*p, 0.0, 0.0, 1.0, p[0], p[1] / 2) for p in CORNERS]
    data = _ply(vertices, [[0, 1, 2], [0, 2, 3]], XYZ + NORMAL + UV, kind, "comment TextureFile Wood Grain.png\n")
    scene = _load(tmp_path, data)
    mesh = scene.meshes[0]
    np.testing.assert_array_equal(mesh.normals, [(0, 0, 1)] * 4)
    assert mesh.uvs is not None
    np.testing.assert_array_equal(mesh.uvs, mesh.vertices[:, :2] * (1, 0.5))
    assert scene.textures[0].pixels[0, 0].tolist() == [1, 2, 3]
    assert scene.materials[0].base_color == (1.0, 1.0, 1.0)


def test_texture_coordinates_per_corner(tmp_path: Path):
    (tmp_path / "a.png").write_bytes(png(np.zeros((1, 1, 3), np.uint8)))
    data = _ply(
        [(*p, 0.0, 0.0, 1.0) for p in CORNERS],
        [[0, 1, 2], [0, 2, 3]],
        XYZ + NORMAL,
        comment="comment TextureFile a.png\n",
    )
    text = data.decode().replace("end_header", "property list uchar float texcoord\nend_header").splitlines()
    text[-2] += " 6 0 0 1 0 1 1"
    text[-1] += " 6 0.5 0.5 0 1 1 0"
    mesh = _load(tmp_path, ("\n".join(text) + "\n").encode()).meshes[0]
    assert mesh.uvs is not None
    assert mesh.normals is not None
    np.testing.assert_array_equal(mesh.uvs[mesh.faces], [[(0, 0), (1, 0), (1, 1)], [(0.5, 0.5), (0, 1), (1, 0)]])
    np.testing.assert_array_equal(mesh.vertices[mesh.faces][1], [CORNERS[k] for k in (0, 2, 3)])


def test_vertex_colours_are_named(tmp_path: Path):
    data = _ply([(*p, 1.0, 0.0, 0.0) for p in CORNERS], [[0, 1, 2]], (*XYZ, "red", "green", "blue"))
    assert any("colours left out" in notice for notice in _load(tmp_path, data).notices)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"obj\n", "not a PLY file"),
        (b"ply\nformat ascii 1.0\n", "cannot read"),
        (_ply(CORNERS, []), "no faces"),
        (_ply(CORNERS, [[0, 1, 2], [0, 2, 3]]).rsplit(b"3 0", 1)[0], "truncated: 1 of 2 entries of 'face'"),
        (_ply(CORNERS, [[0, 1, 2]], kind="binary_little_endian")[:-2], "cannot read"),
        (_ply(CORNERS, [[0, 1, 2], [0, 1, 2, 3]], kind="binary_little_endian"), "triangles only"),
        (_ply(CORNERS, [[0, 1, 7]]), "uses vertex 7, but there are 4"),
        (_ply([*CORNERS[:3], (float("nan"), 0.0, 0.0)], [[0, 1, 3]]), "1 of 3 vertices is NaN"),
        (_ply(CORNERS, [[0, 1, 1]]), "no triangle"),
        (_ply(CORNERS, [[0, 1, 2]], comment="comment TextureFile gone.png\n"), "texture gone.png is not there"),
    ],
)
def test_errors(tmp_path: Path, data: bytes, expected: str):
    with pytest.raises(UserError) as caught:
        _load(tmp_path, data)
    assert expected in str(caught.value)
    assert str(tmp_path / "a.ply") in str(caught.value)
