"""Recorded frames in the place of a scene: played again and again, at the pace at which they were made."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final, Protocol

import numpy as np

from gl.pipelines import remembered
from raytrace.camera import Camera
from raytrace.frame import FramePacket
from raytrace.shot import FPS
from raytrace.worker import Request, Worker
from ui.camera_control import HeldKeys
from ui.keys import Action
from ui.state import State

Size = tuple[int, int]

RUN_UP: Final = 16
"""Frames that are filtered before the one at which the playback stands, when another method is to show it."""

KEPT_BYTES: Final = 1 << 29
"""Main memory for frames that need not be read again."""

_NO_CAMERA: Final = Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0))

_CAMERA: Final = "recorded frames: the camera goes as it went"
_REFUSALS: Final = {
    Action.FLY: _CAMERA,
    Action.RESET_CAMERA: _CAMERA,
    Action.PATH: _CAMERA,
    Action.JITTER: "recorded frames: the jitter is what it was",
    Action.RESOLUTION: "recorded frames: they have one size",
    Action.RECORD: "these frames are recorded already",
}


class Frames(Protocol):
    """A recorded sequence."""

    @property
    def name(self) -> str: ...

    @property
    def size(self) -> Size: ...

    @property
    def cuts(self) -> frozenset[int]:
        """Frames that do not continue the one before."""

    def packet(self, index: int, cut: bool) -> FramePacket: ...


class Reader:
    """Stands in for the tracer: reads ahead on the worker's thread, and waits until the frame is due.

    ``hurry``: it does not wait.
    """

    def __init__(self, frames: Frames) -> None:
        self._frames = frames
        self._kept: dict[tuple[int, bool], FramePacket] = {}
        self._room = KEPT_BYTES
        self._due = 0.0
        self.hurry = False

    def frame(
        self,
        index: int,
        camera: Camera,
        previous_camera: Camera,
        size: Size,
        now: float,
        previous: float,
        cut: bool,
        remember: str,
        lamps: float,
    ) -> FramePacket:
        """The recorded frame at the time ``now``; all that would change how it is traced says nothing here."""
        start = time.perf_counter()
        number = round(now * FPS)
        packet = self._packet(number, cut or number in self._frames.cuts)
        packet.timings["trace"] = time.perf_counter() - start
        if not self.hurry:
            time.sleep(min(max(self._due - time.perf_counter(), 0.0), 1.0 / FPS))
        self._due = time.perf_counter() + 1.0 / FPS
        return packet

    def _packet(self, number: int, cut: bool) -> FramePacket:
        """Read once, as far as there is room to keep it."""
        packet = self._kept.get((number, cut))
        if packet is None:
            packet = self._frames.packet(number, cut)
            size = sum(value.nbytes for value in vars(packet).values() if isinstance(value, np.ndarray))
            if size <= self._room:
                self._room -= size
                self._kept[number, cut] = packet
        return packet


class Playback:
    """A :class:`ui.source.Source`: frames of ``frames`` from ``first`` up to ``end``, and from ``first`` again.

    While it stands still the same frame is filtered again only where something else is to be seen, with the history it
    had the first time: samples that do not change would look like a signal without noise. Another method has no such
    history, so the frames before it are played first.
    """

    triangles = 0
    work = "reading"
    resting = False
    snapshot = None

    def __init__(self, frames: Frames, first: int, end: int, wake: Callable[[], None]) -> None:
        self._frames, self._first, self._end = frames, first, end
        self._reader = Reader(frames)
        self._worker = Worker(self._reader, wake)
        self._shown = first - 1  # the frame asked for last
        self._target = first - 1  # the frame at which to stop
        self._packet: FramePacket | None = None
        self._again = False
        self._settled: tuple[object, ...] = ()

    @property
    def name(self) -> str:
        return self._frames.name

    @property
    def size(self) -> Size:
        return self._frames.size

    @property
    def idle(self) -> bool:
        return not self._worker.busy and not self._again

    def refusal(self, action: Action) -> str:
        return _REFUSALS.get(action, "")

    def look(self, right: float, down: float) -> None:
        """Nothing: the camera goes as it went."""

    def change_speed(self, steps: float) -> str:
        return _CAMERA

    def begin(self, state: State, size: Size, held: HeldKeys, settled: bool) -> None:
        """The next frame, or this one again, or none."""
        held.clear()
        if state.home:
            state.home, state.news = False, _CAMERA
        wanted = (state.denoiser, state.config, state.view, state.split, state.inspect, state.hud)
        if state.animate or state.step or self._packet is None:
            state.step = False
            self._target = self._shown = self._shown + 1 if self._shown + 1 < self._end else self._first
            self._submit(cut=self._shown == self._first)
        elif self._shown < self._target:
            self._shown += 1
            self._submit(cut=False)
        elif settled and self._settled and wanted[0] != self._settled[0]:
            self._shown = max(self._first, self._target - RUN_UP + 1)
            self._submit(cut=True)
        elif not settled or state.reset or state.screenshot or wanted != self._settled:
            self._again = True
        if settled:
            self._tell_of_gradients(state)
            self._settled = wanted

    def _tell_of_gradients(self, state: State) -> None:
        """Say so where a method that wants to know where light changes is shown on frames that do not tell."""
        new = not self._settled or self._settled[0] != state.denoiser
        packet = self._packet
        if new and packet and packet.temporal_gradient is None and remembered(state.config, state.denoiser):
            state.tell("no gradients were recorded: light counts as unchanged")

    def take(self) -> FramePacket | None:
        if self._again:
            self._again = False
        elif (packet := self._worker.take()) is not None:
            self._packet = packet
        else:
            return None
        return self._packet

    def take_path(self) -> list[Camera]:
        """None: it is not the user's."""
        return []

    def close(self) -> None:
        self._worker.close()

    def _submit(self, cut: bool) -> None:
        self._reader.hurry = self._shown < self._target
        self._worker.submit(Request(_NO_CAMERA, self.size, self._shown / FPS, cut=cut))
