"""Errors as people see them: structural similarity, and the difference when flipping between two pictures.

Both take linear radiance, (H, W, 3), and compare whole pictures on the display curve clip(x, 0, 1)^(1 / 2.2), light
sources and sky included. The libraries are loaded when they are first needed: importing them takes a second.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.metrics import Image, display_curve

F32 = NDArray[np.float32]

PIXELS_PER_DEGREE = 67.0
"""FLIP's default: a screen 0.7 m wide with 3840 pixels, seen from 0.7 m."""

WINDOW = 11
"""Pixels across the Gaussian window of SSIM (sigma = 1.5); smaller pictures have none."""


def ssim(image: Image, reference: Image) -> float:
    """Mean structural similarity, 1 for equal pictures, with the Gaussian window and the constants of Wang et al. 2004.

    Mean over the three channels. NaN for pictures smaller than the window.
    """
    from skimage import metrics

    structural_similarity: Callable[..., Any] = metrics.structural_similarity
    if min(image.shape[:2]) < WINDOW:
        return float("nan")
    return float(
        structural_similarity(
            display_curve(image),
            display_curve(reference),
            channel_axis=2,
            data_range=1.0,
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
        )
    )


def flip_map(image: Image, reference: Image) -> F32:
    """LDR-FLIP per pixel, (H, W) in [0, 1]: what a viewer who flips between the two sees (Andersson et al. 2020)."""
    from flip_evaluator import evaluate

    test, truth = (np.ascontiguousarray(display_curve(one), dtype=np.float32) for one in (image, reference))
    errors, _, _ = evaluate(
        truth,
        test,
        "LDR",
        inputsRGB=True,
        applyMagma=False,
        computeMeanError=False,
        parameters={"ppd": PIXELS_PER_DEGREE},
    )
    return np.asarray(errors, dtype=np.float32).reshape(image.shape[:2])


def flip(image: Image, reference: Image) -> float:
    """Mean of :func:`flip_map`."""
    return float(flip_map(image, reference).mean(dtype=np.float64))
