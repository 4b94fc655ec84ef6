"""A-SVGF in NumPy and double precision, from the paper and docs/asvgf.md; the shaders must agree with it.

Images of strata are (rows, columns, C) float64.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from config import Asvgf
from raytrace.frame import STRATUM, FramePacket
from tests.passes.room import room
from tests.passes.svgf_oracle import F64, REC_709, Found, Oracle, Signal, gather, to_half

FLOOR = 1e-3
LARGEST_FACTOR = 4.0
REACH, STRANGER = 4.5, 1e-4


def with_gradients(packet: FramePacket, seed: int, changed: float = 0.3) -> FramePacket:
    """``packet`` with made-up samples of change in two thirds of its strata, ``changed`` of the light on the average.

    The samples that were carried over are marked, as the tracer does.
    """
    width, height = packet.size
    rows, columns = -(-height // STRATUM), -(-width // STRATUM)
    random = np.random.default_rng(seed)
    there = random.random((rows, columns)) < 2 / 3
    then = random.exponential(1.0, (rows, columns, 2))
    now = then * (1 + changed * (random.random((rows, columns, 2)) - 0.7))
    now[random.random((rows, columns, 2)) < 0.3] = 0.0
    values = np.stack([now - then, np.maximum(now, then)], -1).reshape(rows, columns, 4) * there[..., None]
    direct, indirect = packet.direct.copy(), packet.indirect.copy()
    for row, column in np.argwhere(there):
        y, x = (
            min(STRATUM * row + random.integers(3), height - 1),
            min(STRATUM * column + random.integers(3), width - 1),
        )
        direct[y, x, 3] = indirect[y, x, 3] = 0.0
    return replace(packet, direct=direct, indirect=indirect, temporal_gradient=values.astype(np.float32))


def changing_room(index: int, size: tuple[int, int], changed: float = 0.3) -> FramePacket:
    """A frame of the flight through the small room, with :func:`with_gradients`."""
    return with_gradients(room(index, size), 100 + index, changed)


@dataclass
class Strata:
    """What the strata of a frame show."""

    surface: F64
    slope: F64
    light: F64

    @staticmethod
    def of(packet: FramePacket, joint: bool, only: F64 | None = None) -> Strata:
        """``only``: (H, W, 3) the one signal that is looked at; otherwise direct and indirect light."""
        width, height = packet.size
        rows, columns = -(-height // STRATUM), -(-width // STRATUM)
        surface, slope, light = np.zeros((rows, columns, 4)), np.zeros((rows, columns, 2)), np.zeros((rows, columns, 4))
        luminance = np.stack(
            [getattr(packet, n)[..., :3].astype(np.float64) @ REC_709 for n in ("direct", "indirect")], -1
        )
        if only is not None:
            luminance = np.stack([only @ REC_709, np.zeros((height, width))], -1)
        elif joint:
            luminance = np.stack([luminance.sum(-1), np.zeros((height, width))], -1)
        for row, column in np.ndindex(rows, columns):
            top, left = STRATUM * row, STRATUM * column
            part = (slice(top, top + STRATUM), slice(left, left + STRATUM))
            marked = np.argwhere(packet.direct[part][..., 3] == 0.0)
            y, x = marked[-1] + (top, left) if len(marked) else (min(top + 1, height - 1), min(left + 1, width - 1))
            surface[row, column], slope[row, column] = packet.surface[y, x], packet.gradient[y, x]
            values = luminance[part].reshape(-1, 2)
            light[row, column, ::2], light[row, column, 1::2] = values.mean(0), values.var(0)
        return Strata(surface, slope, light)


def joined(change: F64) -> F64:
    """Direct and indirect as one signal."""
    delta, larger = change[..., ::2], change[..., 1::2]
    now = np.where(delta > 0, larger, larger + delta).sum(-1)
    then = np.where(delta > 0, larger - delta, larger).sum(-1)
    zero = np.zeros(now.shape)
    return np.stack([now - then, np.maximum(now, then), zero, zero], -1)


def spread(change: F64, strata: Strata, step: int, p: Asvgf, pixel_size: float) -> F64:
    """One iteration of the wavelet over the strata."""
    rows, columns = change.shape[:2]
    y, x = np.mgrid[:rows, :columns]
    normal, depth = strata.surface[..., :3], strata.surface[..., 3]
    mean, variance = strata.light[..., ::2], strata.light[..., 1::2] / 9
    padded = np.pad(variance, ((1, 1), (1, 1), (0, 0)), mode="edge")
    blur = np.outer((0.25, 0.5, 0.25), (0.25, 0.5, 0.25))
    blurred = sum(blur[j, i] * padded[j : j + rows, i : i + columns] for j, i in np.ndindex(3, 3))
    reach = p.gradient_sigma_l * np.sqrt(blurred) + 1e-6
    total, result = np.zeros((rows, columns, 2)), np.zeros(change.shape)
    for dy, dx in np.ndindex(3, 3):
        away = (np.array([dx, dy]) - 1) * step
        there = (x + away[0], y + away[1])
        surface, inside = gather(strata.surface, *there)
        distance = STRATUM * away
        range_ = p.sigma_z * np.abs(strata.slope @ distance) + 0.1 * pixel_size * depth * np.hypot(*distance) + 1e-30
        cosine = np.maximum(np.einsum("hwk,hwk->hw", surface[..., :3], normal), 0.0)
        weight = (1.0 if dx == 1 else 0.5) * (1.0 if dy == 1 else 0.5) * cosine**p.sigma_n
        weight = (weight * np.exp(-np.abs(surface[..., 3] - depth) / range_) * inside)[..., None] * np.ones(2)
        if p.gradient_guided:
            weight = weight * np.exp(-np.abs(gather(mean, *there)[0] - mean) / reach)
        if (dx, dy) == (1, 1):
            weight = np.ones(weight.shape)
        result += np.repeat(weight, 2, axis=-1) * gather(change, *there)[0]
        total += weight
    return np.asarray(result / np.repeat(total, 2, axis=-1))


def relative(change: F64) -> F64:
    """Of both signals in parts of the larger of now and then."""
    larger = np.maximum(change[..., 1::2], FLOOR * change[..., 1::2].sum(-1, keepdims=True))
    return np.asarray(np.clip(change[..., ::2] / np.maximum(larger, 1e-30), -1.0, 1.0))  # single precision ends there


def void_and_factor(change: F64, strata: Strata, packet: FramePacket, p: Asvgf) -> F64:
    """λ of both signals, and the factors by which they have changed, for every pixel."""
    width, height = packet.size
    y, x = np.mgrid[:height, :width]
    normal, depth = packet.surface[..., :3].astype(np.float64), packet.surface[..., 3].astype(np.float64)
    slope = np.abs(packet.gradient.astype(np.float64))
    total, widest = np.zeros((height, width, 4)), np.zeros((height, width, 2))
    for dy, dx in np.ndindex(3, 3):
        at = x // STRATUM + dx - 1, y // STRATUM + dy - 1
        values, inside = gather(change, *at)
        surface, _ = gather(strata.surface, *at)
        away = np.abs(np.stack([STRATUM * at[0] + 1 - x, STRATUM * at[1] + 1 - y], -1)).astype(np.float64)
        floor = 0.1 * packet.pixel_size * depth * (np.linalg.norm(away, axis=-1) + 1)
        range_ = p.sigma_z * (slope * (away + 1)).sum(-1) + floor + 1e-30
        cosine = np.maximum(np.einsum("hwk,hwk->hw", surface[..., :3], normal), 0.0)
        likeness = cosine**p.sigma_n * np.exp(-np.abs(surface[..., 3] - depth) / range_)
        near = np.maximum(1 - away / REACH, 0.0).prod(-1)
        total += (inside * near * (likeness + STRANGER))[..., None] * values
        widest = np.maximum(widest, np.abs(relative(values)) * inside[..., None])
    whole = relative(total)
    share = np.minimum(p.gain * (widest if p.widen else np.abs(whole)), 1.0)
    factor = np.ones(whole.shape)
    if p.follow:
        factor = np.where(whole < 0, 1 + whole, 1 / np.maximum(1 - whole, 1 / LARGEST_FACTOR))
    return np.concatenate([share, factor], -1)


@dataclass
class AdaptiveOracle(Oracle):
    """SVGF whose histories follow the light: :meth:`step` for a frame with gradients."""

    lambdas: F64 = field(default_factory=lambda: np.zeros(0))
    steps: dict[str, F64] = field(default_factory=dict)
    left: dict[str, F64] = field(default_factory=dict)
    carried: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))
    _signal: str = ""

    def step(self, packet: FramePacket) -> F64:
        p = self.p
        assert isinstance(p, Asvgf)
        assert packet.temporal_gradient is not None
        self.carried = packet.direct[..., 3] == 0.0
        strata = Strata.of(packet, not p.separate)
        change = packet.temporal_gradient.astype(np.float64)
        if not p.separate:
            change = joined(change)
        self.steps = {"surface": strata.surface, "slope": strata.slope, "light": strata.light}
        for i in range(p.gradient_iterations):
            change = self.steps[f"gradient{i}"] = spread(change, strata, 1 << i, p, packet.pixel_size)
        self.lambdas = self.steps["lambda"] = void_and_factor(change, strata, packet, p)
        if self.store is to_half:
            self.lambdas = to_half(self.lambdas)
        return super().step(packet)

    def filter(self, name: str, sample: F64, found: Found, packet: FramePacket) -> F64:
        self._signal = name
        return super().filter(name, sample, Found(found.length.copy(), found.taps), packet)

    def accumulate(self, sample: F64, moments: F64, history: Signal | None, found: Found) -> tuple[F64, F64]:
        p, name = self.p, self._signal
        assert isinstance(p, Asvgf)
        common = found.length
        if history is None:
            self.left[name] = np.ones(common.shape)
            return sample, moments
        channel = int(name == "indirect")
        void, factor = self.lambdas[..., channel], self.lambdas[..., 2 + channel]
        known = common > 0
        length = common * found.fetch(self.left[name][..., None])[..., 0]
        before = found.fetch(history.color)
        if p.color_clamp:
            before = np.clip(before, *self.bounds(sample))
        before = before * factor[..., None]
        then = found.fetch(history.moments) * np.stack([factor, factor**2], -1)
        if p.cut == "power":
            length = length * (1 - void) ** p.power
        share = 1 / (length + 1)

        news = np.where(self.carried & known, void, 1.0)  # what was carried over is in the history already

        def weight(smallest: float) -> NDArray[np.float64]:
            usual = np.maximum(share, smallest)
            return np.asarray(np.where(known, news * (usual + (1 - usual) * void), 1.0))[..., None]

        color = weight(p.alpha) * sample + (1 - weight(p.alpha)) * before
        moments = weight(p.alpha_moments) * moments + (1 - weight(p.alpha_moments)) * then
        if p.cut == "harmonic":
            length = (length + 1) / (1 + void * length) - 1
        length = np.where(known, length, 0.0)
        self.left[name] = (length + news) / (common + 1)
        found.length = np.maximum(length + news - 1, 0.0)
        return color, moments
