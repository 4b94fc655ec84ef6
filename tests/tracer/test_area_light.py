"""Direct light of lamps against Lambert's formula for polygons."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.lights import SHADOW_END
from raytrace.scene import Material, Mesh, Texture
from tests.tracer.conftest import OpenTracer
from tests.tracer.scenes import (
    GREY,
    WHITE,
    Point,
    box,
    light_at,
    mesh,
    placed,
    quad,
    rigid,
    scene,
    sphere,
)
from tests.tracer.statistics import Estimate, assert_same

F64 = NDArray[np.float64]
CAMERA = Camera.look_at((0.0, 3.0, 5.0), (0.0, 0.0, 0.0))
GLOW = (4.0, 2.0, 1.0)
LAMP = Material("lamp", (0.5, 0.5, 0.5), emission=GLOW)
COUNT = 30_000


def above_horizon(corners: F64) -> F64:
    """The part of a polygon (n, 3), relative to the surface point, with z > 0. Sutherland and Hodgman 1974."""
    kept = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if a[2] >= 0:
            kept.append(a)
        if (a[2] >= 0) != (b[2] >= 0):
            kept.append(a + (b - a) * (a[2] / (a[2] - b[2])))
    return np.array(kept).reshape(-1, 3)


def form_factor(point: Point, normal: Point, corners: F64) -> float:
    """Irradiance over π times the radiance, from the front of a polygon (n, 3). Lambert 1760; Arvo 1994."""
    n = np.array(normal) / np.linalg.norm(normal)
    away = corners - np.array(point)
    front = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    if away[0] @ front >= 0:
        return 0.0
    x = np.cross(n, (0.3, 0.5, 0.8))
    x /= np.linalg.norm(x)
    local = above_horizon(np.stack([away @ x, away @ np.cross(n, x), away @ n], axis=1))
    if len(local) < 3:
        return 0.0
    unit = local / np.linalg.norm(local, axis=1, keepdims=True)
    following = np.roll(unit, -1, axis=0)
    edges = np.cross(unit, following)
    angles = np.arctan2(np.linalg.norm(edges, axis=1), (unit * following).sum(1))
    return abs(float((angles * edges[:, 2] / np.linalg.norm(edges, axis=1)).sum())) / (2 * np.pi)


def test_the_formula_itself() -> None:
    """Against the closed form of a square right above a point, and a numerical integral of a tilted case."""
    square = np.array([(-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1)], dtype=np.float64)
    r = 1 / np.sqrt(2)
    assert form_factor((0, 0, 0), (0, 1, 0), square) == pytest.approx(4 * 2 * r * np.arctan(r) / (2 * np.pi))
    n = np.array([0.9, 0.3, 0.1]) / np.linalg.norm([0.9, 0.3, 0.1])
    s = (np.arange(800) + 0.5) / 400 - 1
    x, z = np.meshgrid(s, s)
    away = np.stack([x, np.ones_like(x), z], axis=-1) - np.array([0.2, 0.0, -0.4])
    square_distance = (away**2).sum(-1)
    integral = (np.maximum(away @ n, 0) / square_distance**2).sum() * (2 / 800) ** 2 / np.pi
    assert form_factor((0.2, 0.0, -0.4), tuple(n), square) == pytest.approx(integral, rel=1e-4)


def corners_of(lamp: F64) -> F64:
    """The four corners of what :func:`quad` made."""
    return np.concatenate([lamp[0], lamp[1, 2:]])


LOOKING_DOWN = quad((-0.5, 1, -0.7), (0.5, 1, -0.7), (0.5, 1, 0.7), (-0.5, 1, 0.7))
POINTS: dict[str, tuple[Point, Point]] = {
    "below": ((0.0, 0.0, 0.0), (0, 1, 0)),
    "aside": ((1.5, 0.1, -0.8), (0, 1, 0)),
    "near": ((0.3, 0.9, 0.2), (0, 1, 0)),
    "partly below the horizon": ((0.1, 0.2, 0.1), (1, 0.2, 0.1)),
    "almost below the horizon": ((0.4, 0.6, -0.2), (1, -0.1, 0)),
    "below the horizon": ((0.1, 0.0, 0.1), (0, -1, 0)),
    "behind": ((0.2, 1.3, 0.1), (0, -1, 0)),
    "in its plane": ((2.0, 1.0, 0.0), (-1, 0.5, 0)),
}


def patch(point: Point, normal: Point, name: str = "patch") -> Mesh:
    """A small sheet around ``point`` with its front along ``normal``."""
    n = np.array(normal) / np.linalg.norm(normal)
    x = np.cross(n, (0.3, 0.5, 0.8))
    x *= 0.01 / np.linalg.norm(x)
    y = np.cross(n, x)
    p = np.array(point)
    a, b, c, d = (tuple(float(k) for k in q) for q in (p - x - y, p + x - y, p + x + y, p - x + y))
    return mesh(name, quad(a, b, c, d))  # type: ignore[arg-type]


def eye_over(point: Point, normal: Point, distance: float = 0.05) -> Point:
    n = np.array(normal) / np.linalg.norm(normal)
    x, y, z = (float(c) for c in np.array(point) + n * distance)
    return x, y, z


@pytest.mark.parametrize("where", POINTS)
@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e4], ids=["", "small", "large"])
def test_a_square_lamp_lights_as_lambert_says(trace: OpenTracer, where: str, scale: float) -> None:
    point, normal = POINTS[where]
    what = scene([patch(point, normal), mesh("lamp", LOOKING_DOWN, 1)], [GREY, LAMP], CAMERA)
    expected = form_factor(point, normal, corners_of(LOOKING_DOWN)) * np.array(GLOW)
    eye = eye_over(point, normal)
    scaled = [tuple(scale * c for c in p) for p in (point, eye)]
    got = light_at(trace(placed(what, scale)), scaled[0], scaled[1], COUNT)  # type: ignore[arg-type]
    if expected[0] == 0.0:
        assert got.direct.max() < (1e-6 if where == "in its plane" else 1e-30)
    else:
        assert_same(Estimate.of(got.direct), expected, sharp=0.12 if where == "almost below the horizon" else 0.04)


@pytest.mark.parametrize("size", [0.01, 0.1, 1.0, 10.0])
def test_both_techniques_agree_for_lamps_small_and_large(trace: OpenTracer, size: float) -> None:
    """A tiny lamp is all light samples, a huge one all bounce rays; their sum is right for each, and never noisy:
    the variance of the balance heuristic is bounded by that of the better technique and a little more."""
    lamp = quad((-size, 1, -size), (size, 1, -size), (size, 1, size), (-size, 1, size))
    what = scene([patch((0, 0, 0), (0, 1, 0)), mesh("lamp", lamp, 1)], [GREY, LAMP], CAMERA)
    expected = form_factor((0, 0, 0), (0, 1, 0), corners_of(lamp)) * np.array(GLOW)
    got = light_at(trace(what), (0, 0, 0), (0, 0.05, 0), COUNT)
    assert_same(Estimate.of(got.direct), expected, sharp=0.04)
    assert got.direct.std(0)[0] < 1.2 * expected[0]


def test_several_lamps_of_unlike_size_power_and_colour_add_up(trace: OpenTracer) -> None:
    bright = Material("bright", (0, 0, 0), emission=(30.0, 1.0, 0.0))
    dim = Material("dim", (0, 0, 0), emission=(0.0, 0.1, 0.7))
    both = Material("both", (0, 0, 0), emission=(0.5, 2.0, 1.0), double_sided=True)
    black = Material("black", (0, 0, 0), emission=(0.0, 0.0, 0.0))
    lamps = [
        (quad((-1.2, 1.1, -0.1), (-1.0, 1.1, -0.1), (-1.0, 1.1, 0.1), (-1.2, 1.1, 0.1)), 1, bright),
        (quad((0.2, 1.5, -2.0), (3.0, 1.5, -2.0), (3.0, 1.5, 0.0), (0.2, 1.5, 0.0)), 2, dim),
        (quad((0.5, 0.8, 0.4), (0.5, 0.8, 0.9), (0.9, 0.8, 0.9), (0.9, 0.8, 0.4)), 3, both),  # its front looks up
        (quad((-0.5, 0.8, 0.4), (-0.5, 0.8, 0.9), (-0.9, 0.8, 0.9), (-0.9, 0.8, 0.4)), 4, black),
    ]
    meshes = [mesh(f"lamp {i}", triangles, i) for triangles, i, _ in lamps]
    what = scene([patch((0, 0, 0), (0, 1, 0)), *meshes], [GREY, bright, dim, both, black], CAMERA)
    expected = np.zeros(3)
    for triangles, _, material in lamps:
        corners = corners_of(triangles)
        factor = form_factor((0, 0, 0), (0, 1, 0), corners)
        if material.double_sided:
            factor += form_factor((0, 0, 0), (0, 1, 0), corners[::-1])
        expected += factor * np.array(material.emission)
    t = trace(what)
    assert len(t.scene.lights.triangles) == 6  # the black lamp is none
    got = light_at(t, (0, 0, 0), (0, 0.05, 0), 4 * COUNT)
    assert_same(Estimate.of(got.direct), expected, sharp=0.05)


def test_an_object_in_the_way_takes_its_part(trace: OpenTracer) -> None:
    """A screen at half height: the lamp's visible part is a smaller square lamp. Both sides of a lamp are opaque."""
    screen = quad((0.0, 0.5, -5), (0.0, 0.5, 5), (5, 0.5, 5), (5, 0.5, -5))
    what = scene(
        [patch((0, 0, 0), (0, 1, 0)), mesh("lamp", LOOKING_DOWN, 1), mesh("screen", screen)], [GREY, LAMP], CAMERA
    )
    half = np.array([(-0.5, 1, -0.7), (0.0, 1, -0.7), (0.0, 1, 0.7), (-0.5, 1, 0.7)])
    got = light_at(trace(what), (0, 0, 0), (0, 0.05, 0), COUNT)
    assert_same(Estimate.of(got.direct), form_factor((0, 0, 0), (0, 1, 0), half) * np.array(GLOW), sharp=0.04)


