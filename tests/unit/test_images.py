"""Pictures on disk: row order, round trips, and what can go wrong with files."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from errors import UserError
from images import read_exr, side_by_side, to_srgb8, write_apng, write_exr, write_png


def picture(height: int = 5, width: int = 7, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def test_srgb_of_known_values() -> None:
    """IEC 61966-2-1; out of range is clamped and NaN is black, infinity white."""
    values = [0.0, 1.0, 0.5, 0.18, 0.002, -1.0, 7.0, np.nan, np.inf, -np.inf]
    linear = np.array(values, np.float32).reshape(1, -1, 1).repeat(3, axis=2)
    np.testing.assert_array_equal(to_srgb8(linear)[0, :, 0], [0, 255, 188, 118, 7, 0, 255, 0, 255, 0])


def test_srgb_codes_survive_the_way_there_and_back() -> None:
    codes = np.arange(256)
    c = codes / 255
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    np.testing.assert_array_equal(to_srgb8(linear.reshape(1, 256, 1).repeat(3, axis=2))[0, :, 1], codes)


def test_srgb_leaves_alpha_out() -> None:
    assert to_srgb8(np.zeros((2, 3, 4), np.float32)).shape == (2, 3, 3)


def test_a_png_has_its_top_row_first(tmp_path: Path) -> None:
    pixels = picture()
    path = tmp_path / "new" / "folders" / "a.png"
    write_png(path, pixels)
    with Image.open(path) as image:
        np.testing.assert_array_equal(np.asarray(image), pixels[::-1])
    assert os.listdir(path.parent) == ["a.png"]


def test_an_animation_keeps_frames_order_and_time(tmp_path: Path) -> None:
    frames = [picture(seed=seed) for seed in range(3)]
    write_apng(tmp_path / "a.png", frames, 120)
    with Image.open(tmp_path / "a.png") as image:
        assert image.n_frames == 3  # type: ignore[attr-defined]
        assert image.info["loop"] == 0
        for index, frame in enumerate(frames):
            image.seek(index)
            np.testing.assert_array_equal(np.asarray(image.convert("RGB")), frame[::-1])
            assert image.info["duration"] == 120


def test_an_exr_keeps_every_bit(tmp_path: Path) -> None:
    values = np.random.default_rng(1).normal(size=(6, 9, 3)).astype(np.float32) * np.float32(1e6)
    values[0, 0] = (np.inf, -0.0, 1e-40)
    write_exr(tmp_path / "a.exr", values)
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr").view(np.uint32), values.view(np.uint32))
    top_first = OpenEXR.File(str(tmp_path / "a.exr")).channels()["RGB"].pixels
    np.testing.assert_array_equal(top_first, values[::-1])
    write_exr(tmp_path / "b.exr", np.concatenate([values, values[..., :1]], axis=2))
    np.testing.assert_array_equal(read_exr(tmp_path / "b.exr"), values)


def test_an_exr_of_half_floats_is_read_as_single(tmp_path: Path) -> None:
    half = np.arange(24, dtype=np.float16).reshape(2, 4, 3) / 8
    OpenEXR.File({}, {"RGB": half}).write(str(tmp_path / "half.exr"))
    got = read_exr(tmp_path / "half.exr")
    assert got.dtype == np.float32
    np.testing.assert_array_equal(got, half[::-1].astype(np.float32))


def test_an_exr_with_alpha_gives_its_colour(tmp_path: Path) -> None:
    """OpenEXR hands out R, G, B and A as one array of another name."""
    values = np.random.default_rng(2).random((2, 4, 4)).astype(np.float32)
    OpenEXR.File({}, {"RGBA": values}).write(str(tmp_path / "alpha.exr"))
    np.testing.assert_array_equal(read_exr(tmp_path / "alpha.exr"), values[::-1, :, :3])


def test_an_exr_without_colour_is_refused_by_its_channels(tmp_path: Path) -> None:
    OpenEXR.File({}, {"Z": np.zeros((2, 3), np.float32)}).write(str(tmp_path / "depth.exr"))
    with pytest.raises(UserError, match=r"depth\.exr.*R, G and B.*Z"):
        read_exr(tmp_path / "depth.exr")


def test_files_that_are_missing_or_no_exr_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such file"):
        read_exr(tmp_path / "missing.exr")
    with pytest.raises(UserError, match="no such file"):
        read_exr(tmp_path)
    (tmp_path / "text.exr").write_text("not an image")
    with pytest.raises(UserError, match=r"text\.exr: is not a readable EXR"):
        read_exr(tmp_path / "text.exr")
    write_exr(tmp_path / "whole.exr", np.random.default_rng(0).random((64, 64, 3)).astype(np.float32))
    (tmp_path / "cut.exr").write_bytes((tmp_path / "whole.exr").read_bytes()[:2000])
    with pytest.raises(UserError, match=r"cut\.exr: is not a readable EXR"):
        read_exr(tmp_path / "cut.exr")


WRITERS: dict[str, Callable[[Path], None]] = {
    "png": lambda path: write_png(path, picture()),
    "apng": lambda path: write_apng(path, [picture(), picture(seed=1)], 40),
    "exr": lambda path: write_exr(path, np.zeros((3, 4, 3), np.float32)),
}
any_writer = pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS.keys())


@any_writer
def test_a_place_that_cannot_be_written_to_is_named(tmp_path: Path, write: Callable[[Path], None]) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    for place in (tmp_path / "file" / "a.png", tmp_path / "folder"):
        with pytest.raises(UserError, match=f"{place}: cannot be written"):
            write(place)
    assert sorted(os.listdir(tmp_path)) == ["file", "folder"]


@any_writer
def test_a_failure_half_way_leaves_the_old_picture(
    tmp_path: Path, write: Callable[[Path], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "a.png"
    target.write_text("old")

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    monkeypatch.setattr(OpenEXR.File, "write", full)
    with pytest.raises(UserError, match="No space left on device"):
        write(target)
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.png"]
    monkeypatch.undo()
    write(target)
    assert target.read_bytes()[:3] != b"old"
    assert os.listdir(tmp_path) == ["a.png"]


def test_pictures_stand_side_by_side() -> None:
    first, second = picture(4, 3), picture(4, 5, 1)
    row = side_by_side([first, second], gap=2)
    assert row.shape == (4, 10, 3)
    np.testing.assert_array_equal(row[:, :3], first)
    np.testing.assert_array_equal(row[:, 3:5], 24)
    np.testing.assert_array_equal(row[:, 5:], second)
    np.testing.assert_array_equal(side_by_side([first]), first)
