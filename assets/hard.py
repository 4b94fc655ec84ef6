"""A lamp of 3 cm and radiance 10^4 that shines at a wall: a room lit by what one bright patch sends on.

There for the worst noise there is: nearly all light is indirect, the patch is found by few bounce rays, surfaces are
almost white or almost black, and the lamp outshines the room by five orders of magnitude.
"""

from __future__ import annotations

from assets.motion import slide, spin
from assets.sets import panel, room, stage_with_paints, swaying
from assets.shapes import block, box, quad
from assets.surfaces import ball, lathe
from raytrace.scene import Scene

CYCLE = 4.0
"""Seconds after which lamp and block are back."""

RADIANCE = 1e4


_EYE, _TARGET = (0.0, 1.3, 4.7), (0.0, 0.9, 0.8)


def build(*, animate: bool = False) -> Scene:
    """With ``animate`` the lamp slides along the wall that it lights and a white block turns."""
    stage = stage_with_paints(animate, "white", "red")
    stage.material("snow", (0.97, 0.97, 0.97))
    stage.material("coal", (0.012, 0.012, 0.012))
    stage.material("lamp", (0.5, 0.5, 0.5), emission=(RADIANCE, 0.8 * RADIANCE, 0.6 * RADIANCE))
    walls = room(4.0, 2.5, 5.0, "snow", "red", "snow", "white")
    ceiling = quad([(-2, 2.5, 0), (2, 2.5, 0), (2, 2.5, 5), (-2, 2.5, 5)])
    front = quad([(2, 0, 5), (-2, 0, 5), (-2, 2.5, 5), (2, 2.5, 5)])
    stage.add("room", [*walls, (ceiling, "snow"), (front, "coal")])
    # The shade opens towards the right wall, and hides the lamp from the rest of the room.
    shade = lathe([(0.05, -0.03), (0.16, 0.12), (0.165, 0.12), (0.055, -0.035), (0.0, -0.035), (0.0, -0.03)], 32)
    lamp = panel(0.03, 0.03).turned("x", 180.0)
    lamp_parts = [(shape.turned("z", -90.0), material) for shape, material in ((shade, "coal"), (lamp, "lamp"))]
    stage.add("lamp", lamp_parts, slide((1.3, 1.5, 1.6), (0.0, 0.0, 0.5), CYCLE))
    stage.add("screen", [(block((0.6, -0.001, 1.2), (0.64, 0.8, 2.6)), "snow")])
    stage.add("black ball", [(ball(0.3, 40).moved(-0.3, 0.3005, 2.2), "coal")])
    stage.add("white ball", [(ball(0.3, 40).moved(-1.1, 0.3005, 1.6), "snow")])
    stage.add("block", [(box((0.5, 0.9, 0.5)), "snow")], spin((-0.35, 0.4505, 0.9), CYCLE))
    flight = swaying(_EYE, _TARGET, 0.6, 0.7, 42.0)
    return stage.scene("hard", flight(0.0), flight)
