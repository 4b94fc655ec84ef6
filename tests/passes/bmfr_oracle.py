"""BMFR in NumPy and double precision, from the paper and the docstrings of gl/passes; the shaders must agree with it.

Images are (H, W, C) float64. The least squares are LAPACK's, by singular values.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import Bmfr
from gl.passes.bmfr import OFFSETS
from raytrace.frame import FramePacket
from tests.passes.svgf_oracle import Store, exact, gather

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U32 = NDArray[np.uint32]
Mask = NDArray[np.bool_]
Taps = list[tuple[I64, I64, F64]]
"""x, y and weight, each (H, W), of the texels to blend with."""


@dataclass
class Memory:
    """What is kept of a frame: accumulated irradiance and the number of samples in it, fits, surfaces."""

    color: F64
    count: F64
    fitted: F64
    normal: F64
    depth: F64


@dataclass
class Oracle:
    """Frame after frame: :meth:`step`. ``store``: what happens to colours on their way into a texture."""

    p: Bmfr
    store: Store = exact
    memory: Memory | None = None

    def step(self, packet: FramePacket) -> F64:
        """(H, W, 3) filtered radiance of the next frame."""
        sample = (packet.direct[..., :3] + packet.indirect[..., :3]).astype(np.float64)
        normal, depth = packet.surface[..., :3].astype(np.float64), packet.surface[..., 3].astype(np.float64)
        history, taps = self.find(packet)
        hit = packet.motion[..., 3] >= 0
        color = self.store(self.blend(sample, "color", history, taps, self.p.alpha))
        count = np.where(hit, np.floor(history + 1.5), 0.0)
        fit = self.store(fitted(color, count > 0, packet, self.p))
        clean = self.store(self.blend(fit, "fitted", history, taps, self.p.alpha_fit))
        self.memory = Memory(color, count, clean, normal, depth)
        return np.asarray(clean * packet.albedo[..., :3] + packet.emission[..., :3])

    def find(self, packet: FramePacket) -> tuple[F64, Taps]:
        """N, and the four texels with their weights, 0 where another surface was seen."""
        height, width = packet.surface.shape[:2]
        if self.memory is None:
            return np.zeros((height, width)), []
        motion = packet.motion.astype(np.float64)
        normal = (packet.surface if packet.prev_normal is None else packet.prev_normal)[..., :3].astype(np.float64)
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1)
        at = grid + motion[..., :2] * (width, height)
        rays = directions(packet)
        cosine = np.abs(np.einsum("hwk,hwk->hw", rays, packet.surface[..., :3])) / np.linalg.norm(rays, axis=-1)
        limit = self.p.position_tolerance * packet.pixel_size * motion[..., 2] / np.maximum(cosine, 0.05)

        def in_view(place: F64, z: F64) -> F64:
            across = (place + 0.5 - np.array([width, height]) / 2) * packet.pixel_size
            return np.concatenate([across, np.ones_like(z)[..., None]], -1) * z[..., None]

        expected = in_view(at, motion[..., 2])
        corner = np.floor(at).astype(np.int64)
        f = at - corner
        taps, lengths, total = [], np.zeros((height, width)), np.zeros((height, width))
        for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
            x, y = corner[..., 0] + dx, corner[..., 1] + dy
            count, inside = gather(self.memory.count, x, y)
            moved = in_view(np.stack([x, y], -1), gather(self.memory.depth, x, y)[0]) - expected
            turned = gather(self.memory.normal, x, y)[0] - normal
            same = (np.linalg.norm(moved, axis=-1) <= limit) & ((turned**2).sum(-1) <= self.p.normal_tolerance)
            weight = (f[..., 0] if dx else 1 - f[..., 0]) * (f[..., 1] if dy else 1 - f[..., 1])
            seen = inside & same & (count > 0) & (weight > 1e-4) & (motion[..., 3] >= 0) & (motion[..., 2] > 0)
            taps.append((x, y, np.where(seen, weight, 0.0)))
            lengths += taps[-1][2] * count
            total += taps[-1][2]
        history = np.minimum(lengths / np.where(total > 0, total, 1.0), self.p.max_history - 1)
        return np.floor(history + 0.5) if self.p.round_history else history, taps

    def blend(self, new: F64, kept: str, history: F64, taps: Taps, alpha: float) -> F64:
        """``new`` and the image ``kept`` in memory; ``new`` alone where there is no history."""
        if self.memory is None:
            return new
        total = np.sum([weight for _, _, weight in taps], axis=0)
        old = sum(weight[..., None] * gather(getattr(self.memory, kept), x, y)[0] for x, y, weight in taps)
        share = np.where(total > 0, np.maximum(1 / (history + 1), alpha), 1.0)[..., None]
        return np.asarray(share * new + (1 - share) * old / np.where(total > 0, total, 1.0)[..., None])


def directions(packet: FramePacket, jitter: tuple[float, float] = (0.0, 0.0)) -> F64:
    """Camera rays of depth 1 through all pixels, world space."""
    height, width = packet.surface.shape[:2]
    right, up, forward = np.array(packet.basis, np.float64)
    x = (np.arange(width) + 0.5 + jitter[0] - width / 2) * packet.pixel_size
    y = (np.arange(height) + 0.5 + jitter[1] - height / 2) * packet.pixel_size
    return np.asarray(forward + x[None, :, None] * right + y[:, None, None] * up)


def fitted(color: F64, usable: Mask, packet: FramePacket, p: Bmfr) -> F64:
    """Every block of ``color`` by its features; 0 on misses. ``usable``: pixels that have a sample."""
    height, width = usable.shape
    position = directions(packet, packet.jitter) * packet.surface[..., 3:].astype(np.float64)
    result = np.zeros((height, width, 3))
    side = p.block
    corner = np.array(OFFSETS[packet.index % len(OFFSETS)]) * side // 32 - side // 2
    columns, lines = -(-width // side) + 1, -(-height // side) + 1
    for number in range(columns * lines):
        x0, y0 = corner + side * np.array([number % columns, number // columns])
        y, x = np.mgrid[y0 : y0 + side, x0 : x0 + side].reshape(2, -1)
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        at = mirrored(y, height), mirrored(x, width)
        hit = packet.surface[at][:, 3] > 0
        counts = hit & usable[at]
        features = features_of(packet, position, at, hit, p)
        noise = noise_of(packet.index, number, side, features.shape[1]) * p.noise
        noise[:, 0] = 0.0
        seen = features + (0 if p.regularization == "rank" else noise)
        kept = independent(seen[counts], 1e-7 if p.regularization == "noise" else p.rank_tolerance)
        weights = np.zeros((features.shape[1], 3))
        weights[kept] = np.linalg.lstsq(seen[counts][:, kept], color[at][counts])[0]
        fit = features @ weights
        for part in parts_of(p):
            own = counts[part]
            extra = refit(seen[part][own], color[at][part][own] - seen[part][own] @ weights, p)
            fit[part] = features[part] @ (weights + extra)
        fit = np.where(hit[:, None], np.maximum(fit, 0.0), 0.0)
        result[y[inside], x[inside]] = fit[inside]
    return result


def parts_of(p: Bmfr) -> list[I64]:
    """For each part of a block its elements, which count along x first."""
    if not p.part_side:
        return []
    y, x = np.mgrid[: p.block, : p.block].reshape(2, -1) // p.part_side
    number = y * (p.block // p.part_side) + x
    return [np.flatnonzero(number == part) for part in range(number.max() + 1)]


def refit(features: F64, rest: F64, p: Bmfr) -> F64:
    """(M, 3) weights that a part adds to the block's; ``features`` (pixels, M) and what is left of its colours there.

    The part's own least squares, shrunk by 1 - caution / F; F = (explained / M) / (unexplained / (pixels - M)) over
    all channels: caution 1 takes away what noise alone is expected to explain.
    """
    extra = np.zeros((features.shape[1], 3))
    kept = independent(features, 0.0 if p.regularization != "rank" else p.rank_tolerance) if len(features) else []
    freedom = len(features) - len(kept)
    if freedom <= len(kept):
        return extra
    own = np.linalg.lstsq(features[:, kept], rest)[0]
    explained, unexplained = ((features[:, kept] @ own) ** 2).sum(), ((rest - features[:, kept] @ own) ** 2).sum()
    if explained > 0.0:
        extra[kept] = own * max(1.0 - p.caution * (len(kept) / explained) * (unexplained / freedom), 0.0)
    return extra


def independent(features: F64, tolerance: float) -> list[int]:
    """Columns that are farther than ``tolerance``, root of the mean square, from all combinations of those before."""
    basis = np.empty((len(features), 0))
    kept = []
    for k, column in enumerate(features.T):
        rest = column
        for _ in range(2):  # once leaves rounding errors that the second time takes away
            rest = rest - basis @ (basis.T @ rest)
        length = np.linalg.norm(rest)
        if length > tolerance * np.sqrt(len(features)):
            basis = np.concatenate([basis, rest[:, None] / length], 1)
            kept.append(k)
    return kept


def features_of(packet: FramePacket, position: F64, at: tuple[I64, I64], hit: Mask, p: Bmfr) -> F64:
    """(pixels, M) features of a block; ``at``: its pixels, ``hit``: which of them see a surface."""
    surface = packet.surface[at].astype(np.float64)
    place = np.concatenate([position[at], surface[:, 3:]], -1)
    w = np.zeros_like(place)
    if hit.any():
        low, high = place[hit].min(0), place[hit].max(0)
        span = np.maximum(high - low, max((high - low)[:3].max() / 8, high[3] / 1024))
        w = (place - low) / span if p.unit_scale else (place - (low + high) / 2) * 2 / span
    known = {
        "1": np.ones((len(surface), 1)),
        "n": surface[:, :3],
        "w": w[:, :3],
        "w2": w[:, :3] ** 2,
        "w3": w[:, :3] ** 3,
        "albedo": packet.albedo[at][:, :3].astype(np.float64),
        "depth": w[:, 3:],
    }
    features = np.concatenate([known[name] for name in p.features.split(",")], 1)
    # A shift of a bounded feature does not change what can be fitted, only what the noise does to it.
    middle = p.block // 2 * p.block + p.block // 2
    start = 0
    for name in p.features.split(","):
        count = known[name].shape[1]
        if name in ("n", "albedo"):
            features[:, start : start + count] -= features[middle, start : start + count]
        start += count
    return np.asarray(features)


def mirrored(i: I64, size: int) -> I64:
    """Index into an image of ``size`` that goes on as its mirror image."""
    i = np.where(i < 0, -i - 1, i)
    return np.clip(np.where(i >= size, 2 * size - 1 - i, i), 0, size - 1)


def hashed(x: U32) -> U32:
    """Finalizer of Wellons, "lowbias32"."""
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        x = np.asarray((x ^ (x >> np.uint32(shift))) * np.uint32(factor), np.uint32)
    return np.asarray(x ^ (x >> np.uint32(16)), np.uint32)


def noise_of(frame: int, block: int, side: int, features: int) -> F64:
    """(pixels, M) uniform noise in [-1, 1)."""
    pixels = np.arange(side * side, dtype=np.uint32)
    with np.errstate(over="ignore"):
        state: U32 = hashed(hashed(np.array([frame], np.uint32)) + np.uint32(block * side * side) + pixels)
        values = np.empty((side * side, features))
        for k in range(features):
            state = np.asarray(state * np.uint32(1664525) + np.uint32(1013904223), np.uint32)
            values[:, k] = (state >> 8) / 2.0**23 - 1.0
    return values
