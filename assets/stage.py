"""Collects materials and objects by name and turns them into a :class:`raytrace.scene.Scene`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assets.shapes import Shape, join
from assets.textures import Pixels
from raytrace.camera import Camera
from raytrace.scene import Material, Mesh, Motion, Scene, Texture

Colour = tuple[float, float, float]
Part = tuple[Shape, str]
"""A shape and the name of its material."""


def placed(parts: list[Part], turn_degrees: float = 0.0, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> list[Part]:
    """The parts turned about the y axis through their origin and then carried to (x, y, z)."""
    if turn_degrees:
        parts = [(shape.turned("y", turn_degrees), material) for shape, material in parts]
    return [(shape.moved(x, y, z), material) for shape, material in parts]


class Stage:
    """A scene being built. ``animate``: keep the motions; otherwise moving objects stand as they do at time 0."""

    def __init__(self, animate: bool) -> None:
        self.animate = animate
        self._materials: dict[str, Material] = {}
        self._textures: list[Texture] = []
        self._meshes: list[Mesh] = []

    def texture(self, name: str, pixels: Pixels, alpha: NDArray[np.uint8] | None = None) -> int:
        """Add an image, ``alpha`` (h, w) being its coverage; returns its index."""
        self._textures.append(Texture(name, pixels, alpha=alpha))
        return len(self._textures) - 1

    def material(
        self,
        name: str,
        color: Colour,
        texture: int = -1,
        emission: Colour = (0.0, 0.0, 0.0),
        roughness: float | None = None,
        metallic: float = 0.0,
        cutoff: float | None = None,
    ) -> None:
        """Add a material under a name of its own. ``color`` is linear and multiplies the texture.

        Without a ``roughness`` it is diffuse, with one glossy, or a metal. With a ``cutoff`` it has holes where the
        texture's coverage is below.
        """
        if name in self._materials:
            raise ValueError(f"there is a material {name!r} already")
        material = Material(name, color, texture, emission)
        if roughness is not None:
            material = replace(material, specular=True, roughness=roughness, metallic=metallic)
        self._materials[name] = material if cutoff is None else replace(material, alpha_cutoff=cutoff)

    def add(self, name: str, parts: list[Part], motion: Motion | None = None) -> None:
        """Add one object. With ``motion`` its shapes are in the object's own space, otherwise in the world's."""
        index = {material: i for i, material in enumerate(self._materials)}
        shape = join(part for part, _ in parts)
        materials = np.concatenate([np.full(len(part.faces), index[m], dtype=np.int32) for part, m in parts])
        vertices, normals = shape.vertices, shape.normals
        if motion is not None and not self.animate:
            matrix = motion(0.0)
            vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
            normals = np.ascontiguousarray(normals @ matrix[:3, :3].T.astype(np.float32))
            motion = None
        self._meshes.append(Mesh(name, vertices, shape.faces, materials, normals, shape.uvs, motion))

    def scene(self, name: str, camera: Camera, flight: Callable[[float], Camera]) -> Scene:
        """The finished scene."""
        return Scene(
            name,
            tuple(self._meshes),
            tuple(self._materials.values()),
            camera,
            tuple(self._textures),
            flight=flight,
        )
