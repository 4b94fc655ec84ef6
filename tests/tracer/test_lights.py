"""Lights without a surface and environments, against closed forms and integrals in double precision."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.environment import Environment, build_environment, direction_of
from raytrace.lights import environment_at, find_interval, sample_environment
from raytrace.punctual import PunctualLight
from raytrace.scene import Scene
from raytrace.tables import Tables
from tests.tracer.conftest import OpenTracer
from tests.tracer.scenes import GREY, WHITE, Point, box, light_at, mesh, placed, quad, scene, sphere, still, tracer
from tests.tracer.statistics import Estimate, assert_same

F64 = NDArray[np.float64]

GLOW = (8.0, 4.0, 2.0)
CAMERA = Camera.look_at((0.0, 3.0, 5.0), (0.0, 0.0, 0.0))
FLOOR = mesh("floor", quad((-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)))
SCREEN = mesh("screen", quad((0.3, 1, -1), (2.3, 1, -1), (2.3, 1, 1), (0.3, 1, 1)))
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


OFF = PunctualLight("off", "point", intensity=(0.0, 0.0, 0.0))
"""Of no power, so that nobody draws it: lets all scenes of this file share one variant of the kernels."""


def lit_by(*lights: PunctualLight, environment: Environment | None = None) -> Scene:
    """A floor with a screen one above it, on one side."""
    return replace(scene([FLOOR, SCREEN], [GREY], CAMERA), lights=lights, environment=environment)


def floor_at(what: Scene, place: Point, trace: OpenTracer) -> F64:
    """Direct light on the floor, which must be without noise."""
    x, _, z = place
    got = light_at(trace(what), place, (x, 0.5, z), 64).direct
    assert np.ptp(got, axis=0).max() <= 1e-6 * got.max()
    result: F64 = got[0]
    return result


# --------------------------------------------------------------------------------------------- lights without a surface


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e4], ids=["", "small", "large"])
def test_a_point_light_falls_off_with_the_cosine_and_the_square_of_the_distance(
    trace: OpenTracer, scale: float
) -> None:
    lamp = PunctualLight("lamp", "point", (0.0, 2.0 * scale, 0.0), intensity=GLOW)
    what = replace(placed(scene([FLOOR, SCREEN], [GREY], CAMERA), scale), lights=(lamp,))
    t = trace(what)
    for x in (0.0, -0.5, -3.0):
        square = (4.0 + x * x) * scale**2
        cosine = 2.0 * scale / math.sqrt(square)
        got = light_at(t, (x * scale, 0.0, 0.0), (x * scale, 0.5 * scale, 0.0), 8).direct
        np.testing.assert_allclose(got, np.tile(np.array(GLOW) * cosine / square / math.pi, (8, 1)), rtol=2e-5)
    assert not light_at(t, (2.0 * scale, 0.0, 0.0), (2.0 * scale, 0.5 * scale, 0.0), 8).direct.any()  # screened


def test_a_point_light_below_the_floor_does_not_light_it(trace: OpenTracer) -> None:
    below = PunctualLight("lamp", "point", (0.0, -2.0, 0.0), intensity=GLOW)
    assert not floor_at(lit_by(below), (-1.0, 0.0, 0.0), trace).any()


def test_a_range_fades_the_light_out(trace: OpenTracer) -> None:
    lamp = PunctualLight("lamp", "point", (0.0, 2.0, 0.0), intensity=GLOW, range=3.0)
    expected = np.array(GLOW) / 4.0 / math.pi * (1.0 - (2.0 / 3.0) ** 4)
    np.testing.assert_allclose(floor_at(lit_by(lamp), (0.0, 0.0, 0.0), trace), expected, rtol=2e-5)
    assert not floor_at(lit_by(lamp), (-3.0, 0.0, 0.0), trace).any()


def test_a_spot_has_a_bright_middle_a_soft_edge_and_nothing_outside(trace: OpenTracer) -> None:
    inner, outer = math.radians(20.0), math.radians(40.0)
    spot = PunctualLight("spot", "spot", (0.0, 2.0, 0.0), (0.0, -1.0, 0.0), GLOW, inner, outer)
    for degrees in (0.0, 15.0, 25.0, 35.0, 39.0, 41.0, 75.0):
        x, cosine = -2.0 * math.tan(math.radians(degrees)), math.cos(math.radians(degrees))
        ramp = (cosine - math.cos(outer)) / (math.cos(inner) - math.cos(outer))
        expected = np.array(GLOW) * cosine**3 / 4.0 / math.pi * min(max(ramp, 0.0), 1.0) ** 2
        np.testing.assert_allclose(floor_at(lit_by(spot), (x, 0.0, 0.0), trace), expected, rtol=1e-4, atol=1e-9)


def test_a_directional_light_is_the_same_everywhere_but_in_the_shade(trace: OpenTracer) -> None:
    down = np.array((0.6, -0.8, 0.0))
    sun = PunctualLight("sun", "directional", direction=(0.6, -0.8, 0.0), intensity=GLOW)
    for x in (-8.0, -1.0, 0.5):
        expected = np.array(GLOW) * -down[1] / math.pi
        np.testing.assert_allclose(floor_at(lit_by(sun), (x, 0.0, 0.0), trace), expected, rtol=2e-5)
    assert not floor_at(lit_by(sun), (2.0, 0.0, 0.0), trace).any()


def test_several_lights_of_all_kinds_add_up(trace: OpenTracer) -> None:
    lights = (
        PunctualLight("a", "point", (0.0, 2.0, 0.0), intensity=(1.0, 0.0, 0.0)),
        PunctualLight("b", "spot", (-1.0, 1.5, 0.5), (0.2, -1.0, -0.1), (0.0, 5.0, 0.0), 0.3, 0.9),
        PunctualLight("c", "directional", direction=(0.1, -1.0, 0.3), intensity=(0.0, 0.0, 0.02)),
    )
    each = [floor_at(lit_by(light), (-0.7, 0.0, 0.2), trace) for light in lights]
    assert all(light.max() > 0.0 for light in each)
    got = light_at(trace(lit_by(*lights)), (-0.7, 0.0, 0.2), (-0.7, 0.5, 0.2), 60_000).direct
    assert_same(Estimate.of(got), np.sum(each, axis=0), sharp=0.05)


def test_in_a_white_ball_the_bounce_brings_the_albedo_times_the_direct_light(trace: OpenTracer) -> None:
    """Around a light in the middle of a ball every wall gets I / R^2, and sees every other wall alike."""
    lamp = PunctualLight("lamp", "point", intensity=GLOW)
    ball = scene([mesh("ball", sphere(2.0, splits=3, inward=True))], [GREY], Camera.look_at((0.1, 0, 0), (0, 0, -1)))
    got = light_at(trace(replace(ball, lights=(lamp,))), (0.2, 0.3, -2.0), (0.0, 0.0, 0.0), 30_000)
    expected = np.array(GLOW) / 4.0 / math.pi
    np.testing.assert_allclose(got.direct.mean(axis=0), expected, rtol=0.02)  # of facets, not of the ball
    assert_same(Estimate.of(got.indirect), expected * GREY.base_color, slack=0.02, sharp=0.03)


@pytest.mark.parametrize("kind", ["point", "spot", "directional"])
def test_power_is_what_a_ball_around_the_light_receives(kind: Any) -> None:
    light = PunctualLight("x", kind, intensity=(2.0, 2.0, 2.0), inner=0.4, outer=1.1)
    cosines = (np.arange(20_000) + 0.5) / 10_000 - 1.0
    if kind == "point":
        expected = 2.0 * np.ones_like(cosines).mean() * 4.0 * math.pi
    elif kind == "spot":
        ramp = (cosines - math.cos(1.1)) / (math.cos(0.4) - math.cos(1.1))
        expected = 2.0 * (np.clip(ramp, 0.0, 1.0) ** 2).mean() * 4.0 * math.pi
    else:
        expected = 2.0 * math.pi * 9.0
    assert light.power(3.0) == pytest.approx(expected, rel=1e-6)


# --------------------------------------------------------------------------------------------------------- environments


def noise(width: int = 24, height: int = 12, seed: int = 3) -> Environment:
    """Bright and black texels, a black row and one that outshines everything."""
    random = np.random.default_rng(seed)
    pixels = random.random((height, width, 3)) ** 4 * (random.random((height, width, 1)) > 0.4)
    pixels[3] = 0.0
    pixels[8, 5] = (300.0, 200.0, 100.0)
    return Environment("noise", pixels.astype(np.float32), turn=0.1)


def radiance(environment: Environment, directions: F64) -> F64:
    """Bilinear look-up in float64 at unit vectors (n, 3)."""
    height, width = environment.pixels.shape[:2]
    x, y, z = directions.T
    s = (0.5 + np.arctan2(x, -z) / (2 * math.pi) + environment.turn) * width - 0.5
    t = np.arccos(np.clip(-y, -1, 1)) / math.pi * height - 0.5
    columns, rows = np.floor(s).astype(int), np.floor(t).astype(int)
    fs, ft = (s - columns)[:, None], (t - rows)[:, None]

    def at(row: NDArray[np.int_], column: NDArray[np.int_]) -> F64:
        texels: F64 = environment.pixels[np.clip(row, 0, height - 1), column % width].astype(np.float64)
        return texels

    low = at(rows, columns) * (1 - fs) + at(rows, columns + 1) * fs
    high = at(rows + 1, columns) * (1 - fs) + at(rows + 1, columns + 1) * fs
    result: F64 = low * (1 - ft) + high * ft
    return result


def all_around(count: int = 1000) -> tuple[F64, F64]:
    """Unit vectors (n, 3) and solid angles (n,) that cover the sphere."""
    theta, phi = np.meshgrid((np.arange(count) + 0.5) / count * math.pi, (np.arange(2 * count) + 0.5) / count * math.pi)
    sine = np.sin(theta).ravel()
    directions = np.stack([sine * np.cos(phi).ravel(), np.cos(theta).ravel(), sine * np.sin(phi).ravel()], axis=1)
    return directions, sine * (math.pi / count) ** 2


def received(environment: Environment, normal: Point) -> F64:
    """Irradiance over pi, by quadrature."""
    directions, angles = all_around()
    cosine = np.maximum(directions @ (np.array(normal) / np.linalg.norm(normal)), 0.0)
    result: F64 = (radiance(environment, directions) * (cosine * angles)[:, None]).sum(axis=0) / math.pi
    return result


@pytest.mark.parametrize("side", [(0, 1, 0), (0, -1, 0), (1, 0, 0), (-1, 0, 0), (0, 0, 1), (0, 0, -1)])
def test_an_environment_lights_a_cube_as_the_integral_says(trace: OpenTracer, side: Point) -> None:
    """Each side of it, so that a picture that is mirrored, turned or upside down shows."""
    around = noise()
    cube = replace(
        scene([mesh("cube", box((-1, -1, -1), (1, 1, 1)))], [WHITE], CAMERA), environment=around, lights=(OFF,)
    )
    x, y, z = side
    eye = (0.1 + 2 * x, 0.2 + 2 * y, -0.1 + 2 * z)
    got = light_at(trace(cube), (0.1 + x * 0.9, 0.2 + y * 0.8, -0.1 + z * 1.1), eye, 40_000)
    assert_same(Estimate.of(got.direct), received(around, side), slack=2e-3, sharp=0.05)
    assert not got.indirect.any()


def test_a_constant_environment_is_a_furnace(trace: OpenTracer) -> None:
    """As under the constant sky, only that light samples now know nothing of the surface's cosine."""
    glow = (1.0, 2.0, 3.0)
    even = Environment("even", np.broadcast_to(np.array(glow, np.float32), (16, 32, 3)).copy())
    ball = scene([mesh("ball", sphere(splits=2))], [GREY], CAMERA)
    frames = [still(trace(replace(ball, environment=even, lights=(OFF,))), (32, 24), index) for index in range(30)]
    surface = frames[0].albedo[..., 3] == 1.0
    direct = np.stack([frame.direct[surface][:, :3].mean(axis=0, dtype=np.float64) for frame in frames])
    assert_same(Estimate.of(direct), np.array(glow), sharp=0.03)
    emission = frames[0].emission[~surface][:, :3]
    np.testing.assert_allclose(emission, np.tile(glow, (len(emission), 1)), rtol=1e-6)
    assert not any(frame.indirect[..., :3].any() for frame in frames)


