"""Tracers that a test opens are closed when it ends."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from typing import Protocol

import pytest

from raytrace.integrator import Tracer
from raytrace.scene import Scene
from tests.tracer.scenes import tracer


class OpenTracer(Protocol):
    """:func:`tests.tracer.scenes.tracer` with a tracer that is closed after the test."""

    def __call__(self, what: Scene, **settings: int | str) -> Tracer: ...


@pytest.fixture
def trace() -> Iterator[OpenTracer]:
    with ExitStack() as stack:
        yield lambda what, **settings: stack.enter_context(tracer(what, **settings))
