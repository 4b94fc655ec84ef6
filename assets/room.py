"""The empty room of the interior: shell, panelling, beams, fireplace, window with curtains, door.

The room is 6 m x 2.8 m x 5 m about the origin's vertical axis, floor at y = 0. Things that stand against a wall are
made in the wall's own frame (x to the right as seen from inside, y up, z into the room) and carried there by
:func:`against`. What touches a surface is let into it by a millimetre or more, so that no two faces coincide.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from assets.shapes import Shape, block, join, prism, quad
from assets.stage import Part, Stage, placed
from assets.surfaces import ball, curve, rod, sheet, tube
from raytrace.scene import F64

Wall = Literal["back", "left", "right", "front"]

WIDTH, HEIGHT, DEPTH = 6.0, 2.8, 5.0
DADO = 0.92
_WALLS: dict[Wall, tuple[float, float, float]] = {  # turn in degrees, x and z of the wall's middle
    "back": (0.0, 0.0, -DEPTH / 2),
    "left": (90.0, -WIDTH / 2, 0.0),
    "right": (-90.0, WIDTH / 2, 0.0),
    "front": (180.0, 0.0, DEPTH / 2),
}
FIREPLACE_X = -0.15
BEAMS_Z = (-1.7, -0.25, 1.2)
BEAM_UNDERSIDE = 2.61


def against(parts: list[Part], wall: Wall, along: float = 0.0, y: float = 0.0, out: float = 0.0) -> list[Part]:
    """Parts made in a wall's frame, shifted along the wall, up and into the room, in world space."""
    turn, x, z = _WALLS[wall]
    return placed(placed(parts, 0.0, along, y, out), turn, x, 0.0, z)


def build(stage: Stage) -> None:
    """Add the room to a stage that has the interior's materials."""
    stage.add("shell", _shell())
    stage.add("panelling", [part for wall in _WALLS for part in against(_panelling(wall), wall)])
    stage.add(
        "beams", [(block((-3.05, BEAM_UNDERSIDE, z - 0.09), (3.05, 2.83, z + 0.09), 0.6), "beam") for z in BEAMS_Z]
    )
    stage.add("fireplace", against(_fireplace(), "back", FIREPLACE_X))
    stage.add("fire irons", against(_grate(), "back", FIREPLACE_X))
    stage.add("window", against(_window(), "left", 0.15))
    for name, start, end, seed in (("left curtain", -1.25, -0.58, 1), ("right curtain", 0.58, 1.25, 2)):
        stage.add(name, against([(_curtain(start, end, seed), "drapes")], "left", 0.15))
    stage.add("door", against(_door(), "right", 1.35))


def _shell() -> list[Part]:
    """Floor, ceiling and walls, single faces looking inwards; the parquet runs at 45 degrees to the walls."""
    x, z = WIDTH / 2, DEPTH / 2
    floor = quad([(-x, 0, z), (x, 0, z), (x, 0, -z), (-x, 0, -z)])
    diagonal = floor.vertices[:, [0, 2]] @ np.array([[1.0, 1.0], [1.0, -1.0]]) / (math.sqrt(2) * 2.2)
    floor = Shape(floor.vertices, floor.faces, floor.normals, diagonal.astype(np.float32))
    ceiling = quad([(-x, HEIGHT, -z), (x, HEIGHT, -z), (x, HEIGHT, z), (-x, HEIGHT, z)], (4.0, 3.3))
    parts: list[Part] = [(floor, "parquet"), (ceiling, "ceiling")]
    for wall in _WALLS:
        half = WIDTH / 2 if wall in ("back", "front") else DEPTH / 2
        lower = quad([(-half, 0, 0), (half, 0, 0), (half, DADO, 0), (-half, DADO, 0)], (half, 0.5))
        upper = quad(
            [(-half, DADO, 0), (half, DADO, 0), (half, HEIGHT, 0), (-half, HEIGHT, 0)],
            (2 * half / 0.55, (HEIGHT - DADO) / 0.55),
        )
        parts += against([(lower, "paint"), (upper, "wallpaper")], wall)
    return parts


def _strip(profile: list[tuple[float, float]], start: float, end: float) -> Shape:
    """A moulding along a wall; ``profile`` in (out of the wall, up), counter-clockwise seen along the wall."""
    return prism([(-out, up) for out, up in reversed(profile)], end - start).turned("y", 90.0).moved(start)


