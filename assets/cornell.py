"""The Cornell box, from the measurements published by the Cornell University Program of Computer Graphics.

https://www.graphics.cornell.edu/online/box/data.html, in units of 100 mm: x to the left as the camera sees it, y up,
z away from it. The walls' spectra are rounded to the linear RGB in common use, as is the lamp's radiance, (17, 12, 4).
"""

from __future__ import annotations

import math

from assets.motion import slide, swing
from assets.shapes import Shape, join, quad
from assets.stage import Stage
from raytrace.camera import Camera
from raytrace.scene import Scene

_CYCLE = 2.0  # seconds: block and lamp are back after 60 frames of 1/30 s
_FLIGHT = 4.0  # seconds
_YFOV = 39.3  # degrees: a 25 mm film behind a 35 mm lens

Plan = tuple[tuple[float, float], ...]

# Floor plans (x, z) in the published order, clockwise seen from above.
_SHORT_PLAN = ((1.30, 0.65), (0.82, 2.25), (2.40, 2.72), (2.90, 1.14))
_TALL_PLAN = ((4.23, 2.47), (2.65, 2.96), (3.14, 4.56), (4.72, 4.06))
_SHORT_HEIGHT, _TALL_HEIGHT = 1.65, 3.30
_LAMP_CENTRE, _LAMP_SIZE = (2.78, 5.48, 2.795), (1.30, 1.05)
"""The lamp hangs 8 mm below the ceiling, which is at 5.488, so that it does not coincide with it."""


def _block(plan: Plan, height: float) -> Shape:
    """Four sides and a top; there is no underside, as in the original, because it would lie in the floor."""
    top = quad([(x, height, z) for x, z in plan])
    sides = [
        quad([(ax, 0.0, az), (bx, 0.0, bz), (bx, height, bz), (ax, height, az)])
        for (bx, bz), (ax, az) in zip(plan, plan[1:] + plan[:1], strict=True)
    ]
    return join([top, *sides])


def _flight(time: float) -> Camera:
    """A closed orbit that also goes in and out; the still camera at time 0."""
    turn = 2 * math.pi * math.fmod(time / _FLIGHT, 1.0)
    across, inwards = math.sin(turn), (1 - math.cos(turn)) / 2
    position = (2.78 + 1.7 * across, 2.73 + 0.45 * math.sin(2 * turn), -8.0 + 3.6 * inwards)
    target = (2.78 - 0.9 * across, 2.73 - 0.25 * inwards, 2.8)
    return Camera.look_at(position, target, yfov_degrees=_YFOV)


def build(*, animate: bool = False) -> Scene:
    """The box; with ``animate`` the tall block turns to and fro about its axis, the lamp along x, in 2 s."""
    stage = Stage(animate)
    stage.material("white", (0.73, 0.73, 0.73))
    stage.material("red", (0.63, 0.065, 0.05))
    stage.material("green", (0.14, 0.45, 0.091))
    stage.material("lamp", (0.78, 0.78, 0.78), emission=(17.0, 12.0, 4.0))

    floor = quad([(5.528, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 5.592), (5.496, 0.0, 5.592)])
    ceiling = quad([(5.56, 5.488, 0.0), (5.56, 5.488, 5.592), (0.0, 5.488, 5.592), (0.0, 5.488, 0.0)])
    back = quad([(5.496, 0.0, 5.592), (0.0, 0.0, 5.592), (0.0, 5.488, 5.592), (5.56, 5.488, 5.592)])
    right = quad([(0.0, 0.0, 5.592), (0.0, 0.0, 0.0), (0.0, 5.488, 0.0), (0.0, 5.488, 5.592)])
    left = quad([(5.528, 0.0, 0.0), (5.496, 0.0, 5.592), (5.56, 5.488, 5.592), (5.56, 5.488, 0.0)])
    stage.add("box", [(floor, "white"), (ceiling, "white"), (back, "white"), (right, "green"), (left, "red")])
    stage.add("short block", [(_block(_SHORT_PLAN, _SHORT_HEIGHT), "white")])

    axis_x, axis_z = (sum(corner[k] for corner in _TALL_PLAN) / 4 for k in (0, 1))
    tall = _block(_TALL_PLAN, _TALL_HEIGHT).moved(-axis_x, 0.0, -axis_z)
    stage.add("tall block", [(tall, "white")], swing((axis_x, 0.0, axis_z), "y", 40.0, _CYCLE))

    x, z = _LAMP_SIZE[0] / 2, _LAMP_SIZE[1] / 2
    lamp = quad([(-x, 0.0, -z), (x, 0.0, -z), (x, 0.0, z), (-x, 0.0, z)])
    stage.add("lamp", [(lamp, "lamp")], slide(_LAMP_CENTRE, (0.8, 0.0, 0.0), _CYCLE))
    return stage.scene("cornell", _flight(0.0), _flight)
