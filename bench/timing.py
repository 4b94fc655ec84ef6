"""What a set of measured times is summed up to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Summary:
    """Median and 95th percentile of ``count`` times in milliseconds."""

    median: float
    p95: float
    count: int

    @staticmethod
    def of(milliseconds: Sequence[float]) -> Summary:
        """Raises ValueError for no times at all."""
        if not milliseconds:
            raise ValueError("nothing was measured")
        return Summary(float(np.median(milliseconds)), float(np.percentile(milliseconds, 95)), len(milliseconds))