def test_a_sun_of_one_texel_lights_without_noise(trace: OpenTracer) -> None:
    """Bounce rays do not find it, so that an estimator without light samples would be black but for a few pixels."""
    pixels = np.full((64, 128, 3), 0.01, np.float32)
    pixels[48, 64] = 1e5
    sun = Environment("sun", pixels)
    got = light_at(trace(lit_by(OFF, environment=sun)), (-2.0, 0.0, 0.0), (-2.0, 0.5, 0.0), 4000).direct
    expected = received(sun, (0, 1, 0))
    assert_same(Estimate.of(got), expected, slack=2e-3, sharp=0.02)
    assert got.std(axis=0)[1] < 0.2 * expected[1]


def test_lamps_lights_and_an_environment_add_up(trace: OpenTracer) -> None:
    around, lamp = noise(), PunctualLight("lamp", "point", (0.0, 2.0, 0.0), intensity=GLOW)
    alone = floor_at(lit_by(lamp), (-1.5, 0.0, 0.3), trace)
    floor = replace(scene([FLOOR], [GREY], CAMERA), lights=(lamp,), environment=around)
    got = light_at(trace(floor), (-1.5, 0.0, 0.3), (-1.5, 0.5, 0.3), 60_000).direct
    assert_same(Estimate.of(got), alone + received(around, (0, 1, 0)), slack=2e-3, sharp=0.05)


