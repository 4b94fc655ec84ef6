"""What the record key does: frames that the window shows go to a folder, until it is pressed again."""

from __future__ import annotations

import sys
from pathlib import Path

from errors import UserError
from raytrace.frame import FramePacket
from ui.source import NewRecorder, Recorder, Source
from ui.stage import Stage
from ui.state import State


class Keeper:
    """Follows ``state.recording``. ``new``: makes a recorder of a scene in the folder ``out``; None: nothing does."""

    def __init__(self, new: NewRecorder | None, out: Path, state: State) -> None:
        self._new, self._out, self._state = new, out, state
        self._recorder: Recorder | None = None

    def follow(self, source: Source) -> None:
        """Begin or end a recording, if the state says so. Only a scene can be recorded."""
        if self._state.recording == (self._recorder is not None):
            return
        if not self._state.recording:
            self.stop()
        elif self._new is None or not isinstance(source, Stage):
            self._state.recording = False
        else:
            try:
                self._recorder = self._new(self._out, source.shot.scene)
                self._state.tell(f"recording to {self._recorder.folder}")
            except UserError as error:
                self._state.recording = False
                self._tell(error)

    def keep(self, packet: FramePacket, source: Source) -> None:
        """One frame more, if frames are kept; one that was begun before the key was pressed has no positions."""
        if self._recorder is None or packet.position is None or not isinstance(source, Stage):
            return
        try:
            self._recorder.add(packet, source.camera)
        except UserError as error:
            self._tell(error)
            self.stop()

    def stop(self) -> None:
        """End the recording, if there is one: all its frames are written then."""
        recorder, self._recorder, self._state.recording = self._recorder, None, False
        if recorder is None:
            return
        try:
            recorder.close()
        except UserError as error:
            self._tell(error)
        if recorder.frames:
            self._state.tell(f"recorded {recorder.frames} frames to {recorder.folder}")
            print(recorder.folder, flush=True)

    def _tell(self, error: UserError) -> None:
        print(f"error: {error}", file=sys.stderr, flush=True)
        self._state.tell(str(error).partition("\n")[0])