def _panelling(wall: Wall) -> list[Part]:
    """Skirting board, raised panels below the dado rail, and a cornice, in the wall's frame."""
    long_wall = wall in ("back", "front")
    half = WIDTH / 2 if long_wall else DEPTH / 2
    # The short walls' mouldings end inside those of the long walls and are 1 mm lower, so that no faces coincide.
    start, end, drop = (-half - 0.01, half + 0.01, 0.0) if long_wall else (-half + 0.008, half - 0.008, 0.001)
    skirting = [(-0.01, -0.01), (0.018, -0.01), (0.018, 0.1), (0.012, 0.118), (-0.01, 0.12 - drop)]
    rail = [(-0.01, DADO - 0.03), (0.014, DADO - 0.02), (0.03, DADO - drop), (0.03, DADO + 0.018 - drop)]
    rail += [(0.012, DADO + 0.03 - drop), (-0.01, DADO + 0.03 - drop)]
    cornice = [(-0.01, HEIGHT - 0.11), (0.004, HEIGHT - 0.11), (0.018, HEIGHT - 0.085 - drop), (0.058, HEIGHT - 0.036)]
    cornice += [(0.075, HEIGHT - 0.016 - drop), (0.075, HEIGHT + 0.01), (-0.01, HEIGHT + 0.01)]
    mouldings = [_strip(profile, start, end) for profile in (skirting, rail, cornice)]
    count = 7 if long_wall else 6
    pitch = 2 * half / count
    for k in range(count):
        left, right = -half + k * pitch + 0.09, -half + (k + 1) * pitch - 0.09
        low, high = 0.2, DADO - 0.11
        for lower, upper in (
            ((left, low, -0.01), (right, low + 0.03, 0.012)),
            ((left, high - 0.03, -0.01), (right, high, 0.012)),
            ((left + 0.001, low + 0.01, -0.01), (left + 0.03, high - 0.01, 0.011)),
            ((right - 0.03, low + 0.01, -0.01), (right - 0.001, high - 0.01, 0.011)),
        ):
            mouldings.append(block(lower, upper))
    return [(join(mouldings), "paint")]


def _fireplace() -> list[Part]:
    """Chimney breast with a brick hearth, in the frame of the back wall; the opening is 0.96 m x 0.74 m."""
    depth, half, jamb, lintel = 0.4, 0.86, 0.48, 0.74
    bricks = [
        block((-half, -0.01, -0.01), (-jamb, 1.12, depth), 0.64),
        block((jamb, -0.01, -0.01), (half, 1.12, depth), 0.64),
        block((-jamb - 0.01, lintel, -0.008), (jamb + 0.01, 1.115, depth + 0.012), 0.64),
    ]
    breast = block((-half + 0.03, 1.097, -0.01), (half - 0.03, HEIGHT + 0.01, depth - 0.06), 1.5)
    ledge = prism([(-0.006, 1.05), (0.44, 1.05), (0.49, 1.09), (0.49, 1.1), (-0.006, 1.1)], 1.9)
    shelf = block((-half - 0.12, 1.095, -0.005), (half + 0.12, 1.16, depth + 0.16), 0.8)
    slab = block((-half - 0.06, -0.02, 0.046), (half + 0.06, 0.055, depth + 0.42), 1.2)
    soot = block((-jamb - 0.005, 0.02, -0.005), (jamb + 0.005, lintel + 0.005, 0.05), 0.64)
    return [
        (join(bricks), "brick"),
        (breast, "plaster"),
        (ledge.turned("y", -90.0).moved(half + 0.09), "beam"),
        (shelf, "beam"),
        (slab, "stone"),
        (soot, "soot"),
    ]


def _grate() -> list[Part]:
    """An iron basket with burning logs, in the frame of the back wall."""
    irons = []
    for x in np.linspace(-0.3, 0.3, 7):
        bar = curve([(x, 0.14, 0.1), (x, 0.13, 0.3), (x, 0.15, 0.36), (x, 0.24, 0.38)], 10)
        irons.append(tube(bar, 0.008, 8))
    for y, z in ((0.13, 0.12), (0.125, 0.31), (0.22, 0.372)):
        irons.append(rod(0.009, 0.7, 8).turned("z", 90.0).moved(0.35, y, z))
    for x in (-0.31, 0.31):
        for z in (0.14, 0.33):
            irons.append(rod(0.011, 0.1, 8).moved(x, 0.04, z))
    rng = np.random.default_rng(5)
    logs = []
    for x, y, z, yaw, size in (
        (0, 0.18, 0.17, 4, 0.045),
        (0.01, 0.18, 0.29, -5, 0.042),
        (-0.02, 0.26, 0.235, 14, 0.04),
    ):
        along = np.linspace(-0.27, 0.27, 9)
        path = np.stack([along, 0.008 * np.sin(9 * along + 3 * yaw), 0.01 * np.cos(7 * along)], axis=1)
        logs.append(tube(path, size * rng.uniform(0.88, 1.1, 9), 14).turned("y", yaw).moved(x, y, z))
    flames = [
        _flame(height, bend).turned("y", turn).moved(x, 0.29, z)
        for x, z, height, bend, turn in (
            (-0.16, 0.24, 0.17, 0.035, 40), (-0.05, 0.21, 0.3, -0.03, 80), (0.05, 0.26, 0.21, 0.045, 10),
            (0.15, 0.22, 0.24, 0.03, -30),
        )
    ]  # fmt: skip
    return [(join(irons), "iron"), (join(logs), "bark"), (join(flames), "flame")]


