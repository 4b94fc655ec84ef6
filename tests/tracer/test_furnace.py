"""Furnaces: light is the same everywhere, so that the answer is known for any surface. What is lost or leaks shows."""

from __future__ import annotations

import numpy as np
import pytest

from raytrace.camera import Camera
from raytrace.scene import Material, Scene
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
    scene,
    sphere,
    still,
)
from tests.tracer.statistics import Estimate, assert_same

SKY = (1.0, 2.0, 3.0)
SIZE = (40, 30)
CAMERA = Camera.look_at((2.0, 1.5, 3.0), (0.0, 0.0, 0.0), yfov_degrees=40.0)

PLACES: list[tuple[float, Point]] = [
    (1.0, (0.0, 0.0, 0.0)),
    (1.0, (1e5, -1e5, 1e5)),
    (1e-3, (0.0, 0.0, 0.0)),
    (1e-3, (10.0, 20.0, -30.0)),
    (1e6, (0.0, 0.0, 0.0)),
]
placed_somewhere = pytest.mark.parametrize(
    ("scale", "offset"), PLACES, ids=["here", "far", "small", "small far", "large"]
)
both_backends = pytest.mark.parametrize("backend", ["auto", "run"])


@both_backends
@placed_somewhere
def test_under_a_constant_sky_every_path_on_a_convex_object_sees_exactly_the_sky(
    trace: OpenTracer, scale: float, offset: Point, backend: str
) -> None:
    """Both techniques draw the same directions with the same density, so that the two halves add up without noise:
    one ray stopped by the surface that it leaves would show in its pixel."""
    solid = scene([mesh("ball", sphere(splits=3)), mesh("far", box((-9, -9, -9), (-8, -8, -8)))], [GREY], CAMERA, SKY)
    t = trace(placed(solid, scale, offset), backend=backend)
    seen = 0
    for index in range(4):
        frame = still(t, SIZE, index)
        surface = frame.albedo[..., 3] == 1.0
        seen += int(surface.sum())
        np.testing.assert_allclose(frame.direct[surface][:, :3], np.tile(SKY, (int(surface.sum()), 1)), rtol=2e-6)
        assert not frame.indirect[..., :3].any()
        np.testing.assert_allclose(frame.emission[~surface][:, :3], np.tile(SKY, (int((~surface).sum()), 1)), rtol=1e-6)
    assert seen > SIZE[0] * SIZE[1] // 5 * 4


@both_backends
@placed_somewhere
def test_no_sky_leaks_into_a_closed_box(trace: OpenTracer, scale: float, offset: Point, backend: str) -> None:
    """Along edges and in corners, where offset origins could step outside and rays could slip between triangles."""
    inside = Camera.look_at((0.3, 0.2, 0.1), (-1.0, -1.0, -1.0), yfov_degrees=110.0)
    hut = scene([mesh("hut", box((-1, -1, -1), (1, 1, 1), inward=True))], [WHITE], inside, SKY)
    t = trace(placed(hut, scale, offset), backend=backend)
    for index in range(6):
        frame = still(t, (64, 64), index)
        assert (frame.albedo[..., 3] == 1.0).all(), "a camera ray slipped between two walls"
        assert not frame.direct[..., :3].any()
        assert not frame.indirect[..., :3].any()


def test_no_sky_leaks_into_a_hut_as_large_as_a_file_may_be(trace: OpenTracer) -> None:
    """The shadow ray to the sky must be longer than any scene that the loader accepts."""
    inside = Camera.look_at((0.3, 0.2, 0.1), (-1.0, -1.0, -1.0), yfov_degrees=110.0)
    hut = scene([mesh("hut", box((-1, -1, -1), (1, 1, 1), inward=True))], [WHITE], inside, SKY)
    frame = still(trace(placed(hut, 1e10)), (32, 32))
    assert (frame.albedo[..., 3] == 1.0).all()
    assert not frame.direct[..., :3].any()


