"""The built-in scenes: sound geometry, materials, motions and cameras."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import assets
from assets.far import OFFSET
from assets.metals import ROUGHNESS
from assets.sets import FLIGHT
from errors import UserError
from raytrace.camera import Camera
from raytrace.scene import F64, Mesh, Scene

STUDIES = ("metals", "penumbra", "thin", "mirrorish", "hard")
"""Small scenes, each for one difficulty of the filters."""
BUILT = ("cornell", "interior", *STUDIES)
"""All but ``far``, which is the interior elsewhere and has a test of its own."""
CYCLES = {"cornell": 2.0, "interior": 12.0, **dict.fromkeys(STUDIES, 4.0)}  # seconds until all that moves is back
FLIGHTS = {"cornell": 4.0, "interior": 8.0, **dict.fromkeys(STUDIES, FLIGHT)}
ROOM = np.array([[-3.0, 0.0, -2.5], [3.0, 2.8, 2.5]])


@pytest.fixture(scope="module")
def scenes() -> dict[tuple[str, bool], Scene]:
    """Every built-in scene but ``far``, still and animated."""
    return {(name, animate): assets.build(name, animate) for name in BUILT for animate in (False, True)}


@pytest.fixture(params=[(name, animate) for name in BUILT for animate in (False, True)], ids=str)
def scene(request: pytest.FixtureRequest, scenes: dict[tuple[str, bool], Scene]) -> Scene:
    return scenes[request.param]


@pytest.fixture
def interior(scenes: dict[tuple[str, bool], Scene]) -> Scene:
    return scenes["interior", False]


def corners(mesh: Mesh, time: float = 0.0) -> F64:
    """(F, 3, 3) world-space corners of a mesh's triangles."""
    points = mesh.vertices
    if mesh.motion is not None:
        matrix = mesh.motion(time)
        points = points @ matrix[:3, :3].T + matrix[:3, 3]
    return points[mesh.faces]


def emitting(scene: Scene, mesh: Mesh) -> NDArray[np.bool_]:
    """(F,): which triangles emit."""
    return np.array([material.emits for material in scene.materials])[mesh.materials]


def test_registry_lists_the_scenes() -> None:
    assert tuple(assets.SCENES) == (*BUILT, "far")
    assert all(info.name == name and info.description for name, info in assets.SCENES.items())


def test_unknown_name_tells_the_known_ones_and_the_nearest() -> None:
    with pytest.raises(UserError, match=r"(?s)'interier'.*did you mean 'interior'.*cornell, interior"):
        assets.build("interier")


def test_arrays_keep_the_contract(scene: Scene) -> None:
    names = [mesh.name for mesh in scene.meshes]
    assert len(set(names)) == len(names)
    for mesh in scene.meshes:
        count = len(mesh.vertices)
        assert mesh.normals is not None
        assert mesh.uvs is not None
        assert mesh.vertices.shape == (count, 3)
        assert mesh.vertices.dtype == np.float64
        assert mesh.normals.shape == (count, 3)
        assert mesh.normals.dtype == np.float32
        assert mesh.uvs.shape == (count, 2)
        assert mesh.uvs.dtype == np.float32
        assert mesh.faces.dtype == np.int32
        assert mesh.materials.dtype == np.int32
        assert mesh.materials.shape == (len(mesh.faces),)
        assert mesh.faces.min() == 0, mesh.name
        assert mesh.faces.max() == count - 1, mesh.name
        assert np.isfinite(mesh.vertices).all()
        assert np.isfinite(mesh.uvs).all()
        assert np.abs(np.linalg.norm(mesh.normals, axis=1) - 1.0).max() < 1e-5, mesh.name


