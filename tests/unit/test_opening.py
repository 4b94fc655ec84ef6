"""Scenes opened on a thread of their own. No window."""

from __future__ import annotations

import gc
import threading
import time
import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

import session
from config import Config, load
from console import Progress
from errors import UserError
from raytrace.compile_events import watch_kernels
from raytrace.integrator import Tracer
from raytrace.worker import Request, Worker
from ui.opening import Opening

SECONDS = 60.0


@pytest.fixture(scope="module")
def config() -> Config:
    usual = load(None, ())
    return replace(usual, render=replace(usual.render, width=32, height=18, threads=1))


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """No scene is compiled until this is set."""
    event = threading.Event()
    compile_scene = session.compile_scene  # type: ignore[attr-defined]  # what session calls

    def gated(scene):
        assert event.wait(SECONDS)
        return compile_scene(scene)

    monkeypatch.setattr(session, "compile_scene", gated)
    return event


def count_closed(monkeypatch: pytest.MonkeyPatch) -> list[Tracer]:
    """The tracers that are closed from now on."""
    closed: list[Tracer] = []
    close = Tracer.close

    def noted(tracer: Tracer) -> None:
        closed.append(tracer)
        close(tracer)

    monkeypatch.setattr(Tracer, "close", noted)
    return closed


def test_a_scene_comes_as_if_opened_here_and_nothing_is_printed(config, capfd):
    lines: list[str] = []
    made: list[Opening] = []

    def note() -> None:
        while not made:  # the thread may be faster than the assignment below
            time.sleep(0.001)
        lines.append(made[0].progress)

    opening = Opening("cornell", config, "still", animate=True, notify=note)
    made.append(opening)
    with opening.result().tracer as tracer:
        opened = session.open_shot("cornell", config, "still", animate=True, log=opening)
        with opened.tracer:
            packets = [
                source.frame(3, opened.camera(3), opened.camera(2), (32, 18)) for source in (tracer, opened.tracer)
            ]
    assert np.array_equal(packets[0].direct, packets[1].direct)
    assert opening.done
    assert lines[:2] == ["cornell: reading", "cornell: preparing 32 triangles"]
    assert capfd.readouterr() == ("", "")


def test_what_goes_wrong_is_raised_where_the_result_is_asked_for(config, tmp_path):
    opening = Opening("cornel", config, None, animate=True)
    with pytest.raises(UserError, match="did you mean 'cornell'"):
        opening.result()
    assert opening.done
    with pytest.raises(RuntimeError, match="the result was taken"):
        opening.result()
    (tmp_path / "broken.obj").write_text("v 0 0\n")
    with pytest.raises(UserError, match=r"broken\.obj"):
        Opening(str(tmp_path / "broken.obj"), config, None, animate=True).result()


def test_notices_are_kept(config, tmp_path):
    (tmp_path / "one.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 1 1\n")
    opening = Opening(str(tmp_path / "one.obj"), config, None, animate=True)
    opening.result().tracer.close()
    assert opening.notices
    assert all(line.startswith("one: ") or line.startswith("one.obj: ") for line in opening.notices)
    assert any("nothing in this scene moves" in line for line in opening.notices)


def test_frames_of_the_scene_before_go_on(config, gate):
    before = Opening("cornell", config, "still", animate=True)
    gate.set()
    with before.result().tracer as tracer:
        gate.clear()
        opening = Opening("cornell", config, "still", animate=True)
        camera = tracer.scene.scene.camera
        with Worker(tracer) as worker:
            for _ in range(2):
                worker.submit(Request(camera, (32, 18)))
                packet = worker.take(SECONDS)
                assert packet is not None
                assert packet.direct.max() > 0
        assert not opening.done
        gate.set()
        opening.result().tracer.close()


def fresh_kernel() -> Callable[..., Any]:
    """A kernel that was never compiled, and is not kept on disk."""
    inner = njit(lambda x: x + x)

    def double(values: NDArray[np.float32]) -> None:
        for i in range(values.shape[0]):
            values[i] = inner(values[i])

    compiled: Callable[..., Any] = njit(nogil=True)(double)
    return compiled


