"""Which way to Embree: straight into its library where that is found, through embreex's own calls elsewhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raytrace.casting import RayCaster
from raytrace.embree_native import NativeCaster, load_library
from raytrace.embree_run import PortableCaster

F32 = NDArray[np.float32]

BACKENDS = ("auto", "native", "run")


def open_caster(triangles: F32, static_count: int, backend: str = "auto") -> RayCaster:
    """A caster for ``triangles`` (T, >= 9) float32, the first ``static_count`` of which never move.

    ``backend``: "native", "run", or "auto" for the first that works here.
    Raises ValueError for any other, RuntimeError when "native" is asked for by name and cannot be had.
    """
    if backend not in BACKENDS:
        raise ValueError(f"backend {backend!r}: must be one of {', '.join(BACKENDS)}")
    if backend != "run":
        library = load_library()
        if not isinstance(library, str):
            return NativeCaster(library, triangles, static_count)
        if backend == "native":
            raise RuntimeError(library)
    return PortableCaster(triangles, static_count)


def describe_backend() -> str:
    """What ``auto`` comes to on this machine, for the doctor."""
    library = load_library()
    if isinstance(library, str):
        return f"{PortableCaster.name} ({library})"
    return NativeCaster.name
