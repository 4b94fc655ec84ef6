"""Balls from polished to rough, of a metal, of a coloured plastic and of a white one, under one long lamp.

There to see at which roughness a filter begins to smear reflections, and what demodulation does to tinted metal.
"""

from __future__ import annotations

from assets.motion import slide, swing
from assets.sets import panel, room, stage_with_paints, swaying
from assets.shapes import block
from assets.surfaces import ball
from raytrace.scene import Scene

COLUMNS = 7
ROUGHNESS = tuple(k / (COLUMNS - 1) for k in range(COLUMNS))
"""Of the columns, from left to right; the first is what the tracer makes of a mirror."""

CYCLE = 4.0
"""Seconds after which lamp and bar are back."""

_ROWS = (
    ("copper", (0.95, 0.64, 0.54), 1.0),
    ("green plastic", (0.05, 0.35, 0.12), 0.0),
    ("steel", (0.6, 0.6, 0.62), 1.0),
)
_EYE, _TARGET = (0.0, 1.9, 6.3), (0.0, 0.72, 1.4)


def build(*, animate: bool = False) -> Scene:
    """With ``animate`` the front lamp slides and a striped bar swings, which the balls reflect."""
    stage = stage_with_paints(animate, "white", "grey", "red", "blue")
    stage.material("lamp", (0.5, 0.5, 0.5), emission=(14.0, 13.0, 11.5))
    stage.material("side lamp", (0.5, 0.5, 0.5), emission=(2.5, 3.5, 6.0))
    stage.add("room", room(6.0, 2.6, 5.0, "white", "red", "blue", "grey"))
    for row, (name, color, metallic) in enumerate(_ROWS):
        for column, roughness in enumerate(ROUGHNESS):
            material = f"{name} {roughness:.2f}"
            stage.material(material, color, roughness=roughness, metallic=metallic)
            place = ((column - (COLUMNS - 1) / 2) * 0.66, 0.26 + 0.42 * row, 2.3 - 0.725 * row)
            stage.add(material, [(ball(0.25, 40).moved(*place), material)])
        front = 2.3 - 0.725 * row
        if row:
            step = block((-2.6, -0.001 * row, front - 0.36), (2.6, 0.42 * row, front + 0.35))
            stage.add(f"step {row}", [(step, "white")])
    stage.add("lamp", [(panel(3.6, 0.5), "lamp")], slide((0.0, 2.5, 2.6), (0.5, 0.0, 0.0), CYCLE))
    stage.add("back lamp", [(panel(5.0, 0.15).turned("x", -60.0).moved(0.0, 2.4, 0.25), "side lamp")])
    stripes = []
    for k in range(5):
        piece = block((-0.035, -0.8 + 0.16 * k, -0.035), (0.035, -0.641 + 0.16 * k, 0.035))
        stripes.append((piece, ("red", "white")[k % 2]))
    stage.add("bar", stripes, swing((1.5, 2.4, 2.0), "z", 30.0, CYCLE))
    flight = swaying(_EYE, _TARGET, 0.9, 0.9, 38.0)
    return stage.scene("metals", flight(0.0), flight)
