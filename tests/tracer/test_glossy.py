"""Paths over metals and plastics against closed forms and quadrature in float64."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.integrator import Tracer
from raytrace.scene import Material, Scene, Texture
from tests.tracer import ggx
from tests.tracer.conftest import OpenTracer
from tests.tracer.scenes import (
    Point,
    box,
    glossy,
    mesh,
    quad,
    repeated,
    scene,
    seeds_of,
    still,
    view_of,
    with_every_material,
)
from tests.tracer.statistics import Estimate, assert_same

F64 = NDArray[np.float64]

WHITE_SKY = (1.0, 1.0, 1.0)
CAMERA = Camera.look_at((2.0, 1.5, 3.0), (0.0, 0.0, 0.0), yfov_degrees=40.0)
GOLD = (1.0, 0.7, 0.1)
MATERIALS = {
    "metal": Material("metal", GOLD, specular=True, metallic=1.0),
    "plastic": Material("plastic", GOLD, specular=True, metallic=0.0),
    "half": Material("half", GOLD, specular=True, metallic=0.5),
    "white": Material("white", (1.0, 1.0, 1.0), specular=True, metallic=0.0),
    "mirror": Material("mirror", (1.0, 1.0, 1.0), specular=True, metallic=1.0),
}


@dataclass(frozen=True)
class Seen:
    """``count`` independent estimates at one point, (count, 3) float64 each: signals and radiance without emission."""

    diffuse: F64
    specular: F64
    radiance: F64


def seen(t: Tracer, target: Point, eye: Point, count: int, frame: int = 0) -> Seen:
    """Estimates at the first surface on the way from ``eye`` to ``target``, both in world units."""
    camera = Camera.look_at(eye, target, up=(0.3, 0.9, 0.4), yfov_degrees=1.0)
    packet, view = t.frame(0, camera, camera, (1, 1)), view_of(t, camera, (1, 1))
    hits = repeated(t.primary(view, np.zeros(1, np.int32)), 0, count)
    assert hits.triangle[0] >= 0, "there is no surface"
    direct, indirect, specular = np.full((3, count, 3), np.nan, np.float32)
    t.shade(hits, seeds_of(count, frame), view.eye, direct, indirect, specular, pixel=view.pixel)
    assert packet.specular_albedo is not None
    diffuse = (direct + indirect).astype(np.float64)
    radiance = diffuse * packet.albedo[0, 0, :3] + specular * packet.specular_albedo[0, 0, :3]
    return Seen(diffuse, specular.astype(np.float64), radiance.astype(np.float64))


def from_angle(cosine: float) -> Point:
    """An eye that sees the top of the unit box's middle (0, 1, 0) at that cosine."""
    return 4.0 * math.sqrt(1 - cosine**2), 1.0 + 4.0 * cosine, 0.0


def furnace(material: Material, roughness: float) -> Scene:
    cube = mesh("box", box((-1, -1, -1), (1, 1, 1)))
    return with_every_material(scene([cube], [replace(material, roughness=roughness)], CAMERA, WHITE_SKY))


@pytest.mark.parametrize("cosine", [0.2, 0.9])
@pytest.mark.parametrize("roughness", [0.0, 0.25, 0.5, 0.75, 1.0])
@pytest.mark.parametrize("name", MATERIALS)
def test_in_a_white_furnace_a_convex_object_shows_its_directional_albedo(
    trace: OpenTracer, name: str, roughness: float, cosine: float
) -> None:
    """And each signal, divided by its part of that, shows the sky."""
    material = MATERIALS[name]
    got = seen(trace(furnace(material, roughness)), (0.0, 1.0, 0.0), from_angle(cosine), 20_000)
    expected = ggx.albedo(cosine, material.base_color, material.metallic, roughness)
    assert_same(Estimate.of(got.radiance), expected, sharp=0.05)
    assert expected.max() <= 1.0 + 1e-9
    assert_same(Estimate.of(got.diffuse), np.ones(3), sharp=0.05)
    # The table between whose entries the divisor is interpolated is off by up to 1 %.
    assert abs(got.specular.mean() - 1) < 0.03
    if name == "metal":
        assert got.radiance.mean(0)[2] < 0.6 * got.radiance.mean(0)[0] or cosine < 0.5  # gold stays yellow


