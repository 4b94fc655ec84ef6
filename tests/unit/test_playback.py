"""Recorded frames in the window's place of a scene, by a sequence that only takes notes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import config
from raytrace.frame import FramePacket
from raytrace.shot import FPS
from ui import playback
from ui.camera_control import HeldKeys
from ui.keys import BY_KEY, Action
from ui.playback import RUN_UP, Playback
from ui.state import State

SIZE = (4, 3)


class Notes:
    """Stands in for the sequence."""

    name = "box"
    size = SIZE
    cuts = frozenset({0, 5})

    def __init__(self) -> None:
        self.read: list[tuple[int, bool]] = []

    def packet(self, index: int, cut: bool) -> FramePacket:
        self.read.append((index, cut))
        image: Any = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
        return FramePacket(index, 0.0, image, image, image, image, image, image, image, cut=cut)


@pytest.fixture
def notes() -> Notes:
    return Notes()


@pytest.fixture
def played(notes: Notes) -> Iterator[Playback]:
    made = Playback(notes, 2, 8, lambda: None)
    yield made
    made.close()


def state() -> State:
    return State(config.load(), "svgf")


def begin(played: Playback, state: State, settled: bool = True) -> FramePacket | None:
    """The next frame, None if there is to be none."""
    played.begin(state, (640, 360), HeldKeys(), settled)
    if played.idle:
        return None
    while (packet := played.take()) is None:
        time.sleep(0.001)
    return packet


def index(packet: FramePacket | None) -> int:
    assert packet is not None
    return packet.index


def test_it_begins_again_after_the_last_frame(played: Playback) -> None:
    packets = [begin(played, state()) for _ in range(8)]
    assert [(packet.index, packet.cut) for packet in packets if packet] == [
        *((2, True), (3, False), (4, False), (5, True), (6, False), (7, False)),
        *((2, True), (3, False)),
    ]


def test_frames_are_read_once(played: Playback, notes: Notes) -> None:
    for _ in range(14):
        begin(played, state())
    assert notes.read == [(2, True), (3, False), (4, False), (5, True), (6, False), (7, False)]


def test_only_as_many_frames_are_kept_as_there_is_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    image = SIZE[0] * SIZE[1] * 4 * 4
    monkeypatch.setattr(playback, "KEPT_BYTES", 7 * image * 2)
    notes = Notes()
    played = Playback(notes, 2, 6, lambda: None)
    for _ in range(8):
        begin(played, state())
    played.close()
    assert [number for number, _ in notes.read] == [2, 3, 4, 5, 4, 5]


def test_it_keeps_the_pace_of_the_recording(played: Playback) -> None:
    begin(played, state())
    start = time.perf_counter()
    for _ in range(6):
        begin(played, state())
    assert time.perf_counter() - start > 0.9 * 6 / FPS


def test_it_stands_still_and_goes_on(played: Playback) -> None:
    now = state()
    assert [index(begin(played, now)) for _ in range(2)] == [2, 3]
    now.animate = False
    assert begin(played, now) is None
    now.step = True
    assert (index(begin(played, now)), now.step) == (4, False)
    assert begin(played, now) is None
    now.animate = True
    assert index(begin(played, now)) == 5


@pytest.mark.parametrize(
    "change",
    [
        lambda now: now.perform(BY_KEY["B"]),
        lambda now: now.perform(BY_KEY["F3"]),
        lambda now: now.perform(BY_KEY["X"]),
        lambda now: now.perform(BY_KEY["H"]),
        lambda now: now.perform(BY_KEY["F12"]),  # a screenshot is of a picture made after the key
    ],
)
def test_what_is_to_be_seen_otherwise_is_filtered_again(played: Playback, change: Any) -> None:
    """The very same frame, so that whoever filters it knows."""
    now = state()
    now.textures = ("frame.direct",)
    begin(played, now)
    shown = begin(played, now)
    now.animate = False
    assert begin(played, now) is None
    change(now)
    assert begin(played, now) is shown
    now.reset, now.screenshot = "", False  # as the window leaves them
    assert begin(played, now) is None


def test_a_graph_that_is_not_compiled_yet_is_asked_for_again(played: Playback) -> None:
    now = state()
    shown = begin(played, now)
    now.animate = False
    assert begin(played, now, settled=False) is shown
    assert begin(played, now, settled=False) is shown


def test_another_method_is_led_up_to_the_frame() -> None:
    notes = Notes()
    notes.cuts = frozenset({0})
    played = Playback(notes, 0, 40, lambda: None)
    now = state()
    now.animate = False
    for _ in range(30):
        now.step = True
        begin(played, now)
    now.show("bmfr")
    start = time.perf_counter()
    packets = [begin(played, now) for _ in range(RUN_UP)]
    assert [index(packet) for packet in packets] == list(range(29 - RUN_UP + 1, 30))
    assert [packet.cut for packet in packets if packet] == [True] + [False] * (RUN_UP - 1)
    assert time.perf_counter() - start < 0.9 * RUN_UP / FPS  # at full speed
    assert begin(played, now) is None
    played.close()


def test_a_method_that_lacks_gradients_is_told_of_once(played: Playback) -> None:
    now = state()
    begin(played, now)
    now.show("asvgf")
    now.news = ""
    begin(played, now)
    assert now.news == "no gradients were recorded: light counts as unchanged"
    now.news = ""
    begin(played, now)
    assert now.news == ""
    now.show("svgf")
    now.news = ""
    begin(played, now)
    assert now.news == ""


def test_what_steers_the_camera_does_nothing_and_says_so(played: Playback) -> None:
    for key in ("W", "SHIFT", "R", "F6", "EQUAL", "MINUS", "F11"):
        assert played.refusal(BY_KEY[key].action).startswith(("recorded frames: ", "these frames are recorded"))
    for action in (Action.SHOW, Action.NEXT, Action.ANIMATE, Action.SCREENSHOT, Action.NEXT_SCENE):
        assert played.refusal(action) == ""
    assert played.change_speed(1.0) == "recorded frames: the camera goes as it went"
    now = state()
    now.home = True  # by the panel's button
    begin(played, now)
    assert (now.home, now.news) == (False, "recorded frames: the camera goes as it went")


def test_a_file_that_cannot_be_read_is_told_where_the_frame_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    notes = Notes()

    def broken(index: int, cut: bool) -> FramePacket:
        raise OSError("gone")

    monkeypatch.setattr(notes, "packet", broken)
    played = Playback(notes, 0, 3, lambda: None)
    with pytest.raises(OSError, match="gone"):
        begin(played, state())
    played.close()