@pytest.mark.parametrize("compiles", [True, False])
def test_closing_returns_at_once_and_ends_the_thread_before_the_next_kernel(config, gate, monkeypatch, compiles):
    values = np.ones(1, np.float32)
    closed = count_closed(monkeypatch)
    if compiles:
        monkeypatch.setattr(Tracer, "warm_up", lambda tracer: fresh_kernel()(values))
    opening = Opening("cornell", config, "still", animate=True)
    while "preparing" not in opening.progress:
        time.sleep(0.01)
    start = time.monotonic()
    opening.close()
    assert time.monotonic() - start < 1.0
    gate.set()
    with pytest.raises(RuntimeError, match="not wanted"):
        opening.result()
    assert (values.tolist(), len(closed)) == ([1.0], 1)


def test_closing_frees_what_was_not_taken(config, monkeypatch):
    closed = count_closed(monkeypatch)
    opening = Opening("cornell", config, "still", animate=True)
    opening._finished.wait()
    opening.close()
    assert len(closed) == 1
    taken = Opening("cornell", config, "still", animate=True)
    shot = taken.result()
    taken.close()
    assert len(closed) == 1, "it belongs to whoever took it"
    shot.tracer.close()


def test_a_scene_is_freed_without_the_collector(config):
    opening = Opening("cornell", config, "still", animate=True)
    shot = opening.result()
    parts = [weakref.ref(part) for part in (shot, shot.tracer, shot.scene, shot.scene.triangles)]
    gc.disable()
    try:
        shot.tracer.close()
        del shot
        assert [part() for part in parts] == [None] * 4
    finally:
        gc.enable()


def test_no_full_collection_stops_the_window_meanwhile(config, gate):
    usual = gc.get_threshold()
    generations: list[int] = []

    def note(phase, info):
        generations.append(info["generation"])

    opening = Opening("cornell", config, "still", animate=True)
    while "preparing" not in opening.progress:
        time.sleep(0.01)
    gc.callbacks.append(note)
    try:
        rings: list[list[object]] = []
        for _ in range(200_000):
            ring: list[object] = []
            ring.append(ring)
            rings.append(ring)
    finally:
        gc.callbacks.remove(note)
    assert set(generations) == {0, 1}
    gate.set()
    opening.result().tracer.close()
    assert gc.get_threshold() == usual


def test_kernels_are_named_when_they_are_compiled_but_not_what_they_call():
    double, values = fresh_kernel(), np.ones(3, np.float32)
    names: list[str] = []

    def refuse(name):
        raise InterruptedError(name)

    with pytest.raises(InterruptedError, match="double"), watch_kernels(refuse):
        double(values)
    assert values.tolist() == [1, 1, 1]
    with watch_kernels(names.append):
        double(values)
        double(values)
    assert (names, values.tolist()) == (["double"], [4, 4, 4])


def test_the_terminal_is_told_once_that_kernels_are_compiled(capfd):
    terminal = session.Terminal()
    terminal.compiling("first")
    terminal.compiling("second")
    assert isinstance(terminal.stage("reading"), Progress)
    assert capfd.readouterr() == ("", "compiling the tracer's kernels, once for each kind of scene ...\n")


@pytest.mark.parametrize("cancelled", [True, False])
def test_what_an_opening_had_made_is_freed_when_it_ends_early(
    config: Config, monkeypatch: pytest.MonkeyPatch, cancelled: bool
) -> None:
    class Part:
        """Of a scene."""

    made: list[weakref.ref[Part]] = []
    begun, go_on = threading.Event(), threading.Event()

    def half_a_scene(*arguments: Any, log: Opening) -> None:
        part = Part()
        made.append(weakref.ref(part))
        begun.set()
        assert go_on.wait(SECONDS)
        with log.stage("the other half"):
            raise UserError("not in this file")

    monkeypatch.setattr("ui.opening.open_shot", half_a_scene)
    opening = Opening("half", config, None, True)
    assert begun.wait(SECONDS)
    if cancelled:
        opening.close()
    go_on.set()
    opening._thread.join()
    if not cancelled:
        with pytest.raises(UserError, match="not in this file") as caught:
            opening.result()
        del caught
    assert [part() for part in made] == [None], "without a collector, which is told to leave it alone"