def test_a_camera_sees_the_environment_where_it_is(trace: OpenTracer) -> None:
    around = noise()
    speck = mesh("speck", box((90, 0, 0), (90.1, 0.1, 0.1)))
    what = replace(scene([speck], [GREY], CAMERA), environment=around, lights=(OFF,))
    t = trace(what)
    for target in ((0.0, 0.0, -1.0), (1.0, 0.3, 0.2), (-0.4, -0.9, 0.3)):
        camera = Camera.look_at((0.0, 0.0, 0.0), target, up=(0.1, 1.0, 0.2), yfov_degrees=0.01)
        seen = t.frame(0, camera, camera, (1, 1)).emission[0, 0, :3]
        unit = np.array(target)[None] / np.linalg.norm(target)
        np.testing.assert_allclose(seen, radiance(around, unit)[0], rtol=2e-3, atol=1e-5)


# ---------------------------------------------------------------------------------------------- sample, density, invert


@njit
def _draw(tables: Any, u: Any, v: Any, out: Any) -> None:
    for i in range(u.shape[0]):
        x, y, z, r, g, b, density = sample_environment(tables, u[i], v[i])
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = x, y, z, density
        out[i, 4], out[i, 5], out[i, 6] = r, g, b
        r, g, b, density = environment_at(tables, x * np.float32(3), y * np.float32(3), z * np.float32(3))
        out[i, 7], out[i, 8], out[i, 9], out[i, 10] = r, g, b, density