def test_materials_and_textures_are_valid_and_used(scene: Scene) -> None:
    used = set(np.concatenate([mesh.materials for mesh in scene.meshes]).tolist())
    assert used == set(range(len(scene.materials)))
    textures = {material.base_texture for material in scene.materials} - {-1}
    assert textures == set(range(len(scene.textures)))
    for material in scene.materials:
        assert all(0.0 <= channel <= 1.0 for channel in material.base_color), material.name
        assert material.emission_texture == -1
    for texture in scene.textures:
        assert texture.pixels.dtype == np.uint8
        assert texture.pixels.ndim == 3
        assert texture.pixels.shape[2] == 3
        assert 256 <= min(texture.pixels.shape[:2]) <= max(texture.pixels.shape[:2]) <= 1024
        assert texture.pixels.std() > 1.0, f"{texture.name} shows nothing"


def test_no_triangle_is_degenerate_in_single_precision(scene: Scene) -> None:
    for mesh in scene.meshes:
        points = (corners(mesh) - scene.origin).astype(np.float32).astype(np.float64)
        edges = np.roll(points, -1, axis=1) - points
        height = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / np.linalg.norm(edges, axis=2).max(1)
        assert height.min() > 2e-5, f"{mesh.name}: triangle of height {height.min():.2g}"


def test_shading_normals_are_on_the_front_side(scene: Scene) -> None:
    for mesh in scene.meshes:
        assert mesh.normals is not None
        points = mesh.vertices[mesh.faces]
        normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        cosines = np.einsum("fj,fkj->fk", normals, mesh.normals[mesh.faces].astype(np.float64))
        assert cosines.min() > 0.3, mesh.name


def test_objects_of_the_interior_are_closed_and_face_outwards(interior: Scene) -> None:
    """Every directed edge has its opposite. The walls, floor and ceiling face inwards, towards the whole room."""
    for mesh in interior.meshes:
        sign = -1.0 if mesh.name == "shell" else 1.0
        _, welded = np.unique(np.round(mesh.vertices, 7), axis=0, return_inverse=True)
        solid = welded.reshape(-1)[mesh.faces].astype(np.int64)
        edges = np.stack([solid, np.roll(solid, -1, axis=1)], axis=-1).reshape(-1, 2)
        there = np.sort(edges[:, 0] * (1 << 32) + edges[:, 1])
        back = np.sort(edges[:, 1] * (1 << 32) + edges[:, 0])
        assert np.array_equal(there, back), f"{mesh.name} has a hole"
        a, b, c = (mesh.vertices[mesh.faces[:, k]] - mesh.vertices.mean(0) for k in range(3))
        assert sign * np.sum(a * np.cross(b, c)) > 0.0, f"{mesh.name} is inside out"


def test_interior_is_as_large_as_promised(interior: Scene) -> None:
    assert 100_000 <= interior.triangle_count <= 165_000
    lower, upper = interior.bounds()
    assert (lower > ROOM[0] - 0.06).all()
    assert (upper < ROOM[1] + 0.06).all()


def test_nothing_but_the_structure_reaches_through_the_walls(interior: Scene) -> None:
    for mesh in interior.meshes:
        points = corners(mesh).reshape(-1, 3)
        assert (points >= ROOM[0] - 0.0501).all(), mesh.name
        assert (points <= ROOM[1] + 0.0501).all(), mesh.name


def test_interior_has_several_lights_of_few_triangles(interior: Scene) -> None:
    lights = {mesh.name: int(emitting(interior, mesh).sum()) for mesh in interior.meshes}
    lights = {name: count for name, count in lights.items() if count}
    assert {"hanging lamp", "standing lamp", "table lamp", "fire irons", "ceiling lamp 1"} <= set(lights)
    assert 4 <= len(lights) <= 8
    assert sum(lights.values()) < 500


