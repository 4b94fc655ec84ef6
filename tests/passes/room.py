"""A small room with noise, ray cast in NumPy: frames of a moving camera without the tracer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raytrace.frame import MISS, FramePacket

F64 = NDArray[np.float64]

FOCAL = 1.8
"""Width and height of the picture at depth 1 are 2 / FOCAL, times the aspect."""


@dataclass(frozen=True)
class Wall:
    """The rectangle ``low`` <= p <= ``high``, flat in one of the axes; ``facing`` = +-1 along that axis."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    facing: int
    object_id: int

    @property
    def axis(self) -> int:
        return int(np.argmin(np.subtract(self.high, self.low)))

    @property
    def normal(self) -> F64:
        return np.asarray(np.eye(3)[self.axis] * self.facing)


WALLS = (
    Wall((-3, 0, -6), (3, 0, 2), 1, 0),
    Wall((-3, 0, -6), (3, 3.2, -6), 1, 1),
    Wall((-3, 0, -6), (-3, 3.5, 2), 1, 2),
    Wall((-1, 0, -3.0), (0.5, 1.3, -3.0), 1, 3),
    Wall((0.5, 0, -4.5), (0.5, 1.3, -3.0), 1, 3),
    Wall((-1, 1.3, -4.5), (0.5, 1.3, -3.0), 1, 3),
    Wall((0.9, 0, -0.6), (1.01, 3, -0.6), 1, 4),
)
"""Floor, back wall, left wall, three sides of a block, and a board two pixels wide in front of it all; above and to the
right there is sky."""


@dataclass(frozen=True)
class Pose:
    """Camera position and its turn to the left, radians. It looks along -z."""

    position: tuple[float, float, float]
    turn: float

    def axes(self) -> tuple[F64, F64, F64]:
        """Right, up, forward."""
        c, s = np.cos(self.turn), np.sin(self.turn)
        return np.array([c, 0, -s]), np.array([0.0, 1, 0]), np.array([-s, 0, -c])

    def project(self, points: F64, aspect: float) -> tuple[F64, F64]:
        """uv (..., 2) and depth (...) of world points (..., 3)."""
        right, up, forward = self.axes()
        offset = points - np.array(self.position)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = offset @ forward
            x, y = offset @ right / depth / aspect, offset @ up / depth
        return 0.5 + 0.5 * FOCAL * np.stack([x, y], -1), depth


def flight(index: int) -> Pose:
    """Forwards, sideways and turning, some pixels a frame."""
    return Pose((0.2 + 0.25 * index, 1.5 + 0.05 * index, 1.5 - 0.15 * index), 0.08 + 0.025 * index)


def room(index: int, size: tuple[int, int]) -> FramePacket:
    """Frame ``index`` of the flight with one path's noise, exponentially distributed."""
    width, height = size
    aspect = width / height
    pose, before = flight(index), flight(max(index - 1, 0))
    right, up, forward = pose.axes()
    y, x = np.mgrid[:height, :width]
    across = ((x + 0.5) / width * 2 - 1) * aspect / FOCAL
    upwards = ((y + 0.5) / height * 2 - 1) / FOCAL
    rays = forward + across[..., None] * right + upwards[..., None] * up  # depth 1

    depth = np.full((height, width), np.inf)
    normal, ids = np.zeros((height, width, 3)), np.full((height, width), MISS)
    for wall in WALLS:
        facing = rays @ wall.normal
        with np.errstate(divide="ignore", invalid="ignore"):
            z = (np.subtract(wall.low, pose.position) @ wall.normal) / facing
            points = pose.position + rays * z[..., None]
        others = [k for k in range(3) if k != wall.axis]
        inside = np.all([(points[..., k] >= wall.low[k]) & (points[..., k] <= wall.high[k]) for k in others], 0)
        hit = inside & (facing < 0) & (z > 0) & (z < depth)
        depth = np.where(hit, z, depth)
        normal[hit] = wall.normal
        ids[hit] = wall.object_id
    sky = np.isinf(depth)
    depth = np.where(sky, 0.0, depth)
    points = pose.position + rays * depth[..., None]

    facing = np.where(sky, 1.0, np.einsum("hwk,hwk->hw", rays, normal))
    per_pixel = np.stack([normal @ right * (2 * aspect / FOCAL / width), normal @ up * (2 / FOCAL / height)], -1)
    gradient = -depth[..., None] * per_pixel / facing[..., None]
    uv_now, _ = pose.project(np.where(sky[..., None], pose.position + rays * 1e9, points), aspect)
    uv_then, depth_then = before.project(np.where(sky[..., None], before.position + rays * 1e9, points), aspect)
    motion = np.concatenate([uv_then - uv_now, np.where(sky, 0.0, depth_then)[..., None], ids[..., None]], -1)

    random = np.random.default_rng(100 + index)
    light = 0.4 + 2.0 * np.exp(-((points[..., 0] - 1) ** 2 + (points[..., 2] + 2) ** 2) / 4)

    def noisy(mean: F64, tint: tuple[float, float, float]) -> NDArray[np.float32]:
        values = np.where(sky, 0.0, mean * random.exponential(1.0, mean.shape))[..., None] * tint
        return np.concatenate([values, np.ones((height, width, 1))], -1).astype(np.float32)

    albedo = np.where(sky[..., None], 0.0, 0.3 + 0.5 * np.abs(np.sin(3 * points)))
    emission = np.where(sky[..., None], (0.3, 0.5, 0.9), 0.0)
    ones = np.ones((height, width, 1))
    return FramePacket(
        index=index,
        time=0.0,
        direct=noisy(light, (1.0, 0.9, 0.7)),
        indirect=noisy(0.3 + 0.1 * light, (0.7, 0.9, 1.0)),
        albedo=np.concatenate([albedo, ones], -1).astype(np.float32),
        emission=np.concatenate([emission, ones], -1).astype(np.float32),
        surface=np.concatenate([normal, depth[..., None]], -1).astype(np.float32),
        gradient=gradient.astype(np.float32),
        motion=motion.astype(np.float32),
        scene="room",
        pixel_size=2 / FOCAL / height,
        basis=(triple(right), triple(up), triple(forward)),
    )


def triple(axis: F64) -> tuple[float, float, float]:
    x, y, z = axis.tolist()
    return x, y, z
