"""Surfaces and images of odd shapes: without a slope, edge-on, back to back, to the horizon; one pixel, one row."""

from __future__ import annotations

from typing import Final

import numpy as np

from bench.hard.stage import (
    DEPTH,
    F32,
    FILTERS,
    ON_SURFACES,
    PIXEL_SIZE,
    SIZE,
    Row,
    Size,
    Stage,
    constant,
    noise,
    number,
    of_constant,
    wall,
    with_sky,
    worst,
)
from raytrace.frame import FramePacket

FEW: Final = ("svgf", "bmfr", "joint-separable", "guided")
"""Methods for sizes that shaders have to be compiled for anew."""

SIZES: Final[dict[Size, tuple[str, ...]]] = {(1, 1): FEW, (1, 9): FEW, SIZE: FILTERS, (4097, 3): FEW}

NOISE_LEFT: Final = 0.3
"""Bound on the noise that a filter leaves in one frame, in that of the frame."""

SMOOTHING: Final = ("svgf", "bmfr", "joint", "joint-separable", "guided")
"""Methods that no luminance set by hand stops."""


def measure(stage: Stage) -> list[Row]:
    """All cases of shape."""
    return [
        _no_slope(stage),
        constant(stage, "depth gradient infinite", wall(0.75, gradient=(np.inf, 0.0)), 0.75, _infinite_times_nothing()),
        constant(stage, "depth gradient 1e30", wall(0.75, gradient=(1e30, -1e30)), 0.75, _overflow()),
        worst([_opposite(stage, method) for method in ON_SURFACES]),
        *_horizon(stage),
        *(_size(stage, size, methods) for size, methods in SIZES.items()),
    ]


def _no_slope(stage: Stage) -> Row:
    """A wall that faces the camera, its depth rounded: the range of the depth weight is 0 there but for its floor."""
    rng = np.random.default_rng(2)
    depth = (DEPTH * (1.0 + 2.0**-23 * rng.integers(-1, 2, SIZE[::-1]))).astype(np.float32)
    off = np.abs(depth[:, 1:].astype(np.float64) - depth[:, :-1])
    weights = np.exp(-off / 1e-8)
    packet = wall(noise(3), depth=depth)
    rows = [_noise_left("depth gradient 0", stage, packet, method, "") for method in SMOOTHING]
    row = worst(rows)
    return Row(**{**vars(row), "unguarded": f"{(weights < 1e-6).mean():.0%} of neighbours shut out"})


def _noise_left(case: str, stage: Stage, packet: FramePacket, method: str, unguarded: str) -> Row:
    """Deviation from the mean after one frame, on surfaces, in that of the frame."""
    surface = packet.surface[..., 3] > 0.0
    shown = stage.sequence([packet], method)[0][surface]
    sample = packet.direct[..., :3][surface]
    left = float(np.std(shown) / np.std(sample)) if np.isfinite(shown).all() else float("inf")
    return Row(case, method, "0", left, NOISE_LEFT, unguarded, "of the noise", bool(np.isfinite(shown).all()))


def _infinite_times_nothing() -> str:
    with np.errstate(invalid="ignore"):
        return f"{number(float(np.float32(np.inf) * np.float32(0.0)))}: ∞ · 0 along the edge"


def _overflow() -> str:
    with np.errstate(over="ignore"):
        return f"{number(float(np.float32(1e30) ** 2))}: its square"


def _opposite(stage: Stage, method: str) -> Row:
    """Back to back: the cosine is -1, and an even power of it 1."""
    right = np.broadcast_to(np.arange(SIZE[0]) > SIZE[0] // 2, SIZE[::-1])
    light = np.where(right, 1.0, 0.2)
    normal = np.where(right[..., None], (0.0, 0.0, 1.0), (0.0, 0.0, -1.0))
    shown = stage.sequence([wall(light, normal=normal)] * 2, method)[-1]
    error = float(np.abs(shown[..., 0] - light).max()) if np.isfinite(shown).all() else float("inf")
    mixed = abs(0.5 * (1.0 + 0.2) - 0.2) * float(np.float32(-1.0) ** 128)
    return Row("normals exactly opposite", method, "0.2 | 1", error, 0.02, f"{number(mixed)}: (-1)^128 = 1", "absolute")


def _horizon(stage: Stage) -> list[Row]:
    """A floor 1 below the camera, seen up to a depth of 1e6, sky above."""
    rows = np.arange(SIZE[1])
    down = PIXEL_SIZE * (20.0 - rows) + 1e-6  # rows from 21 on look above the horizon
    floor = np.broadcast_to((down > 0.0)[:, None], SIZE[::-1])
    depth = np.where(down > 0.0, 1.0 / np.maximum(down, 1e-6), 1.0)
    gradient = np.stack([np.zeros_like(depth), depth**2 * PIXEL_SIZE], -1)

    def frame(light: F32) -> FramePacket:
        packet = wall(light, normal=(0.0, 1.0, 0.0), depth=depth[:, None], gradient=gradient[:, None])
        return with_sky(packet, ~floor)

    slope = float(np.abs(np.diff(depth[:21])).max())
    unguarded = f"depths {number(slope)} apart in neighbouring rows"
    still = frame(np.full(SIZE[::-1], 0.75, np.float32))
    noisy = frame(noise(4).astype(np.float32))
    return [
        worst([of_constant(stage, "floor to the horizon", still, method, 0.75, unguarded) for method in FILTERS]),
        worst([_noise_left("floor to the horizon, noisy", stage, noisy, method, unguarded) for method in SMOOTHING]),
    ]


def _size(stage: Stage, size: Size, methods: tuple[str, ...]) -> Row:
    """A constant stays constant, with taps and blocks beyond every border."""
    width, height = size
    packet = wall(0.75, size)
    taps = 25 - min(width, 5) * min(height, 5)
    unguarded = f"{taps} of 25 taps outside" if taps else f"{25 - 9} of 25 taps outside in a corner"
    return worst([of_constant(stage, f"image of {width}x{height}", packet, m, 0.75, unguarded) for m in methods])
