"""Frames to files and back: equal to the bit where the file has it, and near where it must be derived."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from bench.recording import exr
from bench.recording.layout import IMAGES, TOGETHER
from bench.recording.packets import images_of
from bench.recording.sequence import Sequence, open_sequence
from bench.recording.view import View, matrix_of
from bench.recording.writer import Recording, Stage
from errors import UserError
from raytrace.camera import Camera
from raytrace.frame import FramePacket
from tests.unit.documents import table
from tests.unit.recordings import EYE, SIZE, foreign, opened, recorded

FRAMES = 3


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> tuple[Sequence, list[FramePacket]]:
    """With everything that a recording can have: moving objects, a moving camera, jitter, sky."""
    folder = tmp_path_factory.mktemp("recording")
    with opened(jitter=True) as shot:
        packets = recorded(folder, shot, FRAMES, jitter=True)
    assert any((packet.motion[..., 3] < 0.0).any() for packet in packets)
    return open_sequence(folder), packets


def without(folder: Path, *names: str) -> Sequence:
    for name in names:
        for path in folder.glob(f"{name}[0-9]*.exr"):
            path.unlink()
    return open_sequence(folder)


def test_what_was_written_is_read_to_the_bit(recording: tuple[Sequence, list[FramePacket]]) -> None:
    sequence, packets = recording
    only_some = {"gradient_specular"} | {name for group in TOGETHER for name in group}
    written = {name for name, image in IMAGES.items() if not image.sparse} - only_some
    assert set(sequence.images) == written
    with opened() as shot:
        for packet in packets:
            eye = np.asarray(shot.camera(packet.index).position) - shot.scene.origin
            for name, values in images_of(packet, eye, shot.scene.extent).items():
                assert sequence.read(name, packet.index).tobytes() == values.tobytes(), name


def test_a_frame_is_what_it_was(recording: tuple[Sequence, list[FramePacket]]) -> None:
    """All that the filters take, to the bit; but for the sky's motion, whose rays are not in the files."""
    sequence, packets = recording
    for before in packets:
        after = sequence.packet(before.index, cut=before.cut)
        hit = before.motion[..., 3] >= 0.0
        for field in ("direct", "indirect", "albedo", "emission", "surface", "gradient", "prev_normal"):
            assert np.array_equal(getattr(after, field), getattr(before, field)), field
        assert np.array_equal(after.motion[hit], before.motion[hit])
        np.testing.assert_allclose(after.motion[~hit], before.motion[~hit], rtol=0, atol=1e-5)
        np.testing.assert_allclose(after.basis, before.basis, rtol=0, atol=1e-6)
        assert after.pixel_size == pytest.approx(before.pixel_size, rel=1e-6)
        assert after.jitter == pytest.approx(before.jitter, abs=1e-6)
        assert (after.index, after.cut, after.size) == (before.index, before.cut, before.size)


def test_every_image_of_a_packet_is_recorded_or_derived() -> None:
    """Whoever gives frames another image decides here whether recordings have it."""
    stored = {image.field for image in IMAGES.values() if image.field}
    derived = {"albedo", "surface", "gradient", "motion"}
    left_out = {"position", "prev_position"}  # of no use to the filters
    images = {field.name for field in fields(FramePacket) if "F32" in str(field.type)}
    assert stored | derived | left_out == images


