"""Camera paths on disk: keyframes in TOML, which people write and the window records, and one camera a frame in JSON.

TOML, keys in the order of their times::

    [[key]]
    time = 0.0                      # seconds from the start of the shot
    position = [2.25, 1.5, 2.0]     # in the scene's units and axes
    target = [-0.4, 1.0, -1.1]      # what the camera looks at; or forward = [x, y, z], a direction
    up = [0.0, 1.0, 0.0]            # which direction is up in the picture; left out: +y
    yfov = 45.0                     # vertical field of view in degrees; left out: that of the key before, or 45

Between two keys the camera goes along a smooth curve through all of them (Catmull and Rom 1974, with the tangents of
uneven times); before the first and after the last it rests. ``loop = true`` at the head of the file: from the last key,
which repeats the first, it begins again.
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from errors import UserError, did_you_mean
from raytrace.camera import Camera
from raytrace.frame import Vector

F64 = NDArray[np.float64]

PATH_FORMATS: Final = (".toml", ".json")

_KEYS: Final = ("time", "position", "target", "forward", "up", "yfov")
_FORM: Final = (
    "expected [[key]] tables with time = 0.0, position = [x, y, z], and target or forward = [x, y, z]; optional are "
    "up and yfov"
)
_LARGEST: Final = 1e12
_LONGEST: Final = 1e6


@dataclass(frozen=True)
class Keyframe:
    """``camera`` at ``time`` seconds."""

    time: float
    camera: Camera


def read_camera_path(path: Path) -> list[Camera] | Callable[[float], Camera]:
    """A camera for each frame, or at each time, from a file. Raises UserError for what is no camera path."""
    if path.suffix.lower() == ".json":
        return read_frames(path)
    keys, loop = read_keyframes(path)
    return along(keys, loop)


def along(keys: Sequence[Keyframe], loop: bool = False) -> Callable[[float], Camera]:
    """The camera at a time in seconds on the smooth curve through ``keys``, at least one, times rising."""
    times = np.array([key.time for key in keys])
    cameras = [key.camera for key in keys]
    values = np.array([[*c.position, *c.forward, *c.up, c.yfov] for c in cameras])
    slopes = _slopes(times, values, loop)
    cycle = float(times[-1] - times[0])

    def camera(time: float) -> Camera:
        if loop and cycle > 0.0:
            time = float(times[0]) + math.fmod(max(time - float(times[0]), 0.0), cycle)
        i = int(np.searchsorted(times, time, side="right")) - 1
        if i < 0 or i >= len(keys) - 1:
            return cameras[max(i, 0)]
        length = float(times[i + 1] - times[i])
        t = (time - float(times[i])) / length
        if t == 0.0:
            return cameras[i]
        x = _hermite(t, length, values[i], values[i + 1], slopes[i], slopes[i + 1])
        forward, up = _unit(x[3:6], cameras[i].forward), _unit(x[6:9], cameras[i].up)
        return Camera(_triple(x[:3]), forward, up, float(x[9]))

    return camera


def _slopes(times: F64, values: F64, loop: bool) -> F64:
    """Derivatives at the keys: means of those of the segments before and after, each weighing as the other is long."""
    slopes = np.zeros_like(values)
    if len(times) < 2:
        return slopes
    lengths = np.diff(times)[:, None]
    rates = np.diff(values, axis=0) / lengths
    slopes[1:-1] = (rates[:-1] * lengths[1:] + rates[1:] * lengths[:-1]) / (lengths[:-1] + lengths[1:])
    slopes[0], slopes[-1] = rates[0], rates[-1]
    if loop and len(times) > 2:
        slopes[0] = slopes[-1] = (rates[-1] * lengths[0] + rates[0] * lengths[-1]) / (lengths[0] + lengths[-1])
    return slopes


def _hermite(t: float, length: float, a: F64, b: F64, slope_a: F64, slope_b: F64) -> F64:
    square, cube = t * t, t * t * t
    start, end = (2 * cube - 3 * square + 1) * a, (3 * square - 2 * cube) * b
    result: F64 = start + end + length * ((cube - 2 * square + t) * slope_a + (cube - square) * slope_b)
    return result


def _unit(vector: F64, otherwise: Vector) -> Vector:
    length = float(np.linalg.norm(vector))
    return _triple(vector / length) if length > 1e-6 else otherwise


def _triple(vector: F64) -> Vector:
    x, y, z = vector.tolist()
    return x, y, z


# -- TOML -------------------------------------------------------------------------------------------------------------


def read_keyframes(path: Path) -> tuple[list[Keyframe], bool]:
    """Keys, and whether they are a loop. Raises UserError, with the number of the key that is wrong."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})", "check the path") from error
    except (ValueError, RecursionError) as error:  # not UTF-8, not TOML
        raise UserError(f"{path}: is not valid TOML: {error}", _FORM) from error
    for name in content:
        if name not in ("key", "loop"):
            raise UserError(f"{path}: unknown entry {name!r}{did_you_mean(name, ('key', 'loop'))}", _FORM)
    tables, loop = content.get("key", []), content.get("loop", False)
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise UserError(f"{path}: 'key' is not a list of tables", _FORM)
    if not isinstance(loop, bool):
        raise UserError(f"{path}: loop must be true or false")
    if not tables:
        raise UserError(f"{path}: there is no key in this camera path", _FORM)
    keys: list[Keyframe] = []
    for number, table in enumerate(tables):
        key = _key(table, f"{path}: key {number}", keys[-1].camera.yfov if keys else math.radians(45.0))
        if keys and key.time <= keys[-1].time:
            raise UserError(
                f"{path}: key {number} has time {key.time:g}, not after {keys[-1].time:g} of the one before"
            )
        keys.append(key)
    if loop and (len(keys) < 2 or keys[0].camera != keys[-1].camera):
        raise UserError(f"{path}: is a loop, but its last key does not repeat the first", "add such a key at the end")
    return keys, loop


