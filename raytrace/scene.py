"""What a scene is, before it is prepared for tracing.

A :class:`Scene` is plain data in the file's own units and axes, float64, so that a model far from the origin loses
nothing; :mod:`raytrace.compiled` subtracts :attr:`Scene.origin` and turns it into float32 arrays for the kernels.

Conventions: texture coordinates have their origin at the lower left, and so do images here (row 0 is the bottom row);
a loader whose format counts from the top flips both. Colours are linear Rec. 709 unless said otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from raytrace.camera import Camera, NamedCamera
from raytrace.environment import Environment
from raytrace.punctual import PunctualLight

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
I32 = NDArray[np.int32]

Dimmer = Callable[[float], float]
"""Share of its emission that a material gives, >= 0, as a function of time in seconds."""

Motion = Callable[[float], F64]
"""Rigid object-to-world transform, (4, 4) float64 for column vectors, as a function of time in seconds."""


@dataclass(frozen=True)
class Texture:
    """An image read by texture coordinates, repeated in both directions.

    ``pixels``: (h, w, 3) uint8, row 0 = bottom row, sRGB-encoded as base colour and emissive textures are, or with
    ``linear`` plain fractions of 255 as all others (glTF 2.0, sec. 3.9). ``alpha``: (h, w) uint8 coverage, or None.
    """

    name: str
    pixels: NDArray[np.uint8]
    linear: bool = False
    alpha: NDArray[np.uint8] | None = None


@dataclass(frozen=True)
class Material:
    """A surface that may emit: diffuse (Lambertian), or with ``specular`` glTF's metallic-roughness model.

    ``base_color``: linear, in [0, 1], multiplied by ``base_texture`` and the mesh's colours where there are any: the
    reflectance of what is diffuse, and that of a metal seen head-on.
    ``emission``: radiance of the front face (of both faces where ``double_sided``), W/(m² sr) in the scene's own scale,
    multiplied by ``emission_texture`` where there is one. Textures are indices into :attr:`Scene.textures`, -1 = none.
    ``dimmer``: what of the emission there is at a time; None: always all of it.

    ``specular``: whether there is a specular lobe at all; without, ``metallic`` and ``roughness`` mean nothing.
    ``metallic``, ``roughness``: in [0, 1], multiplied by blue and green of the linear ``metallic_roughness_texture``;
    GGX's width is the roughness squared. ``normal_texture``: a linear texture of normals in tangent space, whose x
    and y are multiplied by ``normal_scale``.

    ``alpha``: coverage in [0, 1], multiplied by those of the base texture and the mesh's colours. The surface is not
    there where the product is below ``alpha_cutoff``; None: it is everywhere, whatever the product.
    """

    name: str
    base_color: tuple[float, float, float] = (0.8, 0.8, 0.8)
    base_texture: int = -1
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission_texture: int = -1
    double_sided: bool = False
    dimmer: Dimmer | None = None
    specular: bool = False
    metallic: float = 0.0
    roughness: float = 1.0
    metallic_roughness_texture: int = -1
    normal_texture: int = -1
    normal_scale: float = 1.0
    alpha: float = 1.0
    alpha_cutoff: float | None = None

    @property
    def emits(self) -> bool:
        return max(self.emission) > 0.0


@dataclass(frozen=True)
class Mesh:
    """Triangles of one object, which is what motion vectors and edge tests call an object.

    ``vertices`` (V, 3) float64: world space, or object space where ``motion`` is given. ``faces`` (F, 3) int32.
    ``normals`` (V, 3) float32, unit length, or None for flat shading. ``uvs`` (V, 2) float32 or None.
    ``materials`` (F,) int32: index into :attr:`Scene.materials` per triangle.
    ``colors`` (V, 4) float32: linear factors of base colour and alpha, in [0, 1], or None.
    """

    name: str
    vertices: F64
    faces: I32
    materials: I32
    normals: F32 | None = None
    uvs: F32 | None = None
    motion: Motion | None = None
    colors: F32 | None = None


@dataclass(frozen=True)
class Scene:
    """Meshes, materials, textures, a camera, optionally lights of other kinds and a camera flight.

    ``sky``: radiance of the constant sky, or None: then a ray that leaves the scene brings nothing.
    ``environment``: light from all around instead of the constant sky; ``lights``: those without a surface.
    ``flight``: camera at a time in seconds, for demos and measurements; None: the still camera. ``cameras``: those that
    can be asked for by name.
    ``notices``: what the loader repaired or approximated, one line each.
    """

    name: str
    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    camera: Camera
    textures: tuple[Texture, ...] = ()
    sky: tuple[float, float, float] | None = None
    flight: Callable[[float], Camera] | None = None
    notices: tuple[str, ...] = field(default=())
    lights: tuple[PunctualLight, ...] = ()
    environment: Environment | None = None
    cameras: tuple[NamedCamera, ...] = ()

    @property
    def triangle_count(self) -> int:
        return sum(len(m.faces) for m in self.meshes)

    @property
    def has_motion(self) -> bool:
        return any(m.motion is not None for m in self.meshes)

    @property
    def animated(self) -> bool:
        """Whether an object or a light moves."""
        return self.has_motion or any(light.motion is not None for light in self.lights)

    @property
    def dims(self) -> bool:
        """Whether a lamp shines more or less in time."""
        return any(material.dimmer is not None for material in self.materials)

    def standing(self) -> Scene:
        """The same without motion of objects and lights, as they are at time 0."""
        meshes = tuple(mesh if mesh.motion is None else _standing(mesh) for mesh in self.meshes)
        lights = tuple(replace(light.at(0.0), motion=None) for light in self.lights)
        return replace(self, meshes=meshes, lights=lights)

    def bounds(self) -> tuple[F64, F64]:
        """Lower and upper corner of everything at time 0, each (3,) float64, world space."""
        lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
        for mesh in self.meshes:
            points = mesh.vertices[mesh.faces.reshape(-1)]  # vertices that no triangle uses do not count
            if mesh.motion is not None:
                matrix = mesh.motion(0.0)
                points = points @ matrix[:3, :3].T + matrix[:3, 3]
            lower, upper = np.minimum(lower, points.min(0)), np.maximum(upper, points.max(0))
        return lower, upper

    @property
    def origin(self) -> F64:
        """Centre of the bounds, (3,) float64: subtracted before anything becomes float32."""
        lower, upper = self.bounds()
        return (lower + upper) / 2


def _standing(mesh: Mesh) -> Mesh:
    assert mesh.motion is not None
    matrix = mesh.motion(0.0)
    turn, shift = matrix[:3, :3], matrix[:3, 3]
    normals = None if mesh.normals is None else np.ascontiguousarray(mesh.normals @ turn.T.astype(np.float32))
    return replace(mesh, vertices=mesh.vertices @ turn.T + shift, normals=normals, motion=None)