@pytest.fixture(scope="module")
def draw() -> Callable[[Environment, F64, F64], F64]:
    """Unit vectors, densities and radiances of samples; radiances and densities looked up there: (n, 11)."""

    def drawn(environment: Environment, u: F64, v: F64) -> F64:
        what = lit_by(OFF, environment=environment)
        with tracer(what) as t:
            tables: Tables = t.tables
            out = np.zeros((len(u), 11), np.float32)
            _draw(tables, u.astype(np.float32), v.astype(np.float32), out)
        return out.astype(np.float64)

    return drawn


def test_samples_have_the_density_and_the_radiance_that_a_look_up_finds(
    draw: Callable[[Environment, F64, F64], F64],
) -> None:
    random = np.random.default_rng(1)
    drawn = draw(noise(), random.random(20_000), random.random(20_000))
    np.testing.assert_allclose(np.linalg.norm(drawn[:, :3], axis=1), 1.0, atol=2e-6)
    assert (drawn[:, 3] > 0.0).all()
    # Rounding may put a direction on the border of a texel into the next one.
    close = np.isclose(drawn[:, 3], drawn[:, 10], rtol=1e-4)
    assert close.mean() > 0.999
    np.testing.assert_allclose(drawn[:, 4:7], drawn[:, 7:10], rtol=2e-3, atol=2e-3)


def test_the_density_is_the_luminance_over_its_integral(draw: Callable[[Environment, F64, F64], F64]) -> None:
    """But for what the sine of the polar angle changes within a cell: nothing near the equator."""
    around = noise(96, 48)
    directions, angles = all_around(600)
    total = (radiance(around, directions) @ LUMINANCE) @ angles
    random = np.random.default_rng(5)
    drawn = draw(around, random.random(4000), random.random(4000))
    expected = radiance(around, drawn[:, :3]) @ LUMINANCE / total
    middle = np.abs(drawn[:, 1]) < 0.7
    np.testing.assert_allclose(drawn[middle, 3], expected[middle], rtol=0.05)


