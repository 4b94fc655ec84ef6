"""One scene under way: its tracer in a thread, its camera, its clock."""

from __future__ import annotations

import time
from collections.abc import Callable

from gl.pipelines import remembered
from raytrace.camera import Camera
from raytrace.frame import FramePacket
from raytrace.shot import FPS, Shot
from raytrace.still import Snapshot, StillView
from raytrace.worker import Request, Worker
from ui.camera_control import CameraControl, HeldKeys
from ui.keys import Action
from ui.state import State

Size = tuple[int, int]


class Stage:
    """A :class:`ui.source.Source` that traces its frames. ``close`` ends the thread and frees the tracer.

    ``follow``: the camera begins on the shot's own path. ``wake``: called, from another thread, when a frame is ready.

    ``camera``: that of the frame begun last, without jitter.
    """

    size = None
    work = "tracing"

    def __init__(self, shot: Shot, follow: bool, wake: Callable[[], None]) -> None:
        self.shot = shot
        self.name = shot.scene.scene.name
        self.control = CameraControl(shot.camera, follow, shot.scene.extent)
        self._worker = Worker(shot.tracer, wake, shot.tracer)
        self.camera = shot.camera(0)
        self._frame = -1  # of the scene's time, traced last
        self._look = (0.0, 0.0)
        self._path: list[Camera] = []
        self._changes = shot.scene.moves or shot.scene.scene.dims
        self._last: StillView | None = None
        self.resting = False

    @property
    def snapshot(self) -> Snapshot | None:
        """The reference of the view at rest, as far as it has got; None while something moves, or nobody wants it."""
        found = self._worker.snapshot
        return found if self.resting and found is not None and found.view == self._last else None

    @property
    def triangles(self) -> int:
        return self.shot.scene.scene.triangle_count

    @property
    def idle(self) -> bool:
        """No frame is under way."""
        return not self._worker.busy

    def refusal(self, action: Action) -> str:
        return ""

    def change_speed(self, steps: float) -> str:
        self.control.change_speed(steps)
        return f"flight speed {self.control.speed:.3g} units a second"

    def look(self, right: float, down: float) -> None:
        """Turn the camera of the next frame by a movement of the mouse, in screen coordinates."""
        self._look = (self._look[0] + right, self._look[1] + down)

    def begin(self, state: State, size: Size, held: HeldKeys, settled: bool = True) -> None:
        """Let the next frame be traced: one step of the scene's time, if it goes on, and of the camera."""
        cut, state.home = state.home, False
        if cut:
            self.control.home()
        look, self._look = self._look, (0.0, 0.0)
        self.camera = self.control.next(held.drain(time.perf_counter()), look)
        if state.path:
            self._path.append(self.camera)
        if state.animate or state.step or self._frame < 0:
            self._frame, state.step = self._frame + 1, False
        now, lamps = self._frame / FPS, float(state.lamps)
        view = StillView(self.camera, size, now if self._changes else 0.0, state.jitter, lamps)
        self.resting, self._last = view == self._last, view
        self._worker.accumulate(view if self.resting and state.judged else None)
        self.shot.tracer.carry_positions(state.recording)
        remember = remembered(state.config, state.denoiser)
        self._worker.submit(Request(self.camera, size, now, state.jitter, cut, remember, lamps))

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