def emitting_ball(rho: tuple[float, float, float], glow: tuple[float, float, float]) -> Scene:
    """The inside of a sphere that shines everywhere. Every point of it sees every other with the same form factor, so
    that light samples, weighted by 1 / distance² elsewhere, have hardly any noise."""
    camera = Camera.look_at((0.2, 0.1, 0.3), (0.5, -0.4, -1.0), yfov_degrees=70.0)
    return scene([mesh("ball", sphere(splits=2, inward=True))], [Material("glow", rho, emission=glow)], camera)


@placed_somewhere
def test_inside_a_glowing_ball_one_bounce_brings_the_albedo_times_the_glow(
    trace: OpenTracer, scale: float, offset: Point
) -> None:
    """Where radiance E comes from everywhere, direct light divided by the albedo is E; what comes over one bounce left
    each wall as rho times the light it got, which is E again."""
    rho, glow = (0.8, 0.5, 0.1), (2.0, 1.0, 4.0)
    t = trace(placed(emitting_ball(rho, glow), scale, offset))
    frames = [still(t, (24, 24), index) for index in range(40)]
    direct = np.stack([f.direct[..., :3].mean((0, 1), dtype=np.float64) for f in frames])
    indirect = np.stack([f.indirect[..., :3].mean((0, 1), dtype=np.float64) for f in frames])
    assert_same(Estimate.of(direct), np.array(glow), sharp=0.02)
    assert_same(Estimate.of(indirect), np.array(rho) * np.array(glow), sharp=0.05)
    np.testing.assert_allclose(frames[0].emission[..., :3], np.broadcast_to(glow, (24, 24, 3)), rtol=1e-6)


def test_sky_and_lamps_share_the_light_samples(trace: OpenTracer) -> None:
    """Light samples that go to lamps elsewhere are missing in the sky's share: on a convex face it must not show."""
    lamp = Material("lamp", (0.0, 0.0, 0.0), emission=(50.0, 50.0, 50.0))
    lamp_below = quad((-1, -5, -1), (1, -5, -1), (1, -5, 1), (-1, -5, 1))  # its front looks down, away from everything
    what = scene([mesh("box", box((-1, -1, -1), (1, 1, 1))), mesh("lamp", lamp_below, 1)], [GREY, lamp], CAMERA, SKY)
    t = trace(what)
    assert 0.2 < t.scene.lights.pdf[-1] < 0.8
    got = light_at(t, (0.2, 1.0, -0.3), (0.5, 4.0, 1.0), 20_000)
    assert_same(Estimate.of(got.direct), np.array(SKY), sharp=0.03)
    assert not got.indirect.any()


def test_a_smooth_ball_gains_no_light(trace: OpenTracer) -> None:
    """Interpolated normals drop the directions below the facet, so that a furnace may only lose, and only little."""
    ball = sphere(splits=2)
    t = trace(scene([mesh("ball", ball, normals=ball)], [GREY], CAMERA, (1.0, 1.0, 1.0)))
    frames = np.stack([still(t, SIZE, index).direct[..., :3] for index in range(16)])
    surface = still(t, SIZE).albedo[..., 3] == 1.0
    lit = frames[:, surface].mean()
    assert frames.max() <= 1.0 + 1e-6
    assert 0.97 < lit < 1.0


def test_the_side_that_is_seen_is_the_side_that_is_lit(trace: OpenTracer) -> None:
    """A sheet between a bright sky and a closed dark cellar: light from above reaches its upper side only."""
    cellar = box((-1, -2, -1), (1, 0, 1))[:-4]  # without the lid and the ground
    ground = quad((-1, -2, -1), (1, -2, -1), (1, -2, 1), (-1, -2, 1))
    lid = quad((-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1))
    t = trace(scene([mesh("cellar", np.concatenate([cellar, ground])), mesh("lid", lid)], [WHITE], CAMERA, SKY))
    above = light_at(t, (0.1, 0.0, 0.2), (0.3, 1.0, 0.4), 200)
    below = light_at(t, (0.1, 0.0, 0.2), (0.3, -1.0, 0.4), 200)
    np.testing.assert_allclose(above.direct, np.tile(SKY, (200, 1)), rtol=2e-6)
    assert not below.direct.any()
    assert not below.indirect.any()