def _key(table: dict[str, Any], where: str, yfov: float) -> Keyframe:
    for name in table:
        if name not in _KEYS:
            raise UserError(f"{where}: unknown entry {name!r}{did_you_mean(name, _KEYS)}", _FORM)
    time = _number(table.get("time"), f"{where}: time", 0.0, _LONGEST)
    position = _vector(table.get("position"), f"{where}: position")
    if ("target" in table) == ("forward" in table):
        raise UserError(f"{where}: must have either target or forward", _FORM)
    if "target" in table:
        ahead = _vector(table["target"], f"{where}: target") - position
    else:
        ahead = _vector(table["forward"], f"{where}: forward")
    up = _vector(table.get("up", [0.0, 1.0, 0.0]), f"{where}: up")
    for name, direction in (("line of sight", ahead), ("up", up)):
        if np.linalg.norm(direction) < 1e-12:
            raise UserError(f"{where}: the {name} has no length")
    if "yfov" in table:
        yfov = math.radians(_number(table["yfov"], f"{where}: yfov", 0.01, 179.0))
    forward, upward = (_triple(v / np.linalg.norm(v)) for v in (ahead, up))
    return Keyframe(time, Camera(_triple(position), forward, upward, yfov))


def _number(value: object, where: str, lowest: float, highest: float) -> float:
    good = isinstance(value, (int, float)) and not isinstance(value, bool) and lowest <= value <= highest
    if not good:
        raise UserError(f"{where} must be a number in [{lowest:g};{highest:g}]", _FORM)
    return float(value)  # type: ignore[arg-type]  # checked above


def _vector(value: object, where: str) -> F64:
    if not isinstance(value, list) or len(value) != 3:
        raise UserError(f"{where} must be three numbers, [x, y, z]", _FORM)
    return np.array([_number(part, where, -_LARGEST, _LARGEST) for part in value])


def as_toml(keys: Sequence[Keyframe], comment: str = "") -> str:
    """The text of a file that :func:`read_keyframes` reads back to the same numbers."""
    lines = [f"# {line}" for line in comment.splitlines()]
    for key in keys:
        camera = key.camera
        lines += [
            "",
            "[[key]]",
            f"time = {float(key.time)!r}",
            f"position = {[float(c) for c in camera.position]!r}",
            f"forward = {[float(c) for c in camera.forward]!r}",
            f"up = {[float(c) for c in camera.up]!r}",
            f"yfov = {math.degrees(camera.yfov)!r}",
        ]
    return "\n".join(lines) + "\n"


# -- JSON -------------------------------------------------------------------------------------------------------------


def read_frames(path: Path) -> list[Camera]:
    """Cameras of ``{"frames": [{"camera_to_world_gl": 4x4 rows, "yfov_deg": number}, ...]}``.

    The matrix has OpenGL's axes (looking along -z) and acts on column vectors.
    """
    try:
        frames = json.loads(path.read_text(encoding="utf-8"))["frames"]
        cameras = []
        for number, frame in enumerate(frames):
            matrix = np.array(frame["camera_to_world_gl"], dtype=np.float64)
            yfov = float(frame["yfov_deg"])
            usable = matrix.shape == (4, 4) and np.isfinite(matrix).all() and 0.0 < yfov < 180.0
            if not usable or (np.linalg.norm(matrix[:3, :3], axis=0) < 1e-12).any():
                raise UserError(f"{path}: frame {number} is no camera (4x4 finite matrix, 0 < yfov_deg < 180)")
            cameras.append(Camera.from_matrix(matrix, math.radians(yfov)))
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise UserError(
            f"{path}: is not a camera path ({type(error).__name__}: {error})",
            'expected {"frames": [{"camera_to_world_gl": [[...], ...], "yfov_deg": 45}, ...]}',
        ) from error
    if not cameras:
        raise UserError(f"{path}: there is no frame in this camera path")
    return cameras
