"""Blocks and balls on a floor that is nearly a mirror, in front of a metal wall that is less of one.

There for reflections whose motion is not the surface's: the floor rests, what is seen in it moves with the camera.
"""

from __future__ import annotations

from assets import textures
from assets.motion import slide, spin
from assets.sets import panel, room, stage_with_paints, swaying
from assets.shapes import box, rounded_box
from assets.surfaces import ball, ring
from raytrace.scene import Scene

CYCLE = 4.0
"""Seconds after which lamp and blocks are back."""

_EYE, _TARGET = (0.4, 1.15, 5.3), (0.0, 0.5, 1.2)


def build(*, animate: bool = False) -> Scene:
    """With ``animate`` a block turns on the floor and the lamp slides."""
    stage = stage_with_paints(animate, "white", "red", "blue", "green")
    stage.material("polished", (0.06, 0.06, 0.07), roughness=0.12)
    stage.material("brushed", (0.78, 0.74, 0.68), roughness=0.3, metallic=1.0)
    stage.material("gold", (1.0, 0.77, 0.34), roughness=0.2, metallic=1.0)
    stage.material("wood", (1.0, 1.0, 1.0), stage.texture("oak", textures.wood("#6a4a30", "#a07a52", 4)), roughness=0.4)
    stage.material("lamp", (0.5, 0.5, 0.5), emission=(13.0, 12.0, 10.0))
    stage.material("strip", (0.5, 0.5, 0.5), emission=(2.0, 5.0, 9.0))
    stage.add("room", room(6.0, 2.6, 5.0, "brushed", "red", "blue", "polished"))
    stage.add("block", [(rounded_box((0.7, 0.7, 0.7), 0.04), "wood")], spin((-1.3, 0.3505, 1.5), CYCLE))
    stage.add("ball", [(ball(0.42, 48).moved(0.1, 0.4205, 1.2), "white")])
    stage.add("golden ball", [(ball(0.25, 40).moved(0.75, 0.2505, 2.3), "gold")])
    stage.add("ring", [(ring(0.3, 0.09, 64, 16).turned("x", 75.0).moved(-0.55, 0.35, 2.5), "green")])
    stage.add("post", [(box((0.22, 1.7, 0.22)).turned("y", 20.0).moved(1.5, 0.8505, 1.1), "red")])
    stage.add("strips", [
        (panel(0.06, 1.6).turned("x", -90.0).moved(x, 1.2, 0.05), "strip") for x in (-2.2, 2.2)
    ])  # fmt: skip
    stage.add("lamp", [(panel(1.6, 0.9), "lamp")], slide((0.0, 2.55, 2.6), (0.7, 0.0, 0.0), CYCLE))
    flight = swaying(_EYE, _TARGET, 0.9, 0.8, 38.0)
    return stage.scene("mirrorish", flight(0.0), flight)
