"""The one interface behind which Embree sits: nearest hits and occlusion for batches of rays."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from raytrace.compilation import device

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]


class StopWatch(threading.local):
    """Seconds that this thread has spent inside Embree since it was last reset."""

    def __init__(self) -> None:
        self.seconds = 0.0

    @contextmanager
    def running(self) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.seconds += time.perf_counter() - start


class RayCaster(ABC):
    """Traces batches of rays against a scene's triangles. Safe to call from several threads at a time.

    Triangles that never move live in one Embree scene, built once; those that move in a second one, small, rebuilt
    every frame. A scene in which nothing moves builds and traces the first only.
    """

    name: str

    def __init__(self) -> None:
        self.clock = StopWatch()

    @abstractmethod
    def move(self, triangles: F32, box: F32) -> None:
        """Rebuild the moving scene from the moving rows of ``triangles``; ``box`` (2, 3) float32: their bounds."""

    @abstractmethod
    def intersect(self, origins: F32, directions: F32) -> tuple[I32, F32, F32]:
        """Nearest triangle (n,) int32, -1 = none, and barycentrics u, v (n,) float32 of its second and third corner.

        ``origins``, ``directions`` (n, 3) float32, directions of any length.
        """

    def intersect_rows(self, origins: F32, directions: F32, width: int) -> tuple[I32, F32, F32]:
        """As :meth:`intersect`, for neighbouring rays: (n, 3), rows of ``width`` that begin at a multiple of four."""
        return self.intersect(origins, directions)

    @abstractmethod
    def occluded(self, origins: F32, directions: F32, limits: F32) -> I32:
        """0 where something lies between t = 0 and ``limits``, -1 where the way is free, (n,) int32.

        ``limits`` (n,) float32 in units of the direction's length; the array may be used up.
        """

    @abstractmethod
    def close(self) -> None:
        """Give back what Embree holds; rays cannot be traced afterwards."""


@device
def meets_box(origins, directions, i, limit, box):  # type: ignore[no-untyped-def]
    """Whether ray i meets ``box`` (2, 3) before ``limit`` (slab test, Kay and Kajiya 1986)."""
    near, far = np.float32(0.0), limit
    for axis in range(3):
        inverse = np.float32(1.0) / directions[i, axis]
        a = (box[0, axis] - origins[i, axis]) * inverse
        b = (box[1, axis] - origins[i, axis]) * inverse
        # A ray in the slab's plane gives 0 * inf = NaN, which these comparisons ignore: it counts as meeting.
        if a > b:
            a, b = b, a
        if a > near:
            near = a
        if b < far:
            far = b
    return near <= far
