"""Memory of frames that nobody holds any more, for the frames that come next.

The C library gives blocks of more than 32 MB back to the system at once. The next frame then gets pages that have to be
found and cleared one by one, which in pictures of 1920x1080 took a tenth of the time of tracing.
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]

_UNUSED = 3  # references to a block that only the pool knows: its list, a loop's variable, and the counting itself
_KEPT = 12  # blocks: those of a frame, three times over


class Buffers:
    """A pool of arrays. A block is free once no array that is a view of it exists: each view holds its block.

    For one thread at a time; the arrays may go to others.
    """

    def __init__(self) -> None:
        self._blocks: list[F32] = []

    def empty(self, *shape: int) -> F32:
        """A float32 array of ``shape`` with anything in it."""
        for block in self._blocks:
            if block.shape == shape and sys.getrefcount(block) == _UNUSED:
                return block.view()
        made = np.empty(shape, np.float32)
        self._blocks = [*self._blocks[-_KEPT + 1 :], made]
        return made.view()