def test_a_ball_light_from_outside(trace: OpenTracer) -> None:
    """A sphere of radius r at distance d fills (r/d)² of the cosine-weighted sky, facets aside; most of its lamps face
    away, and smooth normals do not change what a lamp emits."""
    ball = sphere(0.5, (0.0, 2.0, 0.0), 3)
    smooth = (ball - np.array([0.0, 2.0, 0.0])) / 0.5
    for normals in (None, smooth):
        what = scene([patch((0, 0, 0), (0, 1, 0)), mesh("ball", ball, 1, normals=normals)], [GREY, LAMP], CAMERA)
        got = light_at(trace(what), (0, 0, 0), (0, 0.05, 0), COUNT)
        facets = np.linalg.norm(np.cross(ball[:, 1] - ball[:, 0], ball[:, 2] - ball[:, 0]), axis=1).sum() / 2
        shrunk = facets / (4 * np.pi * 0.25)
        expected = 0.0625 * np.array(GLOW) * shrunk
        assert_same(Estimate.of(got.direct), expected, slack=5e-3, sharp=0.06)


def test_a_textured_lamp_that_turns_under_a_sky(trace: OpenTracer) -> None:
    """Every feature at once: lamp with a uniform texture, seen by the sky behind it, at a time other than 0."""
    code = 188
    factor = ((code / 255 + 0.055) / 1.055) ** 2.4
    texture = Texture("grey", np.full((4, 4, 3), code, np.uint8))
    material = replace(LAMP, emission_texture=0, base_texture=0)
    motion = rigid((0, 1, 0), 1.0, (0.3, 0.0, 0.2))
    lamp = mesh("lamp", LOOKING_DOWN, 1, motion=motion, uvs=np.zeros((2, 3, 2)))
    sky = (0.3, 0.6, 1.2)
    what = replace(scene([patch((0, 0, 0), (0, 1, 0)), lamp], [GREY, material], CAMERA, sky), textures=(texture,))
    time = 0.7
    matrix = motion(time)
    corners = corners_of(LOOKING_DOWN) @ matrix[:3, :3].T + matrix[:3, 3]
    share = form_factor((0, 0, 0), (0, 1, 0), corners)
    assert abs(share - form_factor((0, 0, 0), (0, 1, 0), corners_of(LOOKING_DOWN))) > 0.01
    t = trace(what)
    t.set_time(time, 0.0)
    got = light_at(t, (0, 0, 0), (0, 0.05, 0), COUNT)
    assert_same(Estimate.of(got.direct), share * factor * np.array(GLOW) + (1 - share) * np.array(sky), sharp=0.03)


