"""Recordings that go on where they stopped, references that converge, and what is refused instead of overwritten."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.metrics import rmse
from bench.recording import converge, exr, live
from bench.recording.header import read_header
from bench.recording.layout import HEADER, NOTES
from bench.recording.sequence import open_sequence
from bench.recording.writer import Recording, Stage, open_recording
from errors import UserError
from raytrace.frame import FramePacket
from raytrace.integrator import Tracer
from raytrace.shot import Shot
from tests.unit.recordings import SIZE, foreign, opened, recorded


def stage_of(shot: Shot, **about: object) -> Stage:
    return Stage(shot.scene.origin, shot.scene.extent, {"scene": "cornell", **about})


def reopened(folder: Path, shot: Shot, **about: object) -> Recording:
    return open_recording(folder, stage_of(shot, **about), shot.camera, shot.size)


def test_a_recording_goes_on_where_it_stopped(tmp_path: Path) -> None:
    with opened() as shot:
        recorded(tmp_path / "once", shot, 4)
        recorded(tmp_path / "twice", shot, 2)
        assert open_sequence(tmp_path / "twice").frames == 2  # what there is can be used
        recording = reopened(tmp_path / "twice", shot)
        assert recording.frames == 2
        for index in (2, 3):
            recording.add(shot.frame(index), shot.camera(index))
        recording.flush()
    files = {path.name for path in (tmp_path / "once").iterdir()}
    assert files == {path.name for path in (tmp_path / "twice").iterdir()}
    for name in files:
        once, twice = (tmp_path / folder / name for folder in ("once", "twice"))
        assert once.read_bytes() == twice.read_bytes(), name


def test_the_limits_are_four_widths_of_a_pixel_and_a_quarter(tmp_path: Path) -> None:
    with opened() as shot:
        packets = recorded(tmp_path, shot, 3)
    widths = [np.median(p.surface[..., 3][p.surface[..., 3] > 0]) * p.pixel_size for p in packets]
    header = read_header(tmp_path / HEADER)
    assert header.position_limit_squared == pytest.approx((4.0 * np.median(widths)) ** 2, rel=1e-6)
    assert header.normal_limit_squared == 0.25


def test_a_frame_whose_files_are_only_in_part_there_is_recorded_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after the power failed: nothing is told of the frame yet."""
    with opened() as shot:
        recorded(tmp_path, shot, 2)
        exr.write(tmp_path / "color2.exr", np.zeros((SIZE[1], SIZE[0], 3), np.float32))
        with pytest.raises(UserError, match=r"color2\.exr has no camera.*\n.*completed by the same app\.py record"):
            open_sequence(tmp_path)
        recording = reopened(tmp_path, shot)
        assert recording.frames == 2
        recording.add(shot.frame(2), shot.camera(2))
        recording.flush()
    assert open_sequence(tmp_path).frames == 3
    assert exr.read(tmp_path / "color2.exr", 3).any()


def test_what_is_not_ours_is_left_alone(tmp_path: Path) -> None:
    foreign(tmp_path / "other")
    (tmp_path / "file").write_text("")
    with opened() as shot:
        with pytest.raises(UserError, match=r"holds albedo0\.exr, which this program did not record"):
            reopened(tmp_path / "other", shot)
        with pytest.raises(UserError, match="is a file"):
            reopened(tmp_path / "file", shot)
        recorded(tmp_path / "ours", shot, 2)
        with pytest.raises(UserError, match="holds another recording: seed is None there, not 3"):
            reopened(tmp_path / "ours", shot, seed=3)
    with opened(size=(16, 24)) as shot, pytest.raises(UserError, match="the camera of frame 0 is another one"):
        reopened(tmp_path / "ours", shot)


class StoppedError(Exception):
    pass


