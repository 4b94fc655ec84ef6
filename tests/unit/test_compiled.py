"""A scene as the kernels read it: order, origin, records, lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from errors import UserError
from raytrace.camera import Camera
from raytrace.compiled import LIGHT, MATERIAL, OBJECT, CompiledScene, compile_scene
from raytrace.sampling import build_alias
from raytrace.scene import Material, Mesh, Scene, Texture
from tests.tracer.scenes import box, mesh, ordered_triangles, quad, rigid, sphere

CAMERA = Camera.look_at((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
GREY = Material("grey", (0.5, 0.4, 0.3))
LAMP = Material("lamp", (0.1, 0.1, 0.1), emission=(1.0, 1.0, 1.0))
FLOOR = quad((-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2))


def compiled(
    meshes: Sequence[Mesh],
    materials: Sequence[Material] = (GREY, LAMP),
    sky: tuple[float, float, float] | None = None,
    textures: Sequence[Texture] = (),
) -> CompiledScene:
    return compile_scene(Scene("test", tuple(meshes), tuple(materials), CAMERA, tuple(textures), sky))


def square(side: float, x: float = 0.0) -> np.ndarray:
    """A square of ``side`` at height 1 that faces down."""
    return quad((x, 1, 0), (x + side, 1, 0), (x + side, 1, side), (x, 1, side))


def test_what_moves_comes_last_and_objects_follow_that_order() -> None:
    still, turning = rigid((0, 1, 0), 0.0, (0, 0, 0)), rigid((0, 1, 0), 1.0, (0, 0, 0))
    meshes = [
        mesh("a", FLOOR, 1, motion=turning),
        mesh("b", box((0, 0, 0), (1, 1, 1)), 0),
        mesh("c", FLOOR + 3, 1, motion=still),
        mesh("d", FLOOR - 3, 0),
    ]
    scene = compiled(meshes)
    assert scene.static_count == 14
    np.testing.assert_array_equal(scene.triangle_info[:, OBJECT], np.repeat([0, 1, 2, 3], [12, 2, 2, 2]))
    np.testing.assert_array_equal(scene.triangle_info[:, MATERIAL], np.repeat([0, 0, 1, 1], [12, 2, 2, 2]))
    expected = ordered_triangles(scene.scene).reshape(-1, 9) - np.tile(scene.origin, 3)
    np.testing.assert_allclose(scene.triangles[:, :9], expected, atol=1e-6)
    assert len(scene.prev_triangles) == 4
    assert scene.has_motion
    assert not compiled(meshes[1:2]).has_motion


def test_the_origin_is_subtracted_before_anything_is_rounded() -> None:
    here = compiled([mesh("ball", sphere(0.5, (0.25, 0.5, -1.0)))])
    there = compiled([mesh("ball", sphere(0.5, (0.25, 0.5, -1.0)) + np.array([2.0**30, -(2.0**31), 2.0**29]))])
    np.testing.assert_allclose(there.triangles, here.triangles, atol=1e-6)
    np.testing.assert_allclose(there.origin - here.origin, (2.0**30, -(2.0**31), 2.0**29), rtol=1e-12)
    assert np.abs(here.triangles[:, :9]).max() <= 0.5 + 1e-6


def test_moving_triangles_are_written_for_both_times_and_static_ones_stay() -> None:
    motion = rigid((1.0, 2.0, 0.5), 1.3, (0.2, -0.4, 0.1))
    ball = sphere(0.5)
    scene = compiled([mesh("floor", FLOOR), mesh("ball", ball, motion=motion, normals=ball / 0.5)])
    static = scene.triangles[:2].copy()
    for now, previous in ((0.7, 0.3), (0.7, 0.7), (-1.0, 2.0)):
        scene.move_to(now, previous)
        np.testing.assert_array_equal(scene.triangles[:2], static)
        for time, records in ((now, scene.triangles[2:]), (previous, scene.prev_triangles)):
            matrix = motion(time)
            corners = ball @ matrix[:3, :3].T + matrix[:3, 3] - scene.origin
            np.testing.assert_allclose(records[:, :9], corners.reshape(-1, 9), atol=1e-6)
            np.testing.assert_allclose(records[:, 9:18], (ball / 0.5 @ matrix[:3, :3].T).reshape(-1, 9), atol=1e-6)
        lower, upper = scene.moving_box()
        assert (lower < scene.triangles[2:, :9].reshape(-1, 3).min(0)).all()
        assert (upper > scene.triangles[2:, :9].reshape(-1, 3).max(0)).all()
    scene.move_to(0.4, 0.4)
    np.testing.assert_array_equal(scene.triangles[2:], scene.prev_triangles)


def test_without_normals_a_triangle_is_flat() -> None:
    scene = compiled([mesh("box", box((0, 0, 0), (1, 2, 3)))])
    p = scene.triangles[:, :9].reshape(-1, 3, 3).astype(np.float64)
    face = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    np.testing.assert_allclose(
        scene.triangles[:, 9:18].reshape(-1, 3, 3), np.repeat(face[:, None], 3, axis=1), atol=1e-6
    )
    outward = p.mean(1)
    assert ((face * outward).sum(1) > 0).all()


def test_a_triangle_without_area_has_numbers_all_the_same() -> None:
    scene = compiled(
        [mesh("floor", FLOOR), mesh("line", np.array([[(0, 0, 0), (1, 1, 1), (2, 2, 2)], [(1, 1, 1)] * 3]), 1)]
    )
    assert np.isfinite(scene.triangles).all()
    assert len(scene.lights.triangles) == 0
    assert (scene.triangle_info[:, LIGHT] == -1).all()


def test_a_scene_without_triangles_is_refused() -> None:
    with pytest.raises(UserError, match="no triangle"):
        compiled([])
    with pytest.raises(UserError, match="no triangle"):
        compiled([mesh("empty", np.zeros((0, 3, 3)))])


# -------------------------------------------------------------------------------------------------------------- lights


def test_lamps_are_chosen_in_proportion_to_their_power() -> None:
    """Power: area times luminance, twice for a lamp that shines on both sides."""
    materials = [
        GREY,
        Material("green", emission=(0.0, 2.0, 0.0)),
        Material("blue", emission=(0.0, 0.0, 5.0), double_sided=True),
        Material("off", emission=(0.0, 0.0, 0.0)),
    ]
    meshes = [
        mesh("off", square(9.0), 3),
        mesh("green", square(2.0, 10.0), 1),
        mesh("floor", FLOOR, 0),
        mesh("blue", square(1.0, 20.0), 2),
    ]
    scene = compiled(meshes, materials)
    lights = scene.lights
    np.testing.assert_array_equal(lights.triangles, [2, 3, 6, 7])
    power = np.array([2.0 * 2 * 0.7152] * 2 + [0.5 * 5 * 0.0722 * 2] * 2)
    np.testing.assert_allclose(lights.pdf, power / power.sum(), rtol=1e-6)
    assert not lights.has_sky
    np.testing.assert_array_equal(scene.triangle_info[:, LIGHT], [-1, -1, 0, 1, -1, -1, 2, 3])
    for expected, got in zip(build_alias(power)[:2], (lights.threshold, lights.alias), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-6)


def test_a_scene_may_have_no_light_at_all() -> None:
    lights = compiled([mesh("floor", FLOOR)]).lights
    assert len(lights.pdf) == len(lights.triangles) == len(lights.threshold) == 0
    assert not lights.has_sky


def test_the_sky_is_the_last_light_and_takes_no_more_than_half() -> None:
    alone = compiled([mesh("floor", FLOOR)], sky=(0.1, 0.2, 0.3)).lights
    np.testing.assert_array_equal(alone.pdf, [1.0])
    np.testing.assert_allclose(alone.sky, (0.1, 0.2, 0.3))
    meshes = [mesh("floor", FLOOR), mesh("lamp", square(1.0), 1)]
    bright = compiled(meshes, sky=(1e4, 1e4, 1e4)).lights
    np.testing.assert_allclose(bright.pdf, [0.25, 0.25, 0.5], rtol=1e-6)
    dim = compiled(meshes, sky=(1e-3, 1e-3, 1e-3)).lights
    assert 0.0 < dim.pdf[-1] < 0.1
    assert dim.pdf.sum() == pytest.approx(1.0)
    black = compiled(meshes, sky=(0.0, 0.0, 0.0)).lights
    assert not black.has_sky
    assert len(black.pdf) == 2


def glow(pixels: np.ndarray) -> Texture:
    return Texture("glow", np.repeat(pixels.astype(np.uint8)[..., None], 3, axis=2))


CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=np.float64)
SQUARE_UVS = np.stack([CORNERS[[0, 1, 2]], CORNERS[[0, 2, 3]]])


def textured_lamp(pixels: np.ndarray) -> CompiledScene:
    material = replace(LAMP, emission=(2.0, 2.0, 2.0), emission_texture=0)
    return compiled(
        [mesh("floor", FLOOR), mesh("lamp", square(2.0), 1, uvs=SQUARE_UVS)], [GREY, material], textures=[glow(pixels)]
    )


def test_textured_lamps_are_chosen_by_their_mean() -> None:
    """Left half black, right half white: of the square's two triangles the lower right one has three quarters of it."""
    pixels = np.zeros((64, 64))
    pixels[:, 32:] = 255
    lights = textured_lamp(pixels).lights
    np.testing.assert_array_equal(lights.triangles, [2, 3])
    np.testing.assert_allclose(lights.pdf, [0.75, 0.25], atol=0.02)


