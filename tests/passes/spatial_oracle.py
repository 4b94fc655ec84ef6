"""The filters in space in NumPy and double precision, from the papers; the shaders must agree with them.

Images are (H, W, C) float64. A sample is colour and how much of it there is, 0 or 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from config import Config
from raytrace.frame import FramePacket

F64 = NDArray[np.float64]

REC_709 = np.array([0.2126, 0.7152, 0.0722])
KERNEL = {0: 1.0, 1: 2 / 3, 2: 1 / 6}
"""B3 spline, 1 at the centre."""


def sample(packet: FramePacket) -> F64:
    """(H, W, 4): the sum of both signals, and whether there is any."""
    color = (packet.direct[..., :3] + packet.indirect[..., :3]).astype(np.float64)
    there = np.isfinite(color).all(-1) & np.isfinite(packet.surface).all(-1) & (packet.surface[..., 3] > 0)
    finite = np.asarray(np.isfinite(color).all(-1))
    return np.where(finite[..., None], np.dstack([color, there]), 0.0)


class Oracle:
    """The filters of one frame; each takes and returns a sample (H, W, 4)."""

    def __init__(self, packet: FramePacket, config: Config) -> None:
        self.config, self.index = config, packet.index
        self.surface = packet.surface.astype(np.float64)
        self.gradient = packet.gradient.astype(np.float64)
        self.pixel_size = packet.pixel_size
        self.hit = np.isfinite(self.surface).all(-1) & (self.surface[..., 3] > 0)
        self.size = self.hit.shape[1], self.hit.shape[0]
        self.own = sample(packet)[..., :3]

    def run(self, denoiser: str, color: F64) -> F64:
        filters: dict[str, Callable[[F64], F64]] = {
            "gaussian": self.gaussian,
            "bilateral": self.bilateral,
            "joint": self.joint,
            "joint-separable": self.joint_separable,
            "atrous": self.atrous,
            "atrous-jitter": self.atrous_jitter,
            "guided": self.guided,
        }
        return filters[denoiser](color)

    def fetch(self, image: F64, dx: F64 | int, dy: F64 | int) -> tuple[F64, NDArray[np.bool_]]:
        """``image`` that many pixels further, and where that is inside."""
        y, x = np.mgrid[: image.shape[0], : image.shape[1]]
        x, y = x + dx, y + dy
        inside = (x >= 0) & (x < self.size[0]) & (y >= 0) & (y < self.size[1])
        xi, yi = np.clip(x, 0, self.size[0] - 1), np.clip(y, 0, self.size[1] - 1)
        return image[yi.astype(int), xi.astype(int)], inside

    def mean(self, color: F64, taps: Iterable[tuple[F64 | int, F64 | int, F64]]) -> tuple[F64, F64]:
        """Σ w c / Σ w, and Σ w; ``taps``: offsets and w, each a number or (H, W)."""
        total, weights = np.zeros((*self.hit.shape, 3)), np.zeros(self.hit.shape)
        for dx, dy, weight in taps:
            c, inside = self.fetch(color, dx, dy)
            w = np.where(inside, weight, 0.0) * c[..., 3]
            total += w[..., None] * c[..., :3]
            weights += w
        return total / np.where(weights > 0, weights, 1.0)[..., None], weights

    def done(self, mean: F64, weights: F64) -> F64:
        there = self.hit & (weights > 0)
        own = np.dstack([self.own, np.zeros(there.shape)])
        return np.where(there[..., None], np.dstack([mean, np.ones(there.shape)]), own)

    def edges(self, dx: F64 | int, dy: F64 | int) -> F64:
        """w_z w_n of a tap, 0 where the guides are not finite."""
        p = self.config.spatial
        other, _ = self.fetch(self.surface, dx, dy)
        with np.errstate(all="ignore"):
            slope = np.abs(self.gradient[..., 0] * dx + self.gradient[..., 1] * dy)
            width = 0.1 * self.pixel_size * self.surface[..., 3]
            range_ = p.sigma_z * slope + width * np.hypot(dx, dy) + 1e-30
            cosine = np.einsum("hwk,hwk->hw", self.surface[..., :3], other[..., :3])
            weight = np.maximum(cosine, 0.0) ** p.sigma_n * np.exp(
                -np.abs(self.surface[..., 3] - other[..., 3]) / range_
            )
        own = (np.asarray(dx) == 0) & (np.asarray(dy) == 0)
        return np.where(own, 1.0, np.where(np.isfinite(weight), weight, 0.0))

    def window(self, sigma: float, axes: str = "xy") -> Iterable[tuple[int, int, float]]:
        radius = math.ceil(3 * sigma)
        span = range(-radius, radius + 1)
        for dy in span if "y" in axes else (0,):
            for dx in span if "x" in axes else (0,):
                yield dx, dy, math.exp(-0.5 * (dx * dx + dy * dy) / sigma**2)

    def gaussian(self, color: F64) -> F64:
        return self.done(
            *self.mean(color, ((x, y, np.array(w)) for x, y, w in self.window(self.config.gaussian.sigma_d)))
        )

    def bilateral(self, color: F64) -> F64:
        p = self.config.bilateral

        def taps() -> Iterable[tuple[int, int, F64]]:
            for x, y, w in self.window(p.sigma_d):
                off = ((self.fetch(color, x, y)[0] - color)[..., :3] ** 2).sum(-1)
                yield x, y, w * np.where(color[..., 3] > 0, np.exp(-off / (2 * p.sigma_r**2)), 1.0)

        return self.done(*self.mean(color, taps()))

    def joint(self, color: F64) -> F64:
        taps = ((x, y, w * self.edges(x, y)) for x, y, w in self.window(self.config.joint.sigma_d))
        return self.done(*self.mean(color, taps))

    def joint_separable(self, color: F64) -> F64:
        sigma = self.config.joint.sigma_d
        mean, weights = self.mean(color, ((x, y, w * self.edges(x, y)) for x, y, w in self.window(sigma, "x")))
        weights = np.where(self.hit, weights, 0.0) / sum(w for _, _, w in self.window(sigma, "x"))
        rows = np.dstack([mean, weights])
        return self.done(*self.mean(rows, ((x, y, w * self.edges(x, y)) for x, y, w in self.window(sigma, "y"))))

    def atrous(self, color: F64) -> F64:
        for i in range(self.config.atrous.iterations):
            offsets = [(x << i, y << i, KERNEL[abs(x)] * KERNEL[abs(y)]) for y in range(-2, 3) for x in range(-2, 3)]
            color = self.iteration(color, i, offsets)
        return color

    def iteration(self, color: F64, i: int, offsets: Iterable[tuple[F64 | int, F64 | int, float]]) -> F64:
        p = self.config.atrous
        sigma = p.sigma_l * (0.5**i if p.halve else 1.0)

        def taps() -> Iterable[tuple[F64 | int, F64 | int, F64]]:
            for x, y, kernel in offsets:
                off = np.abs((self.fetch(color, x, y)[0] - color)[..., :3] @ REC_709)
                stop = np.where(color[..., 3] > 0, np.exp(-off / sigma), 1.0)
                own = (np.asarray(x) == 0) & (np.asarray(y) == 0)
                yield x, y, np.where(own, 1.0, self.edges(x, y) * stop) * kernel

        return self.done(*self.mean(color, taps()))

    def atrous_jitter(self, color: F64) -> F64:
        for i in range(self.config.atrous.iterations):
            draws = draw(self.size, 8 * self.index + i, i, self.config.atrous.taps)
            color = self.iteration(color, i, [(0, 0, 1.0), *draws])
        return color

    def guided(self, color: F64) -> F64:
        """He et al. 2010, eq. 5, 6 and 8, with whole windows, and with the guides as they are."""
        p = self.config.guided
        guide = np.where(self.hit[..., None], np.nan_to_num(self.surface), 0.0)
        there = color[..., 3]

        def box(image: F64, mask: F64) -> F64:
            """Mean of ``image`` (H, W, C) over the window where ``mask`` is."""
            total, count = np.zeros_like(image), np.zeros(mask.shape)
            for dy in range(-p.radius, p.radius + 1):
                for dx in range(-p.radius, p.radius + 1):
                    (values, inside), (m, _) = self.fetch(image, dx, dy), self.fetch(mask, dx, dy)
                    total += (inside * m)[..., None] * values
                    count += inside * m
            self.count = count
            return total / np.maximum(count, 1.0)[..., None]

        shape = self.hit.shape
        g, c = box(guide, there), box(color[..., :3], there)
        known = (self.count > 0) & self.hit
        square = box(np.einsum("hwi,hwj->hwij", guide, guide).reshape(*shape, 16), there).reshape(*shape, 4, 4)
        cross = box(np.einsum("hwi,hwj->hwij", guide, color[..., :3]).reshape(*shape, 12), there).reshape(*shape, 4, 3)
        scale = np.ones((*shape, 4))
        scale[..., 3] = 1.0 / np.where(self.hit, self.pixel_size * guide[..., 3] * p.radius, 1.0)
        covariance = (square - np.einsum("hwi,hwj->hwij", g, g)) * np.einsum("hwi,hwj->hwij", scale, scale)
        right = (cross - np.einsum("hwi,hwj->hwij", g, c)) * scale[..., None]
        slopes = np.linalg.solve(covariance + p.epsilon * np.eye(4), right) * scale[..., None]
        constant = c - np.einsum("hwij,hwi->hwj", slopes, g)
        mask = known.astype(np.float64)
        slopes = box(slopes.reshape(*shape, 12), mask).reshape(*shape, 4, 3)
        constant = box(constant, mask)
        result = np.einsum("hwij,hwi->hwj", slopes, guide) + constant
        return self.done(np.maximum(result, 0.0), self.count)


def draw(size: tuple[int, int], seed: int, i: int, count: int) -> list[tuple[F64, F64, float]]:
    """The taps that iteration ``i`` of atrous-jitter draws in an image of ``size``: dx, dy (H, W), weight."""

    def mix(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
        for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
            x = ((x ^ (x >> np.uint64(shift))) * np.uint64(factor)) & np.uint64(0xFFFFFFFF)
        return x ^ (x >> np.uint64(16))

    py, px = np.mgrid[: size[1], : size[0]].astype(np.uint64)
    x = mix((mix((np.uint64(seed * 65536) + px) & np.uint64(0xFFFFFFFF)) + py) & np.uint64(0xFFFFFFFF))
    y = mix(x)
    coins = np.repeat([-2, -1, 0, 1, 2], [1, 4, 6, 4, 1])
    found = []
    for k in range(count):
        d = [
            (coins[(u >> np.uint64(28)).astype(int)] << i)
            + ((u >> np.uint64(12)).astype(int) & ((1 << i) - 1))
            - (1 << i) // 2
            for u in (x, y)
        ]
        sign = 1 if k % 2 == 0 else -1
        found.append((sign * d[0], sign * d[1], 1.0))
        x = (x + np.uint64(3242174889)) & np.uint64(0xFFFFFFFF)
        y = (y + np.uint64(2447445414)) & np.uint64(0xFFFFFFFF)
    return found
