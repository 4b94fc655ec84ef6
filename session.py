"""What every command needs first: the scene by name or file, compiled, with a tracer whose kernels are ready."""

from __future__ import annotations

import re
import sys
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import assets
from config import Config, Surroundings
from console import Progress
from errors import Notices, UserError, did_you_mean
from raytrace.camera_path import PATH_FORMATS, read_camera_path
from raytrace.compile_events import watch_kernels
from raytrace.compiled import CompiledScene, compile_scene
from raytrace.integrator import Settings, Tracer
from raytrace.sampling import HALTON, HASH
from raytrace.scene import Scene
from raytrace.shot import CameraPath, Shot

NOTHING_AROUND = Surroundings()

BYTES_PER_PIXEL = 600
"""Main memory that a frame takes, textures included (a software renderer's are there too): measured with SVGF."""


class Log(Protocol):
    """Who is told how far the opening of a scene is. Each may raise, which ends it."""

    def stage(self, text: str) -> AbstractContextManager[object]:
        """What is done while the ``with`` lasts: ``"interior: preparing 161,336 triangles"``."""

    def compiling(self, kernel: str) -> None:
        """A kernel of the tracer begins to be compiled, which takes seconds. On whatever thread needs it."""

    def notice(self, text: str) -> None:
        """What was repaired or approximated."""


class Terminal:
    """On stderr."""

    def __init__(self) -> None:
        self._told = False

    def stage(self, text: str) -> Progress:
        return Progress(text)

    def compiling(self, kernel: str) -> None:
        if not self._told:
            self.notice("compiling the tracer's kernels, once for each kind of scene ...")
        self._told = True

    def notice(self, text: str) -> None:
        print(text, file=sys.stderr, flush=True)


def find_scene(name: str, animate: bool, surroundings: Surroundings = NOTHING_AROUND) -> Scene:
    """A built-in scene by name, or any file by path, in ``surroundings`` if there are any.

    Raises UserError when there is neither, and for surroundings that cannot be read.
    """
    scene = _scene(name, animate, surrounded=surroundings.file is not None)
    if surroundings.file is None:
        return scene
    from raytrace.hdr import load_environment

    notices = Notices()
    environment = load_environment(surroundings.file, notices, surroundings.strength, surroundings.rotation)
    return replace(scene, environment=environment, sky=None, notices=(*scene.notices, *notices.lines))


def _scene(name: str, animate: bool, surrounded: bool) -> Scene:
    if name in assets.SCENES:
        return assets.build(name, animate)
    if Path(name).suffix or Path(name).exists():
        from raytrace.load import load_scene  # slow to import, and not needed above

        return load_scene(name, surrounded, animate)
    raise UserError(
        f"--scene {name}: neither a built-in scene nor a file{did_you_mean(name, assets.SCENES)}",
        f"built in are: {', '.join(assets.SCENES)}",
    )


def prepare_tracer(
    scene: Scene, config: Config, positions: bool = False, log: Log | None = None
) -> tuple[CompiledScene, Tracer]:
    """Compile ``scene``, with a line of progress if that takes a while; its kernels are chosen, but not compiled."""
    with (log or Terminal()).stage(f"{scene.name}: preparing {scene.triangle_count:,} triangles"):
        compiled = compile_scene(scene)
    render = config.render
    settings = Settings(
        seed=render.seed,
        generator=HALTON if render.sequence == "halton" else HASH,
        threads=render.threads,
        tile=render.tile,
        positions=positions,
        regularize=render.regularize,
    )
    return compiled, Tracer(compiled, settings)


def open_tracer(
    scene: Scene, config: Config, positions: bool = False, log: Log | None = None
) -> tuple[CompiledScene, Tracer]:
    """Compile ``scene`` and the kernels it needs, with a line of progress if that takes a while."""
    log = log or Terminal()
    compiled, tracer = prepare_tracer(scene, config, positions, log)
    try:
        with watch_kernels(log.compiling):
            tracer.warm_up()
    except BaseException:
        tracer.close()
        raise
    return compiled, tracer


def open_shot(
    name: str,
    config: Config,
    camera: str | None,
    animate: bool,
    jitter: bool = False,
    log: Log | None = None,
    positions: bool = False,
) -> Shot:
    """Everything between a scene's name and its frames. Progress and the loader's notices go to ``log``, or to stderr.

    ``camera``: "still", "flight", the name of one of the scene's cameras, the file of a camera path, or None for the
    flight if the scene has one. ``positions``: frames carry world positions.
    Raises UserError for a scene or camera that cannot be had, and for a picture that memory has no room for.
    """
    log = log or Terminal()
    size = config.render.width, config.render.height
    require_memory(size)
    with log.stage(f"{Path(name).name}: reading"):
        scene = find_scene(name, animate, config.surroundings)
    tell_notices(scene, animate, log)
    path = _camera_path(scene, camera)
    compiled, tracer = open_tracer(scene, config, positions, log)
    return Shot(compiled, tracer, size, path, animate, jitter)


def tell_notices(scene: Scene, animate: bool, log: Log | None = None) -> None:
    """Tell what the loader has to say, and that nothing moves where ``animate`` asked for it."""
    log = log or Terminal()
    for notice in scene.notices:
        log.notice(f"{scene.name}: {notice}")
    if animate and not scene.animated:
        log.notice(f"{scene.name}: nothing in this scene moves")


def _camera_path(scene: Scene, camera: str | None) -> CameraPath:
    """What ``--camera`` means: a word, one of the scene's own cameras, or a file. Raises UserError."""
    if camera is None:
        camera = "still" if scene.flight is None else "flight"
    if camera == "still":
        return camera
    if camera == "flight":
        if scene.flight is None:
            raise UserError(
                f"--camera flight: {scene.name} has no flight",
                "use --camera still, or a camera path: --camera path.toml",
            )
        return camera
    for own in scene.cameras:
        if own.name == camera:
            return own.flight or [own.camera]
    if Path(camera).suffix in PATH_FORMATS or Path(camera).exists():
        return read_camera_path(Path(camera))
    names = ("still", "flight", *(own.name for own in scene.cameras))
    raise UserError(
        f"--camera {camera}: no camera of {scene.name}, and no file{did_you_mean(camera, names)}",
        f"there are: {', '.join(names)}, or a camera path ({', '.join(PATH_FORMATS)})",
    )


def require_memory(size: tuple[int, int]) -> None:
    """Raises UserError where frames of ``size`` would not fit: a system that runs out may end programs unasked."""
    free, needed = _free_memory(), size[0] * size[1] * BYTES_PER_PIXEL
    if free is not None and needed > free:
        raise UserError(
            f"{size[0]}x{size[1]} pixels need about {needed / 1e9:.1f} GB of memory, {free / 1e9:.1f} GB are free",
            "choose a smaller --size",
        )


def _free_memory() -> int | None:
    """Bytes that may still be used without swapping; None where the system does not tell."""
    free = None
    if (meminfo := Path("/proc/meminfo")).exists():
        found = re.search(r"^MemAvailable:\s*(\d+) kB$", meminfo.read_text(encoding="ascii"), re.MULTILINE)
        free = int(found[1]) * 1024 if found else None
    limit = Path("/sys/fs/cgroup/memory.max")  # a container's, if this is one: "max" or a number of bytes
    if limit.exists() and (text := limit.read_text(encoding="ascii").strip()).isdigit():
        free = int(text) if free is None else min(free, int(text))
    return free
