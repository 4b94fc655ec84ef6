"""A-SVGF: every step against double precision, and what must never happen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from config import Asvgf, Config, Firefly, Svgf, Taa, load
from raytrace.frame import STRATUM, FramePacket
from tests.passes.asvgf_oracle import AdaptiveOracle, changing_room, with_gradients
from tests.passes.harness import F32, HALF, SIZES, Bench, frame, noise, with_sky
from tests.passes.room import room
from tests.passes.svgf_oracle import to_half
from tests.passes.test_svgf_oracle import difference

SIZE = (55, 38)  # neither side is a multiple of three
FRAMES = 5
PLAIN = Taa(enabled=False)


def config(**changes: Any) -> Config:
    return Config(asvgf=replace(Asvgf(), **changes), taa=PLAIN)


def preset(name: str) -> Asvgf:
    return load(None, (f"asvgf.preset={name}",)).asvgf


@pytest.mark.parametrize(
    "p",
    [
        Asvgf(),
        preset("paper"),
        preset("reference"),
        Asvgf(gain=3.0, cut="power", power=4.0, widen=True, gradient_iterations=2, sigma_n=100),
        Asvgf(separate=False, gradient_guided=False, color_clamp=True, alpha=0.05, alpha_moments=0.3),
    ],
    ids=["best", "paper", "reference", "power", "one signal"],
)
def test_every_step_agrees_with_double_precision(bench: Bench, p: Asvgf) -> None:
    oracle = AdaptiveOracle(p, to_half)
    names = {f"gradient{i}": f"asvgf.gradient{i}.out_change" for i in range(p.gradient_iterations)}
    names |= {"surface": "asvgf.strata.out_surface", "slope": "asvgf.strata.out_slope"}
    names |= {"lambda": "asvgf.lambda.out_lambda"} | ({"light": "asvgf.strata.out_light"} if p.gradient_guided else {})
    for index in range(FRAMES):
        packet = changing_room(index, SIZE)
        images = bench.denoise(packet, Config(asvgf=p, taa=PLAIN), "asvgf", keep=names.values())
        expected = oracle.step(packet)
        for step, name in names.items():
            ours = images[name]
            tolerance = HALF if step == "lambda" else 2e-4
            np.testing.assert_allclose(
                ours, oracle.steps[step][..., : ours.shape[2]], tolerance, tolerance, err_msg=step
            )
        error = difference(images["radiance"][..., :3], expected, packet)
        assert error.mean() < HALF / 10
        assert np.quantile(error, 0.99) < 2 * HALF
        assert error.max() < 16 * HALF


@pytest.mark.parametrize("separate", [True, False])
def test_where_nothing_changed_it_is_svgf_to_the_bit(bench: Bench, separate: bool) -> None:
    """In flight, with histories that are shortened, searched for and lost; gradients are there, and are zero."""
    pictures: dict[str, list[F32]] = {"svgf": [], "asvgf": []}
    shared = config(separate=separate)
    same = replace(shared, svgf=Svgf(separate=separate))
    for denoiser, radiance in pictures.items():
        bench.restart()
        for index in range(FRAMES):
            packet = changing_room(index, SIZE)
            assert packet.temporal_gradient is not None
            still = packet.temporal_gradient * np.array([0, 1, 0, 1], np.float32)
            packet = replace(room(index, SIZE), temporal_gradient=still)
            radiance.append(bench.denoise(packet, same, denoiser)["radiance"])
    np.testing.assert_array_equal(pictures["svgf"], pictures["asvgf"])


def test_a_frame_without_gradients_counts_as_one_without_change(bench: Bench) -> None:
    """The frame under way when the method is chosen, or one that was recorded."""
    assert room(0, SIZE).temporal_gradient is None
    for index in range(3):
        images = bench.denoise(room(index, SIZE), config(), "asvgf", keep=["asvgf.lambda.out_lambda"])
        np.testing.assert_array_equal(images["asvgf.lambda.out_lambda"][..., :2], 0.0)
        np.testing.assert_array_equal(images["asvgf.lambda.out_lambda"][..., 2:], 1.0)


def wall(size: tuple[int, int], light: object, change: tuple[float, float, float, float], seed: int = 0) -> FramePacket:
    """A still wall in ``light`` with the same change everywhere."""
    packet = frame(size, direct=light, indirect=light)  # type: ignore[arg-type]
    rows, columns = -(-size[1] // STRATUM), -(-size[0] // STRATUM)
    values = np.broadcast_to(np.array(change, np.float32), (rows, columns, 4))
    return replace(packet, temporal_gradient=values)


def lambdas(bench: Bench, packet: FramePacket, **changes: Any) -> F32:
    name = "asvgf.lambda.out_lambda"
    return bench.denoise(packet, config(**changes), "asvgf", keep=[name])[name]


@pytest.mark.parametrize("size", SIZES)
def test_light_that_is_gone_is_gone_in_the_same_frame(bench: Bench, size: tuple[int, int]) -> None:
    for follow in (True, False):
        bench.restart()
        for seed in range(6):
            bench.denoise(wall(size, noise(size, seed), (0, 1, 0, 1)), config(follow=follow), "asvgf")
        after = bench.denoise(wall(size, 0.0, (-1, 1, -1, 1)), config(follow=follow), "asvgf")["radiance"]
        assert not after[..., :3].any()


def test_one_signal_may_change_and_the_other_keeps_its_history(bench: Bench) -> None:
    size = (30, 20)
    names = [f"asvgf.{signal}.accumulate.out_moments" for signal in ("direct", "indirect")]
    for seed in range(6):
        images = bench.denoise(wall(size, noise(size, seed), (0, 1, 0, 1)), config(), "asvgf", keep=names)
    assert [np.unique(images[name][..., 3]).tolist() for name in names] == [[5.0], [5.0]]
    images = bench.denoise(wall(size, 1.0, (-0.5, 1, 0, 1)), config(), "asvgf", keep=names)
    direct, indirect = (images[name][..., 3] for name in names)
    np.testing.assert_allclose(direct, 7 / (1 + 0.5 * 6) - 1, rtol=1e-3)
    np.testing.assert_array_equal(indirect, 6.0)
    images = bench.denoise(wall(size, 1.0, (0, 1, 0, 1)), config(), "asvgf", keep=names)
    np.testing.assert_allclose(images[names[0]][..., 3], 7 / (1 + 0.5 * 6), rtol=0.2)
    np.testing.assert_array_equal(images[names[1]][..., 3], 7.0)


def test_light_that_is_dimmed_is_followed_by_all_of_the_history(bench: Bench) -> None:
    """By a fifth, with gain 0 so that nothing is cut: mean over time and moments are those of dimmed samples."""
    size = (30, 20)
    names = [f"asvgf.direct.accumulate.out_{what}" for what in ("color", "moments")]
    p = config(gain=0.0, feedback_level=-1, alpha=0.2, alpha_moments=0.2)
    for seed in range(8):
        images = bench.denoise(wall(size, noise(size, seed), (0, 1, 0, 1)), p, "asvgf", keep=names)
    color, moments = (images[name] for name in names)
    images = bench.denoise(wall(size, 0.8, (-0.2, 1, 0, 1)), p, "asvgf", keep=names)
    expected = 0.2 * 0.8 + 0.8 * 0.8 * color[..., :3]
    np.testing.assert_allclose(images[names[0]][..., :3], expected, rtol=4 * HALF)
    square = 0.2 * 0.8**2 + 0.8 * 0.8**2 * moments[..., 1]
    np.testing.assert_allclose(images[names[1]][..., 0], expected[..., 0], rtol=4 * HALF)
    np.testing.assert_allclose(images[names[1]][..., 1], square, rtol=4 * HALF)
    assert (images[names[1]][..., 3] == moments[..., 3] + 1).all()


@pytest.mark.parametrize("separate", [True, False])
@pytest.mark.parametrize("fireflies", ["off", "clamp", "variance"])
def test_a_sample_that_is_in_the_history_does_not_count_twice(bench: Bench, separate: bool, fireflies: str) -> None:
    """Carried over from the last frame and unchanged: neither colour nor length. Changed, as much as λ says."""
    names = [f"asvgf.{'direct' if separate else 'both'}.accumulate.out_{what}" for what in ("color", "moments")]
    p = config(separate=separate, follow=False, gain=1.0, alpha=0.2)
    p = replace(p, firefly=Firefly(mode=fireflies, max_radiance=100.0))
    for change, color, length in ((0.0, 1.0, 4.0), (-0.5, 1.0 + 0.6 * 0.5 * 2.0, 6 / 3.5 - 1.5), (-1.0, 3.0, 0.0)):
        bench.restart()
        for _ in range(5):
            bench.denoise(wall((18, 12), 0.5, (0, 1, 0, 1)), p, "asvgf")
        packet = wall((18, 12), 1.5, (change, 1, change, 1))
        direct, indirect = packet.direct.copy(), packet.indirect.copy()
        direct[..., 3] = indirect[..., 3] = 0.0
        images = bench.denoise(replace(packet, direct=direct, indirect=indirect), p, "asvgf", keep=names)
        scale = 0.5 if separate else 1.0
        np.testing.assert_allclose(images[names[0]][..., :3], scale * color, rtol=4 * HALF)
        np.testing.assert_allclose(images[names[1]][..., 3], max(length, 0.0), rtol=4 * HALF, atol=1e-6)


def test_no_light_then_and_now_is_no_change(bench: Bench) -> None:
    """Nothing divided by nothing (a stratum in the dark, one without a sample) is neither NaN nor 1."""
    np.testing.assert_array_equal(
        lambdas(bench, wall((18, 12), 0.0, (0, 0, 0, 0)), gain=1000.0), [[[0, 0, 1, 1]] * 18] * 12
    )
    denormal = float(np.float32(1e-42))
    assert not lambdas(bench, wall((18, 12), 0.0, (denormal, 0, -denormal, 0)), gain=1000.0)[..., :2].any()


def test_a_signal_that_is_next_to_nothing_may_change(bench: Bench) -> None:
    """Its own history is cut in proportion to all the light there is, not to itself."""
    values = lambdas(bench, wall((18, 12), 1.0, (1e-5, 1e-5, 0, 1.0)))
    np.testing.assert_allclose(values[..., 0], 1e-5 / 1e-3, rtol=0.01)
    assert not values[..., 1].any()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_gradient_that_is_no_number_is_none(bench: Bench, bad: float) -> None:
    packet = wall((18, 12), 1.0, (-0.5, 1, -0.5, 1))
    assert packet.temporal_gradient is not None
    spoilt = packet.temporal_gradient.copy()
    spoilt[1, 2, 0], spoilt[3, 3, 3] = bad, bad
    values = lambdas(bench, replace(packet, temporal_gradient=spoilt))
    np.testing.assert_allclose(values, np.broadcast_to([0.5, 0.5, 0.5, 0.5], values.shape), rtol=2 * HALF)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_light_that_is_no_number_does_not_reach_the_strata_around(bench: Bench, bad: float) -> None:
    packet = with_gradients(frame((30, 20), direct=noise((30, 20), 1), indirect=noise((30, 20), 2)), 5)
    direct = packet.direct.copy()
    direct[7, 7, 1] = bad
    for _ in range(3):
        images = bench.denoise(replace(packet, direct=direct), config(), "asvgf", keep=["asvgf.lambda.out_lambda"])
        assert np.isfinite(images["asvgf.lambda.out_lambda"]).all()
        assert np.isfinite(images["radiance"]).all()


def test_opposite_changes_cancel_and_equal_ones_do_not(bench: Bench) -> None:
    """What is left of the noise has either sign; filtered without it, it would look like a change."""
    packet = wall((48, 36), 1.0, (0, 1, 0, 1))
    assert packet.temporal_gradient is not None
    values = packet.temporal_gradient.copy()
    sign = np.where(np.add.outer(np.arange(12), np.arange(16)) % 2 == 0, 1.0, -1.0)
    values[..., 0] = 0.5 * sign
    values[..., 2] = -0.5
    found = lambdas(bench, replace(packet, temporal_gradient=values.astype(np.float32)))[9:-9, 9:-9]
    assert found[..., 0].max() < 0.02
    np.testing.assert_allclose(found[..., 1], 0.5, rtol=2 * HALF)


def test_change_does_not_cross_edges(bench: Bench) -> None:
    """Two walls of other depths: what happened on the left does not shorten histories on the right or the sky's."""
    size = (36, 24)
    depth = np.where(np.arange(36) < 18, 4.0, 5.0)[None] * np.ones((24, 1))
    packet = frame(size, direct=1.0, indirect=1.0, depth=depth)
    values = np.zeros((8, 12, 4), np.float32)
    values[..., 1::2] = 1.0
    values[:, :6, ::2] = -0.5
    packet = replace(packet, temporal_gradient=values)
    found = lambdas(bench, packet)
    np.testing.assert_allclose(found[:, :18, 0], 0.5, rtol=1e-2)
    assert found[:, 18:, 0].max() < 1e-2
    sky = np.zeros((24, 36), bool)
    sky[:, 18:] = True
    found = lambdas(bench, with_sky(packet, sky), gradient_iterations=5)
    np.testing.assert_allclose(found[:, :18, 0], 0.5, rtol=2 * HALF)


