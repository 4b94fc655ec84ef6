"""Frames to look at without a window, and a screen for those with one."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import moderngl
import pytest

from tests.window.desktop import require_tools, screen
from tests.window.looking import Frame


@pytest.fixture
def frames(ctx: moderngl.Context) -> Iterator[Callable[..., Frame]]:
    """Makes frames, by the arguments of :class:`Frame` but the context; they are released after the test."""
    made: list[Frame] = []

    def make(*args: object, **kwargs: object) -> Frame:
        made.append(Frame(ctx, *args, **kwargs))  # type: ignore[arg-type]
        return made[-1]

    yield make
    for frame in made:
        frame.release()


@pytest.fixture(scope="session")
def display() -> Iterator[str]:
    """The name of an X screen for windows, one after the other."""
    require_tools()
    with screen() as name:
        yield name