def test_as_many_samples_fall_into_a_part_of_the_sphere_as_the_density_says(
    draw: Callable[[Environment, F64, F64], F64],
) -> None:
    """Over the inverse of the density the mean is the solid angle of any part, the caps around the poles included."""
    around = Environment("grey", noise().pixels + np.float32(0.05), turn=0.1)
    random = np.random.default_rng(6)
    drawn = draw(around, random.random(200_000), random.random(200_000))
    up, phi = drawn[:, 1], np.arctan2(drawn[:, 0], -drawn[:, 2])
    for inside, angle in (
        (up > 0.98, 0.02 * 2 * math.pi),
        (up < -0.98, 0.02 * 2 * math.pi),
        ((np.abs(up) < 0.3) & (phi > 0.5) & (phi < 1.7), 0.6 * 1.2),
        ((up > 0.3) & (phi < 0.0), 0.7 * math.pi),
    ):
        assert_same(Estimate.of(inside / drawn[:, 3]), angle, slack=1e-3, sharp=0.3)


def test_a_direction_leads_back_to_the_numbers_it_was_drawn_with(draw: Callable[[Environment, F64, F64], F64]) -> None:
    around = noise()
    tables, (height, width) = build_environment(around), around.pixels.shape[:2]
    luminance = tables.texels[..., :3].astype(np.float64) @ LUMINANCE
    random = np.random.default_rng(2)
    u, v = random.random(500), random.random(500)
    drawn = draw(around, u, v)

    def share(x: float, a: float, b: float, first: float = 0.0, last: float = 1.0) -> float:
        """Of the integral from ``first`` to ``last`` under the line from ``a`` at 0 to ``b`` at 1, that up to x."""
        parts = [a * (q - first) + (b - a) / 2 * (q * q - first * first) for q in (x, last)]
        return parts[0] / parts[1]

    for i in range(500):
        x, y, z = drawn[i, :3]
        s = (math.atan2(x, -z) / (2 * math.pi) + around.turn + 0.5 - 0.5 / width) % 1.0 * width
        t = math.acos(min(max(-y, -1.0), 1.0)) / math.pi * height + 0.5
        row, column = min(int(t), height), min(int(s), width - 1)
        (a, b), (c, d) = luminance[row : row + 2, column : column + 2]
        fx, fy = s - column, t - row
        first, last = (0.5, 1.0) if row == 0 else (0.0, 0.5) if row == height else (0.0, 1.0)
        sums = tables.columns[row]
        v_back = tables.rows[row] + share(fy, a + b, c + d, first, last) * (tables.rows[row + 1] - tables.rows[row])
        u_back = sums[column] + share(fx, a + (c - a) * fy, b + (d - b) * fy) * (sums[column + 1] - sums[column])
        assert (u_back, v_back) == pytest.approx((u[i], v[i]), abs=2e-3)


def test_nothing_is_drawn_where_nothing_shines(draw: Callable[[Environment, F64, F64], F64]) -> None:
    pixels = np.zeros((8, 16, 3), np.float32)
    pixels[5, 3] = 1.0
    random = np.random.default_rng(4)
    drawn = draw(Environment("one", pixels), random.random(4000), random.random(4000))
    middle = direction_of(3.5 / 16, 5.5 / 8)
    assert (drawn[:, :3] @ middle).min() > math.cos(math.radians(45.0))
    black = draw(Environment("black", np.zeros((8, 16, 3), np.float32)), random.random(100), random.random(100))
    assert np.isfinite(black).all()
    assert not black[:, 3:].any()


@pytest.mark.parametrize("sums", [[0, 1], [0, 0, 0.25, 0.25, 1, 1], [0, 0.5, 0.5, 0.5, 1]])
def test_an_interval_of_no_width_is_never_found(sums: list[float]) -> None:
    table = np.array(sums, np.float32)
    for value in np.append(np.linspace(0.0, 1.0, 101)[:-1], 1.0 - 2.0**-24).astype(np.float32):
        i = find_interval(table, value)
        assert table[i] <= value < table[i + 1]