@pytest.mark.parametrize("group", TOGETHER)
def test_what_only_some_frames_have_comes_back_to_the_bit(tmp_path: Path, group: tuple[str, ...]) -> None:
    rng = np.random.default_rng(6)
    width, height = SIZE

    def noise(*size: int) -> np.ndarray:
        return rng.random((*size, 4)).astype(np.float32)

    with opened() as shot:
        plain = shot.frame(0)
        if "gradient" in group:
            direct = plain.direct.copy()
            direct[..., 3] = rng.integers(0, 3, (height, width))
            packet = replace(plain, direct=direct, temporal_gradient=noise(-(-height // 3), -(-width // 3)))
        else:
            specular = noise(height, width)
            specular[..., 3] = 1.0
            packet = replace(plain, specular=specular, specular_albedo=noise(height, width))
        recording = Recording(tmp_path, Stage(shot.scene.origin, shot.scene.extent, {}))
        recording.add(packet, shot.camera(0))
        recording.flush()
    sequence = open_sequence(tmp_path)
    assert set(group) <= set(sequence.images)
    found = sequence.packet(0, cut=True)
    for field in ("direct", "specular", "specular_albedo", "temporal_gradient"):
        before, after = getattr(packet, field), getattr(found, field)
        assert (before is None and after is None) or np.array_equal(before, after), field
    (tmp_path / f"{group[-1]}0.exr").unlink()
    with pytest.raises(UserError, match=rf"there is {group[0]}0\.exr, but no {group[-1]}0\.exr"):
        open_sequence(tmp_path)


def test_the_table_in_the_documentation_is_that_of_the_program() -> None:
    rows = table("docs/recording.md", "What is in the folder")
    assert rows == [
        [f"`{image.name}`", str(image.channels), "yes" if image.required else "no", image.meaning]
        for image in IMAGES.values()
    ]


def test_depth_is_derived_where_it_is_not_there(tmp_path: Path) -> None:
    with opened() as shot:
        packets = recorded(tmp_path, shot, 2)
        extent = shot.scene.extent
    sequence = without(tmp_path, "depth")
    for before in packets:
        after = sequence.packet(before.index)
        np.testing.assert_allclose(after.surface[..., 3], before.surface[..., 3], rtol=0, atol=1e-6 * extent)
        # The Cornell box is of quads that are flat to a percent, so the shading normal's slope is nearly their own.
        width = before.pixel_size * float(np.median(before.surface[..., 3]))
        np.testing.assert_allclose(after.gradient, before.gradient, rtol=0.05, atol=0.05 * width)


def test_without_previous_positions_nothing_moves_but_the_camera(tmp_path: Path) -> None:
    with opened() as shot:
        packets = recorded(tmp_path, shot, 2)
    now, before = packets[1].position, packets[1].prev_position
    assert now is not None
    assert before is not None
    moving = np.abs(now - before).max(axis=2) > 0.0
    assert moving.any()
    packet = without(tmp_path, "prev_position", "prev_normal").packet(1)
    assert packet.prev_normal is None
    hit = packet.motion[..., 3] >= 0.0
    np.testing.assert_array_equal(packet.motion[hit & ~moving], packets[1].motion[hit & ~moving])
    assert np.abs(packet.motion[moving] - packets[1].motion[moving]).max() > 1e-4


def test_a_camera_at_rest_moves_nothing_to_the_bit(tmp_path: Path) -> None:
    foreign(tmp_path)
    packet = open_sequence(tmp_path).packet(1)
    assert (packet.motion[..., :2] == 0.0).all()


def test_what_must_be_there_is_enough(tmp_path: Path) -> None:
    foreign(tmp_path)
    sequence = open_sequence(tmp_path)
    assert not sequence.separate
    packet = sequence.packet(2)
    hit = packet.motion[..., 3] >= 0.0
    assert 0.2 < hit.mean() < 0.8
    np.testing.assert_array_equal(packet.direct[..., :3], sequence.read("color", 2))
    assert (packet.indirect[..., :3] == 0.0).all()
    assert (packet.emission == 0.0).all()
    assert set(np.unique(packet.motion[..., 3])) == {-1.0, 0.0}
    np.testing.assert_array_equal(packet.albedo[..., 3], hit)
    assert (packet.albedo[~hit] == 0.0).all()
    # On a plane the depth one pixel farther on follows from 1 / depth, which is linear.
    depth, slope = packet.surface[..., 3], packet.gradient[..., 1]
    inner = hit[:-1] & hit[1:]
    along = np.diff(1.0 / np.where(hit, depth, 1.0), axis=0) * -(depth[:-1] ** 2)
    np.testing.assert_allclose(slope[:-1][inner], along[inner], rtol=1e-3)


@pytest.mark.parametrize("names", [("shading_normal", "albedo", "color"), ("world_position",)])
def test_half_precision_will_do(tmp_path: Path, names: tuple[str, ...]) -> None:
    foreign(tmp_path, frames=1)
    exact = open_sequence(tmp_path).packet(0)
    for name in names:
        path = tmp_path / f"{name}0.exr"
        values = exr.read(path, 3).astype(np.float16)
        exr.write(path, values.astype(np.float32))
    rough = open_sequence(tmp_path).packet(0)
    lengths = np.linalg.norm(rough.surface[..., :3], axis=2)
    hit = exact.motion[..., 3] >= 0.0
    np.testing.assert_allclose(lengths[hit], 1.0, rtol=1e-6)
    np.testing.assert_allclose(rough.surface, exact.surface, rtol=2e-3, atol=2e-3)
    assert np.abs(rough.motion[hit][:, :2]).max() == 0.0


def test_an_object_of_number_minus_one_is_a_miss(tmp_path: Path) -> None:
    foreign(tmp_path, frames=1)
    before = open_sequence(tmp_path).packet(0)
    ids = np.full((12, 20, 1), 3.0, np.float32)
    ids[:2] = -1.0
    assert (before.motion[:2, :, 3] == 0.0).all()
    exr.write(tmp_path / "object_id0.exr", ids)
    packet = open_sequence(tmp_path).packet(0)
    assert (packet.motion[:2, :, 3] == -1.0).all()
    assert (packet.surface[:2] == 0.0).all()
    assert (packet.albedo[:2] == 0.0).all()
    assert set(np.unique(packet.motion[2:, :, 3])) == {-1.0, 3.0}


def test_a_point_that_was_behind_the_camera_is_found_nowhere(tmp_path: Path) -> None:
    """Its projection lies in the picture, upside down: a history must not be taken from there."""
    foreign(tmp_path)
    for index in range(3):
        images = exr.read(tmp_path / f"world_position{index}.exr", 3)
        behind = 2.0 * np.asarray(EYE.position, dtype=np.float32) - images
        exr.write(tmp_path / f"prev_position{index}.exr", behind)
    packet = open_sequence(tmp_path).packet(1)
    hit = packet.motion[..., 3] >= 0.0
    assert (packet.motion[hit][:, :2] == 2.0).all()
    assert (packet.motion[hit][:, 2] <= 0.0).all()


def test_a_cut_moves_nothing(tmp_path: Path) -> None:
    with opened() as shot:
        recorded(tmp_path, shot, 2)
    sequence = without(tmp_path, "prev_position", "prev_normal")
    assert np.abs(sequence.packet(1).motion[..., :2]).max() > 1e-4
    packet = sequence.packet(1, cut=True)
    assert packet.cut
    assert (packet.motion[..., :2] == 0.0).all()


def test_normals_need_not_have_length_one(tmp_path: Path) -> None:
    foreign(tmp_path, frames=1)
    exact = open_sequence(tmp_path).packet(0)
    path = tmp_path / "shading_normal0.exr"
    exr.write(path, exr.read(path, 3) * np.float32(0.9))
    np.testing.assert_allclose(open_sequence(tmp_path).packet(0).surface, exact.surface, rtol=1e-6)


def test_a_miss_may_have_any_position(tmp_path: Path) -> None:
    foreign(tmp_path, frames=1)
    exact = open_sequence(tmp_path).packet(0)
    path = tmp_path / "world_position0.exr"
    values = exr.read(path, 3)
    values[exact.motion[..., 3] < 0.0] = np.nan
    exr.write(path, values)
    packet = open_sequence(tmp_path).packet(0)
    assert all(np.isfinite(values).all() for values in (packet.motion, packet.surface, packet.gradient))
    np.testing.assert_array_equal(packet.motion, exact.motion)


@pytest.mark.parametrize("scale", [1.0, 0.01, 250.0])
def test_a_matrix_means_the_same_at_any_scale(scale: float) -> None:
    matrix = matrix_of(EYE, SIZE, np.zeros(3)) * np.float32(scale)
    view = View.of(matrix, np.array([0.5, 0.5], np.float32), SIZE)
    np.testing.assert_allclose(view.basis, EYE.axes(), atol=1e-6)
    assert view.pixel_size == pytest.approx(EYE.pixel_size(SIZE[1]), rel=1e-6)
    point = np.asarray(EYE.position) + 3.0 * np.asarray(EYE.forward)
    x, y, depth = view.project(point.astype(np.float32)[None, None])
    np.testing.assert_allclose([x[0, 0], y[0, 0], depth[0, 0]], [0.0, 0.0, 3.0], atol=1e-5)


def test_rays_lead_back_to_their_pixels_through_any_lens() -> None:
    """Shifted, with oblong pixels and jitter."""
    matrix = matrix_of(EYE, SIZE, np.zeros(3)).astype(np.float64)
    matrix[:, 0] = 1.7 * matrix[:, 0] + 0.3 * matrix[:, 3]
    matrix[:, 1] -= 0.2 * matrix[:, 3]
    view = View.of(matrix.astype(np.float32), np.array([0.25, 0.875], np.float32), SIZE)
    eye = np.asarray(EYE.position, dtype=np.float32)
    x, y, depth = view.project(eye + 2.0 * view.rays())
    columns, rows = np.meshgrid(np.arange(SIZE[0]) + 0.25, np.arange(SIZE[1]) + 0.875)
    np.testing.assert_allclose(depth, 2.0, rtol=1e-5)
    np.testing.assert_allclose((x / depth + 1.0) * SIZE[0] / 2, columns, atol=1e-4)
    np.testing.assert_allclose((y / depth + 1.0) * SIZE[1] / 2, rows, atol=1e-4)


@pytest.mark.parametrize("matrix", [np.zeros((4, 4)), np.eye(4), np.full((4, 4), 1.0)])
def test_what_is_no_camera(matrix: np.ndarray) -> None:
    with pytest.raises(ValueError, match="no perspective camera"):
        View.of(matrix.astype(np.float32), np.array([0.5, 0.5], np.float32), SIZE)


def test_the_matrix_is_that_of_the_data_set() -> None:
    """Row vectors, and the top of the picture at y = -1."""
    camera = Camera.look_at((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
    above = np.array([0.0, 1.0, 0.0, 1.0]) @ matrix_of(camera, SIZE, np.zeros(3))
    assert above[1] / above[3] < 0.0
    assert above[3] == pytest.approx(5.0)


def test_frames_without_positions_are_refused() -> None:
    with opened(positions=False, animate=False) as shot:
        with pytest.raises(ValueError, match="without positions"):
            images_of(shot.frame(0), np.zeros(3), 1.0)
        shot.tracer.carry_positions(True)
        assert "world_position" in images_of(shot.frame(0), np.zeros(3), 1.0)
        shot.tracer.carry_positions(False)
        assert shot.frame(0).position is None
