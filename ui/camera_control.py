"""Where the camera goes: along the shot's path until someone takes over, then flying. No window: only numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from raytrace.camera import Camera

F64 = NDArray[np.float64]

DIRECTIONS: Final[Mapping[str, tuple[int, int, int]]] = {
    "right": (1, 0, 0),
    "left": (-1, 0, 0),
    "up": (0, 1, 0),
    "down": (0, -1, 0),
    "forward": (0, 0, 1),
    "back": (0, 0, -1),
}
"""Name -> steps to the camera's right, upwards in the world, and along the line of sight."""

FAST: Final = "fast"
"""Held beside a direction it multiplies the speed by :data:`FAST_FACTOR`."""
FAST_FACTOR: Final = 4.0

TAP: Final = 1 / 30
"""Seconds that a key counts at least, so that a tap between two slow frames is not lost."""
LONGEST: Final = 0.5
"""Seconds that a key counts at most per frame, so that a stall does not become a leap."""

_CROSSING: Final = 8.0  # seconds that it takes to fly from one end of the scene to the other, until the wheel is turned
_WHEEL: Final = 1.25  # change of the speed per step of the wheel
_SLOWEST, _FASTEST = 2.0**-10, 2.0**10  # factors on the scene's own speed
_TURN: Final = math.radians(0.15)  # per unit of mouse movement
_STEEPEST: Final = math.sin(math.radians(89.0))  # elevation up to which one can look up or down


class HeldKeys:
    """How long keys were held, to the millisecond and whatever the frame rate."""

    def __init__(self) -> None:
        self._since: dict[str, float] = {}
        self._seconds: dict[str, float] = {}

    def press(self, key: str, now: float) -> None:
        """``now``: seconds of any clock, the same for all calls."""
        if key not in self._since:
            # The tap is counted in advance; what is held longer adds to it.
            self._seconds[key] = self._seconds.get(key, 0.0) + TAP
            self._since[key] = now + TAP

    def release(self, key: str, now: float) -> None:
        since = self._since.pop(key, now)
        self._seconds[key] = self._seconds.get(key, 0.0) + max(now - since, 0.0)

    def clear(self) -> None:
        """Forget every key, as when the window no longer hears of them being released."""
        self._since.clear()
        self._seconds.clear()

    def drain(self, now: float) -> dict[str, float]:
        """Seconds in (0, LONGEST] that each key was held since the last call."""
        for key, since in self._since.items():
            self._seconds[key] = self._seconds.get(key, 0.0) + max(now - since, 0.0)
            self._since[key] = max(now, since)
        held = {key: min(seconds, LONGEST) for key, seconds in self._seconds.items() if seconds > 0.0}
        self._seconds.clear()
        return held


class FlyCamera:
    """A camera that turns and moves. ``extent``: the scene's diameter in world units, which sets the speed.

    The world's up is the axis nearest to the first camera's up: turning sideways is about that axis, so that no roll
    creeps in, and looking up and down ends just before it. A roll that the first camera has stays.
    """

    def __init__(self, camera: Camera, extent: float) -> None:
        self.camera = camera
        self._base_speed = extent / _CROSSING
        self._factor = 1.0
        axis = int(np.argmax(np.abs(camera.up)))
        self._up = np.zeros(3)
        self._up[axis] = math.copysign(1.0, camera.up[axis])

    @property
    def speed(self) -> float:
        """World units per second."""
        return self._base_speed * self._factor

    def change_speed(self, steps: float) -> None:
        """By ``steps`` of the mouse wheel, positive ones faster."""
        self._factor = min(max(self._factor * _WHEEL**steps, _SLOWEST), _FASTEST)

    def look(self, right: float, down: float) -> None:
        """Turn by a movement of the mouse, in screen coordinates."""
        side, up, forward = self.camera.basis()
        turn = _rotation(self._up, -right * _TURN)
        side, up, forward = turn @ side, turn @ up, turn @ forward
        tilt = _rotation(side, -down * _TURN)
        steeper = abs(float((tilt @ forward) @ self._up)) > abs(float(forward @ self._up))
        if abs(float((tilt @ forward) @ self._up)) <= _STEEPEST or not steeper:
            up, forward = tilt @ up, tilt @ forward
        self.camera = replace(self.camera, forward=_triple(forward), up=_triple(up))

    def fly(self, held: Mapping[str, float]) -> None:
        """Move for as many seconds as each of :data:`DIRECTIONS` was held; other names do not count."""
        seconds = {name: held[name] for name in DIRECTIONS if name in held}
        if not seconds:
            return
        side, _, forward = self.camera.basis()
        steps = np.sum([time * np.array(DIRECTIONS[name]) for name, time in seconds.items()], axis=0)
        way = steps[0] * side + steps[1] * self._up + steps[2] * forward
        length = float(np.linalg.norm(way))
        if length > 0.0:  # two keys at once are not faster than one
            way *= min(1.0, max(seconds.values()) / length)
        speed = self.speed * (FAST_FACTOR if FAST in held else 1.0)
        self.camera = replace(self.camera, position=_triple(np.array(self.camera.position) + way * speed))


class CameraControl:
    """The camera of each frame: ``path`` (frame number -> camera) or, once someone steers, a :class:`FlyCamera`.

    ``follow``: begin by following the path; otherwise its first camera is where flying begins.
    """

    def __init__(self, path: Callable[[int], Camera], follow: bool, extent: float) -> None:
        self._path, self._begin_following = path, follow
        self.following = follow
        self._frame = 0
        self._fly = FlyCamera(path(0), extent)

    def home(self) -> None:
        """Begin again; the speed chosen stays."""
        self.following, self._frame = self._begin_following, 0
        self._fly.camera = self._path(0)

    @property
    def speed(self) -> float:
        """World units per second."""
        return self._fly.speed

    def change_speed(self, steps: float) -> None:
        """By ``steps`` of the mouse wheel, positive ones faster."""
        self._fly.change_speed(steps)

    def next(self, held: Mapping[str, float], look: tuple[float, float] = (0.0, 0.0)) -> Camera:
        """Camera of the next frame, without jitter.

        ``held``: seconds that each of :data:`DIRECTIONS` was held since the last frame. ``look``: movement of the mouse
        since then, to the right and down, in screen coordinates.
        """
        if any(name in DIRECTIONS for name in held) or look != (0.0, 0.0):
            self.following = False  # the fly camera stands where the path has led it
        if self.following:
            self._fly.camera = self._path(self._frame)
            self._frame += 1
        else:
            self._fly.look(*look)
            self._fly.fly(held)
        return self._fly.camera


def _rotation(axis: F64, angle: float) -> F64:
    """(3, 3) rotation by ``angle`` radians about a unit ``axis``, counterclockwise seen against it (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: F64 = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
    return rotation


def _triple(v: F64) -> tuple[float, float, float]:
    return (float(v[0]), float(v[1]), float(v[2]))
