"""Lights without a surface, as glTF's KHR_lights_punctual has them, and the table that kernels read them from."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

Vector = tuple[float, float, float]
Kind = Literal["point", "spot", "directional"]

KINDS: Final[tuple[Kind, ...]] = ("point", "spot", "directional")
POINT, SPOT, DIRECTIONAL = range(3)

KIND, POSITION, DIRECTION, INTENSITY, CONE_SCALE, CONE_OFFSET, INVERSE_RANGE, ROW = 0, 1, 4, 7, 10, 11, 12, 13
"""First columns of the parts of a light's row, and its length."""

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True)
class PunctualLight:
    """A light of no size; rays do not meet it, so that only light samples find it.

    ``position`` in world space and ``direction``, unit, the way it shines (not for "point"). ``intensity``: linear
    Rec. 709 per steradian, for "directional" irradiance on a surface that faces it. ``inner``, ``outer``: radians from
    the axis of a "spot", at which it begins to fall off and where it ends, 0 <= inner < outer <= pi / 2. ``range``:
    distance at which "point" and "spot" have faded to 0. ``motion``: position and direction at a time in seconds.
    """

    name: str
    kind: Kind
    position: Vector = (0.0, 0.0, 0.0)
    direction: Vector = (0.0, 0.0, -1.0)
    intensity: Vector = (1.0, 1.0, 1.0)
    inner: float = 0.0
    outer: float = math.pi / 4
    range: float = math.inf
    motion: Callable[[float], tuple[Vector, Vector]] | None = None

    def at(self, time: float) -> PunctualLight:
        """The light where it is at ``time`` seconds."""
        if self.motion is None:
            return self
        position, direction = self.motion(time)
        return replace(self, position=position, direction=direction)

    def power(self, radius: float) -> float:
        """Emitted power, as luminance; of "directional" what a ball of ``radius`` around the scene receives."""
        luminance = float(np.array(self.intensity) @ _LUMINANCE)
        if self.kind == "point":
            return 4.0 * math.pi * luminance
        if self.kind == "spot":  # the squared ramp of the falloff has a third of its width
            inside, edge = math.cos(self.inner), math.cos(self.outer)
            return 2.0 * math.pi * luminance * (1.0 - inside + (inside - edge) / 3.0)
        return math.pi * radius**2 * luminance


def punctual_rows(lights: Sequence[PunctualLight], origin: F64, time: float = 0.0) -> F32:
    """(max(1, P), ROW) float32 as at ``time`` seconds, positions relative to ``origin``; a row of zeros where there is
    no light."""
    rows = np.zeros((max(1, len(lights)), ROW))
    for row, light in zip(rows, (light.at(time) for light in lights), strict=False):
        row[KIND] = KINDS.index(light.kind)
        row[POSITION : POSITION + 3] = np.array(light.position) - origin
        row[DIRECTION : DIRECTION + 3] = np.array(light.direction) / np.linalg.norm(light.direction)
        row[INTENSITY : INTENSITY + 3] = light.intensity
        # KHR_lights_punctual, "Inner and Outer Cone Angles".
        row[CONE_SCALE] = 1.0 / max(0.001, math.cos(light.inner) - math.cos(light.outer))
        row[CONE_OFFSET] = -math.cos(light.outer) * row[CONE_SCALE]
        row[INVERSE_RANGE] = 0.0 if math.isinf(light.range) else 1.0 / max(light.range, 1e-18)
    return rows.astype(np.float32)
