"""Shaders compiled on a thread of their own, in a second context of the same driver."""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import glcontext
import moderngl
import pytest

from gl import background
from gl.background import Compiler
from gl.executor import Executor
from gl.graph import Graph
from gl.plan import Plan
from gl.resources import Textures
from gl.shader import ShaderError
from gl.unlocked import UnlockedLoader
from gl.variants import variants
from tests.passes.stage import SHADERS, SIZE, Fill, Index, Place, Stage, add_plan, count_plan, fill_plan, pixels

SECONDS = 20.0  # for anything that comes; reached only if something is wrong
HERE, THERE = "here", "there"


def open_context() -> moderngl.Context:
    """A second headless context, current on the calling thread."""
    egl = glcontext.get_backend_by_name("egl")(mode="standalone", glversion=430)
    egl.__enter__()

    def end() -> None:
        egl.__exit__(None, None, None)
        egl.release()

    loader: Any = UnlockedLoader(egl.load, end)  # the stubs know of no other loaders than moderngl's own
    return moderngl.create_context(require=430, context=loader)


def index_plan() -> Plan:
    """One fragment and one compute pass."""
    g = Graph()
    g.output("display", g.add(Index(), in_index=g.add(Place()).out_index).out_pixel)
    return g.compile()


@dataclass
class Watched:
    """A compiler, and which pass was compiled where."""

    compiler: Compiler
    stage: Stage
    prepared: list[tuple[str, str]] = field(default_factory=list)
    gate: threading.Event = field(default_factory=threading.Event)

    def await_ready(self, plan: Plan, size: tuple[int, int] = SIZE) -> None:
        end = time.monotonic() + SECONDS
        while not self.compiler.ready(plan, size):
            assert time.monotonic() < end, f"still {self.compiler.text}"
            time.sleep(0.01)

    def await_errors(self, count: int) -> list[ShaderError]:
        end = time.monotonic() + SECONDS
        while len(errors := self.compiler.reload()) != count:
            assert time.monotonic() < end, errors
            time.sleep(0.01)
        return errors

    def await_value(self, plan: Plan, value: float) -> None:
        """Frame after frame as the window does it, until the picture has that value."""
        end = time.monotonic() + SECONDS
        while pixels(self.stage.run(plan).outputs["display"]).max() != value:
            assert time.monotonic() < end, self.compiler.reload()
            self.compiler.reload()
            self.compiler.ready(plan, SIZE)
            time.sleep(0.01)


