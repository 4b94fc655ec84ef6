"""Camera paths in TOML: read, written, and what is wrong with broken ones."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from errors import UserError
from raytrace.camera import Camera
from raytrace.camera_path import Keyframe, along, as_toml, read_camera_path, read_keyframes
from raytrace.frame import Vector

THREE = """
[[key]]
time = 1.0
position = [0, 1, 2]
target = [0, 1, -5]
yfov = 30.0

[[key]]
time = 2
position = [4, 1, 2]
forward = [0, 0, -2]

[[key]]
time = 4.0
position = [4.0, 1.0, -2.0]
forward = [3.0, 0.0, -3.0]
up = [0, 2, 0]
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "walk.toml"
    path.write_text(text)
    return path


def test_a_path_goes_through_its_keys_and_rests_at_its_ends(tmp_path: Path) -> None:
    camera = read_camera_path(written(tmp_path, THREE))
    assert callable(camera)
    for time, position in ((0.0, (0, 1, 2)), (1.0, (0, 1, 2)), (2.0, (4, 1, 2)), (4.0, (4, 1, -2)), (99.0, (4, 1, -2))):
        assert camera(time).position == position
    assert camera(1.0).forward == (0.0, 0.0, -1.0)
    assert camera(4.0).forward == pytest.approx((math.sqrt(0.5), 0.0, -math.sqrt(0.5)))
    assert camera(3.0).up == (0.0, 1.0, 0.0)
    assert [math.degrees(camera(time).yfov) for time in (0, 1.5, 4)] == pytest.approx([30, 30, 30])
    for time in np.linspace(0, 5, 60):
        assert np.linalg.norm(camera(float(time)).forward) == pytest.approx(1.0)


def test_a_path_has_no_corner_at_a_key(tmp_path: Path) -> None:
    camera = read_camera_path(written(tmp_path, THREE))
    assert callable(camera)
    before, at, after = (np.array(camera(2.0 + step).position) for step in (-1e-4, 0.0, 1e-4))
    np.testing.assert_allclose((at - before) / 1e-4, (after - at) / 1e-4, atol=2e-2)
    assert np.linalg.norm(after - before) > 1e-4


def test_keys_on_a_line_at_an_even_pace_are_a_line_at_an_even_pace() -> None:
    times = (0.0, 0.3, 1.0, 1.1)
    camera = along([Keyframe(t, Camera((2 * t, 0.0, -t), (0.0, 0.0, -1.0))) for t in times])
    for time in np.linspace(0.0, 1.1, 23):
        np.testing.assert_allclose(camera(float(time)).position, (2 * time, 0, -time), atol=1e-12)


def test_a_loop_goes_on_without_a_jump(tmp_path: Path) -> None:
    text = "loop = true\n" + THREE + "\n[[key]]\ntime = 5.0\nposition = [0, 1, 2]\ntarget = [0, 1, -5]\n"
    camera = read_camera_path(written(tmp_path, text))
    assert callable(camera)
    for time in (1.0, 1.7, 3.3):
        np.testing.assert_allclose(camera(time + 4.0).position, camera(time).position, atol=1e-9)
    speeds = [np.array(camera(t + 1e-4).position) - camera(t).position for t in (5.0 - 1e-4, 5.0)]
    np.testing.assert_allclose(speeds[0], speeds[1], atol=1e-6)


def test_what_is_written_is_read_back_to_the_bit(tmp_path: Path) -> None:
    random = np.random.default_rng(1)

    def vector(scale: float) -> Vector:
        x, y, z = (random.standard_normal(3) * scale).tolist()
        return x, y, z

    def unit() -> Vector:
        x, y, z = (v := random.standard_normal(3)) / np.linalg.norm(v)
        return float(x), float(y), float(z)

    keys = [Keyframe(i / 30, Camera(vector(1e5), unit(), unit(), math.radians(39.3))) for i in range(20)]
    path = written(tmp_path, as_toml(keys, "flown\nby hand"))
    assert path.read_text().startswith("# flown\n# by hand\n")
    again, loop = read_keyframes(path)
    assert not loop
    assert [key.time for key in again] == [key.time for key in keys]
    assert [key.camera.position for key in again] == [key.camera.position for key in keys]
    for ours, theirs in zip(keys, again, strict=True):
        np.testing.assert_allclose(theirs.camera.forward, ours.camera.forward, rtol=1e-15)
        np.testing.assert_allclose(theirs.camera.up, ours.camera.up, rtol=1e-15)
        assert theirs.camera.yfov == pytest.approx(ours.camera.yfov, rel=1e-15)


KEY = "[[key]]\ntime = 0.0\nposition = [0, 0, 0]\nforward = [0, 0, -1]\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "there is no key"),
        ("[[key]", "is not valid TOML"),
        ("key = 3", "'key' is not a list of tables"),
        ("speed = 3\n" + KEY, "unknown entry 'speed'"),
        ("loop = 1\n" + KEY, "loop must be true or false"),
        ("loop = true\n" + KEY, "last key does not repeat the first"),
        (KEY + KEY, "key 1 has time 0, not after 0"),
        (KEY.replace("position", "postion"), "key 0: unknown entry 'postion', did you mean 'position'"),
        (KEY.replace("[0, 0, -1]", "[0, 0, 0]"), "key 0: the line of sight has no length"),
        (KEY.replace("[0, 0, -1]", "[0, 0]"), "key 0: forward must be three numbers"),
        (KEY.replace("-1", "nan"), "key 0: forward must be a number in"),
        (KEY.replace("-1", "true"), "key 0: forward must be a number in"),
        (KEY + "target = [1, 2, 3]\n", "either target or forward"),
        (KEY + "up = [0, 0, 0]\n", "key 0: the up has no length"),
        (KEY + "yfov = 180\n", "yfov must be a number in [0.01;179]"),
        (KEY.replace("time = 0.0", "time = -1"), "time must be a number in"),
        (KEY.replace("time = 0.0", ""), "time must be a number in"),
    ],
)
def test_broken_paths_are_refused_in_words(tmp_path: Path, text: str, words: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(UserError) as caught:
        read_camera_path(path)
    assert words in str(caught.value)
    assert str(caught.value).startswith(str(path))


def test_a_path_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"walk\.toml: cannot be read"):
        read_camera_path(tmp_path / "walk.toml")
