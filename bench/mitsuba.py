"""The tracer's time beside that of Mitsuba 3 (llvm_ad_rgb) on the same triangles, camera, size and depth.

    .venv/bin/python -m bench.mitsuba

Needs the package ``mitsuba``, one of the tests' own, and an LLVM library for it (Debian: libllvm). Frames
of the two are traced in turn, each twice, of which the second counts: Mitsuba's threads go on asking for work for a
while after they have done it, on the cores that our next frame is traced on. The ratio is that of the medians, of wall
and of processor time; the latter is hardly disturbed by other programs. Mitsuba's integrator is ``path`` with
``max_depth`` 3 and no Russian roulette: as ours, two surfaces, a light sample and a bounce ray at each (ours has no
bounce ray at the second). Ours makes the guides and motion vectors besides, and keeps direct and indirect light apart.
"""

from __future__ import annotations

import argparse
import importlib
import math
import sys
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

import assets
from errors import UserError
from raytrace.camera import Camera
from raytrace.compiled import compile_scene
from raytrace.integrator import Tracer
from raytrace.scene import Mesh, Scene
from raytrace.shot import jitter_of

SIZE = (640, 360)
SCENES = ("cornell", "interior")
VARIANT = "llvm_ad_rgb"


@dataclass(frozen=True)
class Comparison:
    """Medians of wall and processor time in milliseconds, and the means of the linear pictures: were they far apart,
    the scenes would not be the same."""

    scene: str
    ours: tuple[float, float]
    theirs: tuple[float, float]
    our_mean: float
    their_mean: float

    @property
    def ratios(self) -> tuple[float, float]:
        """Our part of Mitsuba's wall and processor time."""
        return self.ours[0] / self.theirs[0], self.ours[1] / self.theirs[1]


def load_mitsuba() -> Any:
    """The package with its variant set. Raises UserError where it or its compiler is missing."""
    try:
        mi = importlib.import_module("mitsuba")
        mi.set_variant(VARIANT)
        mi.Float(1.0) + 1.0
    except ImportError as error:
        raise UserError(f"Mitsuba is not there ({error})", "make test installs it") from error
    except Exception as error:  # without an LLVM library it raises a RuntimeError of its own
        raise UserError(f"Mitsuba cannot use {VARIANT} ({error})", "install Debian's libllvm") from error
    return mi


def converted(mi: Any, scene: Scene, size: tuple[int, int]) -> Any:
    """``scene`` for Mitsuba: diffuse materials with their textures, one mesh for each object and material."""
    camera = scene.camera
    content: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 3, "rr_depth": 1000},
        "sensor": {
            "type": "perspective",
            "fov": math.degrees(camera.yfov),
            "fov_axis": "y",
            "to_world": _look_at(mi, camera),
            "film": {
                "type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"},
                "pixel_format": "rgb", "component_format": "float32",
            },
            "sampler": {"type": "independent", "sample_count": 1},
        },
    }  # fmt: skip
    for number, mesh in enumerate(scene.meshes):
        for material in np.unique(mesh.materials):
            content[f"mesh_{number}_{material}"] = _mesh(mi, scene, mesh, int(material))
    return mi.load_dict(content)


def _look_at(mi: Any, camera: Camera) -> Any:
    target = np.array(camera.position) + camera.forward
    return mi.ScalarTransform4f().look_at(origin=list(camera.position), target=target.tolist(), up=list(camera.up))


