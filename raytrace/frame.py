"""The frame packet: all that passes from the tracer to the filters, NumPy arrays only."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
Image = NDArray[np.floating]

Vector = tuple[float, float, float]
Basis = tuple[Vector, Vector, Vector]

STANDARD_BASIS: Basis = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
"""Right, up and forward of a camera that looks along -z."""

CameraStep = tuple[Basis, Vector]
"""Rows of a rotation, and a shift, scene units, that together bring a point from a frame's camera space (right, up and
forward of the camera) to that of the frame before."""

STILL: CameraStep = (((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (0.0, 0.0, 0.0))
"""That of a camera that stands still."""

MISS = -1.0
"""Object id of a pixel whose camera ray leaves the scene."""


STRATUM: Final = 3
"""Side in pixels of the squares that have one temporal gradient each."""


@dataclass(frozen=True)
class FramePacket:
    """One frame at one path per pixel. Row 0 of every image is the bottom row; images are (H, W, C) float32.

    With noise:

    ``direct``, ``indirect`` (H, W, 4): rgb = illumination divided by the albedo ("demodulated"), linear; a unused (1),
    except in a frame with temporal gradients: 0 where the sample was carried over from the last frame, 2 where it may
    be carried into the next one.
    Direct holds the light sample of the first hit and light sources hit by the bounce ray, combined by multiple
    importance sampling; indirect is what arrives over one bounce. 0 where the camera ray misses. Both are what the
    diffuse part of the surface reflects.
    ``specular`` (H, W, 4): rgb = what its specular part reflects of both, divided by ``specular_albedo``; 0 where there
    is none; a as of the others. None in a scene without metals and gloss, as is ``specular_albedo``.

    ``temporal_gradient`` (ceil(H / 3), ceil(W / 3), 4): by how much the light has changed since the last frame, one
    surface point for each 3x3 pixels: luminance of the direct light now minus then, and the larger of the two; the same
    for indirect light. All 0 where there is none; exactly 0 in the differences where nothing changed. None unless asked
    for.
    ``temporal_gradient_specular``: the same of specular light, and of all light over the sum of both albedos. What is
    seen in a glossy surface also changes with the view. None in a scene without metals and gloss as well.

    Without noise (guides):

    ``albedo`` (H, W, 4): rgb in [0, 1], the divisor above; a = 1 on surfaces, 0 on misses. Of a glossy surface what
    its diffuse part reflects from everywhere towards the camera, 0 for a metal.
    ``specular_albedo`` (H, W, 4): rgb = what the specular part reflects from everywhere, in [0, 1], 0 on diffuse
    surfaces; a = roughness in [0, 1], there 1. All 0 on a miss.
    ``emission`` (H, W, 4): rgb = radiance emitted by the surface seen, or of the sky on a miss; a unused (1).
    ``surface`` (H, W, 4): xyz = unit shading normal, world space, of the side that faces the camera; w = depth along
    the camera's forward axis, > 0, scene units. All 0 on a miss.
    ``gradient`` (H, W, 2): d depth / d pixel in x and y of the tangent plane, scene units; 0 on a miss.
    ``motion`` (H, W, 4): xy = previous uv minus uv; z = depth the surface point had in the previous frame (<= 0: it was
    behind the camera; on a miss 0); w = object id, MISS on a miss. Unjittered; exactly 0 where nothing moves.
    ``prev_normal`` (H, W, 4): xyz = shading normal that the surface point had one frame ago, world space; w = 0.
    None in a scene without moving objects: there it equals the normal.
    ``position``, ``prev_position`` (H, W, 4): xyz = surface point now and a frame ago, relative to the scene's origin;
    a = 1 on surfaces. None unless asked for.

    ``scene``: its name, for people. ``scene_id``: frames of equal numbers show one scene, whatever its name.
    ``pixel_size``: scene units that a pixel is wide at depth 1, 2 tan(yfov / 2) / height.
    ``basis``: the camera's right, up and forward unit vectors, world space. The ray of pixel (x, y) goes along
    forward + pixel_size ((x + 1/2 + jitter_x - width / 2) right + (y + 1/2 + jitter_y - height / 2) up), and meets the
    surface, relative to the camera, at depth times that.
    ``camera_step``: how the camera has moved; None: not known.
    ``timings``: seconds of wall time by stage name, of the tracer's own clock.
    """

    index: int
    time: float
    direct: F32
    indirect: F32
    albedo: F32
    emission: F32
    surface: F32
    gradient: F32
    motion: F32
    prev_normal: F32 | None = None
    position: F32 | None = None
    prev_position: F32 | None = None
    temporal_gradient: F32 | None = None
    temporal_gradient_specular: F32 | None = None
    specular: F32 | None = None
    specular_albedo: F32 | None = None
    scene: str = ""
    scene_id: int = 0
    cut: bool = False
    pixel_size: float = 0.0
    basis: Basis = STANDARD_BASIS
    jitter: tuple[float, float] = (0.0, 0.0)
    camera_step: CameraStep | None = None
    timings: dict[str, float] = field(default_factory=dict)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.direct.shape[1], self.direct.shape[0]

    def radiance(self) -> F32:
        """The noisy picture, (H, W, 3) linear radiance."""
        return self.modulated(self.direct, self.indirect, self.specular)

    def modulated(self, direct: Image, indirect: Image, specular: Image | None = None) -> Image:
        """(direct + indirect) x albedo + specular x specular albedo + emission, (H, W, 3) linear radiance."""
        diffuse = (direct[..., :3] + indirect[..., :3]) * self.albedo[..., :3]
        if specular is not None and self.specular_albedo is not None:
            diffuse = diffuse + specular[..., :3] * self.specular_albedo[..., :3]
        return diffuse + self.emission[..., :3]
