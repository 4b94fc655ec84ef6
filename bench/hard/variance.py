"""The variance of what is bright and nearly free of noise, by every estimator of ``svgf.variance``."""

from __future__ import annotations

from typing import Final

import numpy as np

from bench.hard.stage import F64, HALF, SIZE, Row, Stage, number, wall
from gl.renderer import read
from raytrace.frame import FramePacket

LEVELS: Final = ((1000.0, 0.1), (1e4, 1.0))
FRAMES: Final = 8
ALPHA: Final = 0.2
EPSILON: Final = 2.0**-24
REC_709: Final = np.array([0.2126, 0.7152, 0.0722])

ESTIMATORS: Final = ("raw", "raw-mean", "welford", "welford-mean", "spatial", "spatial-temporal", "exaggerated")


def measure(stage: Stage) -> list[Row]:
    """Both levels by every estimator, and second moments beyond half precision."""
    rows = [_row(stage, estimator, level, sigma) for level, sigma in LEVELS for estimator in ESTIMATORS]
    return [*rows, _half(stage)]


def _row(stage: Stage, estimator: str, level: float, sigma: float) -> Row:
    packets, samples = flicker(level, sigma)
    expected = exact(estimator, samples)
    found = estimated(stage, packets, estimator)
    # Raw moments are rounded to single precision at the level of their squares, some of them in every frame.
    size = 100.0 if estimator == "exaggerated" else 1.0
    cancels = estimator in ("raw", "raw-mean", "exaggerated")
    bound = 8 * size * level * level * EPSILON / (size * sigma * sigma) if cancels else 0.05
    error = float(np.abs(found - expected).max()) / (size * sigma * sigma)
    return Row(
        case=f"variance of {level:g} ± {sigma:g}",
        method=f"svgf, {estimator}",
        exact=number(size * sigma * sigma),
        error=error,
        bound=bound,
        unguarded=f"{number(unguarded(samples) / sigma**2)} in single precision",
        measure="of σ²",
        finite=bool(np.isfinite(found).all()),
    )


def flicker(level: float, sigma: float) -> tuple[list[FramePacket], list[F64]]:
    """Frames that are ``level`` ± ``sigma`` at random, and their luminances (H, W) as single precision has them."""
    rng = np.random.default_rng(1)
    packets = [wall(level + sigma * rng.choice([-1.0, 1.0], SIZE[::-1])) for _ in range(FRAMES)]
    return packets, [packet.direct[..., :3].astype(np.float64) @ REC_709 for packet in packets]


def estimated(stage: Stage, packets: list[FramePacket], estimator: str) -> F64:
    """(H, W) variance that steers the wavelet in the last frame."""
    name = f"svgf.both.{'variance_mean' if estimator == 'spatial-temporal' else 'variance'}.out_color"
    settings = (f"svgf.variance={estimator}", "svgf.separate=false", f"svgf.alpha_moments={ALPHA}")
    stage.restart()
    for packet in packets:
        result = stage.frame(packet, "svgf", settings, keep=(name,))
    return np.asarray(read(result.texture(name))[..., 3].astype(np.float64) ** 2)


def exact(estimator: str, samples: list[F64]) -> F64:
    """The estimator in double precision, nothing moving, every weight in space 1."""
    if estimator == "spatial":
        return _in_space(samples[-1])
    if estimator == "spatial-temporal":
        mean = np.zeros(SIZE[::-1])
        for n, values in enumerate(samples):
            mean += max(1.0 / (n + 1), ALPHA) * (_in_space(values) - mean)
        return _window(mean, 1)
    count = len(samples)
    weights = np.full(count, 1.0 / count)
    if not estimator.endswith("mean"):
        for n in range(count):
            share = max(1.0 / (n + 1), ALPHA)
            weights[:n] *= 1.0 - share
            weights[n] = share
    stack = np.stack(samples)
    mean = np.tensordot(weights, stack, 1)
    variance = np.asarray(np.tensordot(weights, (stack - mean) ** 2, 1))
    scale = {"welford-mean": count / (count - 1), "exaggerated": 100.0}.get(estimator, 1.0)
    return scale * variance


def unguarded(samples: list[F64]) -> float:
    """Largest error of raw moments in single precision, step by step as a shader has them."""
    first, second = np.zeros(SIZE[::-1], np.float32), np.zeros(SIZE[::-1], np.float32)
    for n, values in enumerate(samples):
        share, x = np.float32(max(1.0 / (n + 1), ALPHA)), values.astype(np.float32)
        first += share * (x - first)
        second += share * (x * x - second)
    return float(np.abs((second - first * first).astype(np.float64) - exact("raw", samples)).max())


def _half(stage: Stage) -> Row:
    """Where squares leave the range of half precision."""
    level, sigma = 300.0, 1.0
    packets, samples = flicker(level, sigma)
    found, expected = estimated(stage, packets, "raw"), exact("raw", samples)
    with np.errstate(over="ignore", invalid="ignore"):
        square = np.float16(level) * np.float16(level)
        wrong = float(square - square)
    return Row(
        case="second moment at 256 and above: 300 ± 1",
        method="svgf, raw",
        exact=number(sigma**2),
        error=float(np.abs(found - expected).max()) / sigma**2,
        bound=8 * level * level * EPSILON / sigma**2 + 8 * HALF,
        unguarded=f"{number(wrong)} in half precision",
        measure="of σ²",
        finite=bool(np.isfinite(found).all()),
    )


def _window(image: F64, radius: int) -> F64:
    """Mean over the square around each pixel, as much of it as there is."""
    side = 2 * radius + 1
    padded = np.pad(image, radius, constant_values=np.nan)
    return np.asarray(np.nanmean(np.lib.stride_tricks.sliding_window_view(padded, (side, side)), axis=(2, 3)))


def _in_space(samples: F64) -> F64:
    mean = _window(samples, 3)
    return _window(samples**2, 3) - mean**2
