"""Frames of the window to disk, on a thread of their own: the picture waits only where the disk does not keep up."""

from __future__ import annotations

import re
import threading
from dataclasses import replace
from pathlib import Path
from queue import Queue
from typing import Final

from bench.recording.writer import Recording, Stage
from errors import UserError
from raytrace.camera import Camera
from raytrace.compiled import CompiledScene
from raytrace.frame import FramePacket
from storage import require_writable

WAITING: Final = 8
"""Frames that may wait to be written."""


class LiveRecorder:
    """Writes what it is given to ``folder``, in order; :meth:`close` ends the thread."""

    def __init__(self, folder: Path, stage: Stage) -> None:
        self.folder, self.frames = folder, 0
        self._recording = Recording(folder, stage)
        self._error: UserError | None = None
        self._queue: Queue[tuple[FramePacket, Camera] | None] = Queue(WAITING)
        self._thread = threading.Thread(target=self._work, name="recorder")
        self._thread.start()

    def add(self, packet: FramePacket, camera: Camera) -> None:
        """One frame more, seen by ``camera``; waits while :data:`WAITING` others are to be written.

        Raises UserError where an earlier one could not be written.
        """
        if self._error is not None:
            raise self._error
        # Whether frames have gradients changes with the method shown, and a sequence has them in all or none.
        self._queue.put((replace(packet, temporal_gradient=None, temporal_gradient_specular=None), camera))
        self.frames += 1

    def close(self) -> None:
        """Wait until all frames are written. Raises UserError where one could not be."""
        self._queue.put(None)
        self._thread.join()
        self.frames = self._recording.frames
        if self._error is not None:
            raise self._error

    def _work(self) -> None:
        for packet, camera in iter(self._queue.get, None):
            if self._error is None:  # the others are taken and dropped: nobody may wait for ever
                try:
                    self._recording.add(packet, camera)
                except UserError as error:
                    self._error = error
        try:
            self._recording.flush()
        except UserError as error:
            self._error = self._error or error


def new_recorder(out: Path, scene: CompiledScene) -> LiveRecorder:
    """A recorder to ``recording_NNN`` in ``out``, NNN not used yet. Raises UserError where nothing can be written."""
    numbers = [
        int(found[1]) for path in out.glob("recording_*") if (found := re.fullmatch(r"recording_(\d+)", path.name))
    ]
    folder = out / f"recording_{max(numbers, default=-1) + 1:03d}"
    require_writable(folder / ".probe")
    about = {"scene": scene.scene.name, "camera": "by hand"}
    return LiveRecorder(folder, Stage(scene.origin, scene.extent, about))
