"""Errors of pictures and of sequences against references.

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


def pooled(errors: Sequence[float]) -> float:
    """RMSE of a sequence: root of the mean of the frames' squared ``errors``, every frame counting alike."""
    return float(np.sqrt(np.mean(np.square(errors))))


def display_curve(image: Image) -> NDArray[np.float64]:
    """clip(x, 0, 1)^(1 / 2.2): what differences are judged on where they are meant to be seen."""
    return np.asarray(np.clip(image.astype(np.float64), 0.0, 1.0) ** (1 / 2.2))


def temporal_difference(
    image: Image, previous: Image, reference: Image, previous_reference: Image, mask: Mask
) -> float:
    """Mean |(o_t - o_{t-1}) - (r_t - r_{t-1})| on the display curve: flicker that the reference does not have."""
    change = display_curve(image) - display_curve(previous)
    expected = display_curve(reference) - display_curve(previous_reference)
    return float(np.mean(np.abs(change - expected)[mask]))
