"""Repairs of triangles and normals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from errors import Notices, UserError
from raytrace.load import load_scene
from raytrace.parts import Part, compacted, face_normals, normalized
from raytrace.repair import Repairs, repaired, without_area
from tests.unit.gltf_files import one_triangle

SQUARE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], dtype=np.float64)


def _part(faces: list[list[int]], **extra: np.ndarray) -> Part:
    return Part(extra.pop("vertices", SQUARE), np.array(faces), np.arange(len(faces)), **extra)


def test_triangles_without_area_go_with_their_materials():
    line = np.array([*SQUARE, (0.5, 0.5, 0.0), SQUARE[1]])
    faces = [[0, 1, 2], [0, 0, 1], [0, 4, 2], [1, 5, 3], [0, 2, 3]]  # good, an index twice, a line, a point twice, good
    repairs = Repairs()
    part = repaired(_part(faces, vertices=line), "x", repairs)
    assert repairs.degenerate == 3
    assert part.materials.tolist() == [0, 4]
    np.testing.assert_array_equal(part.vertices[part.faces], SQUARE[[[0, 1, 2], [0, 2, 3]]])


@pytest.mark.parametrize("scale", [1e-30, 1e-6, 1.0, 1e11])
def test_thin_but_real_triangles_stay_at_any_scale(scale: float):
    thin = np.array([(0, 0, 0), (1, 0, 0), (0.5, 1e-9, 0)]) * scale
    flat = np.array([(0, 0, 0), (1, 0, 0), (0.5, 1e-14, 0)]) * scale
    triangle = np.array([[0, 1, 2]])
    assert not without_area(thin, triangle).any()
    assert without_area(flat, triangle).all()
    np.testing.assert_allclose(face_normals(thin, triangle), [(0, 0, 1)], atol=1e-12)


def test_normals_are_brought_to_length_one_or_replaced(tmp_path: Path):
    normals = [(0, 0, 3.0), (0, 0, 0), (np.nan, 0, 1)]
    scene = load_scene(one_triangle(normals=normals).write_glb(tmp_path / "a.glb"))
    assert scene.meshes[0].normals is not None
    np.testing.assert_allclose(scene.meshes[0].normals, [(0, 0, 1)] * 3)
    assert "repaired: 1 normal brought to length 1" in scene.notices
    assert "repaired: 2 zero or NaN normals replaced by the triangle's own" in scene.notices


def test_nothing_to_repair_says_nothing():
    repairs, notices = Repairs(), Notices()
    normals = np.tile([0.0, 0.0, 1.004], (4, 1))  # as far off as a normal stored in bytes is
    part = repaired(_part([[0, 1, 2], [0, 2, 3]], normals=normals), "x", repairs)
    repairs.report(notices)
    assert notices.lines == []
    assert part.normals is not None
    np.testing.assert_allclose(part.normals, [(0, 0, 1)] * 4)


def test_extreme_normals_neither_over_nor_underflow():
    normals = np.array([(1e300, 1e300, 0), (1e-8, 0, 0), (0, -1e-300, 0), (0, 0, np.inf)])
    with np.errstate(all="raise"):
        part = repaired(_part([[0, 1, 2], [0, 2, 3]], normals=normals), "x", Repairs())
    assert part.normals is not None
    np.testing.assert_allclose(part.normals, [(0.5**0.5, 0.5**0.5, 0), (1, 0, 0), (0, 0, 1), (0, 0, 1)])


def test_unusable_texture_coordinates():
    repairs = Repairs()
    uvs = np.array([(0.5, 2.0), (np.nan, 0.0), (0.0, np.inf), (1e30, 0.0)])
    part = repaired(_part([[0, 1, 2], [0, 2, 3]], uvs=uvs), "x", repairs)
    assert repairs.texture_coordinates == 3
    np.testing.assert_array_equal(part.uvs, [(0.5, 2.0), (0, 0), (0, 0), (0, 0)])


@pytest.mark.parametrize(("index", "count"), [(4, "vertex 4"), (-1, "vertex -1")])
def test_indices_out_of_range(index: int, count: str):
    with pytest.raises(UserError, match=rf"lamp: .*{count}, but there are 4"):
        repaired(_part([[0, 1, index]]), "lamp", Repairs())


@pytest.mark.parametrize("extra", [0, 1000])
def test_compaction_keeps_the_triangles(extra: int):
    """Both ways it is done: marking all vertices, and sorting the few that are used."""
    vertices = np.concatenate([np.full((extra, 3), np.nan), SQUARE, np.full((extra, 3), np.nan)])
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + extra
    uvs = np.arange(len(vertices) * 2, dtype=float).reshape(-1, 2)
    part = compacted(Part(vertices, faces, np.zeros(2, dtype=np.int64), normals=vertices + 1, uvs=uvs))
    assert len(part.vertices) == 4
    np.testing.assert_array_equal(part.vertices[part.faces], vertices[faces])
    assert part.normals is not None
    np.testing.assert_array_equal(part.normals[part.faces], vertices[faces] + 1)
    assert part.uvs is not None
    np.testing.assert_array_equal(part.uvs[part.faces], uvs[faces])


def test_normalized_leaves_zero_alone():
    np.testing.assert_array_equal(normalized(np.array([(0.0, 0.0, 0.0), (0.0, -5.0, 0.0)])), [(0, 0, 0), (0, -1, 0)])
