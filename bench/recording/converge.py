"""References of recorded frames: converging in rounds over all frames, kept after every step, with their own noise."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench.metrics import Mask, display_mse, pooled, psnr, relmse
from bench.metrics_visual import flip, ssim
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
"""Traced between two saves: a few seconds' worth, which is what an interruption costs at most."""


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
    counts = {index: _there(sequence, index, notes, samples) for index in range(frames)}
    step = max(2, PATHS_AT_ONCE // (shot.size[0] * shot.size[1]))
    missing = sum(max(0, samples - count) for count in counts.values())
    done = 0
    with Progress(f"{shot.scene.scene.name}: {frames} references of {samples} paths per pixel") as progress:
        while waiting := [index for index, count in counts.items() if count < samples]:
            # Those that lag behind are led up to the others first.
            least = min(counts[index] for index in waiting)
            for index in (index for index in waiting if counts[index] < least + step):
                count = min(step, samples - counts[index])

                def advance(paths: float, before: int = done) -> None:
                    progress.update((before + paths) / missing)

                reference = _refined(_load(sequence, index), shot, index, jitter, count, advance)
                with uninterrupted():
                    save(sums_path(recording.folder, index), reference)
                    _publish(sequence, index, reference, notes)
                    recording.save_notes()
                counts[index] = reference.samples
                done += count
    _finish(recording, sequence, notes)


def _there(sequence: Sequence, index: int, notes: dict[str, Any], wanted: int) -> int:
    """Paths per pixel of the reference that there is. One whose sums were removed has none, if more are wanted."""
    noted = notes.get(str(index), {}).get("samples", 0)
    published = index in sequence.references
    if published and (noted >= wanted or (noted and sums_path(sequence.folder, index).exists())):
        return int(noted)
    reference = _load(sequence, index)
    if reference.samples:  # it ended before this was told
        _publish(sequence, index, reference, notes)
    return reference.samples


def _refined(
    reference: Reference, shot: Shot, index: int, jitter: bool, count: int, advance: Callable[[float], None]
) -> Reference:
    """With ``count`` more paths per pixel, some for each half: only then is the noise known."""
    camera, time = camera_of(shot, index, jitter), shot.time(index)
    done = 0
    for part in (count - count // 2, count // 2):
        if part:

            def told(share: float, before: int = done, part: int = part) -> None:
                advance(before + share * part)

            means = shot.tracer.reference(camera, shot.size, part, time, reference.samples, told)
            reference = reference.plus(np.concatenate([means[0] + means[1], *means[2:]], axis=2), part)
            done += part
    return reference


def sums_path(folder: Path, index: int) -> Path:
    return folder / SUMS / f"{index}.npz"


def _load(sequence: Sequence, index: int) -> Reference:
    return load(sums_path(sequence.folder, index), sequence.size, "specular" in sequence.images)


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
    """Note what errors the references have by their own noise, and print how noisy they are."""
    for index in range(sequence.frames):
        note = notes.get(str(index), {})
        if note.get("noise") is not None and "floors" not in note:
            note["floors"] = floors(_load(sequence, index), sequence.packet(index, cut=True))
    last: tuple[int, Reference, FramePacket] | None = None
    for index in range(1, sequence.frames):
        note = notes.get(str(index))
        if note is None or "temporal_noise" in note:
            continue
        before, now = (_with_packet(sequence, number, last) for number in (index - 1, index))
        last = index, *now
        if min(*now[0].counts, *before[0].counts) > 0:
            mask = surfaces(now[1]) & surfaces(before[1])
            note["temporal_noise"] = temporal_noise(now, before, mask) if mask.any() else None
    recording.save_notes()
    noise = [note["noise"] for note in notes.values() if note["noise"] is not None]
    if noise:
        least = min(note["samples"] for note in notes.values())
        print(f"references: {least} paths per pixel or more, RMSE of their own noise {pooled(noise):.3g} (linear)")


def floors(reference: Reference, packet: FramePacket) -> dict[str, float]:
    """What the reference's own noise makes of every error of a picture, as in :meth:`bench.scores.Truth.floors`."""
    first, second = reference.halves(packet)
    mask, share = surfaces(packet), reference.share
    return {
        "rmse": reference.noise(packet, mask),
        "relmse": relmse(first, second, mask) * share**2,
        "psnr": psnr(display_mse(first, second) * share**2),
        "ssim": 1.0 - (1.0 - ssim(first, second)) * share**2,
        "flip": flip(first, second) * share,
    }


def _with_packet(
    sequence: Sequence, index: int, last: tuple[int, Reference, FramePacket] | None
) -> tuple[Reference, FramePacket]:
    """The reference of a frame and the frame, which may be the one read last."""
    if last is not None and last[0] == index:
        return last[1:]
    return _load(sequence, index), sequence.packet(index, cut=True)
