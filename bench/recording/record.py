"""``app.py record``: frames of a shot to a folder, and converged references of them."""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from bench.recording import converge
from bench.recording.converge import camera_of
from bench.recording.layout import IMAGES, TOGETHER
from bench.recording.sequence import read_notes
from bench.recording.writer import Recording, Stage, open_recording
from bench.references import ReferenceCache
from config import Config
from console import Progress
from errors import UserError
from raytrace.shot import Shot
from session import open_shot
from storage import require_writable, uninterrupted

COMPRESSED: Final = 0.3
"""Least share of their bytes that compressed images take."""


@dataclass(frozen=True)
class RecordJob:
    """Arguments of ``app.py record``. ``samples``: paths per pixel of the references, 0 for none."""

    scene: str
    camera: str | None
    animate: bool
    jitter: bool
    frames: int
    samples: int
    out: Path
    gradients: bool = False

    @staticmethod
    def of(args: argparse.Namespace, config: Config) -> RecordJob:
        """From the parsed command line."""
        return RecordJob(
            scene=args.scene,
            camera=args.camera,
            animate=args.animate,
            jitter=args.jitter or config.render.jitter == "on",
            frames=args.frames,
            samples=args.reference_spp,
            out=args.out,
            gradients=args.gradients,
        )


def run(job: RecordJob, config: Config) -> None:
    """Record what is not recorded yet; prints the folder's name. Raises UserError for what cannot be had or written."""
    require_writable(job.out / ".probe")
    _require_space(job, (config.render.width, config.render.height))
    shot = open_shot(job.scene, config, job.camera, job.animate, job.jitter, positions=True)
    shot.remember = config.asvgf.remember if job.gradients else ""
    with shot.tracer:
        recording = _open(job, config, shot)
        with _kept(recording):
            _record(job, recording, shot)
            if job.samples:
                converge.run(recording, shot, job.frames, job.jitter, job.samples)
    print(job.out)


def about(shot: Shot, camera: str | None, seed: int) -> dict[str, Any]:
    """What tells one recording from another."""
    return {
        "scene": shot.scene.scene.name,
        "camera": camera or ("still" if shot.scene.scene.flight is None else "flight"),
        "size": list(shot.size),
        "seed": seed,
        "content": ReferenceCache().path(shot, 0).stem,
    }


def _open(job: RecordJob, config: Config, shot: Shot) -> Recording:
    noted = about(shot, job.camera, config.render.seed) | {"animate": job.animate, "gradients": job.gradients}
    stage = Stage(shot.scene.origin, shot.scene.extent, noted)
    return open_recording(job.out, stage, lambda index: camera_of(shot, index, job.jitter), shot.size)


def _require_space(job: RecordJob, size: tuple[int, int]) -> None:
    """Raises UserError where the frames will not fit: better now than after an hour."""
    frames = max(0, job.frames - len(read_notes(job.out).get("footprints", [])))
    at_most = {name for group in TOGETHER for name in group}  # what only some scenes have
    channels = sum(image.channels for name, image in IMAGES.items() if not image.sparse and name not in at_most)
    needed = frames * size[0] * size[1] * channels * 4 * COMPRESSED
    free = shutil.disk_usage(job.out).free
    if needed > free:
        raise UserError(
            f"{job.out}: {frames} frames of {size[0]}x{size[1]} need {needed / 1e9:.1f} GB or more, "
            f"{free / 1e9:.1f} GB are free",
            "choose another place with --out, fewer --frames or a smaller --size",
        )


@contextmanager
def _kept(recording: Recording) -> Iterator[None]:
    """However it ends: what was recorded is a sequence, and a recording that can be gone on with."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"{recording.folder}: {recording.frames} frames are kept; the same command goes on", file=sys.stderr)
        raise
    finally:
        recording.flush()


def _record(job: RecordJob, recording: Recording, shot: Shot) -> None:
    first, count = recording.frames, job.frames
    if first:
        print(
            f"{recording.folder}: {first} {'frame is' if first == 1 else 'frames are'} there already", file=sys.stderr
        )
    with Progress(f"{shot.scene.scene.name}: recording {count} frames") as progress:
        # A frame with gradients depends on all before it: they are traced again.
        for index in range(first if job.gradients and first < count else 0):
            shot.frame(index)
        for index in range(first, count):
            packet = shot.frame(index)
            with uninterrupted():
                recording.add(packet, camera_of(shot, index, job.jitter))
            progress.update((index + 1 - first) / (count - first))
