"""Frames and settings that the tests of BMFR share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from config import Bmfr, Config, Taa
from raytrace.frame import FramePacket
from tests.passes.harness import DEPTH, PIXEL_SIZE, Bench, Images, frame

F32 = NDArray[np.float32]

SIZE = (60, 44)
MODES = ("noise", "rank", "both")


def config(**changes: object) -> Config:
    return Config(bmfr=replace(Bmfr(block=32, part=0), **changes), taa=Taa(enabled=False))  # type: ignore[arg-type]


def run(bench: Bench, packet: FramePacket, index: int = 0, keep: tuple[str, ...] = (), **changes: object) -> Images:
    return bench.denoise(replace(packet, index=index), config(**changes), "bmfr", keep=keep)


def radiance(bench: Bench, packet: FramePacket, index: int = 0, **changes: object) -> F32:
    return run(bench, packet, index, (), **changes)["radiance"][..., :3]


def tilted(size: tuple[int, int] = SIZE, pixel_size: float = PIXEL_SIZE, depth: float = DEPTH) -> FramePacket:
    """A bumpy, slanting surface, whose features are all different."""
    y, x = np.mgrid[: size[1], : size[0]] / 20.0
    relief = 1 + 0.1 * x - 0.05 * y + 0.05 * np.sin(3 * x) * np.cos(2 * y)
    normal = np.stack([np.sin(2 * x), np.cos(3 * y), 2 + 0.3 * np.sin(x * y)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return frame(size, normal=normal, depth=depth * relief, pixel_size=pixel_size)


def positions(packet: FramePacket) -> NDArray[np.float64]:
    """(H, W, 3) relative to the camera, which looks along -z."""
    width, height = packet.size
    y, x = np.mgrid[:height, :width] + 0.5
    ray = np.stack([(x - width / 2) * packet.pixel_size, (y - height / 2) * packet.pixel_size, -np.ones_like(x)], -1)
    return np.asarray(ray * packet.surface[..., 3:].astype(np.float64))


def polynomial(packet: FramePacket, reach: float = 1.0) -> NDArray[np.float64]:
    """(H, W, 3) colours above 0 that are combinations of "1,n,w,w2"; positions in ``reach``."""
    w = positions(packet) / reach
    w -= w.mean(axis=(0, 1))
    features = np.concatenate([np.ones_like(w[..., :1]), packet.surface[..., :3], w, w * w], -1)
    weights = np.random.default_rng(3).uniform(-1, 1, (10, 3))
    colors = features @ weights
    return np.asarray(colors - colors.min() + 0.1)


def with_alpha(colors: ArrayLike) -> F32:
    values = np.asarray(colors, np.float32)
    return np.concatenate([values, np.ones_like(values[..., :1])], -1)
