"""A folder of recorded frames: what is in it, whether all of it is there, and its frames as the filters take them."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench.recording import exr
from bench.recording.header import Header, read_header
from bench.recording.layout import HEADER, IMAGES, NOTES, REQUIRED, TOGETHER, Image, span
from bench.recording.packets import MISS_BELOW, packet_of
from bench.recording.view import View
from errors import UserError, did_you_mean
from raytrace.frame import FramePacket

F32 = NDArray[np.float32]

REFERENCE: Final = "reference"

_NUMBERED = re.compile(r"(?P<name>[A-Za-z_]\w*?)(?P<number>\d+)\.exr")
_PROBES: Final = 4096  # pixels that a camera is tried on
_FARTHEST: Final = 0.05  # of the picture's diagonal: what is farther off its pixel belongs to another camera

_identities = itertools.count(2)


@dataclass(frozen=True)
class Sequence:
    """``size``: width and height in pixels. ``images``: names of those that every frame has. ``references``: frames
    with a reference. ``notes``: what the program that recorded it has to say, {} of another's. ``notices``: what a
    user should know of the folder."""

    folder: Path
    header: Header
    size: tuple[int, int]
    images: tuple[str, ...]
    references: frozenset[int]
    notes: Mapping[str, Any]
    notices: tuple[str, ...]
    scene_id: int

    @property
    def frames(self) -> int:
        return self.header.frames

    @property
    def name(self) -> str:
        return self.folder.resolve().name

    @property
    def separate(self) -> bool:
        """Whether direct and indirect light are told apart."""
        return {"direct", "indirect"} <= set(self.images)

    @property
    def cuts(self) -> frozenset[int]:
        """Frames that are known not to continue the one before."""
        cuts = self.notes.get("cuts", [])
        return frozenset([0, *(cut for cut in cuts if isinstance(cut, int))] if isinstance(cuts, list) else [0])

    def read(self, name: str, index: int) -> F32:
        """One image, (H, W, C) float32, row 0 at the bottom. Raises UserError where it cannot be used."""
        image = IMAGES[name]
        path = image.path(self.folder, index)
        values = exr.read(path, image.channels)
        if (found := (values.shape[1], values.shape[0])) != image.size(self.size):
            raise _other_size(path, found, image.size(self.size))
        if name != "world_position":  # of misses it does not count: see packet
            require_finite(path, values)
        return values

    def packet(self, index: int, cut: bool = False) -> FramePacket:
        """Frame ``index``. ``cut``: it does not continue the one before.

        Raises UserError where one of its files cannot be used.
        """
        unused = {"color"} if self.separate else set()
        images = {name: self.read(name, index) for name in self.images if name not in unused}
        path = IMAGES["world_position"].path(self.folder, index)
        surface = np.asarray(np.square(images["shading_normal"]).sum(axis=2, keepdims=True) > MISS_BELOW)
        require_finite(path, np.where(surface, images["world_position"], np.float32(0.0)))
        view = self.view(index)
        before = view if cut else self.view(max(index - 1, 0))
        packet = packet_of(index, images, view, before, cut, self.name, self.scene_id)
        _require_camera(path, packet, images["world_position"], view)
        return packet

    def view(self, index: int) -> View:
        """Camera of frame ``index``. Raises UserError where its matrix is none."""
        try:
            return View.of(self.header.matrices[index], self.header.offsets[index], self.size)
        except ValueError as error:
            raise UserError(f"{self.folder / HEADER}: camera_matrices[{index}]: {error}") from error

    def reference(self, index: int) -> F32 | None:
        """Converged radiance of frame ``index``, (H, W, 3) float32; None where there is none."""
        return self.read(REFERENCE, index) if index in self.references else None


def open_sequence(folder: Path) -> Sequence:
    """Look through ``folder``: every file is there, whole, and of one size; no pixel is read yet.

    Raises UserError, saying which file, where that is not so.
    """
    if not folder.is_dir():
        what = "is no folder" if folder.exists() else "there is no such folder"
        raise UserError(f"{folder}: {what}", "a recorded sequence is a folder: app.py record --out makes one")
    if not (folder / HEADER).is_file():
        raise UserError(f"{folder}: there is no {HEADER} in it", "docs/recording.md tells what a sequence consists of")
    header = read_header(folder / HEADER)
    found = _numbers(folder)
    for name in REQUIRED:
        if name not in found:
            raise UserError(f"{folder}: there is no {name}0.exr", f"every frame needs {', '.join(REQUIRED)}")
    for name, numbers in found.items():
        if name in IMAGES:
            _require_numbers(folder, IMAGES[name], numbers, header.frames)
    for group in TOGETHER:
        if (there := [name for name in group if name in found]) and len(there) < len(group):
            lacking = next(name for name in group if name not in found)
            raise UserError(
                f"{folder}: there is {there[0]}0.exr, but no {lacking}0.exr", f"{', '.join(group)} go together"
            )
    strangers = sorted(set(found) - set(IMAGES))
    notices = [f"{name}*.exr: not read{did_you_mean(name, IMAGES)}" for name in strangers]
    known = {name: numbers for name, numbers in found.items() if name in IMAGES}
    size = _examine(folder, known)
    every = tuple(name for name in IMAGES if name in known and not IMAGES[name].sparse)
    references = frozenset(known.get(REFERENCE, ()))
    sequence = Sequence(folder, header, size, every, references, read_notes(folder), tuple(notices), -next(_identities))
    for index in range(header.frames):
        sequence.view(index)
    return sequence


def read_notes(folder: Path) -> dict[str, Any]:
    """What :mod:`bench.recording.folder` has noted; {} where there is nothing. Raises UserError for a damaged file."""
    path = folder / NOTES
    if not path.exists():
        return {}
    try:
        notes = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UserError(
            f"{path}: cannot be read ({error})", "without this file the frames can still be replayed"
        ) from error
    if not isinstance(notes, dict):
        raise UserError(f"{path}: is not this program's", "without this file the frames can still be replayed")
    return notes


def require_finite(path: Path, values: F32) -> None:
    """Raises UserError where a pixel of ``values`` (H, W, C), row 0 at the bottom, is NaN or infinite."""
    if not np.isfinite(values).all():
        bad = np.asarray(~np.isfinite(values).all(axis=2))
        rows, columns = np.nonzero(bad[::-1])
        raise UserError(
            f"{path}: NaN or infinite at {len(rows)} {'pixel' if len(rows) == 1 else 'pixels'}, the first in column "
            f"{columns[0]} of row {rows[0]} from the top",
            "histories would keep it: mend the file, or leave the frame out with --frames A:B",
        )


def _numbers(folder: Path) -> dict[str, list[int]]:
    """Names of the images in ``folder``, each with the frames that have it, ascending."""
    found: dict[str, list[int]] = {}
    for path in folder.iterdir():
        match = _NUMBERED.fullmatch(path.name)
        if match is None:
            continue
        if match["number"] != str(int(match["number"])):
            raise UserError(f"{path}: numbers have no leading zeros here: {match['name']}{int(match['number'])}.exr")
        found.setdefault(match["name"], []).append(int(match["number"]))
    return {name: sorted(numbers) for name, numbers in sorted(found.items())}


def _require_numbers(folder: Path, image: Image, numbers: list[int], frames: int) -> None:
    """Raises UserError unless there is one file for each frame; a sparse image may have fewer."""
    if extra := [number for number in numbers if number >= frames]:
        raise UserError(
            f"{folder}: {image.name}{extra[0]}.exr has no camera: {HEADER} has those of frames 0 to {frames - 1}"
            + (f" (more without one: {span(extra[1:])})" if extra[1:] else ""),
            "remove what is too much; a recording that was interrupted is completed by the same app.py record again",
        )
    missing = sorted(set(range(frames)) - set(numbers))
    if missing and not image.sparse:
        raise UserError(
            f"{folder}: {image.name}{missing[0]}.exr is missing: of {frames} frames, {len(missing)} "
            f"{'has' if len(missing) == 1 else 'have'} no {image.name} ({span(missing)})",
            "" if image.required else f"remove all {image.name}*.exr to go without",
        )


def _examine(folder: Path, found: Mapping[str, list[int]]) -> tuple[int, int]:
    """The size of all images."""
    size: tuple[int, int] | None = None
    for name, numbers in sorted(found.items(), key=lambda item: item[0] != "color"):
        for number in numbers:
            path = IMAGES[name].path(folder, number)
            facts = exr.examine(path)
            if size is None:
                size = facts.size  # of color0.exr
            elif facts.size != IMAGES[name].size(size):
                raise _other_size(path, facts.size, IMAGES[name].size(size))
    assert size is not None  # every header has a frame, and every frame a color
    return size


def _other_size(path: Path, size: tuple[int, int], expected: tuple[int, int]) -> UserError:
    return UserError(
        f"{path}: {size[0]}x{size[1]} pixels, but beside color0.exr it must have {expected[0]}x{expected[1]}",
        "all images of a sequence have one size, but gradient and gradient_specular have a pixel for 3x3",
    )


def _require_camera(path: Path, packet: FramePacket, position: F32, view: View) -> None:
    """Raises UserError where the matrix shows the frame's surface points somewhere else: its convention is another."""
    hit = packet.motion[..., 3] >= 0.0
    if not hit.any():
        return
    rows, columns = (numbers[:: len(numbers) // _PROBES + 1] for numbers in np.nonzero(hit))
    with np.errstate(all="ignore"):
        x, y, w = view.project(position[rows, columns][None])
        width, height = view.size
        dx = (x[0] / w[0] + 1.0) * width / 2 - columns - 0.5 - view.jitter[0]
        dy = (y[0] / w[0] + 1.0) * height / 2 - rows - 0.5 - view.jitter[1]
        distance = float(np.median(np.where(w[0] > 0.0, np.hypot(dx, dy), np.inf)))
    if not distance <= max(_FARTHEST * float(np.hypot(width, height)), 2.0):
        where = "behind the camera" if distance == np.inf else f"{distance:.0f} pixels off"
        raise UserError(
            f"{path}: by camera_matrices[{packet.index}] of {HEADER}, half of its points or more lie {where}",
            "matrices are projection x view for row vectors, with y = -1 at the top row: see docs/recording.md",
        )
