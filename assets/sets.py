"""What the small study scenes share: a room open at the front, lamp panels, and a camera that sways."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from assets.shapes import Shape, quad
from assets.stage import Part, Stage
from raytrace.camera import Camera

Point = tuple[float, float, float]

FLIGHT = 8.0
"""Seconds that a flight of :func:`swaying` takes."""


PAINTS: dict[str, Point] = {
    "white": (0.75, 0.75, 0.73),
    "grey": (0.4, 0.4, 0.4),
    "red": (0.6, 0.08, 0.05),
    "blue": (0.08, 0.16, 0.5),
    "green": (0.12, 0.4, 0.1),
}


def stage_with_paints(animate: bool, *paints: str) -> Stage:
    """A stage with those of the diffuse :data:`PAINTS`."""
    stage = Stage(animate)
    for name in paints:
        stage.material(name, PAINTS[name])
    return stage


def room(width: float, height: float, depth: float, walls: str, left: str, right: str, floor: str) -> list[Part]:
    """Floor, back wall and side walls seen from the front, which is open, as is the top; x is centred, z ends at 0."""
    x, z = width / 2, depth
    return [
        (quad([(-x, 0, z), (x, 0, z), (x, 0, 0), (-x, 0, 0)], (width, depth)), floor),
        (quad([(-x, 0, 0), (x, 0, 0), (x, height, 0), (-x, height, 0)], (width, height)), walls),
        (quad([(-x, 0, z), (-x, 0, 0), (-x, height, 0), (-x, height, z)], (depth, height)), left),
        (quad([(x, 0, 0), (x, 0, z), (x, height, z), (x, height, 0)], (depth, height)), right),
    ]


def panel(width: float, depth: float) -> Shape:
    """A rectangle about the origin that looks down."""
    x, z = width / 2, depth / 2
    return quad([(-x, 0, -z), (x, 0, -z), (x, 0, z), (-x, 0, z)])


def swaying(eye: Point, target: Point, across: float, inwards: float, yfov: float) -> Callable[[float], Camera]:
    """From side to side by ``across``, and ``inwards`` and back: closed after FLIGHT seconds, the still one at 0."""
    start, aim = np.array(eye), np.array(target)
    forward = (aim - start) / np.linalg.norm(aim - start)
    side = np.cross(forward, (0.0, 1.0, 0.0))
    side /= np.linalg.norm(side)

    def camera(time: float) -> Camera:
        turn = 2 * math.pi * math.fmod(time / FLIGHT, 1.0)
        x, y, z = start + across * math.sin(turn) * side + inwards * (1 - math.cos(turn)) / 2 * forward
        return Camera.look_at((float(x), float(y), float(z)), target, yfov_degrees=yfov)

    return camera
