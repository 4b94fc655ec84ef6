"""Scene files: ``load_scene`` reads glTF, GLB, OBJ and PLY."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from errors import Notices, UserError, did_you_mean
from raytrace.camera import Camera
from raytrace.gltf import load_gltf
from raytrace.lamps import has_lamp, with_front_lamps
from raytrace.obj import load_obj
from raytrace.parts import Model
from raytrace.ply import load_ply
from raytrace.scene import Scene

_READERS: dict[str, Callable[[Path, Notices], Model]] = {
    ".glb": load_gltf,
    ".gltf": load_gltf,
    ".obj": load_obj,
    ".ply": load_ply,
}
FORMATS = tuple(_READERS)
"""Endings of the files that can be read."""

_FRAMING_DIRECTION = (0.62, 0.42, 0.66)  # from the middle of the scene to the camera: a three-quarter view from above
_FRAMING_FOV_DEGREES = 45.0
_MARGIN = 1.02


def load_scene(path: str | Path, surrounded: bool = False, animate: bool = False) -> Scene:
    """Read a scene file. Units and axes stay the file's; vertices are world space, float64.

    With ``animate`` what the file animates moves, otherwise it stands where it is at time 0.

    Without a camera in the file the whole scene is framed, up being +y; without a light it gets a constant white sky of
    radiance 1, unless it is ``surrounded`` by something that the caller adds. All of that, every repair and every
    simplification are named in ``Scene.notices``.
    Raises UserError, with the file and what to do, for everything that cannot be read.
    """
    path = Path(path).expanduser()
    reader = _reader(path)
    notices = Notices()
    model = reader(path, notices)
    if not model.meshes:
        raise UserError(f"{path}: there is no triangle in this file", "check that objects were exported, as surfaces")
    scene = Scene(
        name=path.resolve().parent.name if path.stem == "scene" else path.stem,
        meshes=tuple(model.meshes),
        materials=tuple(model.materials),
        camera=model.cameras[0].camera if model.cameras else Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
        textures=tuple(model.textures),
        lights=tuple(model.lights),
        cameras=tuple(model.cameras),
        flight=next((camera.flight for camera in model.cameras if camera.flight is not None), None),
    )
    sky = None
    if not model.cameras:
        notices.add("no camera in the file: the whole scene is framed")
        scene = replace(scene, camera=framed(scene))
    if not (surrounded or scene.lights or has_lamp(scene)):
        notices.add("no light in the file: a constant white sky is added")
        sky = (1.0, 1.0, 1.0)
    scene = with_front_lamps(scene, notices)
    scene = scene if animate else scene.standing()
    return replace(scene, sky=sky, notices=tuple(notices.lines))


def _reader(path: Path) -> Callable[[Path, Notices], Model]:
    known = ", ".join(FORMATS)
    if path.is_dir():
        inside = sorted(p.name for p in path.iterdir() if p.suffix.lower() in FORMATS)
        hint = f"in it are: {', '.join(inside[:5])}" if inside else f"give a file ({known})"
        raise UserError(f"{path}: is a folder, not a scene file", hint)
    if not path.exists():
        others = [p.name for p in path.parent.iterdir() if p.suffix.lower() in FORMATS] if path.parent.is_dir() else []
        raise UserError(f"{path}: there is no such file{did_you_mean(path.name, others)}", "check the path")
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        what = f"{path.suffix} files" if path.suffix else "files without an ending"
        raise UserError(f"{path}: {what} cannot be read", f"export the scene as one of {known}")
    return reader


def framed(scene: Scene) -> Camera:
    """A camera that sees the sphere around ``scene``'s bounds, whole for every aspect ratio of at least 1."""
    lower, upper = scene.bounds()
    centre = (lower + upper) / 2
    radius = float(np.linalg.norm(upper - lower)) / 2
    direction = np.array(_FRAMING_DIRECTION) / np.linalg.norm(_FRAMING_DIRECTION)
    eye = centre + direction * radius * _MARGIN / math.sin(math.radians(_FRAMING_FOV_DEGREES) / 2)

    def triple(v: NDArray[np.float64]) -> tuple[float, float, float]:
        return float(v[0]), float(v[1]), float(v[2])

    return Camera.look_at(triple(eye), triple(centre), yfov_degrees=_FRAMING_FOV_DEGREES)
