"""What a scene is said to need of the tracer, against what the tracer then does."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from bench.tracing import record
from raytrace.compiled import compile_scene
from raytrace.environment import Environment
from raytrace.features import compiled_in, content_of, images_of, rays_of
from raytrace.frame import FramePacket
from raytrace.integrator import Settings, Tracer
from raytrace.load import load_scene
from raytrace.punctual import PunctualLight
from raytrace.scene import Scene
from raytrace.shot import Shot
from raytrace.tables import Variant, variant_of
from tests.tracer.conftest import OpenTracer
from tests.tracer.scenes import cornell, everything, glossy, rigid

SIZE = (8, 8)
DARK = replace(
    cornell(), materials=tuple(replace(material, emission=(0.0, 0.0, 0.0)) for material in cornell().materials)
)
SCENES = {
    "still": cornell(),
    "moving": cornell(motion=rigid((0.2, 1.0, 0.3), 2.0, (0.3, 0.4, -0.5))),
    "sky and no lamp": replace(DARK, sky=(0.5, 0.5, 0.5)),
    "dark": DARK,
    "everything": everything(),
    "glossy": glossy(),
    "a light and an environment": replace(
        DARK, lights=(PunctualLight("spot", "spot"),), environment=Environment("grey", np.ones((4, 8, 3), np.float32))
    ),
}
GRADIENTS = {"temporal_gradient", "temporal_gradient_specular"}
ALL_IMAGES = images_of(Variant(*(True for _ in Variant._fields)), positions=True, gradients=True)
GLOSS = {"specular", "specular_albedo"}
SURFACES = ("specular", "glossmap", "bumps", "colored")
any_scene = pytest.mark.parametrize("what", SCENES.values(), ids=SCENES.keys())


@pytest.mark.parametrize(
    ("what", "positions", "missing"),
    [
        ("still", False, {"prev_normal", "position", "prev_position", *GLOSS}),
        ("moving", False, {"position", "prev_position", *GLOSS}),
        ("still", True, {"prev_normal", *GLOSS}),
        ("everything", True, GLOSS),
        ("glossy", True, {"prev_normal"}),
    ],
)
def test_frames_have_the_images_that_are_told(what: str, positions: bool, missing: set[str]) -> None:
    scene = SCENES[what]
    with Tracer(compile_scene(scene), Settings(threads=1, positions=positions)) as tracer:
        packet = tracer.frame(0, scene.camera, scene.camera, SIZE)
        present = {f.name for f in fields(FramePacket) if isinstance(getattr(packet, f.name), np.ndarray)}
        assert set(tracer.images) == set(images_of(tracer.variant, positions)) == present
        assert set(ALL_IMAGES) - present == missing | GRADIENTS, "nobody asked for gradients"


def test_images_of_a_frame_are_all_told() -> None:
    assert {f.name for f in fields(FramePacket) if "F32" in str(f.type)} == set(ALL_IMAGES)


@any_scene
def test_a_path_has_the_rays_that_are_told(trace: OpenTracer, what: Scene) -> None:
    """By kind and in their order; of each kind not more than told, and of what is left out none."""
    tracer = trace(what, threads=1)
    (tile,) = record(Shot(tracer.scene, tracer, SIZE), 0)
    calls = {"camera": "intersect_rows", "shadow at hit 1": "occluded", "bounce": "intersect"}
    calls["shadow at hit 2"] = "occluded"
    told = rays_of(tracer.scene)
    assert [name(batch.trace) for batch in tile] == [calls[kind] for kind, count in told.items() if count]
    assert tile[0].rays == SIZE[0] * SIZE[1]
    assert all(0 < batch.rays <= tile[0].rays for batch in tile)


def name(call: object) -> str:
    assert isinstance(call, partial)
    return str(call.func.__name__)


@any_scene
def test_kernels_contain_what_the_scene_needs(trace: OpenTracer, what: Scene) -> None:
    tracer = trace(what)
    variant = tracer.variant
    guides, first, second = (compiled_in(kernel) for kernel in tracer.kernels)
    assert guides == {
        "textured": variant.textured,
        "has_sky": variant.sky,
        "environment": variant.environment,
        "moving": variant.moving,
        "positions": tracer.settings.positions,
        **{name: getattr(variant, name) for name in SURFACES},
    }
    lights = {name: getattr(variant, name) for name in ("textured", "lamps", "punctual", "environment")}
    lights["has_sky"] = variant.sky
    if variant.specular:
        assert first == second == lights | {name: getattr(variant, name) for name in SURFACES} | {"separable": False}
    else:  # the first hit of a diffuse surface asks for no colour
        assert first == lights
        assert second == lights | {"colored": variant.colored}


def test_everything_is_counted() -> None:
    scene = everything()
    with Tracer(compile_scene(scene), Settings(threads=1)) as tracer:
        content = content_of(tracer.scene, tracer.tables)
    assert (content.triangles, content.moving, content.smooth) == (2 + 320 + 12 + 2, 12, 320)
    assert (content.objects, content.moving_objects) == (4, 1)
    assert content.textures == 2
    assert content.texel_bytes == 3 * (14 * 9 + 7 * 4 + 3 * 2 + 1 + 4 * 4 + 2 * 2 + 1)
    assert (content.lamps, content.textured_lamps, content.double_sided_lamps) == (2, 2, 2)
    assert 0.0 < content.sky_share <= 0.5
    assert (content.punctual, content.environment_size, content.environment_bytes) == ({}, None, 0)
    assert content.table_bytes > content.texel_bytes + tracer.scene.triangles.nbytes

    with Tracer(compile_scene(DARK), Settings(threads=1)) as tracer:
        content = content_of(tracer.scene, tracer.tables)
    assert (content.lamps, content.sky_share, content.textures, content.texel_bytes, content.moving) == (0, 0, 0, 0, 0)

    with Tracer(compile_scene(SCENES["a light and an environment"]), Settings(threads=1)) as tracer:
        content = content_of(tracer.scene, tracer.tables)
    assert (content.punctual, content.environment_size) == ({"spot": 1}, (8, 4))
    assert content.environment_bytes == 4 * (6 * 9 * 4 + 6 + 5 * 9)
    assert 0.0 < content.sky_share <= 0.5


def test_a_feature_that_is_compiled_in_for_nothing_changes_no_bit() -> None:
    scene = compile_scene(cornell())
    with Tracer(scene) as plain, Tracer(scene, variant=variant_of(scene)._replace(sky=True)) as more:
        assert (plain.variant.sky, more.variant.sky) == (False, True)
        camera = scene.scene.camera
        one, other = (tracer.frame(3, camera, camera, SIZE) for tracer in (plain, more))
    for name in plain.images:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_files_of_one_name_are_two_scenes(tmp_path: Path) -> None:
    """Opened one after the other, the second must not go on with what was accumulated of the first."""
    packets = []
    for folder in ("a", "b"):
        path = tmp_path / folder / "room.obj"
        path.parent.mkdir()
        path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        scene = load_scene(path)
        with Tracer(compile_scene(scene), Settings(threads=1)) as tracer:
            packets += [tracer.frame(index, scene.camera, scene.camera, SIZE) for index in range(2)]
    assert {packet.scene for packet in packets} == {"room"}
    a, again, b, _ = (packet.scene_id for packet in packets)
    assert a == again != b
