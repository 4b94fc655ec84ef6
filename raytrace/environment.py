"""Light from all around, stored as one picture, and the tables by which it is sampled.

Equirectangular: columns go round the y axis, rows from straight down to straight up. The middle of the picture is what
a camera sees that looks along -z, and what is right in the picture is to that camera's right, +x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

LARGEST_WIDTH = 4096
"""Texels around the horizon that are kept: 11 per degree, 170 MB with what is needed to sample them."""

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True)
class Environment:
    """``pixels`` (H, W, 3) float32, linear radiance >= 0, row 0 straight down. ``turn``: full turns about the y axis by
    which the picture is turned, counter-clockwise seen from above. Compared by identity."""

    name: str
    pixels: F32
    turn: float = 0.0


@dataclass(frozen=True)
class EnvironmentTables:
    """What kernels read: the cells between the centres of neighbouring texels, in which a look-up is bilinear.

    ``texels`` (H + 2, W + 1, 4) float32: radiance, with the first and last row and the first column once more at the
    other end, so that cell (r, c) lies between rows r, r + 1 and columns c, c + 1; the outermost rows of cells reach to
    the poles and are half as high. The fourth channel, at [r, c], times the luminance, divided by the sine of the angle
    to the y axis, is the density per solid angle. ``rows`` (H + 2,) and ``columns`` (H + 1, W + 1) float32: cumulative
    probabilities of the rows of cells, and of the cells of each row. ``turn``: as in :class:`Environment`. ``mean``:
    luminance, mean over all directions.
    """

    texels: F32
    rows: F32
    columns: F32
    turn: float
    mean: float


def no_environment() -> EnvironmentTables:
    """Tables of the smallest picture, black."""
    return build_environment(Environment("none", np.zeros((1, 1, 3), np.float32)))


def build_environment(environment: Environment) -> EnvironmentTables:
    """Tables for sampling by luminance: PBR book, 4th ed., sec. 12.5, but of the interpolated picture.

    Probabilities constant over a texel would leave a sun of one texel as much noise as it has light: interpolation
    spreads it over four. The probabilities are those of the rounded cumulative sums, so that what is drawn and what is
    told agree.
    """
    height, width = environment.pixels.shape[:2]
    around = np.concatenate([environment.pixels, environment.pixels[:, :1]], axis=1)
    pixels = np.concatenate([around[:1], around, around[-1:]], axis=0).astype(np.float32)
    luminance = pixels.astype(np.float64) @ _LUMINANCE
    means = (luminance[1:, 1:] + luminance[1:, :-1] + luminance[:-1, 1:] + luminance[:-1, :-1]) / 4.0
    borders = np.concatenate([[0.0], np.arange(height) + 0.5, [height]]) / height
    zones = -np.diff(np.cos(np.pi * borders))[:, None]
    weights = means * zones
    rows, columns = _cumulative(weights.sum(axis=1)), _cumulative(weights)
    probability = np.diff(rows.astype(np.float64))[:, None] * np.diff(columns.astype(np.float64), axis=1)
    area = 2.0 * np.pi**2 / width * np.diff(borders)[:, None]
    texels = np.zeros((height + 2, width + 1, 4), np.float32)
    texels[..., :3] = pixels
    texels[:-1, :-1, 3] = probability / (area * np.where(means > 0.0, means, np.inf))
    return EnvironmentTables(texels, rows, columns, environment.turn, float(weights.sum() / (2.0 * width)))


def _cumulative(weights: F64) -> F32:
    """Cumulative sums along the last axis from 0 to exactly 1, one more than ``weights``; uniform where all are 0."""
    count = weights.shape[-1]
    sums = np.concatenate([np.zeros((*weights.shape[:-1], 1)), np.cumsum(weights, axis=-1)], axis=-1)
    total = sums[..., -1:]
    even = np.broadcast_to(np.arange(count + 1) / count, sums.shape)
    result: F32 = np.where(total > 0.0, sums / np.where(total > 0.0, total, 1.0), even).astype(np.float32)
    return result


def direction_of(u: float, v: float, turn: float = 0.0) -> tuple[float, float, float]:
    """Unit vector to the place (u, v) of the picture, both in [0, 1] from its lower left."""
    phi, theta = 2.0 * math.pi * (u - 0.5 - turn), math.pi * v
    return math.sin(theta) * math.sin(phi), -math.cos(theta), -math.sin(theta) * math.cos(phi)
