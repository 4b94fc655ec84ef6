"""``app.py record``: frames of a shot to a folder, and converged references of them."""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.recording import converge
from bench.recording.layout import IMAGES
from bench.recording.view import matrix_of
from bench.recording.writer import Recording, Stage, open_recording
from bench.references import ReferenceCache
from config import Config
from console import Progress
from errors import UserError
from raytrace.camera import Camera
from raytrace.shot import Shot, jitter_of
from session import open_shot
from storage import require_writable


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
        )


def run(job: RecordJob, config: Config) -> None:
    """Record what is not recorded yet; prints the folder's name. Raises UserError for what cannot be had or written."""
    require_writable(job.out / ".probe")
    shot = open_shot(job.scene, config, job.camera, job.animate, job.jitter, positions=True)
    with shot.tracer:
        cameras = [camera_of(shot, index, job.jitter) for index in range(job.frames)]
        recording = _open(job, config, shot, cameras)
        with _kept(recording):
            _record(recording, shot, cameras)
            if job.samples:
                converge.run(recording, shot, cameras, job.samples)
    print(job.out)


def camera_of(shot: Shot, index: int, jitter: bool) -> Camera:
    """Camera of a frame, with the jitter it is traced with."""
    camera = shot.camera(index)
    return camera.with_jitter(jitter_of(index)) if jitter else camera


def about(shot: Shot, camera: str | None, seed: int) -> dict[str, Any]:
    """What tells one recording from another."""
    return {
        "scene": shot.scene.scene.name,
        "camera": camera or ("still" if shot.scene.scene.flight is None else "flight"),
        "size": list(shot.size),
        "seed": seed,
        "content": ReferenceCache().path(shot, 0).stem,
    }


def _open(job: RecordJob, config: Config, shot: Shot, cameras: list[Camera]) -> Recording:
    origin = shot.scene.origin
    stage = Stage(origin, shot.scene.extent, about(shot, job.camera, config.render.seed) | {"animate": job.animate})
    matrices = [matrix_of(camera, shot.size, origin) for camera in cameras]
    offsets = [(0.5 + camera.jitter[0], 0.5 + camera.jitter[1]) for camera in cameras]
    recording = open_recording(job.out, stage, matrices, offsets)
    _require_space(job, shot, len(cameras) - recording.frames)
    return recording


def _require_space(job: RecordJob, shot: Shot, frames: int) -> None:
    """Raises UserError where the frames will not fit: better now than after an hour."""
    channels = sum(image.channels for image in IMAGES.values() if not image.sparse)
    needed = frames * shot.size[0] * shot.size[1] * channels * 4 * 0.5  # they are compressed: half is little
    free = shutil.disk_usage(job.out).free
    if needed > free:
        raise UserError(
            f"{job.out}: {frames} frames of {shot.size[0]}x{shot.size[1]} need {needed / 1e9:.1f} GB or more, "
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


def _record(recording: Recording, shot: Shot, cameras: list[Camera]) -> None:
    first, count = recording.frames, len(cameras)
    if first:
        print(f"{recording.folder}: {first} frames are there already", file=sys.stderr)
    with Progress(f"{shot.scene.scene.name}: recording {count} frames") as progress:
        for index in range(first, count):
            recording.add(shot.frame(index), cameras[index])
            progress.update((index + 1 - first) / (count - first))
