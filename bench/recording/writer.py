"""Recorded frames to a folder, one by one, so that whatever was written stays of use when the rest never comes."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench.recording import exr
from bench.recording.header import Header, read_header, write_header
from bench.recording.layout import FPS, HEADER, IMAGES, NOTES
from bench.recording.packets import images_of
from bench.recording.sequence import read_notes
from bench.recording.view import matrix_of
from errors import UserError
from raytrace.camera import Camera
from raytrace.frame import FramePacket
from storage import replace_file

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NORMAL_LIMIT_SQUARED: Final = 0.25
FOOTPRINTS: Final = 4.0
"""The position limit, in widths of a pixel on the surfaces: the median's."""

_HEADER_EVERY: Final = 1.0  # seconds: the header is written anew for each frame, which would be slow for thousands


@dataclass(frozen=True)
class Stage:
    """What all frames of a recording share. ``origin`` (3,): the point of the world that positions are relative to;
    ``extent``: the scene's diameter. ``about``: what is noted of it, ``{"scene": "cornell", ...}``; a recording goes
    on only where the same is noted already."""

    origin: F64
    extent: float
    about: dict[str, Any]


@dataclass
class Recording:
    """A folder that frames are added to, in order. ``footprints``: median width of a pixel on the surfaces of each
    frame, scene units; 0 where a frame shows none. ``cuts``: frames that do not continue the one before."""

    folder: Path
    stage: Stage
    matrices: list[F32] = field(default_factory=list)
    offsets: list[tuple[float, float]] = field(default_factory=list)
    footprints: list[float] = field(default_factory=list)
    cuts: list[int] = field(default_factory=list)
    extra: dict[str, Any] = field(default_factory=dict)
    _written: float = -np.inf

    @property
    def frames(self) -> int:
        return len(self.matrices)

    def add(self, packet: FramePacket, camera: Camera) -> None:
        """Write the next frame, seen by ``camera``, or nothing of it. Raises UserError where it cannot be written."""
        index = self.frames
        eye = np.asarray(camera.position) - self.stage.origin
        images = images_of(packet, eye, self.stage.extent)
        try:
            for name, values in images.items():
                exr.write(IMAGES[name].path(self.folder, index), values)
        except BaseException:
            for name in images:
                IMAGES[name].path(self.folder, index).unlink(missing_ok=True)
            raise
        depth = packet.surface[..., 3]
        seen = depth[depth > 0.0]
        self.footprints.append(float(np.median(seen)) * packet.pixel_size if seen.size else 0.0)
        self.matrices.append(matrix_of(camera, packet.size, self.stage.origin))
        self.offsets.append(_offset(packet.jitter))
        if packet.cut:
            self.cuts.append(index)
        if time.monotonic() - self._written > _HEADER_EVERY:
            self.flush()

    def flush(self) -> None:
        """Write the header and the notes of the frames so far; to be called at the end, however it comes."""
        if not self.frames:
            return
        seen = [footprint for footprint in self.footprints if footprint > 0.0]
        limit = float(np.square(FOOTPRINTS * np.median(seen))) if seen else 1.0
        header = Header(limit, NORMAL_LIMIT_SQUARED, np.array(self.matrices), np.array(self.offsets, np.float32))
        write_header(self.folder / HEADER, header, _comment(self.stage))
        self.save_notes()
        self._written = time.monotonic()

    def save_notes(self) -> None:
        notes = {
            "about": self.stage.about,
            "fps": FPS,
            "origin": list(map(float, self.stage.origin)),
            "footprints": self.footprints,
            "cuts": self.cuts,
            **self.extra,
        }
        text = json.dumps(notes, indent=1)
        replace_file(self.folder / NOTES, lambda target: target.write_text(text, encoding="utf-8"))


def _offset(jitter: tuple[float, float]) -> tuple[float, float]:
    """Where in its pixel a ray passes, from the lower left corner."""
    return 0.5 + jitter[0], 0.5 + jitter[1]


def _comment(stage: Stage) -> list[str]:
    x, y, z = (repr(float(c)) for c in stage.origin)
    return [
        *(f"{name}: {value}" for name, value in stage.about.items()),
        f"positions are relative to the point ({x}, {y}, {z}) of the scene's world",
        "camera_matrices: projection x view for row vectors, clip_j = sum_k p_k M[k][j], p = (x, y, z, 1); "
        "y = -1 is the top row",
    ]


def open_recording(folder: Path, stage: Stage, camera: Callable[[int], Camera], size: tuple[int, int]) -> Recording:
    """The recording in ``folder``, to be gone on with; a new one where nothing is.

    ``camera``: frame number -> the camera that the frame must have. Raises UserError where ``folder`` holds anything
    else, which is left alone.
    """
    if folder.exists() and not folder.is_dir():
        raise UserError(f"{folder}: is a file", "name another folder with --out")
    notes = read_notes(folder) if folder.is_dir() else {}
    if not notes:
        if folder.is_dir() and (
            foreign := sorted(path.name for path in folder.glob("*.exr")) or (folder / HEADER).exists()
        ):
            what = foreign[0] if isinstance(foreign, list) else HEADER
            raise UserError(
                f"{folder}: holds {what}, which this program did not record", "choose another folder with --out"
            )
        return Recording(folder, stage)
    about = notes.get("about")
    for name, value in stage.about.items():
        before = about.get(name) if isinstance(about, dict) else None
        if before != value:
            raise UserError(
                f"{folder}: holds another recording: {name} is {before!r} there, not {value!r}",
                "choose another folder with --out, or remove that one",
            )
    footprints, header = notes.get("footprints", []), read_header(folder / HEADER)
    count = min(len(footprints), header.frames)
    for index in range(count):
        expected = camera(index)
        same = np.array_equal(header.matrices[index], matrix_of(expected, size, stage.origin))
        if not same or not np.array_equal(header.offsets[index], np.array(_offset(expected.jitter), np.float32)):
            raise UserError(
                f"{folder}: holds another recording: the camera of frame {index} is another one",
                "choose another folder with --out, or remove that one",
            )
    known = {"about", "fps", "origin", "footprints", "cuts"}
    return Recording(
        folder,
        stage,
        list(header.matrices[:count]),
        [(float(x), float(y)) for x, y in header.offsets[:count]],
        list(map(float, footprints[:count])),
        [cut for cut in notes.get("cuts", []) if cut < count],
        {key: value for key, value in notes.items() if key not in known},
    )
