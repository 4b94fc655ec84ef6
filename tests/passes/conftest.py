"""The stage: an executor with small shaders in a folder that a test may change."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import moderngl
import pytest

from gl.executor import SHADER_ROOT, Executor
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
