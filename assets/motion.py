"""Rigid, periodic motions: object-to-world transforms as functions of time in seconds, (4, 4) float64."""

from __future__ import annotations

import math

import numpy as np

from assets.shapes import Axis, rotation
from raytrace.scene import F64, Motion

Point = tuple[float, float, float]


def place(pivot: Point, turn: F64 | None = None) -> F64:
    """Transform that turns by a (3, 3) rotation and then carries the object's origin to ``pivot``."""
    matrix = np.eye(4)
    matrix[:3, 3] = pivot
    if turn is not None:
        matrix[:3, :3] = turn
    return matrix


def _phase(time: float, period: float) -> float:
    """Angle in [0, 2 pi); exactly 0 at whole periods, so that a cycle closes to the bit."""
    return 2 * math.pi * math.fmod(time / period, 1.0)


def spin(pivot: Point, period: float, tilt_degrees: float = 0.0) -> Motion:
    """One turn about the object's own y axis every ``period`` seconds; the axis leans by ``tilt_degrees`` about z."""
    lean = rotation("z", math.radians(tilt_degrees))
    return lambda time: place(pivot, lean @ rotation("y", _phase(time, period)))


def swing(pivot: Point, axis: Axis, amplitude_degrees: float, period: float) -> Motion:
    """To and fro about an axis through ``pivot``, upright and fastest at time 0."""
    amplitude = math.radians(amplitude_degrees)
    return lambda time: place(pivot, rotation(axis, amplitude * math.sin(_phase(time, period))))


def slide(pivot: Point, direction: Point, period: float) -> Motion:
    """To and fro along ``direction``, whose length is the amplitude; in the middle and fastest at time 0."""

    def motion(time: float) -> F64:
        offset = math.sin(_phase(time, period)) * np.array(direction)
        x, y, z = (float(c) for c in np.array(pivot) + offset)
        return place((x, y, z))

    return motion
