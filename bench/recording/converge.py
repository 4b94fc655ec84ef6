"""References of recorded frames: converging in rounds over all frames, kept after every step, with their own noise."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench.metrics import Mask, pooled
from bench.recording import exr
from bench.recording.layout import IMAGES
from bench.recording.sequence import REFERENCE, Sequence, open_sequence
from bench.recording.writer import Recording
from bench.references import Reference, load, save, temporal_noise
from console import Progress
from raytrace.camera import Camera
from raytrace.frame import FramePacket
from raytrace.shot import Shot, jitter_of
from storage import uninterrupted

SUMS: Final = ".references"
"""Folder of the sums that references are made of: with them they are refined, not traced again."""

PATHS_AT_ONCE: Final = 8_000_000
"""Traced between two saves: a few seconds' worth, which is what an interruption costs."""


def surfaces(packet: FramePacket) -> Mask:
    """The pixels that errors are taken of, (H, W): light sources bypass the filters."""
    return np.asarray(packet.emission[..., :3].max(axis=2) == 0.0)


def camera_of(shot: Shot, index: int, jitter: bool) -> Camera:
    """Camera of a frame; ``jitter``: with that which the frame is traced with."""
    camera = shot.camera(index)
    return camera.with_jitter(jitter_of(index)) if jitter else camera


def run(recording: Recording, shot: Shot, frames: int, jitter: bool, samples: int) -> None:
    """Bring the references of the first ``frames`` to ``samples`` paths per pixel, and tell how noisy they still are.

    Round by round: after an interruption all frames have references of about the same quality. Raises UserError where
    they cannot be written.
    """
    recording.flush()
    sequence = open_sequence(recording.folder)
    notes = recording.extra.setdefault("references", {})
    counts = {index: _load(sequence, index).samples for index in range(frames)}
    width, height = shot.size
    # A reference needs two slices at least to know its noise.
    step = max(1, min(PATHS_AT_ONCE // (width * height), -(-samples // 2)))
    missing = sum(max(0, samples - count) for count in counts.values())
    done = 0
    with Progress(f"{shot.scene.scene.name}: {frames} references of {samples} paths per pixel") as progress:
        while waiting := [index for index, count in counts.items() if count < samples]:
            # Those that lag behind are led up to the others first.
            least = min(counts[index] for index in waiting)
            for index in (index for index in waiting if counts[index] < least + step):
                count = min(step, samples - counts[index])

                def advance(share: float, before: int = done, count: int = count) -> None:
                    progress.update((before + share * count) / missing)

                reference = _load(sequence, index)
                means = shot.tracer.reference(
                    camera_of(shot, index, jitter), shot.size, count, shot.time(index), reference.samples, advance
                )
                reference = reference.plus(means[0] + means[1], count)
                with uninterrupted():
                    save(sums_path(recording.folder, index), reference)
                    _publish(sequence, index, reference, notes)
                    recording.save_notes()
                counts[index] = reference.samples
                done += count
    _finish(recording, sequence, notes)


def sums_path(folder: Path, index: int) -> Path:
    return folder / SUMS / f"{index}.npz"


def _load(sequence: Sequence, index: int) -> Reference:
    return load(sums_path(sequence.folder, index), sequence.size)


def _publish(sequence: Sequence, index: int, reference: Reference, notes: dict[str, Any]) -> None:
    """Write ``reference{i}.exr`` and note what it is worth."""
    packet = sequence.packet(index, cut=True)
    radiance: NDArray[np.float32] = reference.radiance(packet).astype(np.float32)
    exr.write(IMAGES[REFERENCE].path(sequence.folder, index), radiance)
    mask = surfaces(packet)
    known = min(reference.counts) > 0 and bool(mask.any())
    notes[str(index)] = {
        "samples": reference.samples,
        "noise": reference.noise(packet, mask) if known else None,
    }


def _finish(recording: Recording, sequence: Sequence, notes: dict[str, Any]) -> None:
    """Note the flicker that the references have by their own noise, and print how noisy they are."""
    last: tuple[Reference, FramePacket] | None = None
    for index in range(sequence.frames):
        now = _load(sequence, index), sequence.packet(index, cut=True)
        note = notes.get(str(index), {})
        if last is not None and "temporal_noise" not in note and min(*now[0].counts, *last[0].counts) > 0:
            mask = surfaces(now[1]) & surfaces(last[1])
            note["temporal_noise"] = temporal_noise(now, last, mask) if mask.any() else None
        last = now
    recording.save_notes()
    noise = [note["noise"] for note in notes.values() if note["noise"] is not None]
    if noise:
        least = min(note["samples"] for note in notes.values())
        print(f"references: {least} paths per pixel or more, RMSE of their own noise {pooled(noise):.3g} (linear)")
