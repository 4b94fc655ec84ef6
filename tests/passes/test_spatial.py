"""The filters in space: invariants, and each against NumPy in double precision."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config import Config, load
from gl.passes.spatial import SPATIAL
from raytrace.frame import FramePacket
from tests.passes.harness import DEPTH, HALF, PIXEL_SIZE, Bench, columns, frame, noise, with_sky
from tests.passes.spatial_oracle import Oracle, sample

FILTERS = tuple(SPATIAL)
GUIDED = ("joint", "joint-separable", "atrous", "atrous-jitter", "guided")
"""Those that know edges of surfaces."""

BY_COLOR = ("bilateral", "atrous", "atrous-jitter")
"""Those that the noise stops as well as edges of light."""

SMALL = ("guided.radius=3", "joint.sigma_d=1.5", "bilateral.sigma_d=1.5", "atrous.iterations=3", "atrous.taps=5")


def alone(*settings: str) -> Config:
    """Without time."""
    return load(None, ("spatial.temporal=false", *settings))


def radiance(bench: Bench, packet: FramePacket, denoiser: str, config: Config | None = None) -> np.ndarray:
    return bench.denoise(packet, config or alone(), denoiser)["radiance"][..., :3]


def rough(size: tuple[int, int], seed: int = 0, sky: bool = True) -> FramePacket:
    """Noise on a bumpy surface with a step in it, pixels without a sample or a finite guide, and a hole."""
    rng = np.random.default_rng(seed)
    height, width = size[1], size[0]
    depth = DEPTH + np.cumsum(rng.normal(0.0, 0.01, (height, width)), 1) + columns(size, np.arange(width) > width // 2)
    normal = rng.normal(0.0, 0.05, (height, width, 3)) + np.array([0.0, 0.0, 1.0])
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    gradient = rng.normal(0.0, 0.02, (height, width, 2))
    light = noise(size, seed)
    light[rng.random((height, width)) < 0.05] = np.nan
    packet = frame(
        size, direct=light, indirect=0.3 * noise(size, seed + 1), normal=normal, depth=depth, gradient=gradient
    )
    if not sky:
        return packet
    surface = packet.surface.copy()
    surface[rng.random((height, width)) < 0.02, 3] = np.inf
    hole = np.zeros((height, width), bool)
    hole[height // 3 : height // 2, width // 4 : width // 2] = True
    return with_sky(replace(packet, surface=surface), hole)


@pytest.mark.parametrize("size", [(31, 33), (1, 1), (1, 9)])
@pytest.mark.parametrize("denoiser", FILTERS)
def test_constant_light_stays_constant(bench: Bench, denoiser: str, size: tuple[int, int]) -> None:
    """Whatever the surfaces, in every corner, and around the sky, which stays black."""
    packet = rough(size, 3)
    hit = packet.surface[..., 3] > 0  # also where the depth is infinite: the sample is left alone there
    plain = replace(packet, direct=frame(size, direct=0.75).direct, indirect=frame(size).indirect)
    got = radiance(bench, plain, denoiser)
    np.testing.assert_allclose(got[hit], 0.75, rtol=2 * HALF)
    assert (got[~hit] == 0).all()


@pytest.mark.parametrize("size", [(23, 14), (1, 9)])
@pytest.mark.parametrize("denoiser", FILTERS)
def test_every_filter_is_its_formula(bench: Bench, denoiser: str, size: tuple[int, int]) -> None:
    packet = replace(rough(size, 5), index=7)
    config = alone(*SMALL)
    got = radiance(bench, packet, denoiser, config)
    expected = Oracle(packet, config).run(denoiser, sample(packet))[..., :3]
    # Half precision between the passes; where luminance decides, its rounding moves weights as well.
    np.testing.assert_allclose(got, expected, rtol=8 * HALF, atol=2e-3)
    assert np.abs(got - expected).mean() < 5e-4


@pytest.mark.parametrize("denoiser", FILTERS)
def test_a_filter_removes_noise_and_keeps_the_light(bench: Bench, denoiser: str) -> None:
    """On a wall. Where colours stop it, it does not: pixels leave out what is unlike them, and the bright are few."""
    packet = frame((60, 44), direct=noise((60, 44), 1))
    mean, deviation = packet.direct[..., 0].mean(), packet.direct[..., 0].std()
    got = radiance(bench, packet, denoiser, alone("atrous.sigma_l=1000", "bilateral.sigma_r=1000"))
    assert got.std() < 0.2 * deviation
    assert got.mean() == pytest.approx(mean, rel=0.05)
    stopped = radiance(bench, packet, denoiser, alone("atrous.sigma_l=1", "bilateral.sigma_r=1"))
    assert (stopped.mean() < 0.96 * mean) == (denoiser in BY_COLOR)


@pytest.mark.parametrize("denoiser", FILTERS)
def test_what_is_not_finite_stays_where_it_is(bench: Bench, denoiser: str) -> None:
    """A pixel without a sample takes its neighbours' light; nobody else notices."""
    size = (21, 17)
    light = np.ones((17, 21, 3))
    light[8, 10] = np.nan
    light[3, 3, 1] = np.inf
    got = radiance(bench, frame(size, direct=light), denoiser)
    np.testing.assert_allclose(got, 1.0, rtol=2 * HALF)


