"""Small recordings to read, break and play."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

import assets
from bench.recording import exr
from bench.recording.converge import camera_of
from bench.recording.header import Header, write_header
from bench.recording.layout import HEADER
from bench.recording.view import matrix_of
from bench.recording.writer import Recording, Stage
from raytrace.camera import Camera
from raytrace.compiled import compile_scene
from raytrace.frame import FramePacket
from raytrace.integrator import Settings, Tracer
from raytrace.shot import Shot

F32 = np.ndarray

SIZE = (24, 16)

EYE = Camera.look_at((0.5, 1.0, 4.0), (0.0, 0.5, 0.0))
"""Of :func:`foreign` frames."""


@contextmanager
def opened(
    size: tuple[int, int] = SIZE, animate: bool = True, jitter: bool = False, positions: bool = True
) -> Iterator[Shot]:
    """The Cornell box in flight, whose camera sees some sky beside it."""
    scene = compile_scene(assets.build("cornell", animate))
    with Tracer(scene, Settings(threads=1, positions=positions)) as tracer:
        yield Shot(scene, tracer, size, "flight", animate, jitter)


def recorded(folder: Path, shot: Shot, count: int, jitter: bool = False) -> list[FramePacket]:
    """Frames 0 to ``count`` - 1 of ``shot``, written to ``folder``."""
    recording = Recording(folder, Stage(shot.scene.origin, shot.scene.extent, {"scene": "cornell"}))
    packets = []
    for index in range(count):
        packets.append(shot.frame(index))
        recording.add(packets[-1], camera_of(shot, index, jitter))
    recording.flush()
    return packets


def foreign(folder: Path, frames: int = 3, size: tuple[int, int] = (20, 12)) -> None:
    """What any other program may have written, nothing but what must be there: the floor under a grey sky."""
    folder.mkdir(parents=True, exist_ok=True)
    width, height = size
    right, up, forward = EYE.basis()
    pixel = EYE.pixel_size(height)
    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
    rays = forward + pixel * (x[..., None] * right + y[..., None] * up)
    hit = rays[..., 1] < -0.05
    distance = np.where(hit, -EYE.position[1] / np.where(hit, rays[..., 1], 1.0), 100.0)
    images = {
        "albedo": np.where(hit[..., None], 0.5, 1.0) * np.ones(3),
        "shading_normal": np.where(hit[..., None], np.array([0.0, 1.0, 0.0]), 0.0),
        "world_position": np.asarray(EYE.position) + distance[..., None] * rays,
    }
    rng = np.random.default_rng(5)
    for index in range(frames):
        noisy = hit[..., None] * rng.exponential(1.0, (height, width, 3))
        for name, values in {"color": noisy, **images}.items():
            exr.write(folder / f"{name}{index}.exr", values.astype(np.float32))
    matrix = matrix_of(EYE, size, np.zeros(3))
    header = Header(0.01, 0.25, np.repeat(matrix[None], frames, 0), np.full((frames, 2), 0.5, np.float32))
    write_header(folder / HEADER, header)
