"""Fixtures and options of every test."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import numpy as np
import pytest

from gl.context import create_headless

np.seterr(divide="raise", over="raise", invalid="raise")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--regenerate", action="store_true", help="write the reference images instead of comparing")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "ctx" in getattr(item, "fixturenames", ()):
            item.add_marker("gl")


@pytest.fixture(scope="session")
def regenerate(request: pytest.FixtureRequest) -> bool:
    """Whether reference images are to be written rather than compared with."""
    return bool(request.config.getoption("--regenerate"))


@pytest.fixture(scope="session")
def _session_context() -> Iterator[moderngl.Context]:
    context = create_headless()
    yield context
    context.release()


@pytest.fixture
def ctx(_session_context: moderngl.Context) -> Iterator[moderngl.Context]:
    """The session's OpenGL context, made current; no error may be pending before or after the test."""
    with _session_context:
        assert _session_context.error == "GL_NO_ERROR", "left behind by an earlier test"
        yield _session_context
        assert _session_context.error == "GL_NO_ERROR"