@pytest.mark.parametrize("roughness", [0.5, 0.8])
def test_masking_may_be_separable(trace: OpenTracer, roughness: float) -> None:
    """The older form, which some renderers have, loses more at grazing angles."""
    what = furnace(MATERIALS["mirror"], roughness)
    got = seen(trace(what, separable=True), (0.0, 1.0, 0.0), from_angle(0.2), 20_000)
    expected = ggx.albedo(0.2, (1.0, 1.0, 1.0), 1.0, roughness, separable=True)
    assert_same(Estimate.of(got.radiance), expected, sharp=0.02)
    assert ggx.albedo(0.2, (1.0, 1.0, 1.0), 1.0, roughness)[0] > expected[0] + 0.003


def lamp_integral(material: Material, eye: Point, lamp: Point, side: float) -> F64:
    """Radiance at (0, 1, 0) of a surface that faces up, lit by a square lamp of radiance 1 that faces down, (3,)."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    x, z = np.meshgrid(nodes * side / 2 + lamp[0], nodes * side / 2 + lamp[2])
    share = np.outer(weights, weights) * (side / 2) ** 2
    to = np.stack([x, np.full_like(x, lamp[1] - 1.0), z], axis=-1)
    distance = np.linalg.norm(to, axis=-1)
    light = to / distance[..., None]
    v = np.array(eye) - np.array([0.0, 1.0, 0.0])
    v /= np.linalg.norm(v)
    turn = [0, 2, 1]  # the surface's normal is y here, z in the model
    v, light = v[turn], light[..., turn]
    h = light + v
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    alpha = material.roughness**2
    white = (1 - h @ v) ** 5
    lobe = ggx.distribution(h, alpha) * ggx.masking(v, light, alpha) / (4 * v[2] * light[..., 2])
    a, b = ggx.lobe_terms(float(v[2]), alpha)
    base = np.array(material.base_color)
    head_on = ggx.F0 + material.metallic * (base - ggx.F0)
    diffuse = (1 - material.metallic) * base / np.pi * (1 - ggx.F0 * (a - b) - b)
    f = diffuse + lobe[..., None] * (head_on + (1 - head_on) * white[..., None])
    measure = share * light[..., 2] ** 2 / distance**2  # the lamp faces down: both cosines are equal
    total: F64 = (f * measure[..., None]).sum(axis=(0, 1))
    return total


@pytest.mark.parametrize("roughness", [0.15, 0.4, 0.9])
@pytest.mark.parametrize("name", ["metal", "plastic", "half"])
def test_direct_light_of_a_lamp_is_its_integral(trace: OpenTracer, name: str, roughness: float) -> None:
    """Light samples and bounce rays together, for lobes much narrower and much wider than the lamp."""
    material = replace(MATERIALS[name], roughness=roughness)
    lamp, side, eye = (-1.5, 3.0, 0.2), 1.0, (2.0, 3.2, 0.1)
    x, y, z = lamp
    half = side / 2
    square = quad((x - half, y, z - half), (x + half, y, z - half), (x + half, y, z + half), (x - half, y, z + half))
    glow = Material("lamp", (0.0, 0.0, 0.0), emission=(1.0, 1.0, 1.0))
    table = quad((-0.3, 1, 0.3), (0.3, 1, 0.3), (0.3, 1, -0.3), (-0.3, 1, -0.3))
    t = trace(with_every_material(scene([mesh("table", table), mesh("lamp", square, 1)], [material, glow], CAMERA)))
    got = seen(t, (0.0, 1.0, 0.0), eye, 40_000)
    assert_same(Estimate.of(got.radiance), lamp_integral(material, eye, lamp, side), sharp=0.05)


def test_regularisation_is_a_bias_of_the_second_hit_only(trace: OpenTracer) -> None:
    """A polished floor seen by way of a diffuse wall: its lobe is widened in frames, never in references."""
    wall = quad((-1, 0, 0), (1, 0, 0), (1, 2, 0), (-1, 2, 0))
    floor = quad((-1, 0, 2), (1, 0, 2), (1, 0, 0), (-1, 0, 0))
    lamp = quad((-0.2, 1.9, 1.5), (0.2, 1.9, 1.5), (0.2, 1.9, 1.9), (-0.2, 1.9, 1.9))
    materials = [
        Material("wall", (0.8, 0.8, 0.8)),
        Material("floor", (1.0, 1.0, 1.0), specular=True, metallic=1.0, roughness=0.15),
        Material("lamp", (0.0, 0.0, 0.0), emission=(20.0, 20.0, 20.0)),
    ]
    camera = Camera.look_at((0.0, 1.0, 3.0), (0.0, 1.0, 0.0), yfov_degrees=30.0)
    room = [mesh("wall", wall), mesh("floor", floor, 1), mesh("lamp", lamp, 2)]
    what = with_every_material(scene(room, materials, camera))
    plain, wide = trace(what, regularize=False), trace(what)
    signals = {}
    for name, t in (("plain", plain), ("wide", wide)):
        frames = [still(t, (16, 16), index) for index in range(60)]
        signals[name] = (
            np.stack([f.direct[..., :3].mean((0, 1)) for f in frames]),
            np.stack([f.indirect[..., :3] for f in frames]),
        )
    np.testing.assert_array_equal(signals["plain"][0], signals["wide"][0])
    assert signals["wide"][1].var() < 0.5 * signals["plain"][1].var()
    references = [t.reference(camera, (16, 16), 8) for t in (plain, wide)]
    for one, other in zip(*references, strict=True):
        np.testing.assert_array_equal(one, other)


def test_signals_of_a_frame_add_up_to_the_reference(trace: OpenTracer) -> None:
    t = trace(glossy(), regularize=False)
    frames = np.stack([still(t, (20, 15), index).radiance() for index in range(400)])
    means = frames.reshape(20, 20, *frames.shape[1:]).mean(axis=1)
    signals = t.reference(glossy().camera, (20, 15), 400)
    assert len(signals) == 3
    expected = still(t, (20, 15)).modulated(*signals)
    ours, theirs = means.mean(axis=(1, 2)), expected.mean(axis=(0, 1))
    assert_same(Estimate.of(ours), theirs, sharp=0.05)


@pytest.mark.parametrize("uv_sign", [1.0, -1.0], ids=["as it is", "mirrored"])
def test_a_normal_map_tilts_along_the_texture_coordinates(trace: OpenTracer, uv_sign: float) -> None:
    """Red leans towards growing u, green towards growing v, on both sides and where the texture is mirrored."""
    floor = quad((-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1))
    u = floor[..., 0:1] * uv_sign
    uvs = np.concatenate([u, -floor[..., 2:3]], axis=-1)  # v grows towards -z
    material = Material("floor", normal_texture=0, normal_scale=0.5, double_sided=True)
    camera = Camera.look_at((0.0, 2.0, 0.001), (0.0, 0.0, 0.0), yfov_degrees=20.0)
    what = scene([mesh("floor", floor, uvs=uvs)], [material], camera, WHITE_SKY)

    def made_of(pixel: tuple[int, int, int]) -> Scene:
        textured = replace(what, textures=(Texture("bumps", np.full((2, 2, 3), pixel, np.uint8), linear=True),))
        return with_every_material(textured)

    expected = np.array([0.5 * uv_sign, 1.0, 0.0]) / math.sqrt(1.25)
    normal = still(trace(made_of((255, 128, 255))), (3, 3)).surface[1, 1, :3]
    np.testing.assert_allclose(normal, expected, atol=0.005)
    green = still(trace(made_of((128, 255, 255))), (3, 3)).surface[1, 1, :3]
    np.testing.assert_allclose(green, np.array([0.0, 1.0, -0.5]) / math.sqrt(1.25), atol=0.005)
    below = Camera.look_at((0.0, -2.0, 0.001), (0.0, 0.0, 0.0), yfov_degrees=20.0)
    under = trace(replace(made_of((255, 128, 255)), camera=below))
    np.testing.assert_allclose(still(under, (3, 3)).surface[1, 1, :3], -expected, atol=0.005)


def test_textures_of_roughness_and_metal_are_linear(trace: OpenTracer) -> None:
    """Roughness is green, metallic blue: 51 is 0.2, and no sRGB code."""
    floor = quad((-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1))
    uvs = np.concatenate([floor[..., 0:1], floor[..., 2:3]], axis=-1)
    material = Material(
        "floor", (1.0, 0.5, 0.0), specular=True, metallic=1.0, roughness=0.5, metallic_roughness_texture=0
    )
    camera = Camera.look_at((0.0, 2.0, 0.001), (0.0, 0.0, 0.0), yfov_degrees=20.0)
    what = scene([mesh("floor", floor, uvs=uvs)], [material], camera, WHITE_SKY)
    for blue in (0, 102, 255):
        texture = Texture("gloss", np.full((4, 4, 3), (9, 51, blue), np.uint8), linear=True)
        frame = still(trace(with_every_material(replace(what, textures=(texture,)))), (3, 3))
        assert frame.specular_albedo is not None
        assert frame.specular_albedo[1, 1, 3] == pytest.approx(0.1, abs=1e-6)
        whole = frame.albedo[1, 1, :3] + frame.specular_albedo[1, 1, :3]
        np.testing.assert_allclose(whole, ggx.albedo(1.0, (1.0, 0.5, 0.0), blue / 255, 0.1), atol=3e-3)


def test_colours_of_vertices_are_factors_of_the_base_colour(trace: OpenTracer) -> None:
    floor = quad((-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1))
    painted = mesh("floor", floor)
    colors = np.ones((6, 4), np.float32)
    colors[:, 0] = (floor[..., 0].reshape(-1) + 1) / 2  # red grows with x
    colors[:, 1] = 0.25
    camera = Camera.look_at((0.0, 2.0, 0.001), (0.0, 0.0, 0.0), yfov_degrees=40.0)
    material = Material("floor", (0.8, 0.8, 0.4), specular=True)
    what = scene([replace(painted, colors=colors)], [material], camera)
    frame = still(trace(with_every_material(what)), (9, 9))
    assert frame.specular_albedo is not None
    assert frame.position is not None
    share = 1 - frame.specular_albedo[..., 0]
    x = frame.position[..., 0] + trace(with_every_material(what)).scene.origin[0]
    np.testing.assert_allclose(frame.albedo[..., 0], 0.8 * (x + 1) / 2 * share, atol=0.01)
    np.testing.assert_allclose(frame.albedo[..., 1], 0.2 * share, atol=0.01)
    np.testing.assert_allclose(frame.albedo[..., 2], 0.4 * share, atol=0.01)


def test_a_frame_is_the_same_for_any_tiling_and_number_of_threads(trace: OpenTracer) -> None:
    frames = [still(trace(glossy(), **how), (24, 16)) for how in ({"tile": 96}, {"threads": 2, "tile": 192}, {})]
    for name in ("direct", "indirect", "specular", "albedo", "specular_albedo", "surface"):
        first, *others = (getattr(frame, name) for frame in frames)
        assert np.isfinite(first).all()
        for other in others:
            np.testing.assert_array_equal(first, other)
