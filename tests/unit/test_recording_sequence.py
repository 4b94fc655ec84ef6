"""What can be wrong with a folder of frames: one message each, naming the file."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from bench.recording import exr
from bench.recording.header import Header, read_header, write_header
from bench.recording.layout import HEADER, IMAGES, NOTES, span
from bench.recording.sequence import open_sequence
from errors import UserError
from tests.unit.recordings import foreign


def image(path: Path, change: Callable[[np.ndarray], object]) -> None:
    """Write ``path`` anew with a change."""
    values = exr.read(path, 3)
    change(values)
    exr.write(path, values)


def set_pixel(value: float) -> Callable[[Path], None]:
    """One pixel of frame 1: the third from the left, in the second row from the top."""

    def change(folder: Path) -> None:
        image(folder / "albedo1.exr", lambda values: values.__setitem__((-2, 2, 1), value))

    return change


def remove(*names: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        for name in names:
            (folder / name).unlink()

    return change


def copy(source: str, *targets: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        for target in targets:
            (folder / target).write_bytes((folder / source).read_bytes())

    return change


def cut(name: str, share: float) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[: int(len(content) * share)])

    return change


def smaller(folder: Path) -> None:
    exr.write(folder / "shading_normal2.exr", np.zeros((11, 20, 3), np.float32))


def folder_instead(folder: Path) -> None:
    (folder / "color1.exr").unlink()
    (folder / "color1.exr").mkdir()


def channels(folder: Path) -> None:
    OpenEXR.File({}, {"Y": np.zeros((12, 20), np.float32)}).write(str(folder / "color0.exr"))


def replaced(old: str, new: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        text = (folder / HEADER).read_text()
        assert old in text
        (folder / HEADER).write_text(text.replace(old, new, 1))

    return change


def matrices(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    """Other conventions."""

    def rewrite(folder: Path) -> None:
        header = read_header(folder / HEADER)
        write_header(folder / HEADER, Header(1.0, 1.0, change(header.matrices).copy(), header.offsets))

    return rewrite


COLUMNS = matrices(lambda m: m.transpose(0, 2, 1))
UPWARDS = matrices(lambda m: m * np.array([1, -1, 1, 1], np.float32))
BEHIND = matrices(lambda m: -m)


MISTAKES: dict[str, tuple[Callable[[Path], object], str]] = {
    "no header": (remove(HEADER), f": there is no {HEADER} in it"),
    "header": (replaced("pixel_offsets", "offsets"), "pixel_offsets is not declared, did you mean 'offsets'?"),
    "missing": (remove("color1.exr"), ": color1.exr is missing: of 3 frames, 1 has no color (1)"),
    "gap": (remove("albedo0.exr", "albedo1.exr"), ": albedo0.exr is missing: of 3 frames, 2 have no albedo (0 to 1)"),
    "none of a kind": (
        remove(*(f"world_position{index}.exr" for index in range(3))),
        ": there is no world_position0.exr\n  every frame needs color, albedo, shading_normal, world_position",
    ),
    "optional, not of all": (
        copy("color0.exr", "emission0.exr", "emission2.exr"),
        ": emission1.exr is missing: of 3 frames, 1 has no emission (1)\n  remove all emission*.exr to go without",
    ),
    "extra": (
        copy("color0.exr", "color3.exr", "color4.exr", "color7.exr"),
        f": color3.exr has no camera: {HEADER} has those of frames 0 to 2 (more without one: 4, 7)",
    ),
    "extra reference": (copy("color0.exr", "reference3.exr"), ": reference3.exr has no camera"),
    "leading zeros": (copy("color0.exr", "color01.exr"), "color01.exr: numbers have no leading zeros here: color1.exr"),
    "not an image": (lambda folder: (folder / "color2.exr").write_text("PNG"), "color2.exr: is not an EXR file"),
    "empty": (lambda folder: (folder / "color2.exr").write_bytes(b""), "color2.exr: is empty"),
    "half written": (cut("color2.exr", 0.6), "color2.exr: is only half written"),
    "other channels": (channels, "color0.exr: must have channels R, G and B, but has Y"),
    "other size": (smaller, "shading_normal2.exr: 20x11 pixels, but beside color0.exr it must have 20x12"),
    "nan": (set_pixel(np.nan), "albedo1.exr: NaN or infinite at 1 pixel, the first in column 2 of row 1 from the top"),
    "infinite": (set_pixel(np.inf), "albedo1.exr: NaN or infinite at 1 pixel"),
    "a folder in the way": (
        folder_instead,
        "color1.exr: cannot be read",
    ),
    "transposed": (COLUMNS, f"world_position0.exr: by camera_matrices[0] of {HEADER}, half of its points or more"),
    "flipped": (UPWARDS, "pixels off\n  matrices are projection x view for row vectors, with y = -1 at the top row"),
    "behind": (BEHIND, "half of its points or more lie behind the camera"),
    "arithmetic": (replaced("{{", "{{0*"), f"{HEADER}, line 4: camera_matrices: '*"),
    "notes": (lambda folder: (folder / NOTES).write_text("{"), f"{NOTES}: cannot be read"),
    "other notes": (lambda folder: (folder / NOTES).write_text("[]"), f"{NOTES}: is not this program's"),
}


def read_all(folder: Path) -> None:
    sequence = open_sequence(folder)
    for index in range(sequence.frames):
        sequence.packet(index)


@pytest.mark.parametrize(("mistake", "message"), MISTAKES.values(), ids=MISTAKES.keys())
def test_one_message_names_the_file(
    tmp_path: Path, mistake: Callable[[Path], object], message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    foreign(tmp_path)
    mistake(tmp_path)
    with pytest.raises(UserError) as told:
        read_all(tmp_path)
    assert message in str(told.value)
    assert str(told.value).startswith(str(tmp_path))
    assert capfd.readouterr() == ("", "")


def test_a_matrix_of_no_camera_is_found_before_any_pixel_is_read(tmp_path: Path) -> None:
    foreign(tmp_path)
    matrices(lambda m: np.array([m[0], np.eye(4), m[2]], np.float32))(tmp_path)
    with pytest.raises(UserError, match=r"camera_matrices\[1\]: this matrix is no perspective camera's"):
        open_sequence(tmp_path)


@pytest.mark.parametrize(("name", "message"), [("nowhere", "there is no such folder"), ("file", "is no folder")])
def test_where_there_is_no_folder(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=message):
        open_sequence(tmp_path / name)


def test_other_files_do_not_matter_and_unknown_images_are_told(tmp_path: Path) -> None:
    foreign(tmp_path)
    for name in ("notes.txt", ".color0.abc.exr", "thumbnail.png"):
        (tmp_path / name).write_text("")
    copy("color0.exr", "emision0.exr", "bokeh0.exr")(tmp_path)
    sequence = open_sequence(tmp_path)
    assert sequence.images == ("color", "albedo", "shading_normal", "world_position")
    assert sequence.notices == ("bokeh*.exr: not read", "emision*.exr: not read, did you mean 'emission'?")


def test_references_may_be_there_for_some_frames(tmp_path: Path) -> None:
    foreign(tmp_path)
    copy("color0.exr", "reference1.exr")(tmp_path)
    sequence = open_sequence(tmp_path)
    assert sequence.references == {1}
    assert sequence.reference(0) is None
    np.testing.assert_array_equal(sequence.reference(1), sequence.read("color", 0))


def test_numbers_in_few_words() -> None:
    assert span([]) == ""
    assert span([3, 4, 5, 9]) == "3 to 5, 9"
    assert span(range(0, 20, 2)) == "0, 2, 4, 6 ..."


def test_names_of_files_do_not_overlap() -> None:
    assert all(not name[-1].isdigit() for name in IMAGES)


def test_a_cut_is_remembered(tmp_path: Path) -> None:
    foreign(tmp_path)
    (tmp_path / NOTES).write_text(json.dumps({"cuts": [0, 2]}))
    assert open_sequence(tmp_path).cuts == {0, 2}
