"""A scene under way: what it asks the tracer for, by a tracer that only takes notes."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

import config
from raytrace.camera import Camera
from raytrace.shot import FPS
from ui import keys
from ui.camera_control import HeldKeys
from ui.stage import Stage
from ui.state import State

SIZE = (32, 18)


class Notes:
    """Stands in for the tracer."""

    def __init__(self) -> None:
        self.frames: list[SimpleNamespace] = []
        self.closed = False
        self.positions = False

    def carry_positions(self, wanted: bool) -> None:
        self.positions = wanted

    def frame(
        self, index: int, camera: Camera, previous: Camera, size: Any, now: float, before: float, cut: bool, **how: Any
    ) -> Any:
        noted = {"index": index, "camera": camera, "size": size, "step": round(now * FPS), "cut": cut, **how}
        self.frames.append(SimpleNamespace(**noted))
        return self.frames[-1]

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def stage() -> Iterator[Stage]:
    def camera(frame: int) -> Camera:
        return Camera((float(frame), 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), 1.0)

    scene = SimpleNamespace(scene=SimpleNamespace(name="room", dims=False), extent=8.0, moves=True)
    shot: Any = SimpleNamespace(scene=scene, camera=camera, tracer=Notes())
    made = Stage(shot, True, lambda: None)
    yield made
    made.close()
    assert shot.tracer.closed


def frames(stage: Stage, state: State, count: int) -> list[Any]:
    """The next ``count`` frames, one after the other."""
    taken: list[Any] = []
    for _ in range(count):
        stage.begin(state, SIZE, HeldKeys())
        while (packet := stage.take()) is None:
            pass
        taken.append(packet)
    return taken


def state_of() -> State:
    return State(config.load(), "svgf")


def steps(packets: list[Any]) -> list[int]:
    return [packet.step for packet in packets]


def test_time_goes_on_stands_still_and_goes_on_where_it_was(stage):
    state = state_of()
    assert steps(frames(stage, state, 3)) == [0, 1, 2]
    state.perform(keys.BY_KEY["SPACE"])
    assert steps(frames(stage, state, 2)) == [2, 2], "what is shown stays"
    state.perform(keys.BY_KEY["SPACE"])
    assert steps(frames(stage, state, 2)) == [3, 4]


def test_a_step_is_one_frame_and_time_stands_still_after_it(stage):
    state = state_of()
    frames(stage, state, 2)
    state.perform(keys.BY_KEY["PERIOD"])
    assert steps(frames(stage, state, 3)) == [2, 2, 2]
    state.perform(keys.BY_KEY["PERIOD"])
    assert steps(frames(stage, state, 2)) == [3, 3]


def test_what_rests_at_first_begins_at_time_0(stage):
    state = state_of()
    state.animate = False
    assert steps(frames(stage, state, 2)) == [0, 0]
    state.perform(keys.BY_KEY["PERIOD"])
    assert steps(frames(stage, state, 1)) == [1]


def test_the_camera_goes_home_with_a_cut(stage):
    state = state_of()
    first, second, third = frames(stage, state, 3)
    assert [packet.camera.position[0] for packet in (first, second, third)] == [0.0, 1.0, 2.0]
    assert (first.cut, second.cut, third.cut) == (True, False, False)
    state.perform(keys.BY_KEY["R"])
    (back,) = frames(stage, state, 1)
    assert back.cut
    assert back.camera.position[0] == 0.0
    assert not state.home, "the wish is fulfilled"


def test_the_mouse_turns_the_camera_once(stage):
    state = state_of()
    frames(stage, state, 1)
    stage.look(100.0, 0.0)
    stage.look(100.0, 0.0)
    (turned,) = frames(stage, state, 1)
    assert turned.camera.forward[0] > 0.2
    (still,) = frames(stage, state, 1)
    assert still.camera.forward == turned.camera.forward


def test_gradients_are_traced_for_the_method_that_reads_them_and_lamps_follow_their_key(stage):
    state = state_of()
    state.perform(keys.BY_KEY["O"])
    assert state.news == "lamps off"
    assert [(p.remember, p.lamps) for p in frames(stage, state, 1)] == [("", 0.0)]
    state.perform(keys.BY_KEY["3"])
    state.perform(keys.BY_KEY["O"])
    assert [(p.remember, p.lamps) for p in frames(stage, state, 1)] == [("random", 1.0)]
    state.set("asvgf.remember", "brightest")
    assert frames(stage, state, 1)[0].remember == "brightest"
    state.perform(keys.BY_KEY["F1"])
    assert frames(stage, state, 1)[0].remember == "", "without a history there is nothing to cut"
