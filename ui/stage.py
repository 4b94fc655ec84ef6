"""One scene under way: its tracer in a thread, its camera, its clock."""

from __future__ import annotations

import time
from collections.abc import Callable

from raytrace.camera import Camera
from raytrace.frame import FramePacket
from raytrace.shot import FPS, Shot
from raytrace.worker import Request, Worker
from ui.camera_control import CameraControl, HeldKeys
from ui.state import State

Size = tuple[int, int]


class Stage:
    """What the window shows frames of. ``close`` ends the thread and frees the tracer.

    ``follow``: the camera begins on the shot's own path. ``wake``: called, from another thread, when a frame is ready.
    """

    def __init__(self, shot: Shot, follow: bool, wake: Callable[[], None]) -> None:
        self.shot = shot
        self.name = shot.scene.scene.name
        self.control = CameraControl(shot.camera, follow, shot.scene.extent)
        self._worker = Worker(shot.tracer, wake)
        self._frame = -1  # of the scene's time, traced last
        self._look = (0.0, 0.0)
        self._path: list[Camera] = []

    @property
    def idle(self) -> bool:
        """No frame is under way."""
        return not self._worker.busy

    def look(self, right: float, down: float) -> None:
        """Turn the camera of the next frame by a movement of the mouse, in screen coordinates."""
        self._look = (self._look[0] + right, self._look[1] + down)

    def begin(self, state: State, size: Size, held: HeldKeys) -> None:
        """Let the next frame be traced: one step of the scene's time, if it goes on, and of the camera."""
        cut, state.home = state.home, False
        if cut:
            self.control.home()
        look, self._look = self._look, (0.0, 0.0)
        camera = self.control.next(held.drain(time.perf_counter()), look)
        if state.path:
            self._path.append(camera)
        if state.animate or state.step or self._frame < 0:
            self._frame, state.step = self._frame + 1, False
        self._worker.submit(Request(camera, size, self._frame / FPS, state.jitter, cut))

    def take_path(self) -> list[Camera]:
        """The cameras noted since the last call, one for each frame that was begun."""
        path, self._path = self._path, []
        return path

    def take(self) -> FramePacket | None:
        """The frame under way, or None if it is not ready."""
        return self._worker.take()

    def close(self) -> None:
        """Wait for the frame under way, which is lost, and free everything."""
        self._worker.close()
        self.shot.tracer.close()