def test_a_diode_on_a_black_panel_lights_as_what_it_is(trace: OpenTracer) -> None:
    """A bright spot of 8 x 8 texels in a texture of 256 x 256: what can be seen must also light."""
    pixels = np.zeros((256, 256, 3), np.uint8)
    pixels[96:104, 176:184] = 255
    corner = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=np.float64)
    uvs = np.stack([corner[[0, 1, 2]], corner[[0, 2, 3]]])
    panel = mesh("panel", LOOKING_DOWN, 1, uvs=uvs)
    aside = mesh("aside", box((40, 40, 40), (41, 41, 41)), motion=rigid((0, 1, 0), 0.0, (0, 0, 0)))
    materials = [GREY, Material("diode", (0, 0, 0), emission=(900.0, 600.0, 300.0), emission_texture=0)]
    dark = 1e-6  # a sky too dark to matter: this kind of scene has its kernels compiled already
    what = scene([patch((0, 0, 0), (0, 1, 0)), panel, aside], materials, CAMERA, (dark, dark, dark))
    t = trace(replace(what, textures=(Texture("diode", pixels),)))
    t.set_time(0.0, 0.0)
    spot = np.array([(x, 1.0, z) for x, z in ((176, 96), (184, 96), (184, 104), (176, 104))]) / (256, 1, 256)
    spot = spot * (1.0, 1.0, 1.4) - (0.5, 0.0, 0.7)
    got = light_at(t, (0, 0, 0), (0, 0.05, 0), 20 * COUNT)
    expected = form_factor((0, 0, 0), (0, 1, 0), spot) * np.array(materials[1].emission)
    assert_same(Estimate.of(got.direct), expected, slack=0.02, sharp=0.3)


