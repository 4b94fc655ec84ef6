"""What the look-alikes are made with: named materials and objects of a glTF file, pictures, and a sky with a sun."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assets.shapes import Shape
from raytrace.camera import Camera
from tests.unit.gltf_files import GltfBuilder, png
from tests.unit.radiance_files import encoded, run_lengths, written

U8 = NDArray[np.uint8]
F64 = NDArray[np.float64]
Color = tuple[float, float, float]

SUN = 20_000.0
"""Radiance of the brightest texel of :func:`write_sky`: over its solid angle about three times what the sky gives."""


class Model(GltfBuilder):
    """A glTF file of :class:`assets.shapes.Shape` pieces."""

    def paint(self, name: str, color: Color = (1.0, 1.0, 1.0), roughness: float = 1.0, metallic: float = 0.0,
              image: U8 | None = None, **more: Any) -> int:  # fmt: skip
        """A material of both sides. ``image``: base colour, (h, w, 3), row 0 = bottom. ``more``: as in the file."""
        surface: dict[str, Any] = {
            "baseColorFactor": [*color, 1.0],
            "metallicFactor": metallic,
            "roughnessFactor": roughness,
        }
        if image is not None:
            surface["baseColorTexture"] = {"index": self.texture(png(image[::-1]))}
        return self.add("materials", {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True, **more})

    def lamp(self, radiance: Color, **more: Any) -> int:
        """A black material that emits, by KHR_materials_emissive_strength, its factor being at most 1."""
        strength = max(radiance)
        extensions = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        factor = [channel / strength for channel in radiance]
        return self.paint("lamp", (0.0, 0.0, 0.0), emissiveFactor=factor, extensions=extensions, **more)

    def show(self, name: str, shape: Shape, material: int, *, normals: bool = True, **node: Any) -> None:
        """An object. Without ``normals`` it is to be shaded flat. ``node``: its place, as in the file."""
        uvs = shape.uvs * np.array([1, -1], np.float32) + np.array([0, 1], np.float32)  # the file counts from the top
        part = self.primitive(
            shape.vertices, shape.faces.reshape(-1), shape.normals if normals else None, uvs, material=material
        )
        self.node(mesh=self.mesh(part), name=name, **node)

    def roll(self, name: str, keys: Sequence[tuple[float, Color]]) -> None:
        """Animate the place of an object: (seconds, place) from key to key."""
        node = next(k for k, node in enumerate(self.json["nodes"]) if node["name"] == name)
        sampler = {"input": self.accessor([time for time, _ in keys]), "output": self.accessor([at for _, at in keys])}
        channel = {"sampler": 0, "target": {"node": node, "path": "translation"}}
        self.add("animations", {"samplers": [sampler], "channels": [channel]})

    def camera(self, camera: Camera) -> None:
        entry = {"yfov": camera.yfov, "znear": 0.01, "zfar": 1e4, "aspectRatio": 1.0}
        index = self.add("cameras", {"type": "perspective", "perspective": entry})
        self.node(camera=index, name="camera", matrix=matrix_of(camera).T.ravel().tolist())


def matrix_of(camera: Camera) -> F64:
    """Camera to world, (4, 4) for column vectors, with OpenGL's axes."""
    right, up, forward = camera.basis()
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, up, -forward, np.array(camera.position)], axis=1)
    return matrix


def grain(height: int, width: int, colors: Sequence[Color], seed: int) -> U8:
    """Boards along u, (height, width, 3): rows of random shades between two colours, drawn out lengthwise."""
    rng = np.random.default_rng(seed)
    rows = rng.random((height, 1)) * 0.7 + rng.random((height, width)) * 0.3
    low, high = np.array(colors)
    image: U8 = np.rint(255 * (low + rows[..., None] * (high - low))).astype(np.uint8)
    return image


def letter_f(height: int, width: int) -> NDArray[np.bool_]:
    """A capital F in the middle, (height, width), row 0 = bottom: it tells up from down and left from right."""
    v, u = (np.mgrid[0:height, 0:width] + 0.5) / np.array([height, width])[:, None, None]
    stem = (abs(u - 0.35) < 0.06) & (abs(v - 0.5) < 0.35)
    arms = (u > 0.3) & (((abs(v - 0.79) < 0.06) & (u < 0.72)) | ((abs(v - 0.53) < 0.06) & (u < 0.6)))
    result: NDArray[np.bool_] = stem | arms
    return result


def write_sky(path: Path, azimuth: float = 0.0, elevation: float = 35.0) -> Path:
    """A Radiance picture of 256 x 128 texels with runs: sky, lawn, a dark wood all around with a red tower ahead.

    One texel is the sun, ``azimuth`` degrees to the right of -z and ``elevation`` above the horizon.
    """
    height, width = 128, 256
    v, u = (np.mgrid[0:height, 0:width] + 0.5) / np.array([height, width])[:, None, None]  # row 0 = bottom
    up = np.sin(np.pi * (v - 0.5))
    sky = np.array([0.35, 0.55, 1.0]) * (1.3 - 0.8 * up[..., None])
    lawn = np.array([0.16, 0.3, 0.05]) * (0.8 + 0.4 * np.random.default_rng(4).random((height, width, 1)))
    image = np.where((up > 0.0)[..., None], sky, lawn)
    image[(up > 0.0) & (up < 0.08 + 0.03 * np.sin(24 * np.pi * u))] = (0.03, 0.06, 0.03)
    image[(abs(u - 0.5) < 0.02) & (up > 0.0) & (up < 0.3)] = (0.7, 0.05, 0.03)
    row, column = round((0.5 + elevation / 180) * height - 0.5), round((0.5 + azimuth / 360) * width - 0.5) % width
    image[row - 1 : row + 2, column - 1 : column + 2] = 40.0
    image[row, column] = SUN, 0.9 * SUN, 0.75 * SUN
    coded = encoded(image[::-1])
    return written(path, coded, run_lengths(coded))
