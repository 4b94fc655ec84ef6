"""SVGF in NumPy and double precision, from the papers and the docstrings of gl/passes; the shaders must agree with it.

Images are (H, W, C) float64. ``store`` is what happens to a value on its way into a texture of half precision: rounding
to the nearest half, or nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from config import Svgf
from raytrace.frame import FramePacket

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Store = Callable[[F64], F64]

REC_709 = np.array([0.2126, 0.7152, 0.0722])


def to_half(values: F64) -> F64:
    return values.astype(np.float16).astype(np.float64)


def exact(values: F64) -> F64:
    return values


def gather(image: F64, x: I64, y: I64) -> tuple[F64, NDArray[np.bool_]]:
    """``image`` at integer coordinates (H, W), and which of them are inside."""
    height, width = image.shape[:2]
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return image[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)], inside


@dataclass
class Surfaces:
    """What is remembered of a frame's surfaces: normal, depth, object id, history length h, cosine to the view ray."""

    normal: F64
    depth: F64
    ids: F64
    length: F64
    cosine: F64


@dataclass
class Found:
    """Where each pixel was in the last frame: N, and the weight of every texel that may be used.

    ``taps``: (x, y, weight), each (H, W); weights are not normalised.
    """

    length: F64
    taps: list[tuple[I64, I64, F64]]

    def fetch(self, image: F64) -> F64:
        total = np.zeros(self.length.shape)
        result = np.zeros_like(image)
        for x, y, weight in self.taps:
            values, _ = gather(image, x, y)
            result += weight[..., None] * values
            total += weight
        return np.asarray(result / np.where(total > 0, total, 1.0)[..., None])


@dataclass
class Signal:
    """Histories of one of the filtered signals: filtered colour, raw moments."""

    color: F64
    moments: F64