def test_references_converge_go_on_and_know_their_noise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(converge, "PATHS_AT_ONCE", 8 * SIZE[0] * SIZE[1])
    traced: list[tuple[int, int]] = []
    reference = Tracer.reference

    def counting(tracer: Tracer, *arguments: Any) -> Any:
        if len(traced) == 8:
            raise StoppedError
        traced.append((arguments[4], arguments[2]))  # first sample, count
        return reference(tracer, *arguments)

    monkeypatch.setattr(Tracer, "reference", counting)
    with opened(animate=False) as shot:
        recorded(tmp_path, shot, 3)
        with pytest.raises(StoppedError):
            converge.run(reopened(tmp_path, shot), shot, 3, False, 32)
        # One round over all frames before the next, so that all are about equally good when it stops.
        assert traced == [(0, 4), (4, 4)] * 3 + [(8, 4), (12, 4)]
        assert open_sequence(tmp_path).references == {0, 1, 2}
        monkeypatch.setattr(Tracer, "reference", reference)
        converge.run(reopened(tmp_path, shot), shot, 3, False, 32)
        notes = open_sequence(tmp_path).notes["references"]
        assert [notes[str(index)]["samples"] for index in range(3)] == [32, 32, 32]
        assert "temporal_noise" in notes["2"]
        sequence = open_sequence(tmp_path)
        packet = sequence.packet(1)
        means = shot.reference(1, 32)
        truth = sum(shot.tracer.reference(shot.camera(1), SIZE, 512, 0.0, 32)) * packet.albedo[..., :3]
    got = sequence.reference(1)
    assert got is not None
    expected = (means[0] + means[1]) * packet.albedo[..., :3] + packet.emission[..., :3]
    np.testing.assert_allclose(got, expected, rtol=1e-5, atol=1e-6)
    mask = converge.surfaces(packet) & (packet.motion[..., 3] >= 0.0)
    assert notes["1"]["noise"] == pytest.approx(rmse(got, truth, mask), rel=0.3)


def test_references_that_are_there_cost_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with opened(animate=False) as shot:
        recorded(tmp_path, shot, 1)
        converge.run(reopened(tmp_path, shot), shot, 1, False, 4)
        before = (tmp_path / "reference0.exr").read_bytes()
        monkeypatch.setattr(Tracer, "reference", None)
        converge.run(reopened(tmp_path, shot), shot, 1, False, 2)
        (tmp_path / "reference0.exr").unlink()  # as after the power failed
        converge.run(reopened(tmp_path, shot), shot, 1, False, 4)
        assert (tmp_path / "reference0.exr").read_bytes() == before
        converge.sums_path(tmp_path, 0).unlink()
        converge.run(reopened(tmp_path, shot), shot, 1, False, 4)


def test_references_whose_sums_were_removed_begin_anew(tmp_path: Path) -> None:
    with opened(animate=False) as shot:
        recorded(tmp_path, shot, 1)
        converge.run(reopened(tmp_path, shot), shot, 1, False, 4)
        converge.sums_path(tmp_path, 0).unlink()
        converge.run(reopened(tmp_path, shot), shot, 1, False, 6)
        means = shot.reference(0, 6)
    sequence = open_sequence(tmp_path)
    assert sequence.notes["references"]["0"]["samples"] == 6
    packet, got = sequence.packet(0), sequence.reference(0)
    assert got is not None
    expected = (means[0] + means[1]) * packet.albedo[..., :3] + packet.emission[..., :3]
    np.testing.assert_allclose(got, expected, rtol=1e-5, atol=1e-6)


def test_the_window_s_recorder_writes_what_it_is_given(tmp_path: Path) -> None:
    (tmp_path / "recording_004").mkdir()
    with opened() as shot:
        recorder = live.new_recorder(tmp_path, shot.scene)
        packets = [shot.frame(index) for index in range(3)]
        for packet in packets:
            recorder.add(packet, shot.camera(packet.index))
        recorder.close()
    assert (recorder.folder, recorder.frames) == (tmp_path / "recording_005", 3)
    sequence = open_sequence(recorder.folder)
    for packet in packets:
        np.testing.assert_array_equal(sequence.packet(packet.index, packet.cut).surface, packet.surface)


def add_all(recorder: live.LiveRecorder, shot: Shot, packets: list[FramePacket]) -> None:
    for packet in packets:
        recorder.add(packet, shot.camera(packet.index))


def test_the_window_s_recorder_tells_of_a_full_disk_and_keeps_what_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = exr.write

    def full(path: Path, values: np.ndarray) -> None:
        if path.name == "direct1.exr":
            raise UserError(f"{path}: cannot be written (No space left on device)")
        write(path, values)

    monkeypatch.setattr(exr, "write", full)
    with opened() as shot:
        recorder = live.new_recorder(tmp_path, shot.scene)
        packets = [shot.frame(index) for index in range(3)]
        recorder.add(packets[0], shot.camera(0))
        with pytest.raises(UserError, match="No space left"):
            add_all(recorder, shot, packets * 10)  # more than may wait
        with pytest.raises(UserError, match="No space left"):
            recorder.close()
    assert recorder.frames == 1
    assert json.loads((recorder.folder / NOTES).read_text())["cuts"] == [0]
    assert open_sequence(recorder.folder).frames == 1  # and nothing is left of the one that failed
