"""How the tracer's time grows: with pixels, triangles and threads. What features cost: :mod:`bench.features`.

    .venv/bin/python -m bench.scaling

All that one table compares is traced in turn, frame by frame, and medians are taken: a drift of the machine hits all
alike. Ratios are those of processor time, of all threads together, which other programs disturb less than wall time.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

import assets
from errors import UserError
from raytrace.camera import Camera
from raytrace.compiled import compile_scene
from raytrace.integrator import Settings, Tracer
from raytrace.scene import Material, Mesh, Scene

SIZES = ((320, 180), (640, 360), (960, 540), (1280, 720), (1920, 1080))
TRIANGLES = (1_000, 10_000, 100_000, 1_000_000)
THREADS = (1, 2)
MIDDLE = (640, 360)

Size = tuple[int, int]


@dataclass(frozen=True)
class Row:
    """Milliseconds of a frame, medians: ``wall`` and processor time, the latter ``relative`` to another row's."""

    label: str
    wall: float
    processor: float
    relative: float


Times = tuple[float, float]
"""Wall and processor time, ms."""


def terrain(triangles: int) -> Scene:
    """Waves under a square lamp, seen from the side: about so many triangles, all in sight."""
    side = max(2, round((triangles / 2) ** 0.5))
    x, z = np.meshgrid(np.linspace(-2.0, 2.0, side + 1), np.linspace(-2.0, 2.0, side + 1))
    y = 0.2 * np.sin(4.0 * x) * np.cos(3.0 * z)
    slope = np.stack(
        [-0.8 * np.cos(4.0 * x) * np.cos(3.0 * z), np.ones_like(x), 0.6 * np.sin(4.0 * x) * np.sin(3.0 * z)]
    )
    normals = (slope / np.linalg.norm(slope, axis=0)).reshape(3, -1).T.astype(np.float32)
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel().astype(np.int32)
    below = corner + np.int32(side + 1)
    halves = [(corner, below, below + 1), (corner, below + 1, corner + 1)]
    faces = np.concatenate([np.stack(half, axis=1) for half in halves])
    ground = Mesh("ground", np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, np.zeros(len(faces), np.int32), normals)
    lamp = Mesh(
        "lamp",
        np.array([(-1, 2, -1), (1, 2, -1), (1, 2, 1), (-1, 2, 1)], dtype=np.float64),
        np.array([(0, 1, 2), (0, 2, 3)], np.int32),
        np.ones(2, np.int32),
        np.tile(np.array([0.0, -1.0, 0.0], np.float32), (4, 1)),
    )
    materials = (Material("ground", (0.6, 0.6, 0.5)), Material("lamp", emission=(6.0, 6.0, 6.0)))
    camera = Camera.look_at((0.5, 1.4, 3.2), (0.0, 0.0, 0.0), yfov_degrees=45.0)
    return Scene("terrain", (ground, lamp), materials, camera)


def medians(shots: Mapping[str, Callable[[int], object]], repeats: int) -> dict[str, Times]:
    """Times of each, called with 0, 1, ... in turn; the first two calls do not count."""
    times: dict[str, list[Times]] = {name: [] for name in shots}
    for index in range(repeats + 2):
        for name, shot in shots.items():
            wall, processor = time.perf_counter(), time.process_time()
            shot(index)
            if index >= 2:
                times[name].append(((time.perf_counter() - wall) * 1e3, (time.process_time() - processor) * 1e3))
    middle = {name: np.median(np.array(taken), axis=0).tolist() for name, taken in times.items()}
    return {name: (wall, processor) for name, (wall, processor) in middle.items()}


def _frames(tracer: Tracer, size: Size) -> Callable[[int], object]:
    camera = tracer.scene.scene.camera
    return lambda index: tracer.frame(index, camera, camera, size)


def by_size(scene: Scene, sizes: Sequence[Size] = SIZES, repeats: int = 7) -> list[Row]:
    """``relative``: to the second size's time for each pixel."""
    with Tracer(compile_scene(scene)) as tracer:
        taken = medians({f"{w}x{h}": _frames(tracer, (w, h)) for w, h in sizes}, repeats)
    per_pixel = [own / (w * h) for (_, own), (w, h) in zip(taken.values(), sizes, strict=True)]
    base = per_pixel[min(1, len(sizes) - 1)]
    return [Row(name, *times, own / base) for (name, times), own in zip(taken.items(), per_pixel, strict=True)]


def by_triangles(counts: Sequence[int] = TRIANGLES, size: Size = MIDDLE, repeats: int = 7) -> list[Row]:
    """``relative``: to the first."""
    tracers = {f"{scene.triangle_count:,}": Tracer(compile_scene(scene)) for scene in map(terrain, counts)}
    try:
        taken = medians({name: _frames(tracer, size) for name, tracer in tracers.items()}, repeats)
    finally:
        for tracer in tracers.values():
            tracer.close()
    return _relative(taken)


def by_threads(scene: Scene, threads: Sequence[int] = THREADS, size: Size = MIDDLE, repeats: int = 7) -> list[Row]:
    """``relative``: to the first, 1 where threads do not stand in each other's way."""
    tracers = {count: Tracer(compile_scene(scene), Settings(threads=count)) for count in threads}
    try:
        taken = medians({f"{count} threads": _frames(tracer, size) for count, tracer in tracers.items()}, repeats)
    finally:
        for tracer in tracers.values():
            tracer.close()
    return _relative(taken)


def _relative(taken: Mapping[str, Times]) -> list[Row]:
    """Rows relative to the first."""
    first = next(iter(taken.values()))[1]
    return [Row(name, wall, processor, processor / first) for name, (wall, processor) in taken.items()]


def table(title: str, rows: Sequence[Row], relative: str) -> str:
    width = max(len(row.label) for row in rows)
    lines = [title, f"  {'':{width}}  {'wall ms':>9}  {'processor':>9}  {relative}"]
    for row in rows:
        lines.append(f"  {row.label:{width}}  {row.wall:9.2f}  {row.processor:9.2f}  {row.relative:.3f}")
    return "\n".join(lines)


def build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "bench.scaling", description="how tracing grows with pixels, triangles and threads"
    )
    parser.add_argument("--repeats", type=int, default=7, help="frames of each that count (default 7)")
    return parser


def main() -> int:
    """All tables, on stdout."""
    repeats = max(1, build_parser().parse_args().repeats)
    try:
        interior = assets.build("interior")
        print(table("interior by size", by_size(interior, repeats=repeats), "per pixel, relative"), flush=True)
        print(table("\nterrain by triangles, 640x360", by_triangles(repeats=repeats), "relative"), flush=True)
        print(table("\ninterior by threads, 640x360", by_threads(interior, repeats=repeats), "relative"), flush=True)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
