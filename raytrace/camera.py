"""Pinhole camera: float64 pose in the scene's world space, float32 matrices relative to the scene's origin."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pyrr
from numpy.typing import NDArray

from raytrace.frame import Basis, CameraStep, Vector

F64 = NDArray[np.float64]

_NEAR, _FAR = 0.01, 1000.0  # only x, y and w of clip space are used, which do not depend on these two


@dataclass(frozen=True)
class Camera:
    """``position`` in world units, unit ``forward`` and ``up``, vertical field of view ``yfov`` in radians.

    ``jitter``: where in its pixel a camera ray passes, in pixels relative to the centre, each in [-0.5, 0.5].
    Motion vectors and projections ignore it.
    """

    position: tuple[float, float, float]
    forward: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    yfov: float = math.radians(45.0)
    jitter: tuple[float, float] = (0.0, 0.0)

    @staticmethod
    def look_at(
        position: tuple[float, float, float],
        target: tuple[float, float, float],
        up: tuple[float, float, float] = (0.0, 1.0, 0.0),
        yfov_degrees: float = 45.0,
    ) -> Camera:
        """Camera at ``position`` looking towards ``target``; all in world units."""
        direction = np.subtract(target, position).astype(np.float64)
        direction /= np.linalg.norm(direction)
        x, y, z = (float(c) for c in direction)
        return Camera(position, (x, y, z), up, math.radians(yfov_degrees))

    @staticmethod
    def from_matrix(camera_to_world: F64, yfov: float) -> Camera:
        """From a (4, 4) camera-to-world matrix for column vectors with OpenGL axes (looking along -z)."""
        m = np.asarray(camera_to_world, dtype=np.float64)
        axes = m[:3, :3] / np.linalg.norm(m[:3, :3], axis=0)

        return Camera(_triple(m[:3, 3]), _triple(-axes[:, 2]), _triple(axes[:, 1]), yfov)

    def with_jitter(self, jitter: tuple[float, float]) -> Camera:
        return replace(self, jitter=jitter)

    def pixel_size(self, height: int) -> float:
        """World units that one pixel of an image of ``height`` rows covers at depth 1."""
        return 2.0 * math.tan(self.yfov / 2) / height

    def basis(self) -> tuple[F64, F64, F64]:
        """Right, up and forward unit vectors, (3,) float64 each, world space."""
        forward = np.array(self.forward, dtype=np.float64)
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, np.array(self.up, dtype=np.float64))
        length = np.linalg.norm(right)
        if length < 1e-6:  # looking along `up`: any horizontal axis will do, but always the same one
            right = np.cross(forward, np.array([1.0, 0.0, 0.0]) if abs(forward[0]) < 0.9 else np.array([0.0, 0.0, 1.0]))
            length = np.linalg.norm(right)
        right /= length
        return right, np.cross(right, forward), forward

    def axes(self) -> Basis:
        """:meth:`basis` as plain numbers, for a frame packet."""
        right, up, forward = (_triple(axis) for axis in self.basis())
        return right, up, forward

    def step_from(self, before: Camera) -> CameraStep:
        """What brings a point from this camera's space to that of the camera ``before``, for a frame packet."""
        now, then = np.array(self.basis()), np.array(before.basis())
        turn = then @ now.T
        shift = then @ (np.array(self.position, np.float64) - np.array(before.position, np.float64))
        return (_triple(turn[0]), _triple(turn[1]), _triple(turn[2])), _triple(shift)

    def view_projection(self, aspect: float, origin: F64) -> NDArray[np.float32]:
        """(4, 4) float32 for column vectors, from world space relative to ``origin`` to clip space, without jitter.

        w of the result is the depth along the camera's forward axis.
        """
        eye = np.array(self.position, dtype=np.float64) - origin
        _, up, forward = self.basis()
        view = pyrr.matrix44.create_look_at(eye, eye + forward, up, dtype=np.float64)
        projection = pyrr.matrix44.create_perspective_projection(
            math.degrees(self.yfov), aspect, _NEAR, _FAR, dtype=np.float64
        )
        # pyrr writes matrices for row vectors; ours are for column vectors.
        return np.ascontiguousarray((view @ projection).T, dtype=np.float32)


@dataclass(frozen=True)
class NamedCamera:
    """One of a scene's cameras. ``flight``: the camera at a time in seconds, None where it stands still."""

    name: str
    camera: Camera
    flight: Callable[[float], Camera] | None = None


def _triple(v: F64) -> Vector:
    return float(v[0]), float(v[1]), float(v[2])
