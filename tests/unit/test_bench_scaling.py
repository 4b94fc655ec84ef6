"""The tables of how the tracer's time grows: that they count what they say; no figures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import assets
from bench import features
from bench.scaling import Row, by_size, by_threads, by_triangles, medians, table, terrain


@pytest.mark.parametrize("count", [50, 1_000, 20_000])
def test_terrains_have_about_as_many_triangles_as_asked_for(count: int) -> None:
    scene = terrain(count)
    assert scene.triangle_count == pytest.approx(count, rel=0.1)
    for mesh in scene.meshes:
        assert mesh.normals is not None
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        facing = np.einsum("ij,ij->i", np.cross(b - a, c - a), mesh.normals[mesh.faces[:, 0]].astype(np.float64))
        assert (facing > 0.0).all(), mesh.name


def test_all_are_called_in_turn_and_the_first_two_calls_do_not_count() -> None:
    calls: list[tuple[str, int]] = []

    def note(name: str) -> Callable[[int], None]:
        return lambda index: calls.append((name, index))

    found = medians({name: note(name) for name in "ab"}, 2)
    assert calls == [(name, index) for index in range(4) for name in "ab"]
    assert all(processor >= 0.0 and 0.0 <= wall < 50.0 for wall, processor in found.values())


def test_rows_are_relative_to_what_they_say() -> None:
    scene = terrain(50)
    sizes = by_size(scene, ((16, 8), (32, 16)), repeats=1)
    assert [row.label for row in sizes] == ["16x8", "32x16"]
    assert sizes[0].relative == pytest.approx(sizes[0].processor / sizes[1].processor * 4)
    for rows in (by_threads(scene, (1, 2), (16, 8), repeats=1), by_triangles((50, 200), (16, 8), repeats=1)):
        assert rows[0].relative == 1.0
        assert rows[1].relative == pytest.approx(rows[1].processor / rows[0].processor)
    text = table("by size", [Row("16x8", 1.0, 2.0, 1.0), Row("32x16", 3.0, 4.0, 0.5)], "relative")
    assert text.splitlines() == [
        "by size",
        "           wall ms  processor  relative",
        "  16x8        1.00       2.00  1.000",
        "  32x16       3.00       4.00  0.500",
    ]


def test_features_are_measured_where_they_are_lacking(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(features, "FEATURES", {"sky": "a constant sky", "lamps": "lamps"})
    (cost,) = features.measure("cornell", (16, 16), rounds=1)
    assert cost.feature == "sky"
    assert cost.without > 0.0
    assert cost.saved == cost.unused - cost.without


def test_a_plain_scene_has_no_textures_but_those_that_cut_holes() -> None:
    scene = assets.build("thin")
    bare = features.plain(scene)
    for before, after in zip(scene.materials, bare.materials, strict=True):
        assert after == before if before.alpha_cutoff is not None else after.base_texture == -1
