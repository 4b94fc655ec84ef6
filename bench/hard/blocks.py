"""Blocks in which BMFR's features depend on each other, and blocks that are spoilt."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from bench.hard.stage import DEPTH, F32, F64, PIXEL_SIZE, SIZE, Row, Stage, number, wall, with_sky
from raytrace.frame import FramePacket

RANK_TEST: Final = 2e-3
"""Bound with the rank test alone: half precision of samples and fit, and what it neglects."""

INDICES: Final = (0, 3, 5)
"""Frames, each with the grid elsewhere: blocks end in the middle of the picture and far beyond its border."""


@dataclass(frozen=True)
class Block:
    """A frame whose light (H, W, 3) is a combination of the features that are named."""

    name: str
    packet: FramePacket
    light: F64
    features: str = "1,n,w,w2"
    bound: float = RANK_TEST


def measure(stage: Stage) -> list[Row]:
    """All blocks, fitted with the rank test alone and, for comparison, by normal equations in single precision."""
    return [_row(stage, block) for block in blocks()] + [_spoilt(stage, bad) for bad in (np.nan, np.inf)]


def blocks() -> list[Block]:
    """Every block of reduced rank."""
    oblique, curved = _oblique(), _curved()
    skew = _normals(1e-7)
    far_curved, far_flat = _curved(1e6, 1e3), wall(0.5, depth=1e6, pixel_size=1e-3 / (32 * 1e6))
    bright, dim = (scale * _polynomial(oblique) / _polynomial(oblique).max() for scale in (6e4, 1e-6))
    facing = wall(0.5)
    return [
        Block("block of constant features", facing, np.full((*SIZE[::-1], 3), 0.5)),
        Block("block of a plane of constant normal", oblique, _polynomial(oblique)),
        Block("block half outside the image", curved, _polynomial(curved)),
        Block("block 1000 wide at 1e6", far_curved, _polynomial(far_curved)),
        Block("block 0.001 wide at 1e6", far_flat, np.full((*SIZE[::-1], 3), 0.5)),
        Block("two equal features", curved, _polynomial(curved, "1,w"), "1,w,depth"),
        Block("two features equal to 1e-7", skew, _polynomial(skew, "1,n,w"), "1,n,w"),
        Block("block of radiance 6e4", oblique, bright),
        Block("block of radiance 1e-6", oblique, dim, bound=0.1),
        Block("block of sky", with_sky(facing, np.ones(SIZE[::-1], bool)), np.zeros((*SIZE[::-1], 3))),
    ]


def _row(stage: Stage, block: Block) -> Row:
    packet = replace(block.packet, direct=_with_alpha(block.light) * (block.packet.surface[..., 3:] > 0.0))
    largest = max(float(block.light.max()), 1e-30)
    shown = [_fit(stage, replace(packet, index=index), block.features) for index in INDICES]
    error = max(_error(image, block.light) for image in shown)
    return Row(
        case=block.name,
        method="bmfr, rank test",
        exact=f"≤ {number(largest)}" if block.light.any() else "0",
        error=error,
        bound=block.bound,
        unguarded=f"{_cholesky(block)} by normal equations",
        finite=bool(np.isfinite(shown).all()),
    )


def _spoilt(stage: Stage, bad: float) -> Row:
    """One pixel of a block is not finite: the others are fitted without it."""
    packet = _oblique()
    light = _polynomial(packet)
    samples = _with_alpha(light)
    samples[7, 9] = bad
    shown = _fit(stage, replace(packet, direct=samples), "1,n,w,w2")
    error = _error(shown, light)
    return Row(
        case=f"block with one pixel {number(bad)}",
        method="bmfr, rank test",
        exact=f"≤ {number(light.max())}",
        error=error,
        bound=RANK_TEST,
        unguarded="NaN in the whole block: every rotation mixes rows",
        finite=bool(np.isfinite(shown).all()),
    )


def _error(image: F32, light: F64) -> float:
    """Largest difference, in the largest light; infinite for what is not finite."""
    difference = np.abs(image.astype(np.float64) - light).max() / max(float(light.max()), 1e-30)
    return float(difference) if np.isfinite(difference) else float("inf")


def _fit(stage: Stage, packet: FramePacket, features: str) -> F32:
    """The first frame of a sequence: what the fit alone makes of it."""
    settings = (f'bmfr.features="{features}"', "bmfr.regularization=rank", "bmfr.part=0")
    return stage.sequence([packet], "bmfr", settings)[0]


def _with_alpha(light: F64) -> F32:
    return np.concatenate([light, np.ones_like(light[..., :1])], -1).astype(np.float32)


# ---------------------------------------------------------------------------------------------------------- surfaces


def _grid() -> tuple[F64, F64]:
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] / 20.0
    return y, x


def _oblique() -> FramePacket:
    """A plane: its positions have two dimensions, its normal is constant."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    ray = (x - SIZE[0] / 2) * PIXEL_SIZE, (y - SIZE[1] / 2) * PIXEL_SIZE
    normal = np.array([0.36, 0.48, 0.8])
    depth = DEPTH * 0.8 / (0.8 - 0.36 * ray[0] - 0.48 * ray[1])
    return wall(0.0, normal=normal, depth=depth)


