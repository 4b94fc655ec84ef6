"""EXR files of recordings: numbers to the bit, what other programs write, and files that are not whole."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

from bench.recording import exr
from errors import UserError


def save(path: Path, channels: dict[str, np.ndarray], **header: Any) -> Path:
    OpenEXR.File({"type": OpenEXR.scanlineimage, **header}, channels).write(str(path))
    return path


@pytest.mark.parametrize("channels", [1, 3])
def test_numbers_come_back_to_the_bit(tmp_path: Path, channels: int) -> None:
    bits = np.random.default_rng(2).integers(0, 2**32, (37, 19, channels), dtype=np.uint32)
    values = np.where(np.isfinite(bits.view(np.float32)), bits.view(np.float32), np.float32(-0.0))
    exr.write(tmp_path / "a.exr", values)
    assert exr.read(tmp_path / "a.exr", channels).tobytes() == values.tobytes()
    assert exr.examine(tmp_path / "a.exr").size == (19, 37)


def test_the_top_row_comes_first_in_the_file(tmp_path: Path) -> None:
    values = np.zeros((3, 2, 3), np.float32)
    values[2] = 1.0  # the top row in memory
    exr.write(tmp_path / "a.exr", values)
    assert OpenEXR.File(str(tmp_path / "a.exr")).channels()["RGB"].pixels[0].min() == 1.0


@pytest.mark.parametrize(
    ("name", "compression"),
    [
        ("none", OpenEXR.NO_COMPRESSION),
        ("rle", OpenEXR.RLE_COMPRESSION),
        ("zips", OpenEXR.ZIPS_COMPRESSION),
        ("piz", OpenEXR.PIZ_COMPRESSION),
    ],
)
@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_what_other_programs_write(tmp_path: Path, name: str, compression: Any, kind: type) -> None:
    pixels: np.ndarray = np.linspace(0, 9, 40 * 5 * 3).reshape(40, 5, 3).astype(kind)
    path = save(tmp_path / f"{name}.exr", {"RGB": pixels}, compression=compression)
    np.testing.assert_array_equal(exr.read(path, 3), pixels[::-1].astype(np.float32))


def test_alpha_and_tiles_and_separate_channels(tmp_path: Path) -> None:
    pixels = np.random.default_rng(3).random((4, 6, 4)).astype(np.float32)
    path = save(tmp_path / "alpha.exr", {"RGBA": pixels})
    np.testing.assert_array_equal(exr.read(path, 3), pixels[::-1, :, :3])
    assert exr.examine(path).channels == ("A", "B", "G", "R")
    path = save(tmp_path / "three.exr", {name: pixels[:, :, i].copy() for i, name in enumerate("RGB")})
    np.testing.assert_array_equal(exr.read(path, 3), pixels[::-1, :, :3])
    OpenEXR.File(
        {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}, {"RGB": pixels[..., :3].copy()}
    ).write(str(path))
    np.testing.assert_array_equal(exr.read(path, 3), pixels[::-1, :, :3])


def test_one_channel_of_any_name(tmp_path: Path) -> None:
    numbers = np.arange(6, dtype=np.uint32).reshape(2, 3)
    path = save(tmp_path / "id.exr", {"id": numbers})
    np.testing.assert_array_equal(exr.read(path, 1)[..., 0], numbers[::-1])
    path = save(tmp_path / "grey.exr", {"RGB": np.repeat(numbers[..., None], 3, 2).astype(np.float32)})
    np.testing.assert_array_equal(exr.read(path, 1)[..., 0], numbers[::-1])


def test_missing_channels(tmp_path: Path) -> None:
    path = save(tmp_path / "xy.exr", {"X": np.zeros((2, 2), np.float32), "Z": np.zeros((2, 2), np.float32)})
    with pytest.raises(UserError, match="must have channels R, G and B, but has X, Z"):
        exr.read(path, 3)
    with pytest.raises(UserError, match="must have one channel, but has X, Z"):
        exr.read(path, 1)


@pytest.mark.parametrize("rows", [1, 16, 33])
def test_every_cut_is_noticed(tmp_path: Path, rows: int, capfd: pytest.CaptureFixture[str]) -> None:
    """By one message of ours, and by nothing that a library prints."""
    path = tmp_path / "a.exr"
    exr.write(path, np.random.default_rng(4).random((rows, 7, 3)).astype(np.float32))
    content = path.read_bytes()
    for length in {0, 3, 4, 7, 8, 20, 100, 200, 300, len(content) // 2, len(content) - 1}:
        if length < len(content):
            path.write_bytes(content[:length])
            with pytest.raises(UserError, match=r"half written|not an EXR file|is empty|damaged or cut short"):
                exr.read(path, 3)
    assert capfd.readouterr() == ("", "")


def test_a_table_of_zeros_is_a_file_half_written(tmp_path: Path) -> None:
    """What a writer leaves that was stopped: it fills in the chunks' places last."""
    path = tmp_path / "a.exr"
    exr.write(path, np.random.default_rng(4).random((40, 7, 3)).astype(np.float32))
    content = bytearray(path.read_bytes())
    table = 8 * 3  # bytes, for 40 rows of which 16 make a chunk; the first chunk follows it
    at = next(at for at in range(len(content)) if int.from_bytes(content[at : at + 8], "little") == at + table)
    content[at : at + table] = bytes(table)
    path.write_bytes(content)
    with pytest.raises(UserError, match="half written"):
        exr.examine(path)


@pytest.mark.parametrize("content", [b"P6 2 2 255\n" + b"\0" * 12, b"v/1\x01" + b"\xff" * 400, b"v/1\x01" + b"\0" * 60])
def test_what_is_no_exr(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.exr").write_bytes(content)
    with pytest.raises(UserError, match=r"not an EXR file|not a readable EXR"):
        exr.read(tmp_path / "a.exr", 3)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"a\.exr: there is no such file"):
        exr.read(tmp_path / "a.exr", 3)


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.exr"
    old = np.ones((2, 2, 3), np.float32)
    exr.write(path, old)

    def fails(*_: object) -> None:
        raise RuntimeError("no space left on device")

    monkeypatch.setattr(OpenEXR, "File", lambda *_: type("Full", (), {"write": fails})())
    with pytest.raises(UserError, match="no space left on device"):
        exr.write(path, old * 2)
    monkeypatch.undo()
    np.testing.assert_array_equal(exr.read(path, 3), old)
    assert [file.name for file in tmp_path.iterdir()] == ["a.exr"]
