"""camera_matrices.h as text: numbers to the bit, the liberties that C gives, and what is wrong with it, by line."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from bench.recording.header import Header, read_header, write_header
from errors import UserError

GOOD = """\
// of another program
#ifndef CAMERA
#define CAMERA
/* limits,
   squared: position_limit_squared = 7; */
const float position_limit_squared = 0.25;
static const float normal_limit_squared = 1.0f ;
const float camera_matrices[2][4][4] = {
 { {1.0f,0,0,0}, {0,-2.5e0f,0,0}, {0,0,1.,1}, {0,0,-.5,0} },
 { {1,0,0,0}, {0,2,0,0}, {0,0,1,+1}, {0,0,-1E-1F,0}, },  // a comma may follow the last
};
const float pixel_offsets[2][2]={{0.5f,0.5f},{0.25,.75}};
#endif
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "camera_matrices.h"
    path.write_text(text)
    return path


def test_numbers_are_read_back_to_the_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    bits = rng.integers(0, 2**32, (7, 4, 4), dtype=np.uint32)
    matrices = np.where(np.isfinite(bits.view(np.float32)), bits.view(np.float32), np.float32(-0.0))
    header = Header(0.1, 0.25, matrices, rng.random((7, 2)).astype(np.float32))
    write_header(tmp_path / "a.h", header, ["scene: box"])
    found = read_header(tmp_path / "a.h")
    assert found.matrices.tobytes() == matrices.tobytes()
    assert found.offsets.tobytes() == header.offsets.tobytes()
    assert (np.float32(found.position_limit_squared), found.normal_limit_squared) == (np.float32(0.1), 0.25)


def test_it_is_c(tmp_path: Path) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("there is no C compiler on this machine to ask")
    header = Header(1.0, 0.25, np.full((1, 4, 4), 1e-30, np.float32), np.full((1, 2), 3.0, np.float32))
    write_header(tmp_path / "a.h", header, ["a comment"])
    (tmp_path / "a.c").write_text('#include "a.h"\nint main(void) { return camera_matrices[0][3][3] != 1e-30f; }\n')
    subprocess.run([compiler, "-Werror", "-o", tmp_path / "a", tmp_path / "a.c"], check=True, cwd=tmp_path)
    subprocess.run([tmp_path / "a"], check=True)


def test_what_c_allows(tmp_path: Path) -> None:
    header = read_header(written(tmp_path, GOOD))
    assert (header.frames, header.position_limit_squared, header.normal_limit_squared) == (2, 0.25, 1.0)
    np.testing.assert_array_equal(header.matrices[0], np.array([1, -2.5, 1, 0]) * np.eye(4) + corner(1, -0.5))
    assert header.matrices[1, 3, 2] == np.float32(-0.1)
    np.testing.assert_array_equal(header.offsets, [[0.5, 0.5], [0.25, 0.75]])


def corner(above: float, beside: float) -> np.ndarray:
    matrix = np.zeros((4, 4))
    matrix[2, 3], matrix[3, 2] = above, beside
    return matrix


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("position_limit_squared = 0.25", "position_limit = 0.25", "position_limit_squared is not declared, did you"),
        ("camera_matrices", "camera_poses", "camera_matrices is not declared"),
        ("= 0.25;", "= 0.25", "line 7: position_limit_squared: 'static' is no number"),
        ("0.25;", ";", "line 6: position_limit_squared: a value is missing"),
        ("{1.0f,0,0,0}", "{1.0f,0,0}", "line 8: camera_matrices: its rows are not equally long"),
        ("[2][4][4]", "[3][4][4]", "line 8: camera_matrices[3][4][4] has 2 x 4 x 4 values"),
        ("{0.5f,0.5f},", "", "pixel_offsets[2][2] has 1 x 2 values"),
        ("[2][2]={{0.5f,0.5f},", "[][2]={", "line 12: 2 camera_matrices, but 1 pixel_offsets"),
        ("-2.5e0f", "sin(2)", "line 9: camera_matrices: 'sin(2),0,0},' is no number"),
        ("-2.5e0f", "nan", "line 9: camera_matrices: 'nan,0,0},' is no number"),
        ("-2.5e0f", "1e39", "camera_matrices: a number is too large for a float"),
        ("{0,0,1,+1}", "{0,0,1 +1}", "line 10: camera_matrices: a comma is missing before '+1'"),
        ("{0,0,1,+1}", "{0,0,,1}", "line 10: camera_matrices: a value is missing before ','"),
        ("{0.25,.75}};", "{0.25,.75};", "a closing brace is missing"),
        ("{0.25,.75}};", "{0.25,.75}}};", "'}' stands after the value"),
        ("= 0.25;", "= {0.25};", "position_limit_squared must be one number, but is 1"),
    ],
)
def test_what_is_wrong_is_told_by_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in GOOD
    with pytest.raises(UserError) as told:
        read_header(written(tmp_path, GOOD.replace(old, new)))
    assert message in str(told.value)
    assert str(told.value).startswith(f"{tmp_path / 'camera_matrices.h'}, line ")


def test_it_is_not_executed(tmp_path: Path) -> None:
    """A header is somebody else's: names in it mean nothing here."""
    with pytest.raises(UserError, match="is no number"):
        read_header(written(tmp_path, GOOD.replace("0.25;", "__import__('os').getpid();")))


@pytest.mark.parametrize("content", [b"", b"\x00\xff\xfe" * 400, b"const float a = " + b"{" * 100_000])
def test_what_is_no_header(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "camera_matrices.h"
    path.write_bytes(content)
    with pytest.raises(UserError, match="is not declared"):
        read_header(path)


def test_a_header_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot be read"):
        read_header(tmp_path / "camera_matrices.h")
