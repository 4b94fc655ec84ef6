"""Shaders compiled in a second window's context while the first goes on."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.window.desktop import SECONDS, require_tools, running, screen

pytestmark = pytest.mark.window

PROGRAM = """
import threading
from config import load
from gl.background import Compiler
from gl.executor import Executor
from gl.pipelines import FrameTraits, build
from gl.variants import variant, variants
from ui.compiling_context import CompilingContext
from ui.glfw_window import Window

size = (64, 37)
plans = {name: build(load(None, ()), name, FrameTraits()).compile() for name in ("accumulate", "svgf")}
with Window("first", size) as window, CompilingContext() as second:
    executor, there = Executor(window.ctx), set()
    prepare = Executor.prepare

    def noted(self, node, size):
        if threading.current_thread().name == "shaders":
            there.add(variant(node, size))
        prepare(self, node, size)

    Executor.prepare = noted
    compiler = Compiler(executor, second.open, window.wake)
    for name, plan in plans.items():
        frames = 0
        while not compiler.ready(plan, size):
            window.ctx.screen.clear(0.5, 0.5, 0.5)
            window.swap()
            window.wait(0.02)
            frames += 1
        print(name, frames > 1, variants(plan, size).keys() <= there)
    print(compiler.notices.lines)
    compiler.close()
    executor.release()
    print(window.ctx.error, threading.active_count())
"""


def test_the_window_goes_on_while_shaders_are_compiled(tmp_path: Path) -> None:
    require_tools()
    with screen() as display, running(display, tmp_path, "-c", PROGRAM) as program:
        assert program.process.wait(3 * SECONDS) == 0, program.stderr()
        assert program.stdout().splitlines() == ["accumulate True True", "svgf True True", "[]", "GL_NO_ERROR 1"]
        assert program.stderr() == ""
