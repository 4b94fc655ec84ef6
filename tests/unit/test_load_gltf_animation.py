"""Animations of glTF files: keyframes of every interpolation, what they move, and what is wrong with broken ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from errors import UserError
from raytrace.compiled import compile_scene
from raytrace.load import load_scene
from raytrace.punctual import DIRECTION, POSITION
from raytrace.scene import Scene
from tests.unit.gltf_files import GltfBuilder, one_triangle

F64 = NDArray[np.float64]
HALF = math.sqrt(0.5)
UPRIGHT, QUARTER = (0.0, 0.0, 0.0, 1.0), (0.0, HALF, 0.0, HALF)
"""No rotation, and a quarter of a turn about y: x goes to -z."""


def animate(
    builder: GltfBuilder,
    node: int,
    path: str,
    times: Sequence[float],
    values: ArrayLike,
    interpolation: str | None = None,
    dtype: str = "f4",
) -> dict[str, Any]:
    sampler: dict[str, Any] = {"input": builder.accessor(times), "output": builder.accessor(values, dtype)}
    if interpolation is not None:
        sampler["interpolation"] = interpolation
    animation = {"samplers": [sampler], "channels": [{"sampler": 0, "target": {"node": node, "path": path}}]}
    builder.add("animations", animation)
    return animation


def opened(builder: GltfBuilder, folder: Path, moving: bool = True) -> Scene:
    return load_scene(builder.write_glb(folder / "a.glb"), animate=moving)


def at(scene: Scene, time: float, mesh: int = 0) -> F64:
    """Corners of the first triangle of a mesh, (3, 3)."""
    what = scene.meshes[mesh]
    matrix = np.eye(4) if what.motion is None else what.motion(time)
    corners: F64 = (what.vertices @ matrix[:3, :3].T + matrix[:3, 3])[what.faces[0]]
    return corners


def test_a_translation_goes_from_key_to_key_and_begins_again(tmp_path: Path) -> None:
    builder = one_triangle()
    animate(builder, 0, "translation", [0.5, 1.0, 2.0], [(0, 0, 0), (2, 0, 0), (2, 4, 0)])
    scene = opened(builder, tmp_path)
    rest = at(scene, 0.0)
    for time, shift in ((0.25, (0, 0, 0)), (0.75, (1, 0, 0)), (1.0, (2, 0, 0)), (1.5, (2, 2, 0)), (2.75, (1, 0, 0))):
        np.testing.assert_allclose(at(scene, time), rest + shift, atol=1e-6)


def test_a_rotation_takes_the_shorter_way_at_an_even_pace(tmp_path: Path) -> None:
    builder = one_triangle()
    animate(builder, 0, "rotation", [0.0, 1.0], [UPRIGHT, tuple(-q for q in QUARTER)])  # the same rotation as QUARTER
    scene = opened(builder, tmp_path)
    for time in (0.0, 0.2, 0.5, 0.999):
        angle = time * math.pi / 2
        np.testing.assert_allclose(at(scene, time)[1], (math.cos(angle), 0, -math.sin(angle)), atol=1e-6)


def test_steps_hold_and_splines_follow_their_tangents(tmp_path: Path) -> None:
    builder = one_triangle()
    animate(builder, 0, "translation", [0.0, 1.0, 2.0], [(0, 0, 0), (1, 0, 0), (5, 0, 0)], "STEP")
    scene = opened(builder, tmp_path)
    assert [round(float(at(scene, time)[0, 0]), 6) for time in (0.0, 0.99, 1.0, 1.99)] == [0, 0, 1, 1]

    builder = one_triangle()
    keys = [(0, 0, 0), (0, 0, 0), (3, 0, 0), (0, 0, 0), (4, 0, 0), (0, 0, 0)]  # in, value, out; in, value, out
    animate(builder, 0, "translation", [0.0, 2.0], keys, "CUBICSPLINE")
    scene = opened(builder, tmp_path)
    for time in (0.0, 0.5, 1.0, 1.5):
        t = time / 2
        expected = (t**3 - 2 * t**2 + t) * 2 * 3 + (3 * t**2 - 2 * t**3) * 4
        assert at(scene, time)[0, 0] == pytest.approx(expected, abs=1e-6)

    builder = one_triangle()
    zero = (0, 0, 0, 0)
    animate(builder, 0, "rotation", [0.0, 1.0], [zero, UPRIGHT, zero, zero, QUARTER, zero], "CUBICSPLINE")
    middle = at(opened(builder, tmp_path), 0.5)[1]
    np.testing.assert_allclose(middle, (HALF, 0, -HALF), atol=1e-6)  # half way by symmetry, and of length 1


def test_rotations_in_integers_are_fractions(tmp_path: Path) -> None:
    builder = one_triangle()
    keys = np.rint(np.array([UPRIGHT, QUARTER]) * 32767)
    animate(builder, 0, "rotation", [0.0, 1.0], keys, dtype="i2")
    np.testing.assert_allclose(at(opened(builder, tmp_path), 0.999999)[1], (0, 0, -1), atol=1e-3)


def test_a_child_moves_with_its_parents_and_keeps_its_scale(tmp_path: Path) -> None:
    builder = GltfBuilder()
    child = builder.node(mesh=builder.mesh(builder.primitive()), translation=[2, 0, 0], scale=[1, 3, 1])
    pivot = builder.node(children=[child], translation=[0, 5, 0])
    animate(builder, pivot, "rotation", [0.0, 1.0], [UPRIGHT, QUARTER])
    scene = opened(builder, tmp_path)
    np.testing.assert_allclose(at(scene, 0.0), [(2, 5, 0), (3, 5, 0), (2, 8, 0)], atol=1e-6)
    np.testing.assert_allclose(at(scene, 0.999999), [(0, 5, -2), (0, 5, -3), (0, 8, -2)], atol=1e-5)
    motion = scene.meshes[0].motion
    assert motion is not None
    np.testing.assert_allclose(motion(0.4)[:3, :3] @ motion(0.4)[:3, :3].T, np.eye(3), atol=1e-9)


def test_without_animation_all_stands_as_at_time_0(tmp_path: Path) -> None:
    builder = one_triangle(normals=[(0, 0, 1)] * 3)
    animate(builder, 0, "translation", [0.0, 1.0], [(7, 0, 0), (9, 0, 0)])
    still, moving = opened(builder, tmp_path, moving=False), opened(builder, tmp_path)
    assert (still.animated, moving.animated) == (False, True)
    np.testing.assert_allclose(at(still, 0.5), at(moving, 0.0), atol=1e-9)
    assert still.meshes[0].normals is not None


def test_scales_and_other_things_that_are_not_rigid_are_left_out_and_told(tmp_path: Path) -> None:
    builder = GltfBuilder()
    child = builder.node(mesh=builder.mesh(builder.primitive()))
    builder.node(children=[child], scale=[1, 2, 1])
    animate(builder, child, "rotation", [0.0, 1.0], [UPRIGHT, (0.0, 0.0, HALF, HALF)])
    animate(builder, child, "scale", [0.0, 1.0], [(1, 1, 1), (2, 2, 2)])
    animate(builder, child, "weights", [0.0, 1.0], [0.0, 1.0])
    scene = opened(builder, tmp_path)
    assert not scene.animated
    text = "\n".join(scene.notices)
    for words in ("1 animated object below a stretched node", "1 animated scale left out", "left out: weights (1)"):
        assert words in text


def test_cameras_and_lights_move_too(tmp_path: Path) -> None:
    builder = one_triangle()
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "spot", "color": [1, 0.5, 0]}]}}
    builder.add("cameras", {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 1}})
    still = builder.node(camera=0, name="still")
    eye = builder.node(camera=0, name="eye")
    lamp = builder.node(extensions={"KHR_lights_punctual": {"light": 0}})
    for node in (eye, lamp):
        animate(builder, node, "translation", [0.0, 1.0], [(1, 2, 3), (2, 2, 3)])
        animate(builder, node, "rotation", [0.0, 1.0], [UPRIGHT, QUARTER])
    scene = opened(builder, tmp_path)
    assert still == 1
    assert [camera.flight is not None for camera in scene.cameras] == [False, True]
    assert scene.flight is not None
    camera = scene.flight(0.5)
    np.testing.assert_allclose(camera.position, (1.5, 2, 3), atol=1e-6)
    np.testing.assert_allclose(camera.forward, (-HALF, 0, -HALF), atol=1e-6)
    assert camera.yfov == 0.7
    assert not scene.has_motion
    assert scene.animated
    compiled = compile_scene(scene)
    compiled.move_to(0.5, 0.4)
    row = compiled.lights.punctual[0]
    np.testing.assert_allclose(row[POSITION : POSITION + 3] + compiled.origin, (1.5, 2, 3), atol=1e-6)
    np.testing.assert_allclose(row[DIRECTION : DIRECTION + 3], (-HALF, 0, -HALF), atol=1e-6)
    assert opened(builder, tmp_path, moving=False).lights[0].position == pytest.approx((1, 2, 3))


def _break(change: Callable[[GltfBuilder, dict[str, Any]], object], folder: Path) -> str:
    builder = one_triangle()
    animation = animate(builder, 0, "translation", [0.0, 1.0], [(0, 0, 0), (1, 0, 0)])
    change(builder, animation)
    with pytest.raises(UserError) as caught:
        opened(builder, folder)
    return str(caught.value)


def test_broken_animations_are_refused_in_words(tmp_path: Path) -> None:
    def times(*values: float) -> Callable[[GltfBuilder, dict[str, Any]], None]:
        return lambda b, a: a["samplers"][0].update(input=b.accessor(values))

    cases: list[tuple[Callable[[GltfBuilder, dict[str, Any]], object], str]] = [
        (times(1.0, 1.0), "do not rise"),
        (times(2.0, 1.0), "do not rise"),
        (times(-1.0, 1.0), "do not rise"),
        (times(0.0, math.nan), "NaN or infinite"),
        (times(0.0, 1.0, 2.0), "3 key times for 2 values (LINEAR)"),
        (lambda b, a: a["samplers"][0].update(interpolation="CUBICSPLINE"), "2 key times for 2 values (CUBICSPLINE)"),
        (lambda b, a: a["samplers"][0].update(interpolation="SMOOTH"), "has the interpolation SMOOTH"),
        (lambda b, a: a["samplers"][0].update(output=99), "refers to accessors[99]"),
        (lambda b, a: a["samplers"][0].pop("input"), "refers to accessors[None]"),
        (lambda b, a: a["channels"][0].update(sampler=3), "refers to sampler 3, but has 1"),
        (lambda b, a: a["channels"][0]["target"].update(node=8), "refers to nodes[8]"),
        (lambda b, a: a["channels"][0]["target"].update(path="rotation"), "VEC4 is expected"),
        (
            lambda b, a: (
                a["samplers"][0].update(output=b.accessor(np.zeros((2, 4)))),
                a["channels"][0]["target"].update(path="rotation"),
            ),
            "quaternion of length 0",
        ),
        (lambda b, a: a.update(channels=3), "not a list of objects"),
    ]  # fmt: skip
    for change, words in cases:
        assert words in _break(change, tmp_path)
