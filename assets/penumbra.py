"""Columns and a grille between lamps and a bare floor: shadows from hard at the foot to soft far away.

There to see whether a filter keeps a shadow as sharp as it is, and how long it lags behind a lamp that moves: nothing
in the surfaces' own motion tells where the shadow was.
"""

from __future__ import annotations

from assets.motion import slide, spin
from assets.sets import panel, room, stage_with_paints, swaying
from assets.shapes import block
from assets.surfaces import rod
from raytrace.scene import Scene

CYCLE = 4.0
"""Seconds after which lamp and wheel are back."""

_EYE, _TARGET = (0.2, 2.5, 6.0), (0.0, 0.5, 1.7)


def build(*, animate: bool = False) -> Scene:
    """With ``animate`` the large lamp slides to and fro and a wheel of spokes turns under the small one."""
    stage = stage_with_paints(animate, "white", "grey", "red", "blue")
    stage.material("large lamp", (0.5, 0.5, 0.5), emission=(34.0, 28.0, 20.0))
    stage.material("small lamp", (0.5, 0.5, 0.5), emission=(170.0, 210.0, 280.0))
    stage.add("room", room(6.0, 2.8, 5.0, "white", "white", "white", "white"))
    for k in range(4):
        height = 0.5 + 0.4 * k
        stage.add(f"column {k + 1}", [(rod(0.06, height, 32).moved(-2.1 + 0.65 * k, -0.001, 1.3), "grey")])
    bars = [(block((0.5 + 0.16 * k, -0.001, 0.9), (0.54 + 0.16 * k, 1.3, 0.94)), "blue") for k in range(9)]
    stage.add("grille", [*bars, (block((0.45, 1.301, 0.88), (1.87, 1.36, 0.96)), "blue")])
    spokes = [(block((-0.5, -0.008, -0.025), (0.5, 0.008, 0.025)).turned("y", 45.0 * k).moved(y=0.017 * k), "red")
              for k in range(4)]  # fmt: skip
    stage.add("wheel", spokes, spin((1.3, 0.75, 2.4), CYCLE, 8.0))
    stage.add("large lamp", [(panel(0.7, 0.5), "large lamp")], slide((-1.2, 2.4, 0.6), (0.7, 0.0, 0.0), CYCLE))
    stage.add("small lamp", [(panel(0.08, 0.08).moved(1.3, 2.3, 0.35), "small lamp")])
    flight = swaying(_EYE, _TARGET, 0.9, 0.7, 40.0)
    return stage.scene("penumbra", flight(0.0), flight)