@pytest.mark.parametrize("guide", ["surface", "gradient", "motion"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("denoiser", FILTERS)
def test_guides_that_are_not_finite_spoil_no_other_pixel(bench: Bench, denoiser: str, guide: str, bad: float) -> None:
    size = (21, 17)
    packet = frame(size, direct=1.0)
    spoilt = getattr(packet, guide).copy()
    spoilt[8, 10] = bad
    spoilt[2, 3, -1] = bad
    got = radiance(bench, replace(packet, **{guide: spoilt}), denoiser, load())
    assert np.isfinite(got).all()
    others = np.ones(got.shape[:2], bool)
    others[8, 10] = others[2, 3] = False
    np.testing.assert_allclose(got[others], 1.0, rtol=2 * HALF)


@pytest.mark.parametrize("edge", ["depth", "normal"])
@pytest.mark.parametrize("denoiser", FILTERS)
def test_guides_stop_at_the_edges_of_surfaces(bench: Bench, denoiser: str, edge: str) -> None:
    size = (40, 20)
    right = np.arange(40) >= 20
    depth = columns(size, np.where(right, 2 * DEPTH, DEPTH)) if edge == "depth" else DEPTH
    normal = (
        np.where(columns(size, right)[..., None] > 0, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
        if edge == "normal"
        else (0, 0, 1)
    )
    packet = frame(size, direct=columns(size, np.where(right, 1.0, 0.2)), depth=depth, normal=normal)
    got = radiance(bench, packet, denoiser, alone("bilateral.sigma_r=1000"))
    leak = np.abs(got[:, 19:21, 0] - packet.direct[:, 19:21, 0]).max()
    if denoiser == "guided":  # the edge is a linear function of the guide, which epsilon dampens
        assert leak < 0.02
    elif denoiser in GUIDED:
        assert leak < 1e-3
    else:
        assert leak > 0.2, "neither of the two looks at surfaces"


def test_the_bilateral_filter_stops_at_edges_of_colour(bench: Bench) -> None:
    size = (40, 20)
    packet = frame(size, direct=columns(size, np.where(np.arange(40) >= 20, 1.0, 0.2)))
    sharp = radiance(bench, packet, "bilateral", alone("bilateral.sigma_r=0.1"))
    np.testing.assert_allclose(sharp[..., 0], packet.direct[..., 0], atol=1e-3)


def test_a_separable_gaussian_is_the_whole_one(bench: Bench) -> None:
    """Also beside holes: rows pass on how much of them there was."""
    packet = rough((31, 33), 2)
    whole = radiance(bench, packet, "gaussian", alone("gaussian.separable=false"))
    np.testing.assert_allclose(radiance(bench, packet, "gaussian"), whole, rtol=4 * HALF, atol=1e-4)


def test_the_separable_joint_filter_is_exact_on_a_wall_and_off_across_an_edge(bench: Bench) -> None:
    def both(packet: FramePacket) -> list[np.ndarray]:
        return [radiance(bench, packet, name, alone("joint.sigma_d=2")) for name in ("joint", "joint-separable")]

    light = noise((31, 33), 4)
    whole, rows_and_columns = both(frame((31, 33), direct=light))
    # The floor of the depth weight's range does not count where no depth differs.
    np.testing.assert_allclose(rows_and_columns, whole, rtol=4 * HALF)
    y, x = np.mgrid[:33, :31]
    whole, rows_and_columns = both(frame((31, 33), direct=light, depth=np.where(2 * x + y < 48, DEPTH, 2 * DEPTH)))
    assert np.abs(rows_and_columns - whole).max() > 0.02


def test_tolerance_for_luminance_is_halved(bench: Bench) -> None:
    """So that a step that the first iteration passes stops the last."""
    size = (60, 20)
    packet = frame(size, direct=columns(size, np.where(np.arange(60) >= 30, 1.0, 0.2)))

    def leak(*settings: str) -> float:
        got = radiance(bench, packet, "atrous", alone("atrous.sigma_l=0.5", *settings))
        return float(np.abs(got - packet.direct[..., :3]).sum())

    assert leak() < 0.6 * leak("atrous.halve=false")


def test_random_taps_change_with_the_frame_and_with_nothing_else(bench: Bench) -> None:
    packet = frame((31, 33), direct=noise((31, 33), 4))
    one = radiance(bench, packet, "atrous-jitter")
    assert (radiance(bench, packet, "atrous-jitter") == one).all()
    assert (radiance(bench, replace(packet, index=1), "atrous-jitter") != one).mean() > 0.9


def test_random_taps_are_on_average_where_the_kernel_is(bench: Bench) -> None:
    """The mean over frames of a point of light, one iteration without its own pixel: the kernel, and no direction."""
    size = (21, 21)
    light = np.zeros((21, 21))
    light[10, 10] = 1.0
    config = alone("atrous.iterations=1", "atrous.sigma_l=1000", "atrous.taps=24")
    packet = frame(size, direct=light)
    got = np.mean([radiance(bench, replace(packet, index=i), "atrous-jitter", config)[..., 0] for i in range(64)], 0)
    got *= 25.0  # Σ w of 24 taps and the centre
    binomial = np.array([1, 4, 6, 4, 1]) / 16
    expected = 24 * np.outer(binomial, binomial)
    expected[2, 2] += 1.0
    np.testing.assert_allclose(got[8:13, 8:13], expected, atol=0.35)
    assert got.sum() == pytest.approx(25.0, rel=0.02)
    assert got[8:13, 8:10].sum() == pytest.approx(got[8:13, 11:13].sum(), rel=0.1)


@pytest.mark.parametrize("denoiser", FILTERS)
@pytest.mark.parametrize("order", ["filter-first", "blend-first"])
def test_both_orders_blend_over_time(bench: Bench, denoiser: str, order: str) -> None:
    """A still camera, a running mean: what is left of the noise after 12 frames is far below that of one."""
    size = (31, 33)
    config = load(None, (f"spatial.order={order}", "spatial.alpha=0", *SMALL))
    frames = [replace(frame(size, direct=noise(size, i)), index=i) for i in range(12)]
    got = [radiance(bench, packet, denoiser, config) for packet in frames]
    assert got[-1].std() < 0.45 * got[0].std()
    if denoiser not in BY_COLOR:
        assert got[-1].mean() == pytest.approx(1.0, rel=0.02)


def test_the_order_does_not_matter_to_a_linear_filter_with_a_still_camera_and_does_to_others(bench: Bench) -> None:
    size = (31, 33)
    frames = [replace(rough(size, 0, sky=False), direct=frame(size, direct=noise(size, i)).direct) for i in range(4)]

    def last(denoiser: str, order: str) -> np.ndarray:
        bench.restart()
        config = load(None, (f"spatial.order={order}", *SMALL))
        return [radiance(bench, packet, denoiser, config) for packet in frames][-1]

    for denoiser in ("gaussian", "joint", "joint-separable", "guided"):
        a, b = (last(denoiser, order) for order in ("filter-first", "blend-first"))
        np.testing.assert_allclose(a, b, rtol=8 * HALF, atol=2e-3, err_msg=denoiser)
    assert np.abs(last("bilateral", "filter-first") - last("bilateral", "blend-first")).max() > 0.05


def test_the_blend_is_a_running_mean_and_then_exponential(bench: Bench) -> None:
    values = [1.0, 3.0, 2.0, 8.0, 5.0]
    config = load(None, ("spatial.alpha=0.4",))
    expected = 0.0
    for n, value in enumerate(values, 1):
        got = radiance(bench, frame(direct=value), "gaussian", config)
        expected += max(1 / n, 0.4) * (value - expected)
        np.testing.assert_allclose(got, expected, rtol=4 * HALF)


def test_without_demodulation_the_filter_sees_the_albedo(bench: Bench) -> None:
    size = (40, 20)
    albedo = columns(size, np.where(np.arange(40) >= 20, 1.0, 0.2))
    packet = frame(size, direct=1.0, albedo=albedo)
    kept = radiance(bench, packet, "gaussian", alone())
    np.testing.assert_allclose(kept[..., 0], albedo, rtol=2 * HALF)
    blurred = radiance(bench, packet, "gaussian", alone("spatial.demodulate=false"))
    assert 0.4 < blurred[10, 20, 0] < 0.8


def test_the_guided_filter_reproduces_what_is_linear_in_its_guide(bench: Bench) -> None:
    """Light that is a linear function of depth and normal comes back, however far away; only epsilon dampens it."""
    size = (31, 33)
    y, x = np.mgrid[:33, :31]
    tilt = 0.02 * x
    normal = np.dstack([np.sin(tilt), np.zeros_like(tilt), np.cos(tilt)])
    for far in (1.0, 1e4):
        depth = far * (DEPTH + 0.05 * y)
        light = 0.5 + 0.1 * (depth / far - DEPTH) + 0.3 * np.sin(tilt)
        packet = frame(size, direct=light, depth=depth, normal=normal, pixel_size=PIXEL_SIZE)
        got = radiance(bench, packet, "guided", alone("guided.epsilon=1e-6", "guided.radius=4"))
        np.testing.assert_allclose(got[..., 0], light, rtol=2e-3)


def test_the_guided_filter_does_not_cancel_far_from_the_camera(bench: Bench) -> None:
    """1 m of relief 1e5 m away: squares of depths would differ in the eleventh digit."""
    size = (31, 33)
    rng = np.random.default_rng(0)
    relief = rng.random((33, 31))
    packet = frame(size, direct=1.0 + relief, depth=1e5 + relief, pixel_size=1e-5)
    depth = packet.surface[..., 3].astype(np.float64) - 1e5
    got = radiance(bench, packet, "guided", alone("guided.epsilon=1e-6", "guided.radius=4"))
    np.testing.assert_allclose(got[..., 0], 1.0 + depth, atol=0.02)