def _curved(distance: float = DEPTH, extent: float = DEPTH * PIXEL_SIZE * 32) -> FramePacket:
    """A bumpy surface, ``extent`` wide at ``distance``."""
    y, x = _grid()
    relief = extent * (0.3 * x - 0.2 * y + 0.1 * np.sin(3 * x) * np.cos(2 * y))
    normal = np.stack([np.sin(2 * x), np.cos(3 * y), 2 + 0.3 * np.sin(x * y)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return wall(0.0, normal=normal, depth=distance + relief, pixel_size=extent / (32 * distance))


def _normals(off: float) -> FramePacket:
    """The second component of the normal is the first but for ``off`` of itself."""
    y, x = _grid()
    first = 0.3 * np.sin(2 * x + y)
    second = first * (1.0 + off)
    normal = np.stack([first, second, np.sqrt(1.0 - first**2 - second**2)], -1)
    return replace(_curved(), surface=np.concatenate([normal, _curved().surface[..., 3:]], -1).astype(np.float32))


def _features(packet: FramePacket, names: str, scale: bool = True) -> F64:
    """(H, W, M) of ``names``; positions relative to the camera, brought to [-1, 1] if ``scale``."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    ray = (x - SIZE[0] / 2) * packet.pixel_size, (y - SIZE[1] / 2) * packet.pixel_size, -np.ones_like(x)
    depth = packet.surface[..., 3].astype(np.float64)
    w = np.stack(ray, -1) * depth[..., None]
    if scale:
        low, high = w.min((0, 1)), w.max((0, 1))
        w = (2 * w - low - high) / max(float((high - low).max()), 1e-30)
    known = {
        "1": np.ones_like(w[..., :1]),
        "n": packet.surface[..., :3].astype(np.float64),
        "w": w,
        "w2": w * w,
        "depth": depth[..., None] if not scale else -w[..., 2:],
    }
    return np.concatenate([known[name] for name in names.split(",")], -1)


def _polynomial(packet: FramePacket, names: str = "1,n,w,w2") -> F64:
    """(H, W, 3) light above 0 that is a combination of ``names``."""
    features = _features(packet, names)
    light = features @ np.random.default_rng(3).uniform(-1, 1, (features.shape[-1], 3))
    return np.asarray(light - light.min() + 0.1)


def _cholesky(block: Block) -> str:
    """Error of normal equations in single precision, relative to the largest light; "no solution" if there is none."""
    features = _features(block.packet, block.features).reshape(SIZE[0] * SIZE[1], -1).astype(np.float32)
    light = block.light.reshape(-1, 3).astype(np.float32)
    if not (block.packet.surface[..., 3] > 0.0).any():
        features = np.zeros_like(features)
    try:
        factor = np.linalg.cholesky(features.T @ features)
    except np.linalg.LinAlgError:
        return "no solution"
    weights = np.linalg.solve(factor.T, np.linalg.solve(factor, features.T @ light))
    return number(float(np.abs(features @ weights - light).max() / max(float(light.max()), 1e-30)))
