"""What a scene needs of the tracer, and what is left out for it: kernels, rays, images. For people and for tests.

Read from the compiled scene and from the kernels themselves, without running anything.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from raytrace.compiled import LIGHT, MATERIAL, SMOOTH, CompiledScene
from raytrace.guides import Outputs
from raytrace.punctual import KINDS
from raytrace.tables import Variant

ILLUMINATION = ("direct", "indirect", "specular")
"""The images of a frame with noise; all others come from the guide kernel."""


GRADIENT, GRADIENT_SPECULAR = "temporal_gradient", "temporal_gradient_specular"
"""The images with what is known of the change since the last frame; made for a frame whose method asks for it."""


def images_of(variant: Variant, positions: bool, gradients: bool = False) -> tuple[str, ...]:
    """Names of the images that frames have in scenes of this kind; a :class:`FramePacket` has None for the others.

    ``positions``: the surface points are asked for as well. ``gradients``: temporal gradients are.
    """
    needed = {
        "prev_normal": variant.moving,
        "position": positions,
        "prev_position": positions,
        "specular": variant.specular,
        "specular_albedo": variant.specular,
    }
    images = (name for name in (*ILLUMINATION, *Outputs._fields) if needed.get(name, True))
    return (*images, *(gradients_of(variant) if gradients else ()))


def gradients_of(variant: Variant) -> tuple[str, ...]:
    """Names of the images that frames with temporal gradients have besides."""
    return (GRADIENT, GRADIENT_SPECULAR) if variant.specular else (GRADIENT,)


def rays_of(scene: CompiledScene) -> dict[str, int]:
    """How many rays a path has at most, by kind, in the order in which they are traced.

    A path ends early where it leaves the scene, and a shadow ray is not traced whose light cannot arrive anyway.
    """
    lamps = int(len(scene.lights.pdf) > 0)
    return {"camera": 1, "shadow at hit 1": lamps, "bounce": 1, "shadow at hit 2": lamps}


def compiled_in(kernel: Callable[..., Any]) -> dict[str, bool]:
    """The switches that ``kernel`` was made with: a loop for scenes without a feature does not contain its code.

    Numba takes the variables that a function closes over as constants, and drops the branches not taken.
    """
    closed_over = inspect.getclosurevars(getattr(kernel, "py_func", kernel)).nonlocals
    return {name: value for name, value in sorted(closed_over.items()) if isinstance(value, bool)}


@dataclass(frozen=True)
class Content:
    """What a compiled scene consists of, counted.

    ``moving``, ``smooth``: triangles that move, and those with the vertices' normals. ``textures``: images that a
    material refers to; ``texel_bytes``: with all their levels. ``lamps``: triangles that emit, of which
    ``textured_lamps`` by a texture and ``double_sided_lamps`` on both sides. ``punctual``: lights without a surface, by
    kind. ``environment_size``: width and height of the environment's picture, or None; ``environment_bytes``: with what
    is needed to sample it. ``sky_share``: what the sky or the environment gets of the light samples. ``table_bytes``:
    all arrays that the kernels read, texels included. Bytes are of main memory.
    """

    triangles: int
    moving: int
    smooth: int
    objects: int
    moving_objects: int
    textures: int
    texel_bytes: int
    lamps: int
    textured_lamps: int
    double_sided_lamps: int
    punctual: dict[str, int]
    environment_size: tuple[int, int] | None
    environment_bytes: int
    sky_share: float
    table_bytes: int


def content_of(scene: CompiledScene, tables: tuple[Any, ...]) -> Content:
    """Count what is in ``scene``; ``tables``: its arrays as the kernels take them."""
    used = scene.material_info[:, :2]
    lamps = scene.material_info[scene.triangle_info[scene.triangle_info[:, LIGHT] >= 0, MATERIAL]]
    lights, around = scene.lights, scene.scene.environment
    kinds = [light.kind for light in scene.scene.lights]
    tables_around = lights.environment
    bytes_around = sum(part.nbytes for part in (tables_around.texels, tables_around.rows, tables_around.columns))
    return Content(
        triangles=len(scene.triangles),
        moving=len(scene.triangles) - scene.static_count,
        smooth=int(scene.triangle_info[:, SMOOTH].sum()),
        objects=len(scene.scene.meshes),
        moving_objects=sum(mesh.motion is not None for mesh in scene.scene.meshes),
        textures=len(set(used[used >= 0].tolist())),
        texel_bytes=scene.textures.texels.nbytes if scene.has_textures else 0,
        lamps=len(lights.triangles),
        textured_lamps=int((lamps[:, 1] >= 0).sum()),
        double_sided_lamps=int((lamps[:, 2] != 0).sum()),
        punctual={kind: kinds.count(kind) for kind in KINDS if kind in kinds},
        environment_size=None if around is None else (around.pixels.shape[1], around.pixels.shape[0]),
        environment_bytes=0 if around is None else bytes_around,
        sky_share=float(lights.pdf[-1]) if lights.has_sky or around is not None else 0.0,
        table_bytes=sum(array.nbytes for array in tables if hasattr(array, "nbytes")),
    )