def test_one_bounce_from_a_lit_wall(trace: OpenTracer) -> None:
    """A lamp that only a wall sees, a patch that only sees the wall: indirect light is the wall's albedo times the
    integral of its own direct light over the patch's view, taken numerically with Lambert's formula for each."""
    wall_material = Material("wall", (0.9, 0.6, 0.2))
    wall = quad((-1, 0.5, -1), (1, 0.5, -1), (1, 2.5, -1), (-1, 2.5, -1))  # faces +z
    lamp = quad((-0.3, 1.2, 0.5), (-0.3, 1.8, 0.5), (0.3, 1.8, 0.5), (0.3, 1.2, 0.5))  # faces -z
    n = (0.0, 0.5, -1.0)
    point = (0.0, 0.0, 0.6)
    what = scene(
        [patch(point, n), mesh("wall", wall, 1), mesh("lamp", lamp, 2)],
        [WHITE, wall_material, replace(LAMP, base_color=(0.0, 0.0, 0.0))],
        CAMERA,
    )
    unit = np.array(n) / np.linalg.norm(n)
    cells = 24
    s = (np.arange(cells) + 0.5) / cells * 2
    total = 0.0
    for x in s - 1:
        for y in s + 0.5:
            away = np.array([x, y, -1.0]) - np.array(point)
            square = away @ away
            geometry = max(away @ unit, 0.0) * -away[2] / square**2 / np.pi * (2 / cells) ** 2
            total += geometry * form_factor((float(x), float(y), -1.0), (0, 0, 1), corners_of(lamp))
    got = light_at(trace(what), point, eye_over(point, n), 4 * COUNT)
    assert not got.direct.any()
    assert_same(
        Estimate.of(got.indirect), total * np.array(GLOW) * np.array(wall_material.base_color), slack=3e-3, sharp=0.05
    )


def test_shadow_rays_reach_almost_to_the_lamp() -> None:
    """A sheet a hair in front of the lamp must still block: the end is a share of the way, well above rounding."""
    assert 0.99999 < SHADOW_END < 1.0


@pytest.mark.parametrize("gap", [1e-2, 1e-4])
def test_what_touches_a_lamp_almost_still_hides_it(trace: OpenTracer, gap: float) -> None:
    cover = LOOKING_DOWN * np.array([1.1, 1, 1.1]) - np.array([0, gap, 0])
    what = scene(
        [patch((0, 0, 0), (0, 1, 0)), mesh("lamp", LOOKING_DOWN, 1), mesh("cover", cover)], [GREY, LAMP], CAMERA
    )
    got = light_at(trace(what), (0, 0, 0), (0, 0.05, 0), 2000)
    assert not got.direct.any()


def test_a_box_on_the_floor_has_its_shadow_to_the_edge(trace: OpenTracer) -> None:
    """No light leaks in under what stands on the floor: an offset ray must not start behind the box's wall."""
    floor = quad((-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3))
    block = box((-1, -0.5, -1), (1, 0.5, 1))
    lamp = quad((-4, 1, -0.5), (-3.5, 1, -0.5), (-3.5, 1, 0.5), (-4, 1, 0.5))
    what = scene([mesh("floor", floor), mesh("block", block), mesh("lamp", lamp, 1)], [GREY, LAMP], CAMERA)
    t = trace(what)
    for gap in (1e-2, 1e-3, 1e-4):
        behind = light_at(t, (1.0 + gap, 0.0, 0.1), (1.3, 0.4, 0.1), 500)
        assert not behind.direct.any()
        ahead = light_at(t, (-1.0 - gap, 0.0, 0.1), (-1.3, 0.4, 0.1), 500)
        assert ahead.direct.any()
