"""The camera of a recorded frame, taken from its matrix, and what follows from it: rays, projections, slopes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.frame import Basis, Vector

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

MIN_COSINE: Final = np.float32(0.05)
"""Least cosine between normal and ray that slopes are computed with; the tracer's."""

_ROUNDING: Final = 1e-5


def matrix_of(camera: Camera, size: tuple[int, int], origin: F64) -> F32:
    """The (4, 4) float32 matrix of ``camera`` as ``camera_matrices.h`` has it, for positions relative to ``origin``."""
    matrix = camera.view_projection(size[0] / size[1], origin).T.copy()
    matrix[:, 1] *= np.float32(-1.0)  # there y points downwards
    return matrix


@dataclass(frozen=True)
class View:
    """One frame's camera.

    ``clip`` (4, 4) float32: to clip space, for column vectors, y upwards; w is the depth, scene units. ``basis``,
    ``pixel_size``, ``jitter``: as in the :class:`raytrace.frame.FramePacket`, whose formula of the rays holds; of a
    lens that is shifted, or whose pixels are oblong, the basis is neither of unit length nor at right angles.
    """

    size: tuple[int, int]
    clip: F32
    basis: Basis
    pixel_size: float
    jitter: tuple[float, float]

    @staticmethod
    def of(matrix: F32, offset: F32, size: tuple[int, int]) -> View:
        """From what ``camera_matrices.h`` says. Raises ValueError where the matrix is no perspective camera's."""
        clip = matrix.T.copy()
        clip[1] *= np.float32(-1.0)
        rows = clip[[0, 1, 3], :3].astype(np.float64)
        lengths = np.linalg.norm(rows, axis=1)
        if not lengths.min() > 0.0 or np.linalg.cond(rows / lengths[:, None]) > 1e6:
            raise ValueError("this matrix is no perspective camera's")
        scale = lengths[2]
        if abs(scale - 1.0) > _ROUNDING:  # our own matrices stay as they are, to the bit
            clip = (clip / scale).astype(np.float32)
        across, upwards, forward = np.linalg.inv(rows / scale).T  # of a ray of depth 1, per unit of x, y and 1
        right, up = across * 2.0 / size[0], upwards * 2.0 / size[1]
        pixel = float(np.linalg.norm(up))
        basis = _triple(right / pixel), _triple(up / pixel), _triple(forward)
        return View(size, clip, basis, pixel, (float(offset[0]) - 0.5, float(offset[1]) - 0.5))

    def rays(self) -> F32:
        """Through each pixel, of depth 1: (H, W, 3) float32, world space."""
        width, height = self.size
        right, up, forward = (np.array(axis, dtype=np.float32) for axis in self.basis)
        step = np.float32(self.pixel_size)
        x = step * (np.arange(width, dtype=np.float32) + np.float32(0.5 + self.jitter[0] - width / 2))
        y = step * (np.arange(height, dtype=np.float32) + np.float32(0.5 + self.jitter[1] - height / 2))
        return np.asarray(forward + x[None, :, None] * right + y[:, None, None] * up, dtype=np.float32)

    def project(self, points: F32, at_infinity: bool = False) -> tuple[F32, F32, F32]:
        """Clip-space x, y and w, (H, W) float32 each, of ``points`` (H, W, 3), world space.

        ``at_infinity``: they are directions. Term by term as the tracer computes it, so that both agree to the bit.
        """
        x, y, z = points[..., 0], points[..., 1], points[..., 2]

        def row(number: int) -> F32:
            a, b, c, d = self.clip[number]
            value = a * x + b * y + c * z
            return np.asarray(value if at_infinity else value + d, dtype=np.float32)

        return row(0), row(1), row(3)


def slopes(view: View, depth: F32, normal: F32, hit: Mask) -> F32:
    """Change of depth from pixel to pixel in x and y, (H, W, 2) float32, scene units; 0 where not ``hit``.

    Of the plane through the point with the shading normal, ``normal`` (H, W, 3); ``depth`` (H, W). The tracer takes the
    geometric normal instead, which is in no file: on smooth surfaces the two differ, in the interior by 0.06 widths of
    a pixel on average. Differences between neighbouring depths would be 0.6 off there, because of edges, and the median
    of all these estimates 0.14.
    """
    rays = view.rays()
    length = np.sqrt(np.einsum("ijk,ijk->ij", rays, rays))
    facing = np.minimum(np.einsum("ijk,ijk->ij", normal, rays), -MIN_COSINE * length)
    steps = np.array(view.basis[:2], dtype=np.float32) * np.float32(view.pixel_size)
    slope = (-depth / facing)[..., None] * (normal @ steps.T)
    return np.where(hit[..., None], slope, np.float32(0.0)).astype(np.float32)


def _triple(v: F64) -> Vector:
    return float(v[0]), float(v[1]), float(v[2])
