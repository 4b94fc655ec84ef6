"""Means with their standard errors, and the question whether two of them are the same number."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

SIGNIFICANCE = 1e-3
"""Chance that a right tracer fails one comparison, all of its numbers together. Seeds are fixed: no test can flake."""


@dataclass(frozen=True)
class Estimate:
    """``mean`` of any shape and the standard ``error`` of each of its numbers."""

    mean: F64
    error: F64

    @staticmethod
    def of(samples: NDArray[np.floating]) -> Estimate:
        """From independent ``samples`` (n, ...)."""
        values = np.asarray(samples, dtype=np.float64)
        return Estimate(values.mean(0), values.std(0, ddof=1) / math.sqrt(len(values)))


def limit(count: int) -> float:
    """Largest |z| of ``count`` independent normal numbers at :data:`SIGNIFICANCE`. Sidak 1967."""
    return NormalDist().inv_cdf(1.0 - (1.0 - (1.0 - SIGNIFICANCE) ** (1.0 / count)) / 2.0)


def assert_same(a: Estimate, b: Estimate | F64 | float, slack: float = 1e-5, sharp: float | None = None) -> None:
    """z-test of every number of ``a`` against ``b``, an estimate or exact values.

    ``slack``: relative error that single precision may add. ``sharp``: fails a test that could not have seen a relative
    error of this size, because its standard error is too large.
    """
    mean = b.mean if isinstance(b, Estimate) else np.broadcast_to(np.asarray(b, np.float64), a.mean.shape)
    error = np.hypot(a.error, b.error) if isinstance(b, Estimate) else a.error
    allowed = error * limit(a.mean.size) + slack * np.abs(mean)
    distance = np.abs(a.mean - mean)
    worst = np.unravel_index(np.argmax(distance - allowed), a.mean.shape)
    assert (distance <= allowed).all(), (
        f"{worst}: {a.mean[worst]:.6g} against {mean[worst]:.6g}, allowed is a distance of {allowed[worst]:.3g}"
    )
    if sharp is not None:
        assert (allowed <= sharp * np.abs(mean)).all(), f"blind: {np.max(allowed / np.abs(mean)):.3g} is allowed"