@dataclass
class Oracle:
    """Frame after frame: :meth:`step`."""

    p: Svgf
    store: Store = exact
    surfaces: Surfaces | None = None
    signals: dict[str, Signal] = field(default_factory=dict)
    _shape: dict[tuple[int, int], tuple[I64, I64, F64, F64]] = field(default_factory=dict)

    def step(self, packet: FramePacket) -> F64:
        """(H, W, 3) filtered radiance of the next frame."""
        p = self.p
        self._shape.clear()
        scale = 1.0 if p.demodulate else packet.albedo[..., :3].astype(np.float64)
        noisy = {name: getattr(packet, name)[..., :3].astype(np.float64) * scale for name in ("direct", "indirect")}
        if not p.separate:
            noisy = {"both": noisy["direct"] + noisy["indirect"]}
        found = self.reproject(packet)
        total = sum(self.filter(name, sample, found, packet) for name, sample in noisy.items())
        albedo = packet.albedo[..., :3] if p.demodulate else 1.0
        return np.asarray(total * albedo + packet.emission[..., :3])

    # ------------------------------------------------------------------------------------------- sec. 4.1, in time

    def reproject(self, packet: FramePacket) -> Found:
        """Texels of the last frame that saw the same surface; remembers this frame's surfaces."""
        p = self.p
        normal = packet.surface[..., :3].astype(np.float64)
        depth = packet.surface[..., 3].astype(np.float64)
        gradient = packet.gradient.astype(np.float64)
        motion = packet.motion.astype(np.float64)
        height, width = depth.shape
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.linalg.norm(gradient, axis=-1) / (packet.pixel_size * depth)
        cosine = np.maximum(1 / np.sqrt(1 + np.nan_to_num(slope) ** 2), 0.05)

        grid_y, grid_x = np.mgrid[:height, :width]
        at = np.stack([grid_x, grid_y], -1) + motion[..., :2] * (width, height)
        found = Found(np.zeros((height, width)), [])
        if self.surfaces is not None:
            hit = (motion[..., 3] >= 0) & (motion[..., 2] > 0)
            found = self._find(at, motion, gradient, normal, hit, cosine)
        found.length = np.minimum(found.length, p.max_history - 1)
        self.surfaces = Surfaces(normal, depth, motion[..., 3], found.length + 1, cosine)
        return found

    def _find(self, at: F64, motion: F64, gradient: F64, normal: F64, hit: NDArray[np.bool_], cosine: F64) -> Found:
        before = self.surfaces
        assert before is not None

        def usable(x: I64, y: I64) -> NDArray[np.bool_]:
            ids, inside = gather(before.ids, x, y)
            expected = motion[..., 2] + gradient[..., 0] * (x - at[..., 0]) + gradient[..., 1] * (y - at[..., 1])
            limit = self.p.depth_tolerance * motion[..., 2] + np.abs(gradient).sum(-1)
            same_depth = np.abs(gather(before.depth, x, y)[0] - expected) <= limit
            facing = np.einsum("hwk,hwk->hw", gather(before.normal, x, y)[0], normal)
            same = (ids == motion[..., 3]) & same_depth & (facing >= self.p.normal_tolerance)
            return np.asarray(hit & inside & same)

        corner = np.floor(at).astype(np.int64)
        f = at - corner
        bilinear = []
        for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
            x, y = corner[..., 0] + dx, corner[..., 1] + dy
            weight = (f[..., 0] if dx else 1 - f[..., 0]) * (f[..., 1] if dy else 1 - f[..., 1])
            bilinear.append((x, y, np.where(usable(x, y) & (weight > 1e-4), weight, 0.0)))
        total = np.sum([weight for _, _, weight in bilinear], axis=0)
        nearest = np.floor(at + 0.5).astype(np.int64)
        around = [(nearest[..., 0] + dx, nearest[..., 1] + dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
        rescue = [(x, y, np.where(usable(x, y) & (total == 0), 1.0, 0.0)) for x, y in around]
        found = Found(np.zeros(total.shape), [*bilinear, *rescue])
        length = found.fetch(before.length[..., None])[..., 0]
        length *= np.where(total > 0, np.sqrt(np.minimum(total, 1.0)), 1.0)
        ratio = np.clip((found.fetch(before.cosine[..., None])[..., 0] / cosine - 0.4) / 0.4, 0, 1)
        length *= ratio * ratio * (3 - 2 * ratio)
        found.length = np.floor(length + 0.5)
        found.taps = [(x, y, np.where(found.length >= 1, weight, 0.0)) for x, y, weight in found.taps]
        return found

    def accumulate(self, sample: F64, moments: F64, history: Signal | None, found: Found) -> tuple[F64, F64]:
        """Running mean until the share of the new sample has fallen to alpha, exponential from then on."""
        if history is None:
            return sample, moments
        before = found.fetch(history.color)
        if self.p.color_clamp:
            before = np.clip(before, *self.bounds(sample))
        share = 1 / (found.length + 1)
        for_color = np.where(found.length > 0, np.maximum(share, self.p.alpha), 1.0)[..., None]
        for_moments = np.where(found.length > 0, np.maximum(share, self.p.alpha_moments), 1.0)[..., None]
        color = for_color * sample + (1 - for_color) * before
        return color, for_moments * moments + (1 - for_moments) * found.fetch(history.moments)

    def bounds(self, sample: F64) -> tuple[F64, F64]:
        """Mean of 7x7 pixels, fewer at the borders, minus and plus so many of their standard deviations."""
        padded = np.pad(sample, ((3, 3), (3, 3), (0, 0)), constant_values=np.nan)
        window = np.lib.stride_tricks.sliding_window_view(padded, (7, 7), axis=(0, 1))
        mean = np.nanmean(window, axis=(3, 4))
        reach = self.p.color_clamp_sigma * np.nanstd(window, axis=(3, 4))
        return self.store(mean - reach), self.store(mean + reach)

    # ------------------------------------------------------------------------------------ sec. 4.2 to 4.4, in space

    def filter(self, name: str, sample: F64, found: Found, packet: FramePacket) -> F64:
        """One signal through accumulation, variance and wavelet; keeps its history."""
        luminance = sample @ REC_709
        moments = np.stack([luminance, luminance**2], -1)
        color, moments = self.accumulate(sample, moments, self.signals.get(name), found)
        color = self.store(color)
        in_time = np.maximum(moments[..., 1] - moments[..., 0] ** 2, 0.0)
        length = found.length + 1
        in_space = self.spatial_variance(moments, packet) * 4 / length
        sky = packet.motion[..., 3] < 0
        deviation = self.store(np.sqrt(np.where((length < 4) & ~sky, in_space, in_time)))
        history = color
        if self.p.prefilter and self.p.variance_guided:
            smooth = self.store(self.spatial_mean(color, packet))
            color = np.where(((length < 4) & ~sky)[..., None], smooth, color)
        for i in range(self.p.iterations):
            color, deviation = self.atrous(color, deviation, packet, i, found.length + 1)
            if i == self.p.feedback:
                history = color
        self.signals[name] = Signal(history, moments)
        return color

    def _neighbour(self, packet: FramePacket, dx: int, dy: int) -> tuple[I64, I64, F64, F64]:
        """Where an offset leads, w_z there, which is 0 outside of the picture, and the cosine between the normals."""
        if (dx, dy) not in self._shape:
            normal = packet.surface[..., :3].astype(np.float64)
            depth = packet.surface[..., 3].astype(np.float64)
            gradient = packet.gradient.astype(np.float64)
            y, x = np.mgrid[: depth.shape[0], : depth.shape[1]] + np.array([dy, dx])[:, None, None]
            z, inside = gather(depth, x, y)
            cosine = np.maximum(np.einsum("hwk,hwk->hw", gather(normal, x, y)[0], normal), 0.0)
            slope = np.abs(gradient[..., 0] * dx + gradient[..., 1] * dy)
            reach = self.p.sigma_z * slope + 0.1 * packet.pixel_size * depth * np.hypot(dx, dy) + 1e-30
            self._shape[dx, dy] = x, y, np.where(inside, np.exp(-np.abs(z - depth) / reach), 0.0), cosine
        return self._shape[dx, dy]

    def spatial_mean(self, image: F64, packet: FramePacket) -> F64:
        """Of 7x7 pixels, weighted by depth and normal."""
        window = [(dx, dy) for dy in range(-3, 4) for dx in range(-3, 4)]
        total = np.zeros((*image.shape[:2], 1))
        mean = np.zeros_like(image)
        for dx, dy in window:
            x, y, w_z, cosine = self._neighbour(packet, dx, dy)
            weight = (w_z * cosine**128)[..., None]
            mean += weight * gather(image, x, y)[0]
            total += weight
        return np.asarray(mean / np.where(total > 0, total, 1.0))

    def spatial_variance(self, moments: F64, packet: FramePacket) -> F64:
        mean = self.spatial_mean(moments, packet)
        return np.maximum(mean[..., 1] - mean[..., 0] ** 2, 0.0)

    def atrous(self, color: F64, deviation: F64, packet: FramePacket, number: int, length: F64) -> tuple[F64, F64]:
        """Iteration ``number``; what is carried is the standard deviation."""
        p = self.p
        step = 1 << number
        luminance = color @ REC_709
        padded = np.pad(deviation**2, 1, mode="edge")
        height, width = deviation.shape
        blur = np.outer((0.25, 0.5, 0.25), (0.25, 0.5, 0.25))
        blurred = np.sum([blur[y, x] * padded[y : y + height, x : x + width] for y, x in np.ndindex(3, 3)], axis=0)
        tolerance = p.sigma_l * (p.first_sigma_l if number == 0 else 1.0)
        reach = tolerance * np.sqrt(blurred) + 1e-6
        exponent = np.full(length.shape, float(p.sigma_n))
        if p.normal_history:
            exponent = np.maximum(exponent * np.minimum(length / p.normal_history, 1.0), 1.0)
        spline = np.array([1, 4, 6, 4, 1]) / 16
        # The centre counts in full, whatever its surface.
        total = np.full(deviation.shape, spline[2] ** 2)
        result = color * spline[2] ** 2
        variance = (deviation * spline[2] ** 2) ** 2
        for j, i in np.ndindex(5, 5):
            if (i, j) == (2, 2):
                continue
            x, y, w_z, cosine = self._neighbour(packet, (i - 2) * step, (j - 2) * step)
            weight = spline[i] * spline[j] * w_z * cosine**exponent
            if p.variance_guided:
                weight = weight * np.exp(-np.abs(gather(luminance, x, y)[0] - luminance) / reach)
            result += weight[..., None] * gather(color, x, y)[0]
            variance += weight**2 * gather(deviation, x, y)[0] ** 2
            total += weight
        if number == 0 and p.accumulated_variance:  # of the mean of so many samples, no more that of one
            variance *= np.maximum(1 / length, p.alpha / (2 - p.alpha))
        return self.store(result / total[..., None]), self.store(np.sqrt(variance) / total)