@pytest.fixture
def watched(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> Iterator[Watched]:
    """The stage with a compiler that may begin once ``gate`` is set."""
    monkeypatch.setattr(background, "SETTLED", 0.0)
    monkeypatch.setattr(background, "LOOK_EVERY", 0.0)

    def opened() -> moderngl.Context:
        assert made.gate.wait(SECONDS)
        return open_context()

    prepare = Executor.prepare

    def noted(executor, node, size):
        made.prepared.append((HERE if executor is stage.executor else THERE, node.name))
        prepare(executor, node, size)

    monkeypatch.setattr(Executor, "prepare", noted)
    made = Watched(Compiler(stage.executor, opened), stage)
    yield made
    made.gate.set()
    made.compiler.close()


def test_what_a_plan_needs_is_compiled_there_before_it_is_here(watched: Watched) -> None:
    plan = index_plan()
    assert not watched.compiler.ready(plan, SIZE)
    assert (watched.compiler.progress, watched.compiler.text) == ((0, 2), "compiling 1 of 2 shaders")
    assert watched.prepared == []
    watched.gate.set()
    watched.await_ready(plan)
    assert (watched.compiler.progress, watched.compiler.text) == ((0, 0), "")
    assert sorted(watched.prepared) == [(HERE, "index"), (HERE, "place"), (THERE, "index"), (THERE, "place")]
    for name in ("index", "place"):
        assert watched.prepared.index((THERE, name)) < watched.prepared.index((HERE, name))
    assert watched.stage.executor.unprepared(variants(plan, SIZE)) == {}
    assert pixels(watched.stage.run(plan).outputs["display"])[4, 9].tolist() == [9, 4]
    assert watched.compiler.notices.lines == []


def test_a_history_and_another_size_are_variants_too(watched: Watched) -> None:
    watched.gate.set()
    watched.await_ready(count_plan())
    assert watched.compiler.ready(count_plan(), (11, 5))
    assert not watched.compiler.ready(count_plan(), (16, 8)), "sides that are powers of two"
    assert not watched.compiler.ready(count_plan("rgba32f"), SIZE), "another format of the target"
    assert watched.compiler.progress == (0, 1)


def test_only_the_plan_asked_for_last_is_compiled(watched: Watched) -> None:
    assert not watched.compiler.ready(index_plan(), SIZE)
    assert not watched.compiler.ready(fill_plan(), SIZE)
    assert watched.compiler.progress == (0, 1)
    watched.gate.set()
    watched.await_ready(fill_plan())
    assert watched.prepared == [(THERE, "fill"), (HERE, "fill")]


def test_taking_over_stops_after_its_share_of_the_frame(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background, "TAKE_OVER", 0.0)
    compiler = Compiler(watched.stage.executor, None)
    assert [compiler.ready(add_plan(), SIZE) for _ in range(2)] == [False, True]
    assert watched.prepared == [(HERE, "fill"), (HERE, "add")]
    compiler.close()


def test_a_broken_shader_is_reported_here_and_ends_nothing(watched: Watched) -> None:
    (watched.stage.root / "add.frag").write_text(SHADERS["add.frag"].replace("* FACTOR", "* FACTOR * oops"))
    watched.gate.set()
    with pytest.raises(ShaderError, match=r"\nadd\.frag:9: .*oops"):
        watched.await_ready(add_plan())
    with pytest.raises(ShaderError, match=r"\nadd\.frag:9: .*oops"):
        watched.compiler.ready(add_plan(), SIZE)
    watched.await_ready(index_plan())
    assert (THERE, "index") in watched.prepared, "the thread goes on"
    assert watched.compiler.notices.lines == []


def test_without_a_second_context_all_is_compiled_here(watched: Watched) -> None:
    def refused() -> moderngl.Context:
        raise RuntimeError("no more contexts")

    compiler = watched.compiler = Compiler(watched.stage.executor, refused)
    watched.await_ready(add_plan())
    assert watched.prepared == [(HERE, "fill"), (HERE, "add")]
    (line,) = compiler.notices.lines
    assert line == "shaders are not compiled in the background: RuntimeError: no more contexts"


def test_a_driver_that_fails_in_the_background_ends_nothing(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    prepare = Executor.prepare

    def failing(executor, node, size):
        if executor is not watched.stage.executor:
            raise MemoryError("out of it")
        prepare(executor, node, size)

    monkeypatch.setattr(Executor, "prepare", failing)
    watched.gate.set()
    watched.await_ready(fill_plan())
    assert watched.compiler.notices.lines == ["shaders are not compiled in the background: MemoryError: out of it"]
    assert pixels(watched.stage.run(fill_plan()).outputs["display"])[0, 0].tolist() == [1, 2, 3, 4]


@pytest.mark.parametrize("in_background", [True, False])
def test_shaders_are_reloaded(watched: Watched, in_background: bool) -> None:
    if not in_background:
        watched.compiler = Compiler(watched.stage.executor, None)
    watched.gate.set()
    plan, file = add_plan(), watched.stage.root / "add.frag"
    watched.await_ready(plan)
    watched.await_value(plan, 2.0)
    assert watched.compiler.reload() == []
    watched.prepared.clear()
    file.write_text(SHADERS["add.frag"].replace("* FACTOR", "+ FACTOR"))
    watched.await_value(plan, 3.0)
    watched.await_ready(plan)
    assert watched.prepared == [(THERE, "add"), (HERE, "add")][1 - in_background :], "nothing else anew"

    file.write_text(SHADERS["add.frag"].replace("* FACTOR", "+ FACTOR;\n oops"))
    (error,) = watched.await_errors(1)
    assert "add.frag:10: " in str(error)
    assert watched.compiler.ready(plan, SIZE), "the last good program is still there"
    watched.await_value(plan, 3.0)

    file.write_text(SHADERS["add.frag"].replace("* FACTOR", "+ 8.0 * FACTOR"))
    watched.await_errors(0)
    watched.await_value(plan, 17.0)


def test_looking_again_puts_no_reload_off(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(background, "SETTLED", 0.3)
    monkeypatch.setattr(background, "LOOK_EVERY", 0.05)
    watched.gate.set()
    watched.await_value(add_plan(), 2.0)
    (watched.stage.root / "add.frag").write_text(SHADERS["add.frag"].replace("* FACTOR", "+ FACTOR"))
    watched.await_value(add_plan(), 3.0)


def test_files_are_looked_at_now_and_then_only(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[float] = []

    def looked(executor: Executor) -> bool:
        looks.append(time.monotonic())
        return False

    monkeypatch.setattr(background, "LOOK_EVERY", 0.2)
    monkeypatch.setattr(Executor, "shaders_changed", looked)
    compiler = Compiler(watched.stage.executor, None)
    end = time.monotonic() + 0.5
    while time.monotonic() < end:
        compiler.reload()
    assert 1 <= len(looks) <= 2


def sleeping(name: str) -> int:
    """A driver that takes 400 ms for everything."""
    return ctypes.cast(ctypes.CDLL(None).usleep, ctypes.c_void_p).value or 0


@pytest.mark.parametrize(("name", "unlocked"), [("glCompileShader", True), ("glUniform1i", False)])
def test_other_threads_run_during_slow_calls(name: str, unlocked: bool) -> None:
    loader = UnlockedLoader(sleeping, lambda: None)
    # As moderngl calls it: with Python's lock held.
    call = ctypes.PYFUNCTYPE(None, ctypes.c_uint)(loader.load_opengl_function(name))
    ended = threading.Event()
    gaps: list[float] = []

    def tick() -> None:
        last = time.perf_counter()
        while not ended.is_set() or not gaps:
            time.sleep(0.002)
            now = time.perf_counter()
            gaps.append(now - last)
            last = now

    ticker = threading.Thread(target=tick)
    ticker.start()
    call(400_000)
    ended.set()
    ticker.join()
    assert (max(gaps) < 0.3) == unlocked


def test_functions_that_the_driver_lacks_stay_missing() -> None:
    assert UnlockedLoader(lambda name: 0, lambda: None).load_opengl_function("glCompileShader") == 0


def test_preparing_leaves_no_textures_behind(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[moderngl.Texture | moderngl.Framebuffer] = []

    def noting(create):
        def noted(*arguments):
            made.append(create(*arguments))
            return made[-1]

        return noted

    monkeypatch.setattr(Textures, "create", noting(Textures.create))
    monkeypatch.setattr(Textures, "framebuffer", noting(Textures.framebuffer))
    for node in index_plan().passes:
        stage.executor.prepare(node, SIZE)
    assert [type(item).__name__ for item in made] == ["Texture"] * 2 + ["Framebuffer"] + ["Texture"] * 3
    assert all(isinstance(item.mglo, moderngl.InvalidObject) for item in made)


def test_parameters_that_do_not_fit_are_found_when_preparing(stage: Stage) -> None:
    g = Graph()
    g.output("display", g.add(Fill(u_color="red")).out_color)
    (node,) = g.compile().passes
    with pytest.raises(Exception, match=r"fill\.u_color = 'red' is not a vec4"):
        stage.executor.prepare(node, SIZE)
    assert stage.executor.unprepared(variants(g.compile(), SIZE)), "not as if it had worked"


def test_nothing_is_taken_over_before_the_cache_is_sure_to_be_written(
    watched: Watched, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(background, "SETTLED", 1e6)
    watched.gate.set()
    end = time.monotonic() + SECONDS
    while (THERE, "fill") not in watched.prepared and time.monotonic() < end:
        watched.compiler.ready(fill_plan(), SIZE)
        time.sleep(0.01)
    time.sleep(0.1)
    assert not watched.compiler.ready(fill_plan(), SIZE)
    assert watched.prepared == [(THERE, "fill")]


@pytest.mark.parametrize("size", [SIZE, (16, 8)])
def test_a_run_after_preparing_compiles_nothing(stage: Stage, size: tuple[int, int]) -> None:
    """Told by the time: the driver compiles for much longer than it draws. The salt keeps its cache on disk out."""
    salt = time.time_ns() % 1_000_003
    terms = "\n".join(f"x += texelFetch(in_a, p + {i}, 0) * sin(x + {salt}.{i});" for i in range(12))
    text = SHADERS["add.frag"].replace("* FACTOR;", f"* FACTOR; vec4 x = out_color; {terms} out_color = x;")
    (stage.root / "add.frag").write_text(text)
    plan = add_plan()

    def milliseconds(call: Callable[[], object]) -> float:
        start = time.perf_counter()
        call()
        stage.ctx.finish()
        return (time.perf_counter() - start) * 1e3

    preparing = sum(milliseconds(partial(stage.executor.prepare, node, size)) for node in plan.passes)
    running = milliseconds(lambda: stage.run(plan, size))
    assert preparing > 5 * running, (preparing, running)
