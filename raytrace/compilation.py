"""How the tracer's loops are compiled.

No fast-math: a result must not depend on how a loop was vectorised, hence on the tile a pixel fell into.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from llvmlite import ir
from numba import config, njit, types
from numba.core import cgutils
from numba.extending import intrinsic

Compiled = Callable[..., Any]

SOURCES = (
    "brdf",
    "casting",
    "compilation",
    "compiled",
    "cutouts",
    "directional_albedo",
    "embree_native",
    "embree_run",
    "frame",
    "gradients",
    "guides",
    "kernels",
    "kernels_glossy",
    "lights",
    "punctual",
    "reflectance",
    "rgbe",
    "sampling",
    "surface",
    "tables",
    "textures",
)
"""Modules of this package whose functions and constants go into machine code."""


def _cache_folder() -> Path:
    """A folder for this state of :data:`SOURCES`, where Numba would use one for all.

    Left alone it looks at the file that a kernel stands in and at no other, and goes on using machine code that has
    former functions and constants of the others compiled in.
    """
    here = Path(__file__).parent
    digest = hashlib.sha256(b"".join((here / f"{name}.py").read_bytes() for name in SOURCES)).hexdigest()
    return Path(os.environ.get("NUMBA_CACHE_DIR") or here / "__pycache__") / f"kernels-{digest[:16]}"


config.CACHE_DIR = str(_cache_folder())  # type: ignore[attr-defined]  # made at run time

# _nrt=False: no reference counting of arrays inside compiled code. Counting is atomic, every row that is looked at
# counts, and the threads then fight for the same counters: it took a third of the time of the shading kernels. None of
# them creates or keeps an array, so there is nothing to count.
_options: dict[str, Any] = {"error_model": "numpy", "_nrt": False}


def kernel(function: Callable[..., Any]) -> Compiled:
    """A loop over arrays that releases Python's global lock and whose machine code is kept on disk."""
    compiled: Compiled = njit(nogil=True, cache=True, **_options)(function)
    return compiled


def device(function: Callable[..., Any]) -> Compiled:
    """A function that kernels call."""
    compiled: Compiled = njit(**_options)(function)
    return compiled


def inlined(function: Callable[..., Any]) -> Compiled:
    """A device function that takes a scene's tables: always inlined, since a call would copy a kilobyte of pointers."""
    compiled: Compiled = njit(inline="always", **_options)(function)
    return compiled


def _prefetch(typing_context, array, row, column):  # type: ignore[no-untyped-def]

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        pointers: Any = cgutils
        kind = signature.args[0]
        store = context.make_array(kind)(context, builder, arguments[0])
        indices = [
            context.cast(builder, value, given, types.intp)
            for value, given in zip(arguments[1 : 1 + kind.ndim], signature.args[1:], strict=False)
        ]
        address = pointers.get_item_pointer(context, builder, kind, store, indices, wraparound=False)
        byte = ir.IntType(8).as_pointer()
        number = ir.IntType(32)
        function = builder.module.declare_intrinsic(
            "llvm.prefetch", [byte], ir.FunctionType(ir.VoidType(), [byte, number, number, number])
        )
        read, keep, data = number(0), number(3), number(1)
        builder.call(function, [builder.bitcast(address, byte), read, keep, data])
        return context.get_dummy_value()

    return types.void(array, row, column), generate


prefetch: Compiled = intrinsic(_prefetch)
"""Called with an array, a row and a column, by kernels: ask for the cache line there, which is needed soon and
which the processor then fetches meanwhile. An array of one dimension has no columns."""
