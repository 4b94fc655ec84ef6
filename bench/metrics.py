"""Errors of pictures and of sequences against references; docs/measuring.md has the formulas and their sources.

All take linear radiance, (H, W, 3) arrays; ``mask`` (H, W) bool selects the pixels that count (emissive ones do not:
they bypass the filters, and their brightness would hide every other error).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.floating]
Mask = NDArray[np.bool_]


def rmse(image: Image, reference: Image, mask: Mask) -> float:
    """Root of the mean squared difference over the pixels of ``mask`` and all channels."""
    difference = image[mask].astype(np.float64) - reference[mask]
    return float(np.sqrt(np.mean(difference * difference)))


RELATIVE_EPSILON = 0.01
"""Keeps relMSE from being decided by the darkest pixels; squared radiance."""


def relmse(image: Image, reference: Image, mask: Mask) -> float:
    """Mean of (x - r)² / (r² + 0.01) over the pixels of ``mask`` and all channels (Rousselle et al. 2011, sec. 5)."""
    expected = reference[mask].astype(np.float64)
    difference = image[mask] - expected
    return float(np.mean(difference * difference / (expected * expected + RELATIVE_EPSILON)))


def pooled(errors: Sequence[float]) -> float:
    """RMSE of a sequence: root of the mean of the frames' squared ``errors``, every frame counting alike."""
    return float(np.sqrt(np.mean(np.square(errors))))


def display_curve(image: Image) -> NDArray[np.float64]:
    """clip(x, 0, 1)^(1 / 2.2): what differences are judged on where they are meant to be seen."""
    return np.asarray(np.clip(image.astype(np.float64), 0.0, 1.0) ** (1 / 2.2))


def psnr(mean_squared: float) -> float:
    """Peak signal-to-noise ratio in dB of a mean squared difference on the display curve, whose peak is 1."""
    return float(-10.0 * np.log10(mean_squared)) if mean_squared > 0.0 else float("inf")


def display_mse(image: Image, reference: Image) -> float:
    """Mean squared difference on the display curve, over all pixels and channels."""
    return float(np.mean(np.square(display_curve(image) - display_curve(reference))))


def temporal_difference(
    image: Image, previous: Image, reference: Image, previous_reference: Image, mask: Mask
) -> float:
    """Mean |(o_t - o_{t-1}) - (r_t - r_{t-1})| on the display curve: flicker that the reference does not have."""
    change = display_curve(image) - display_curve(previous)
    expected = display_curve(reference) - display_curve(previous_reference)
    return float(np.mean(np.abs(change - expected)[mask]))