def test_a_stratum_speaks_for_the_surface_of_its_sample(bench: Bench) -> None:
    """At an edge that crosses a stratum: the gradient goes to the side on which the carried point lies."""
    size = (36, 24)
    depth = np.where(np.arange(36) < 17, 4.0, 5.0)[None] * np.ones((24, 1))  # the sixth column of strata has both
    values = np.tile(np.array([0, 1, 0, 1], np.float32), (8, 12, 1))
    values[:, 5] = -0.5, 1.0, -0.5, 1.0
    name = "asvgf.strata.out_surface"
    for column, expected in ((15, 4.0), (17, 5.0)):
        packet = frame(size, direct=1.0, indirect=1.0, depth=depth)
        direct = packet.direct.copy()
        direct[1::3, column, 3] = 0.0
        packet = replace(packet, direct=direct, temporal_gradient=values)
        images = bench.denoise(packet, config(), "asvgf", keep=[name, "asvgf.lambda.out_lambda"])
        np.testing.assert_array_equal(images[name][:, 5, 3], expected)
        left, right = images["asvgf.lambda.out_lambda"][:, 16, 0], images["asvgf.lambda.out_lambda"][:, 17, 0]
        near, far = (left, right) if expected == 4.0 else (right, left)
        assert near.min() > 0.05
        assert far.max() < 0.01