def coplanar_overlaps(triangles: F64) -> list[tuple[int, int]]:
    """Pairs of axis-aligned triangles (n, 3, 3) that lie in one plane and overlap by more than 20 micrometres."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    axes = np.abs(normals).argmax(1)
    aligned = np.abs(normals).max(1) > 0.99999 * np.linalg.norm(normals, axis=1)
    found = []
    for axis in range(3):
        members = np.flatnonzero(aligned & (axes == axis))
        levels = triangles[members, :, axis].mean(1)
        order = np.argsort(levels)
        for group in np.split(members[order], np.flatnonzero(np.diff(levels[order]) > 1e-5) + 1):
            flat = np.delete(triangles[group], axis, axis=2)
            low, high = flat.min(1) + 1e-5, flat.max(1) - 1e-5
            first, second = np.nonzero(np.triu(((low[:, None] < high) & (low < high[:, None])).all(2), 1))
            a, b = flat[first], flat[second]
            apart = np.zeros(len(a), dtype=bool)
            for edges in (np.roll(a, -1, axis=1) - a, np.roll(b, -1, axis=1) - b):  # separating axis theorem
                across = np.stack([-edges[..., 1], edges[..., 0]], axis=-1)
                across /= np.linalg.norm(across, axis=2, keepdims=True)
                on_a, on_b = a @ across.swapaxes(1, 2), b @ across.swapaxes(1, 2)  # (pairs, corners, edges)
                gap = np.maximum(on_a.min(1) - on_b.max(1), on_b.min(1) - on_a.max(1))
                apart |= (gap > -2e-5).any(1)
            found += [(int(group[i]), int(group[j])) for i, j in zip(first[~apart], second[~apart], strict=True)]
    return found


def test_overlap_finder_finds_an_overlap_and_no_more() -> None:
    floor = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0]], dtype=np.float64)
    neighbour = np.array([[1, 0, 0], [0, 0, 1], [1, 0, 1]], dtype=np.float64)
    raised = floor + np.array([0.0, 0.001, 0.0])
    shifted = floor + np.array([0.5, 0.0, 0.0])
    assert coplanar_overlaps(np.stack([floor, neighbour, raised])) == []
    assert coplanar_overlaps(np.stack([floor, raised, shifted])) == [(0, 2)]


@pytest.mark.parametrize("name", BUILT)
def test_no_two_faces_lie_in_one_plane_and_overlap(name: str, scenes: dict[tuple[str, bool], Scene]) -> None:
    """No z-fighting. Faces sunk behind the walls, which nobody can see, may coincide."""
    scene = scenes[name, False]
    triangles = np.concatenate([corners(mesh) for mesh in scene.meshes])
    owners = np.repeat([mesh.name for mesh in scene.meshes], [len(mesh.faces) for mesh in scene.meshes])
    if name == "interior":
        behind = ((triangles < ROOM[0] - 1e-6).all(1) | (triangles > ROOM[1] + 1e-6).all(1)).any(1)
        triangles, owners = triangles[~behind], owners[~behind]
    pairs = {(str(owners[i]), str(owners[j])) for i, j in coplanar_overlaps(triangles)}
    assert pairs == set()


def test_cornell_is_the_published_box(scenes: dict[tuple[str, bool], Scene]) -> None:
    scene = scenes["cornell", False]
    lower, upper = scene.bounds()
    assert lower == pytest.approx(0.0)
    assert upper == pytest.approx([5.56, 5.488, 5.592])
    assert [len(mesh.faces) for mesh in scene.meshes] == [10, 10, 10, 2]
    block = next(mesh for mesh in scene.meshes if mesh.name == "tall block")
    top = np.unique(np.round(block.vertices[block.vertices[:, 1] > 3.0], 9), axis=0)
    assert top.tolist() == [[2.65, 3.3, 2.96], [3.14, 3.3, 4.56], [4.23, 3.3, 2.47], [4.72, 3.3, 4.06]]


def test_cornell_lamp_hangs_below_the_ceiling_and_shines_down(scenes: dict[tuple[str, bool], Scene]) -> None:
    scene = scenes["cornell", False]
    lamps = [mesh for mesh in scene.meshes if emitting(scene, mesh).any()]
    assert [lamp.name for lamp in lamps] == ["lamp"]
    material = scene.materials[int(lamps[0].materials[0])]
    assert material.emission == (17.0, 12.0, 4.0)
    assert not material.double_sided
    points = corners(lamps[0])
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    assert (normals[:, 1] < 0.0).all()
    assert 5.45 < points[..., 1].min() <= points[..., 1].max() < 5.487
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(1.3 * 1.05)


@pytest.mark.parametrize("name", BUILT)
def test_motions_are_rigid_continuous_and_periodic(name: str, scenes: dict[tuple[str, bool], Scene]) -> None:
    moving = [mesh for mesh in scenes[name, True].meshes if mesh.motion is not None]
    assert moving
    for mesh in moving:
        assert mesh.motion is not None
        start = mesh.motion(0.0)
        assert np.array_equal(mesh.motion(CYCLES[name]), start), mesh.name
        travelled, before = 0.0, corners(mesh)
        for frame in range(1, round(CYCLES[name] * 30) + 1):
            matrix = mesh.motion(frame / 30)
            assert matrix.shape == (4, 4)
            assert matrix[:3, :3] @ matrix[:3, :3].T == pytest.approx(np.eye(3), abs=1e-12)
            assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0)
            assert matrix[3].tolist() == [0.0, 0.0, 0.0, 1.0]
            if frame % 10 == 0:
                now = corners(mesh, frame / 30)
                travelled = max(travelled, float(np.linalg.norm(now - corners(mesh), axis=2).max()))
                assert np.linalg.norm(now - before, axis=2).max() < 1.0, f"{mesh.name} jumps"
                before = now
        assert travelled > 0.05, f"{mesh.name} stands still"


def test_a_light_and_an_object_move_in_each_scene(scenes: dict[tuple[str, bool], Scene]) -> None:
    for name in BUILT:
        scene = scenes[name, True]
        shining = [emitting(scene, mesh).any() for mesh in scene.meshes if mesh.motion is not None]
        assert any(shining)
        assert not all(shining)


@pytest.mark.parametrize("name", BUILT)
def test_still_scene_is_the_animated_one_at_time_zero(name: str, scenes: dict[tuple[str, bool], Scene]) -> None:
    still, animated = scenes[name, False], scenes[name, True]
    assert not still.has_motion
    for a, b in zip(still.meshes, animated.meshes, strict=True):
        assert a.name == b.name
        assert np.array_equal(a.faces, b.faces)
        assert np.abs(corners(a) - corners(b)).max() < 1e-12
        assert a.normals is not None
        assert b.normals is not None
        turn = np.eye(3) if b.motion is None else b.motion(0.0)[:3, :3]
        assert np.abs(a.normals - b.normals @ turn.T).max() < 1e-6


def flight_of(scene: Scene, name: str) -> Iterator[Camera]:
    assert scene.flight is not None
    for frame in range(round(FLIGHTS[name] * 30)):
        yield scene.flight(frame / 30)


@pytest.mark.parametrize("name", BUILT)
def test_flight_is_smooth_and_closes(name: str, scenes: dict[tuple[str, bool], Scene]) -> None:
    scene = scenes[name, False]
    assert scene.flight is not None
    assert scene.flight(0.0) == scene.flight(FLIGHTS[name])
    cameras = [*flight_of(scene, name), scene.flight(0.0)]
    places = np.array([camera.position for camera in cameras])
    views = np.array([camera.forward for camera in cameras])
    assert np.linalg.norm(views, axis=1) == pytest.approx(1.0)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    turns = np.degrees(np.linalg.norm(np.diff(views, axis=0), axis=1))
    size = 5.5 if name == "cornell" else 2.8
    assert 0.001 * size < steps.min()
    assert steps.max() < 0.03 * size
    assert turns.max() < 1.2  # degrees per frame
    assert np.linalg.norm(np.diff(places, 2, axis=0), axis=1).max() < 0.2 * steps.max()


def test_cornell_flight_looks_into_the_box_between_its_walls(scenes: dict[tuple[str, bool], Scene]) -> None:
    scene = scenes["cornell", False]
    assert scene.camera.position == (2.78, 2.73, -8.0)
    assert math.degrees(scene.camera.yfov) == pytest.approx(39.3)
    for camera in [scene.camera, *flight_of(scene, "cornell")]:
        x, y, z = camera.position
        assert 0.5 < x < 5.0
        assert 0.5 < y < 5.0
        assert z < -1.0
        assert camera.forward[2] > 0.9


def test_interior_flight_keeps_clear_of_everything(interior: Scene) -> None:
    points = np.concatenate([corners(mesh).reshape(-1, 3) for mesh in interior.meshes])
    points = np.unique(np.round(points, 2), axis=0)
    for camera in [interior.camera, *list(flight_of(interior, "interior"))[::10]]:
        place = np.array(camera.position)
        assert (place > ROOM[0] + 0.4).all()
        assert (place < ROOM[1] - 0.4).all()
        assert 1.3 < place[1] < 1.7, "eye height"
        assert np.linalg.norm(points - place, axis=1).min() > 0.35


def test_two_builds_are_equal_to_the_bit(scenes: dict[tuple[str, bool], Scene]) -> None:
    for (name, animate), first in scenes.items():
        second = assets.build(name, animate)
        assert first.materials == second.materials
        assert first.camera == second.camera
        for a, b in zip(first.meshes, second.meshes, strict=True):
            for field in ("vertices", "faces", "normals", "uvs", "materials"):
                assert np.array_equal(getattr(a, field), getattr(b, field)), f"{a.name}.{field}"
        for x, y in zip(first.textures, second.textures, strict=True):
            assert np.array_equal(x.pixels, y.pixels), x.name


def test_far_is_the_interior_elsewhere() -> None:
    home, away = assets.build("interior", True), assets.build("far", True)
    assert away.name == "far"
    assert away.materials == home.materials
    for a, b in zip(home.meshes, away.meshes, strict=True):
        assert (a.faces is b.faces) or np.array_equal(a.faces, b.faces)
        np.testing.assert_allclose(corners(b, 0.7)[:9], corners(a, 0.7)[:9] + OFFSET, rtol=0, atol=1e-9)
    assert home.flight is not None
    assert away.flight is not None
    for near, far in ((home.camera, away.camera), (home.flight(1.3), away.flight(1.3))):
        np.testing.assert_allclose(np.array(far.position) - OFFSET, near.position, rtol=0, atol=1e-9)
        assert far.forward == near.forward


def test_metals_have_a_ramp_of_roughness(scenes: dict[tuple[str, bool], Scene]) -> None:
    glossy = [material for material in scenes["metals", False].materials if material.specular]
    assert [material.roughness for material in glossy] == 3 * list(ROUGHNESS)
    assert {material.metallic for material in glossy} == {0.0, 1.0}


def test_the_lamp_of_hard_is_tiny_and_hidden_from_what_the_camera_sees(scenes: dict[tuple[str, bool], Scene]) -> None:
    """Its shade lets it shine at the wall on the right only: the rest of the room has no line of sight to it."""
    scene = scenes["hard", False]
    shining = np.concatenate([corners(mesh)[emitting(scene, mesh)] for mesh in scene.meshes])
    assert np.ptp(shining.reshape(-1, 3), axis=0).max() < 0.05
    assert max(max(material.emission) for material in scene.materials) == 1e4
    assert {0.97, 0.012} <= {material.base_color[0] for material in scene.materials}
    cross = np.cross(shining[:, 1] - shining[:, 0], shining[:, 2] - shining[:, 0])
    assert (cross[:, 0] > 0.99 * np.linalg.norm(cross, axis=1)).all(), "towards the wall"


def test_the_readme_of_the_scenes_counts_their_triangles(scenes: dict[tuple[str, bool], Scene]) -> None:
    text = Path(assets.__file__).with_name("README.md").read_text()
    for name in BUILT:
        assert f"| `{name}` | {scenes[name, False].triangle_count:,} |" in text
    assert f"| `far` | {scenes['interior', False].triangle_count:,} |" in text
