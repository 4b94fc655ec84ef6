"""The stage: an executor with small shaders in a folder that a test may change."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import moderngl
import pytest

from gl.executor import SHADER_ROOT, Executor
from tests.passes.harness import Bench
from tests.passes.stage import SHADERS, Stage


@pytest.fixture
def stage(ctx: moderngl.Context, tmp_path: Path) -> Iterator[Stage]:
    for path, text in SHADERS.items():
        (tmp_path / path).write_text(text)
    (tmp_path / "common").mkdir()
    shutil.copy(SHADER_ROOT / "common/fullscreen.vert", tmp_path / "common")
    executor = Executor(ctx, tmp_path)
    yield Stage(ctx, tmp_path, executor)
    executor.release()


@pytest.fixture(scope="session")
def _session_bench(_session_context: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    with _session_context:
        bench = Bench(_session_context, tmp_path_factory.mktemp("shaders"))
        yield bench
        bench.release()


@pytest.fixture
def bench(ctx: moderngl.Context, _session_bench: Bench) -> Bench:
    """The filters on synthetic frames. Programs are compiled once for all tests; each test begins a new sequence."""
    _session_bench.restart()
    return _session_bench