def test_a_surface_narrower_than_a_stratum_hears_of_the_light_around(bench: Bench) -> None:
    """No stratum speaks for the board, one pixel wide: without any likeness the walls around it must do."""
    size = (36, 24)
    depth = np.where(np.arange(36) == 18, 2.0, 5.0)[None] * np.ones((24, 1))
    packet = frame(size, direct=1.0, indirect=1.0, depth=depth)
    values = np.tile(np.array([-1, 1, -1, 1], np.float32), (8, 12, 1))
    found = lambdas(bench, replace(packet, temporal_gradient=values))
    np.testing.assert_allclose(found[..., :2], 1.0, rtol=2 * HALF)
    np.testing.assert_allclose(found[..., 2:], 0.0, atol=2 * HALF)


def test_a_stratum_in_the_dark_has_no_say(bench: Bench) -> None:
    """Where its sample found no light then nor now: those around that did tell what has changed."""
    values = np.tile(np.array([-1, 1, -1, 1], np.float32), (8, 12, 1))
    values[2:4, 3:6] = 0.0
    packet = replace(frame((36, 24), direct=1.0, indirect=1.0), temporal_gradient=values)
    np.testing.assert_allclose(lambdas(bench, packet, gradient_iterations=2)[..., :2], 1.0, rtol=2 * HALF)
