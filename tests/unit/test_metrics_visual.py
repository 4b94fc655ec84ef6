"""bench/metrics_visual.py, metrics_time.py and pareto.py on inputs whose answers are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.metrics import display_curve, display_mse, psnr, relmse
from bench.metrics_time import Deviation, recovery, steady
from bench.metrics_visual import WINDOW, flip, flip_map, ssim
from bench.pareto import front

EVERYWHERE = np.ones((16, 24), dtype=bool)


def flat(value: float, size: tuple[int, int] = (24, 16)) -> np.ndarray:
    return np.full((size[1], size[0], 3), value, np.float32)


def gratings(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.1, 0.9, (16, 24, 3)).astype(np.float32)


# ------------------------------------------------------------------------------------------------ relative error


def test_relmse_of_a_known_difference():
    assert relmse(flat(0.6), flat(0.5), EVERYWHERE) == pytest.approx(0.01 / (0.25 + 0.01), rel=1e-5)


def test_relmse_of_a_black_reference_is_bounded_by_epsilon():
    assert relmse(flat(0.1), flat(0.0), EVERYWHERE) == pytest.approx(1.0, rel=1e-5)


def test_relmse_weighs_dark_and_bright_alike():
    dark, bright = relmse(flat(1.1), flat(1.0), EVERYWHERE), relmse(flat(110.0), flat(100.0), EVERYWHERE)
    assert dark == pytest.approx(bright, rel=0.02)


def test_relmse_reads_the_mask_only():
    image, mask = flat(0.5), np.zeros((16, 24), dtype=bool)
    image[3, 4] = 9.0
    mask[0] = True
    assert relmse(image, flat(0.5), mask) == 0.0
    mask[3, 4] = True
    assert relmse(image, flat(0.5), mask) == pytest.approx(8.5**2 / 0.26 / 25, rel=1e-5)


# -------------------------------------------------------------------------------------------- peak signal to noise


def test_psnr_of_known_differences():
    low, high = 0.5**2.2, 0.6**2.2  # a tenth apart on the display curve
    assert psnr(display_mse(flat(low), flat(high))) == pytest.approx(20.0, abs=1e-4)
    assert psnr(display_mse(flat(0.0), flat(1.0))) == 0.0
    assert psnr(display_mse(flat(0.3), flat(0.3))) == math.inf


def test_psnr_sees_nothing_above_white():
    assert display_mse(flat(50.0), flat(2.0)) == 0.0


# --------------------------------------------------------------------------------------------- structural similarity


def test_ssim_of_equal_pictures_is_one():
    assert ssim(gratings(), gratings()) == pytest.approx(1.0, abs=1e-12)


def test_ssim_of_flat_pictures_is_its_luminance_term():
    """No variance: (2 a b + c1) / (a² + b² + c1), c1 = 0.01²; Wang et al. 2004, eq. 13."""
    a, b = 0.5, 0.7
    expected = (2 * a * b + 1e-4) / (a * a + b * b + 1e-4)
    assert ssim(flat(a**2.2), flat(b**2.2)) == pytest.approx(expected, abs=1e-5)


def test_ssim_of_the_inverted_picture_is_negative():
    values = display_curve(gratings())
    inverted = np.clip(1.0 - values, 0.0, 1.0) ** 2.2
    assert ssim(inverted, gratings()) < -0.5


def test_pictures_smaller_than_the_window_have_no_ssim():
    side = WINDOW - 1
    assert math.isnan(ssim(flat(0.5, (40, side)), flat(0.5, (40, side))))
    assert ssim(flat(0.5, (40, WINDOW)), flat(0.5, (40, WINDOW))) == 1.0


# ------------------------------------------------------------------------------------------------------------ FLIP


def test_flip_of_equal_pictures_is_zero():
    assert flip(gratings(), gratings()) == pytest.approx(0.0, abs=1e-6)


def test_flip_of_black_and_white_is_nearly_one():
    """The error of black against white is what FLIP's colour differences are scaled by: 0.95 of them become 1."""
    assert 0.9 < flip(flat(0.0), flat(1.0)) <= 1.0


def test_flip_of_grey_steps_is_in_order_and_symmetric():
    errors = [flip(flat((0.5 + step) ** 2.2), flat(0.5**2.2)) for step in (0.02, 0.05, 0.1, 0.2)]
    assert errors == sorted(errors)
    assert errors[0] > 0.0
    assert flip(gratings(1), gratings(2)) == pytest.approx(flip(gratings(2), gratings(1)), rel=1e-3)


def test_flip_stays_near_its_cause():
    image = flat(0.2, (96, 64))
    image[30:34, 40:44] = 1.0
    errors = flip_map(image, flat(0.2, (96, 64)))
    assert errors.shape == (64, 96)
    assert errors[32, 42] > 0.3
    assert errors[5, 5] == pytest.approx(0.0, abs=1e-4)


def test_flip_takes_what_is_brighter_than_white():
    assert flip(flat(50.0), flat(2.0)) == pytest.approx(0.0, abs=1e-6)


# ------------------------------------------------------------------------------------------------------- over time


def test_a_deviation_over_time_is_that_of_the_samples():
    rng = np.random.default_rng(3)
    frames = rng.uniform(0.0, 1.2, (12, 16, 24, 3))
    deviation = Deviation()
    for frame in frames:
        deviation.add(frame)
    np.testing.assert_allclose(deviation.per_pixel(), display_curve(frames).std(axis=0, ddof=1), rtol=1e-10)
    assert deviation.mean(EVERYWHERE) == pytest.approx(display_curve(frames).std(axis=0, ddof=1).mean())


def test_a_still_picture_does_not_deviate_and_one_frame_is_too_few():
    deviation = Deviation()
    with pytest.raises(ValueError, match="two frames"):
        deviation.per_pixel()
    for _ in range(3):
        deviation.add(gratings())
    assert deviation.mean(EVERYWHERE) == 0.0


def test_recovery_counts_the_frames_until_the_error_is_steady():
    falling = [0.1 + 0.9 * 0.5**frame for frame in range(16)]
    assert steady(falling) == pytest.approx(0.1, rel=1e-2)
    assert recovery(falling) == 7  # 0.9 / 2^7 < 0.01 <= 0.9 / 2^6
    assert recovery([1.0] * 16) == 0
    assert recovery([9.0, *[1.0] * 15]) == 1


def test_what_is_not_over_when_the_frames_are_has_no_recovery():
    assert recovery([1.0 - 0.05 * frame for frame in range(16)]) is None
    assert recovery([1.0 - 0.05 * min(frame, 11) for frame in range(16)]) == 11


def test_one_noisy_frame_later_on_is_no_relapse():
    assert recovery([5.0, 1.0, 1.0, 1.3, *[1.0] * 12]) == 1


def test_without_errors_there_is_no_recovery():
    with pytest.raises(ValueError, match="no error"):
        steady([])


# ------------------------------------------------------------------------------------------------------ Pareto front


def test_the_front_has_what_nothing_else_beats():
    points = [(1.0, 9.0), (2.0, 4.0), (3.0, 5.0), (4.0, 1.0), (5.0, 1.0), (2.0, 4.0)]
    assert front(points) == [True, True, False, True, False, True]


def test_what_has_no_error_is_not_on_the_front():
    assert front([(1.0, math.nan), (2.0, 3.0), (math.nan, 1.0)]) == [False, True, False]
