"""bench/metrics.py on images whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest

from bench.metrics import display_curve, pooled, rmse, temporal_difference

EVERYWHERE = np.ones((4, 5), dtype=bool)


def flat(value: float) -> np.ndarray:
    return np.full((4, 5, 3), value, dtype=np.float32)


def test_rmse_of_a_constant_offset_is_the_offset():
    assert rmse(flat(3.25), flat(3.0), EVERYWHERE) == pytest.approx(0.25)


def test_rmse_is_zero_only_for_equal_pictures():
    assert rmse(flat(2.0), flat(2.0), EVERYWHERE) == 0.0


def test_rmse_weighs_channels_alike():
    image = flat(0.0)
    image[..., 1] = 3.0
    assert rmse(image, flat(0.0), EVERYWHERE) == pytest.approx(np.sqrt(3.0))


def test_rmse_ignores_pixels_outside_the_mask():
    image = flat(1.0)
    image[2, 3] = 1e6
    mask = EVERYWHERE.copy()
    mask[2, 3] = False
    assert rmse(image, flat(1.0), mask) == 0.0
    assert rmse(image, flat(1.0), EVERYWHERE) > 1e5


def test_rmse_does_not_round_in_single_precision():
    """A float32 sum of 1e8 and 1 loses the 1."""
    image, reference = flat(0.0).astype(np.float64), flat(0.0).astype(np.float64)
    image[0, 0] = 1e4
    image[1:] = 1.0
    expected = np.sqrt((3 * 1e8 + 45) / 60)
    assert rmse(image, reference, EVERYWHERE) == pytest.approx(expected, rel=1e-12)


def test_pooled_is_the_rmse_of_all_frames_as_one():
    rng = np.random.default_rng(0)
    images, references = rng.random((2, 3, 4, 5, 3))
    single = [rmse(image, reference, EVERYWHERE) for image, reference in zip(images, references, strict=True)]
    together = rmse(images.reshape(12, 5, 3), references.reshape(12, 5, 3), np.ones((12, 5), dtype=bool))
    assert pooled(single) == pytest.approx(together)
    assert pooled([3.0, 4.0]) == pytest.approx(np.sqrt(12.5))


def test_display_curve_clips_and_bends():
    values = np.array([[[-1.0, 0.0, 0.5], [1.0, 7.0, 0.25]]], dtype=np.float32)
    expected = [[[0.0, 0.0, 0.5 ** (1 / 2.2)], [1.0, 1.0, 0.25 ** (1 / 2.2)]]]
    np.testing.assert_allclose(display_curve(values), expected, rtol=1e-12)


def test_a_constant_bias_does_not_flicker():
    assert temporal_difference(flat(0.3), flat(0.3), flat(0.9), flat(0.9), EVERYWHERE) == 0.0


def test_a_change_that_the_reference_has_does_not_count():
    assert temporal_difference(flat(0.8), flat(0.2), flat(0.8), flat(0.2), EVERYWHERE) == 0.0


def test_flicker_is_measured_on_the_display_curve():
    assert temporal_difference(flat(1.0), flat(0.0), flat(0.5), flat(0.5), EVERYWHERE) == pytest.approx(1.0)
    expected = 0.5 ** (1 / 2.2) - 0.25 ** (1 / 2.2)
    assert temporal_difference(flat(0.25), flat(0.5), flat(0.1), flat(0.1), EVERYWHERE) == pytest.approx(expected)


def test_a_change_that_is_missing_counts():
    assert temporal_difference(flat(0.0), flat(0.0), flat(1.0), flat(0.0), EVERYWHERE) == pytest.approx(1.0)


def test_flicker_above_white_is_invisible():
    assert temporal_difference(flat(50.0), flat(2.0), flat(1.0), flat(1.0), EVERYWHERE) == 0.0


def test_temporal_difference_is_a_mean_over_the_mask():
    image = flat(0.0)
    image[0, 0] = 1.0
    assert temporal_difference(image, flat(0.0), flat(0.0), flat(0.0), EVERYWHERE) == pytest.approx(1 / 20)
    mask = np.zeros((4, 5), dtype=bool)
    mask[0, :2] = True
    assert temporal_difference(image, flat(0.0), flat(0.0), flat(0.0), mask) == pytest.approx(1 / 2)
