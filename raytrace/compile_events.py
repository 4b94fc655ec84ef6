"""Which kernel is being compiled: for a line of progress, and for a way out between two of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.event import Listener, install_listener


class _Kernels(Listener):
    def __init__(self, begin: Callable[[str], None]) -> None:
        self._begin = begin

    def on_start(self, event: Any) -> None:
        dispatcher = event.data["dispatcher"]
        if dispatcher.targetoptions.get("nogil"):  # a kernel, not one of the functions that it calls
            self._begin(dispatcher.py_func.__name__)

    def on_end(self, event: Any) -> None:
        pass


@contextmanager
def watch_kernels(begin: Callable[[str], None]) -> Iterator[None]:
    """Inside, ``begin`` is called with the name of every kernel that any thread begins to compile.

    Kernels that are on disk do not count: loading takes a moment. What ``begin`` raises comes out of whatever called
    the kernel, which then is not compiled.
    """
    with install_listener("numba:compile", _Kernels(begin)):
        yield
