"""What every command needs first: the scene by name or file, compiled, with a tracer whose kernels are ready."""

from __future__ import annotations

import sys
import threading
from pathlib import Path

import assets
from config import Config
from console import Progress
from errors import UserError
from raytrace.compiled import CompiledScene, compile_scene
from raytrace.integrator import Settings, Tracer
from raytrace.load import load_scene
from raytrace.sampling import HALTON, HASH
from raytrace.scene import Scene
from raytrace.shot import Shot, read_camera_path


def find_scene(name: str, animate: bool) -> Scene:
    """A built-in scene by name, or any file by path. Raises UserError when there is neither."""
    if name in assets.SCENES:
        return assets.build(name, animate)
    if Path(name).suffix or Path(name).exists():
        return load_scene(name)
    return assets.build(name, animate)  # raises, naming what there is


def open_tracer(scene: Scene, config: Config, positions: bool = False) -> tuple[CompiledScene, Tracer]:
    """Compile ``scene`` and the kernels it needs, with a line of progress if that takes a while."""
    with Progress(f"{scene.name}: preparing {scene.triangle_count:,} triangles"):
        compiled = compile_scene(scene)
    render = config.render
    settings = Settings(
        seed=render.seed,
        generator=HALTON if render.sequence == "halton" else HASH,
        threads=render.threads,
        tile=render.tile,
        positions=positions,
    )
    tracer = Tracer(compiled, settings)
    late = threading.Timer(
        1.0,
        lambda: print("compiling the tracer's kernels, once for each kind of scene ...", file=sys.stderr, flush=True),
    )
    late.daemon = True
    late.start()
    try:
        tracer.warm_up()
    finally:
        late.cancel()
    return compiled, tracer


def open_shot(name: str, config: Config, camera: str, animate: bool, jitter: bool = False) -> Shot:
    """Everything between a scene's name and its frames. Notices of the loader go to stderr.

    ``camera``: "still", "flight", or the path of a camera path in JSON.
    """
    scene = find_scene(name, animate)
    for notice in scene.notices:
        print(f"{scene.name}: {notice}", file=sys.stderr)
    if animate and not scene.has_motion:
        print(f"{scene.name}: nothing in this scene moves", file=sys.stderr)
    path = "still" if camera == "still" else "flight" if camera == "flight" else read_camera_path(Path(camera))
    if camera == "flight" and scene.flight is None:
        raise UserError(
            f"{scene.name}: this scene has no flight", "use --camera still, or a camera path: --camera path.json"
        )
    compiled, tracer = open_tracer(scene, config)
    return Shot(compiled, tracer, (config.render.width, config.render.height), path, animate, jitter)