def _mesh(mi: Any, scene: Scene, mesh: Mesh, material: int) -> Any:
    faces = mesh.faces[mesh.materials == material]
    used, renumbered = np.unique(faces, return_inverse=True)
    surface = scene.materials[material]
    props = mi.Properties()
    props["bsdf"] = mi.load_dict(_bsdf(mi, scene, material))
    if surface.emits:
        radiance = {"type": "rgb", "value": list(surface.emission)}
        props["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
    made = mi.Mesh(
        mesh.name, len(used), len(faces), has_vertex_normals=mesh.normals is not None,
        has_vertex_texcoords=mesh.uvs is not None, props=props,
    )  # fmt: skip
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = mesh.vertices[used].astype(np.float32).ravel()
    parameters["faces"] = renumbered.astype(np.uint32).ravel()
    if mesh.normals is not None:
        parameters["vertex_normals"] = mesh.normals[used].ravel()
    if mesh.uvs is not None:
        parameters["vertex_texcoords"] = (mesh.uvs[used] * (1.0, -1.0) + (0.0, 1.0)).astype(np.float32).ravel()
    parameters.update()
    return made


def _bsdf(mi: Any, scene: Scene, material: int) -> dict[str, Any]:
    surface = scene.materials[material]
    reflectance: dict[str, Any] = {"type": "rgb", "value": list(surface.base_color)}
    if surface.base_texture >= 0:
        pixels = scene.textures[surface.base_texture].pixels[::-1].astype(np.float32) / 255.0
        linear = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)
        colors = (linear * np.array(surface.base_color, np.float32)).astype(np.float32)
        reflectance = {"type": "bitmap", "bitmap": mi.Bitmap(colors), "raw": True}
    diffuse: dict[str, Any] = {"type": "diffuse", "reflectance": reflectance}
    return {"type": "twosided", "bsdf": diffuse}


def compare(name: str, mi: Any, size: tuple[int, int] = SIZE, repeats: int = 14) -> Comparison:
    """Frames of the built-in scene ``name``, which must be diffuse, by both in turn; rays of both fill the pixels."""
    dr = importlib.import_module("drjit")
    scene = assets.build(name)
    theirs = converted(mi, scene, size)
    clocks: list[list[float]] = []
    means: list[tuple[float, float]] = []

    def render(index: int) -> Any:
        picture = mi.render(theirs, spp=1, seed=index)
        dr.eval(picture)
        dr.sync_thread()
        return picture

    with Tracer(compile_scene(scene)) as tracer:
        for index in range(repeats + 2):
            for _ in range(2):  # see the head of this file: the second counts
                stamps = [_now()]
                packet = tracer.frame(index, scene.camera.with_jitter(jitter_of(index)), scene.camera, size)
                stamps.append(_now())
            ours_alone = np.subtract(stamps[1], stamps[0])
            for _ in range(2):
                stamps = [_now()]
                picture = render(index)
                stamps.append(_now())
            means.append((float(packet.radiance().mean()), float(np.array(picture).mean())))
            if index >= 2:
                clocks.append([*ours_alone, *np.subtract(stamps[1], stamps[0])])
    wall, processor, their_wall, their_processor = (np.median(clocks, axis=0) * 1e3).tolist()
    ours, others = np.mean(means, axis=0).tolist()
    return Comparison(name, (wall, processor), (their_wall, their_processor), ours, others)


def _now() -> tuple[float, float]:
    return time.perf_counter(), time.process_time()


def build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("bench.mitsuba", description="time of tracing beside Mitsuba 3")
    parser.add_argument("--repeats", type=int, default=14, help="frames of each that count (default 14)")
    return parser


def main() -> int:
    """A table on stdout."""
    repeats = max(1, build_parser().parse_args().repeats)
    try:
        mi = load_mitsuba()
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{SIZE[0]}x{SIZE[1]}, one path per pixel, Mitsuba {mi.__version__} {VARIANT}")
    for name in SCENES:
        row = compare(name, mi, repeats=repeats)
        print(
            f"  {name:9s} ours {row.ours[0]:.1f} ms, Mitsuba {row.theirs[0]:.1f} ms, ratio {row.ratios[0]:.2f}; "
            f"processor {row.ours[1]:.1f} and {row.theirs[1]:.1f} ms, ratio {row.ratios[1]:.2f}; "
            f"mean radiance {row.our_mean:.4f} and {row.their_mean:.4f}",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
