"""BMFR with a stage switched off: each leaves what the others make of the frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.passes.bmfr_frames import SIZE, polynomial, radiance, tilted, with_alpha
from tests.passes.harness import HALF, Bench, frame, noise, with_sky


def test_without_time_every_frame_stands_alone(bench: Bench) -> None:
    first, second = (replace(tilted(), direct=with_alpha(noise(SIZE, seed))) for seed in (1, 2))
    alone = radiance(bench, second, 3, temporal=False)
    bench.restart()
    radiance(bench, first, 2, temporal=False)
    np.testing.assert_array_equal(radiance(bench, second, 3, temporal=False), alone)
    bench.restart()
    radiance(bench, first, 2)
    assert np.abs(radiance(bench, second, 3) - alone).max() > 0.01


def test_without_the_fit_samples_are_averaged(bench: Bench) -> None:
    frames = [replace(tilted(), direct=with_alpha(noise(SIZE, seed))) for seed in range(3)]
    for packet in frames:
        mean = radiance(bench, packet, fit=False)
    expected = np.mean([packet.direct[..., :3] for packet in frames], axis=0)
    np.testing.assert_allclose(mean, expected, rtol=4 * HALF)


def test_without_either_the_samples_pass(bench: Bench) -> None:
    """But for the sky, which has none, and for what is not finite."""
    direct, indirect = (with_alpha(noise(SIZE, seed)) for seed in (1, 2))
    direct[3, 4, 1] = np.nan
    sky = np.zeros((SIZE[1], SIZE[0]), bool)
    sky[:, :5] = True
    packet = with_sky(replace(tilted(), direct=direct, indirect=indirect), sky)
    passed = radiance(bench, packet, temporal=False, fit=False)
    expected = (packet.direct + packet.indirect)[..., :3]
    expected[~np.isfinite(expected).all(axis=-1)] = 0.0
    np.testing.assert_allclose(passed, expected, rtol=HALF)


def test_without_time_what_is_not_finite_takes_no_part_in_the_fit(bench: Bench) -> None:
    direct = with_alpha(np.full((SIZE[1], SIZE[0], 3), 0.75))
    direct[10:14, 20:24] = np.nan
    fitted = radiance(bench, replace(tilted(), direct=direct), temporal=False)
    np.testing.assert_allclose(fitted, 0.75 * np.ones_like(fitted), rtol=0.02)


def test_without_demodulation_a_texture_is_fitted_like_light(bench: Bench) -> None:
    """A checkered albedo under even light: kept to the bit of a half with demodulation, blurred without."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    albedo = np.where((x + y) % 2, 0.25, 0.75)
    packet = frame(SIZE, direct=1.0, albedo=albedo)
    np.testing.assert_allclose(radiance(bench, packet), np.repeat(albedo[..., None], 3, -1), rtol=HALF)
    bench.restart()
    blurred = radiance(bench, packet, demodulate=False)
    np.testing.assert_allclose(blurred, 0.5, rtol=0.02)


def test_radiance_that_features_express_is_reproduced_without_demodulation(bench: Bench) -> None:
    packet = tilted()
    colors = polynomial(packet)
    fitted = radiance(bench, replace(packet, direct=with_alpha(colors)), demodulate=False, regularization="rank")
    np.testing.assert_allclose(fitted, colors * packet.albedo[..., :3], atol=2e-3 * colors.max())