def _flame(height: float, bend: float) -> Shape:
    """A tongue of fire from y = 0, that sways by ``bend`` along x: few triangles, because it is a light."""
    t = np.array([0.0, 0.18, 0.42, 0.7, 1.0])
    path = np.stack([bend * np.sin(3.4 * t), height * t, np.zeros(5)], axis=1)
    return tube(path, 0.16 * height * np.array([0.35, 0.85, 1.0, 0.55, 0.06]), 5)


def _window() -> list[Part]:
    """A casement on a dark night, with its sill and the curtain rod, in the frame of the wall."""
    low, high, half = 0.95, 2.25, 0.62
    night = block((-half, low, -0.01), (half, high, 0.012))
    frame = [
        block((-half - 0.06, low - 0.05, -0.01), (-half + 0.02, high + 0.05, 0.05)),
        block((half - 0.02, low - 0.05, -0.01), (half + 0.06, high + 0.05, 0.05)),
        block((-half - 0.05, high - 0.02, -0.01), (half + 0.05, high + 0.06, 0.048)),
        block((-half - 0.1, low - 0.04, -0.01), (half + 0.1, low + 0.015, 0.062)),
        block((-0.035, low + 0.002, -0.01), (0.035, high - 0.002, 0.042)),
    ]
    for k in (1, 2):
        y = low + (high - low) * k / 3
        frame.append(block((-half + 0.004, y - 0.014, -0.01), (half - 0.004, y + 0.014, 0.033)))
    rail = rod(0.016, 2.8, 16).turned("z", 90.0).moved(1.4, 2.42, 0.13)
    ends = [ball(0.035, 20).moved(x, 2.42, 0.13) for x in (-1.42, 1.42)]
    brackets = [block((x - 0.012, 2.40, -0.01), (x + 0.012, 2.43, 0.125)) for x in (-1.3, 1.3)]
    return [(night, "night"), (join(frame), "paint"), (join([rail, *ends, *brackets]), "brass")]


def _curtain(start: float, end: float, seed: int) -> Shape:
    """Heavy cloth in folds that open towards the hem, hanging from the rod, in the frame of the wall."""
    rng = np.random.default_rng(seed)
    rows, columns, folds = 14, 100, 5.5
    fall = np.linspace(0.0, 1.0, rows)[:, None]  # 0 at the rod, 1 at the hem
    across = np.linspace(0.0, 1.0, columns)[None, :]
    start_a, start_b = rng.uniform(0.0, 2 * math.pi, 2)
    wander = 0.1 * np.sin(7.0 * across + start_a) + 0.06 * np.sin(15.0 * across + start_b)
    phase = 2 * math.pi * (folds * across + fall * wander)
    swell = 0.025 + 0.017 * fall**0.7
    outwards = 0.13 + swell * np.sin(phase) + 0.012 * np.sin(3.1 * fall + 5 * across)
    sideways = start + (end - start) * across + 0.02 * fall * (across - 0.5)
    points: F64 = np.empty((rows, columns, 3))
    points[..., 0], points[..., 1], points[..., 2] = sideways, 2.4 - 2.37 * fall, outwards
    return sheet(points, 0.003, (3.0, 4.0))


def _door() -> list[Part]:
    """A panelled door, closed, with its frame, in the frame of the wall."""
    leaf = [block((-0.42, 0.008, -0.01), (0.42, 2.04, 0.028))]
    for low, high in ((0.163, 0.783), (0.923, 1.363), (1.503, 1.923)):
        for left in (-0.34, 0.05):
            leaf.append(block((left, low, 0.004), (left + 0.29, high, 0.038)))
            leaf.append(block((left + 0.03, low + 0.03, 0.006), (left + 0.26, high - 0.03, 0.046)))
    frame = [
        block((-0.52, -0.01, -0.01), (-0.415, 2.13, 0.06)),
        block((0.415, -0.01, -0.01), (0.52, 2.13, 0.06)),
        block((-0.54, 2.035, -0.01), (0.54, 2.16, 0.066)),
    ]
    knob = [rod(0.012, 0.05, 12).turned("x", 90.0), ball(0.028, 20).moved(z=0.06)]
    knob.append(rod(0.03, 0.006, 16).turned("x", 90.0).moved(z=0.001))
    return [(join(leaf + frame), "paint"), (join(knob).moved(0.36, 1.0, 0.026), "brass")]
