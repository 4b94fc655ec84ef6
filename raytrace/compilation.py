"""How the tracer's loops are compiled.

No fast-math: a result must not depend on how a loop was vectorised, hence on the tile a pixel fell into.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

Compiled = Callable[..., Any]

# _nrt=False: no reference counting of arrays inside compiled code. Counting is atomic, every row that is looked at
# counts, and the threads then fight for the same counters: it took a third of the time of the shading kernels. None of
# them creates or keeps an array, so there is nothing to count.
_options = {"error_model": "numpy", "_nrt": False}


def kernel(function: Callable[..., Any]) -> Compiled:
    """A loop over arrays that releases Python's global lock and whose machine code is kept on disk."""
    compiled: Compiled = njit(nogil=True, cache=True, **_options)(function)
    return compiled


def device(function: Callable[..., Any]) -> Compiled:
    """A function that kernels call."""
    compiled: Compiled = njit(**_options)(function)
    return compiled
