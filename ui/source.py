"""What the window needs of whatever its frames come from: a scene that is traced, or frames that were recorded."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from raytrace.camera import Camera
from raytrace.compiled import CompiledScene
from raytrace.frame import FramePacket
from raytrace.still import Snapshot
from ui.camera_control import HeldKeys
from ui.keys import Action
from ui.state import State

Size = tuple[int, int]


class Source(Protocol):
    """Frames, one under way at a time: :meth:`begin`, and :meth:`take` when it is ready."""

    @property
    def name(self) -> str:
        """For people."""

    @property
    def triangles(self) -> int:
        """Of the scene; 0 where nobody knows."""

    @property
    def work(self) -> str:
        """What is done to have a frame: "tracing"."""

    @property
    def size(self) -> Size | None:
        """The only size, in pixels, that frames come in; None: any that is asked for."""

    @property
    def idle(self) -> bool:
        """No frame is under way."""

    def refusal(self, action: Action) -> str:
        """Why a key that does ``action`` would do nothing here, "" if it does something."""

    def look(self, right: float, down: float) -> None:
        """Turn the camera of the next frame by a movement of the mouse, in screen coordinates."""

    def change_speed(self, steps: float) -> str:
        """Fly faster by ``steps`` of the wheel; returns what to tell."""

    def begin(self, state: State, size: Size, held: HeldKeys, settled: bool) -> None:
        """Let the next frame come, if there is to be one. ``settled``: the last one was shown as ``state`` wants it."""

    def take(self) -> FramePacket | None:
        """The frame under way, or None if it is not ready."""

    def take_path(self) -> list[Camera]:
        """The cameras noted since the last call, one for each frame that was begun while the state asked for it."""

    @property
    def resting(self) -> bool:
        """Nothing moves, and there is a scene: a reference of the view can be traced."""

    @property
    def snapshot(self) -> Snapshot | None:
        """The reference of the view at rest, as far as it has got; None while something moves, or nobody wants it."""

    def close(self) -> None:
        """Wait for the frame under way, which is lost, and free everything."""


class Recorder(Protocol):
    """Keeps the frames that the window shows."""

    @property
    def frames(self) -> int:
        """How many it was given."""

    @property
    def folder(self) -> Path: ...

    def add(self, packet: FramePacket, camera: Camera) -> None:
        """One frame more, with positions; waits where the disk does not keep up.

        Raises:
            UserError: an earlier one could not be written.
        """

    def close(self) -> None:
        """Wait until all are written.

        Raises:
            UserError: one could not be.
        """


class NewRecorder(Protocol):
    """Makes a :class:`Recorder` that writes to a new folder in ``out``."""

    def __call__(self, out: Path, scene: CompiledScene) -> Recorder: ...
