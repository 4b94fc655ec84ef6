"""The record key without a window: recordings begin, end and fail as the state says."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import config
from errors import UserError
from raytrace.camera import Camera
from raytrace.frame import FramePacket
from ui.keeping import Keeper
from ui.keys import BY_KEY
from ui.playback import Playback
from ui.stage import Stage
from ui.state import State

CAMERA = Camera((1.0, 2.0, 3.0), (0.0, 0.0, -1.0))


class Recorder:
    def __init__(self, out: Path, trouble: str = "") -> None:
        self.folder, self.frames, self.trouble = out / "recording_000", 0, trouble
        self.cameras: list[Camera] = []
        self.closed = False

    def add(self, packet: FramePacket, camera: Camera) -> None:
        if self.trouble and self.frames == 2:
            raise UserError(self.trouble, "choose another place")
        self.frames += 1
        self.cameras.append(camera)

    def close(self) -> None:
        self.closed = True
        if self.trouble:
            raise UserError(self.trouble, "choose another place")


@pytest.fixture
def stage() -> Any:
    made = Stage.__new__(Stage)  # without its thread
    made.shot, made.camera = SimpleNamespace(scene="scene"), CAMERA  # type: ignore[assignment]
    return made


@pytest.fixture
def state() -> State:
    return State(config.load(), "svgf")


def frame(positions: bool = True) -> FramePacket:
    image: Any = np.zeros((2, 2, 4), np.float32)
    where = image if positions else None
    return FramePacket(0, 0.0, image, image, image, image, image, image, image, position=where, prev_position=where)


def test_from_the_key_to_the_key(tmp_path: Path, stage: Any, state: State, capsys: pytest.CaptureFixture[str]) -> None:
    made: list[Recorder] = []

    def new(out: Path, scene: object) -> Recorder:
        assert (out, scene) == (tmp_path, "scene")
        made.append(Recorder(out))
        return made[-1]

    keeper = Keeper(new, tmp_path, state)
    keeper.follow(stage)
    keeper.keep(frame(), stage)
    assert made == []
    state.perform(BY_KEY["F11"])
    keeper.follow(stage)
    assert state.news == f"recording to {tmp_path}/recording_000"
    keeper.keep(frame(positions=False), stage)  # begun before the key was pressed
    for _ in range(3):
        keeper.follow(stage)
        keeper.keep(frame(), stage)
    state.news = ""
    state.perform(BY_KEY["F11"])
    keeper.follow(stage)
    assert (len(made), made[0].frames, made[0].closed) == (1, 3, True)
    assert made[0].cameras == [CAMERA] * 3
    assert state.news == f"recorded 3 frames to {tmp_path}/recording_000"
    assert capsys.readouterr().out == f"{tmp_path}/recording_000\n"
    keeper.stop()
    assert capsys.readouterr().out == ""


def test_a_full_disk_ends_the_recording_and_nothing_else(
    tmp_path: Path, stage: Any, state: State, capsys: pytest.CaptureFixture[str]
) -> None:
    keeper = Keeper(lambda out, scene: Recorder(out, "disk full"), tmp_path, state)
    state.recording = True
    keeper.follow(stage)
    for _ in range(3):
        keeper.keep(frame(), stage)
    assert not state.recording
    assert "disk full" in state.news
    assert "recorded 2 frames" in state.news
    assert "error: disk full\n  choose another place\n" in capsys.readouterr().err
    keeper.follow(stage)
    assert not state.recording


def test_a_place_that_cannot_be_written_is_told(tmp_path: Path, stage: Any, state: State) -> None:
    def refuse(out: Path, scene: object) -> Recorder:
        raise UserError(f"{out}: cannot be written")

    keeper = Keeper(refuse, tmp_path, state)
    state.recording = True
    keeper.follow(stage)
    assert (state.recording, state.news) == (False, f"{tmp_path}: cannot be written")


def test_only_a_scene_can_be_recorded(tmp_path: Path, stage: Any, state: State) -> None:
    for new, source in ((None, stage), (lambda out, scene: Recorder(out), Playback.__new__(Playback))):
        keeper = Keeper(new, tmp_path, state)
        state.recording = True
        keeper.follow(source)
        assert not state.recording