def test_what_is_black_all_over_is_no_light() -> None:
    assert len(textured_lamp(np.zeros((64, 64))).lights.triangles) == 0


@pytest.mark.parametrize("size", [16, 256, 1024])
def test_a_small_lamp_in_a_large_texture_is_not_overlooked(size: int) -> None:
    """One bright square of 1/64 of the edge, anywhere."""
    random = np.random.default_rng(size)
    for _ in range(20):
        pixels = np.zeros((size, size))
        width = max(1, size // 64)
        x, y = random.integers(0, size - width, 2)
        pixels[y : y + width, x : x + width] = 255
        assert len(textured_lamp(pixels).lights.triangles) >= 1, (x, y)


def test_uv_density_is_texture_per_length() -> None:
    """A square of side 2 with the whole texture on it: half a texture per unit; nothing where there are no uvs."""
    scene = textured_lamp(np.full((4, 4), 255))
    np.testing.assert_allclose(scene.uv_density, [0, 0, 0.5, 0.5], atol=1e-6)
    np.testing.assert_allclose(scene.triangle_uvs[2:].reshape(2, 3, 2), SQUARE_UVS)
    assert scene.has_textures
    plain = compiled([mesh("floor", FLOOR)])
    assert not plain.has_textures
    assert plain.triangle_uvs.shape == (1, 6)


def test_the_camera_stands_still_unless_it_flies() -> None:
    scene = compiled([mesh("floor", FLOOR)])
    assert scene.camera_at(3.0, moving=True) == CAMERA
    scene.scene = replace(scene.scene, flight=lambda time: replace(CAMERA, yfov=time))
    assert scene.camera_at(0.5, moving=True).yfov == 0.5
    assert scene.camera_at(0.5, moving=False) == CAMERA


# -------------------------------------------------------------------------------------------------------- machine code


def test_every_module_that_goes_into_machine_code_is_part_of_its_name() -> None:
    """Or a change of it would go on using what was compiled before."""
    import ast
    from pathlib import Path

    from raytrace import compilation

    folder = Path(compilation.__file__).parent
    needed = {"compilation"}
    for path in folder.glob("*.py"):
        names: dict[str, set[str]] = {}
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("raytrace."):
                names.setdefault(node.module.removeprefix("raytrace."), set()).update(
                    alias.name for alias in node.names
                )
        if "compilation" in names:
            # Functions are lower case and constants upper case: a class is not compiled in.
            needed |= {path.stem} | {
                module for module, used in names.items() if any(n.lower() == n or n.upper() == n for n in used)
            }
    assert needed == set(compilation.SOURCES)
