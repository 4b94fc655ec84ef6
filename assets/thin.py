"""A picket fence, a wire mesh, grass, a shrub and a hedge of cut-out twigs: much that is thinner than a pixel.

There for disocclusion: with every step of the camera strips of the background come into view that have no history, and
guides change from pixel to pixel.
"""

from __future__ import annotations

import numpy as np

from assets import textures
from assets.motion import slide, swing
from assets.plants import leaf
from assets.sets import panel, room, stage_with_paints, swaying
from assets.shapes import Shape, block, join, quad
from assets.stage import Part
from assets.surfaces import rod, tube
from assets.textures import linear
from raytrace.scene import Scene

CYCLE = 4.0
"""Seconds after which lamp and gate are back."""

_EYE, _TARGET = (0.2, 1.25, 5.4), (0.0, 0.75, 1.2)


def _picket(height: float) -> Shape:
    """A board with a pointed end, 6 cm wide and 12 mm thick, from y = 0."""
    outline = [(-0.03, 0.0), (0.03, 0.0), (0.03, height - 0.04), (0.0, height), (-0.03, height - 0.04)]
    front = [(x, y, 0.006) for x, y in outline]
    back = [(x, y, -0.006) for x, y in outline]
    count = len(outline)
    sides = [[back[i], back[(i + 1) % count], front[(i + 1) % count], front[i]] for i in range(count)]
    return join([_fan(front), _fan(back[::-1]), *(_fan(side) for side in sides)])


def _fan(corners: list[tuple[float, float, float]]) -> Shape:
    """A flat convex polygon, counter-clockwise seen from its front."""
    points = np.array(corners)
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    normal /= np.linalg.norm(normal)
    index = np.arange(1, len(points) - 1)
    faces = np.stack([np.zeros_like(index), index, index + 1], axis=1).astype(np.int32)
    normals = np.tile(normal.astype(np.float32), (len(points), 1))
    return Shape(points, faces, normals, points[:, :2].astype(np.float32))


def _fence(left: float, count: int) -> list[Part]:
    """Pickets every 11 cm from ``left``, with two rails behind them."""
    pickets = [(_picket(0.95).moved(left + 0.11 * k, 0.05, 0.0), "white") for k in range(count)]
    right = left + 0.11 * (count - 1)
    rails = [(block((left - 0.05, y, -0.03), (right + 0.05, y + 0.05, -0.007)), "wood") for y in (0.25, 0.72)]
    return [*pickets, *rails]


def _mesh(width: float, height: float, spacing: float) -> list[Part]:
    """Wires of 5 mm in a frame, upright ones before the level ones; from x = 0 and y = 0."""
    columns, rows = (spacing * np.arange(1, round(side / spacing)) for side in (width, height))
    upright = [rod(0.0025, height, 6).moved(float(x), 0.0, 0.003) for x in columns]
    level = [rod(0.0025, width, 6).turned("z", -90.0).moved(0.0, float(y), -0.003) for y in rows]
    posts = [rod(0.02, height + 0.03, 12).moved(x, 0.0, 0.0) for x in (0.0, width)]
    return [(join([*upright, *level]), "steel"), (join(posts), "steel")]


def _grass(rng: np.random.Generator, count: int) -> Shape:
    blades = []
    for _ in range(count):
        blade = leaf(float(rng.uniform(0.12, 0.34)), 0.012, float(rng.uniform(0.3, 1.2)), 0.25, 5, 3)
        blade = blade.turned("x", float(rng.uniform(-85, -60))).turned("y", float(rng.uniform(0, 360)))
        blades.append(blade.moved(float(rng.uniform(-2.6, 2.6)), -0.01, float(rng.uniform(2.75, 3.3))))
    return join(blades)


def _shrub(rng: np.random.Generator, twigs: int) -> tuple[Shape, Shape]:
    """Leaves and twigs about the origin, 1.3 m high."""
    stems, leaves = [], []
    for k in range(twigs):
        way, lean, tall = 2.4 * k, float(rng.uniform(0.1, 0.5)), float(rng.uniform(0.7, 1.3))
        t = np.linspace(0.0, 1.0, 8)
        path = np.stack([lean * np.cos(way) * t**1.4, tall * t, lean * np.sin(way) * t**1.4], axis=1)
        stems.append(tube(path, np.linspace(0.008, 0.003, 8), 6))
        for i in range(16):
            at = 0.25 + 0.75 * (i + 0.5) / 16
            x, y, z = (float(np.interp(at, t, path[:, axis])) for axis in range(3))
            blade = leaf(float(rng.uniform(0.07, 0.12)), 0.045, float(rng.uniform(0.2, 0.8)), 0.2, 4, 3)
            turned = blade.moved(z=0.01).turned("x", float(rng.uniform(-60, 10))).turned("y", 137.5 * i + 50 * k)
            leaves.append(turned.moved(x, y, z))
    return join(leaves), join(stems)


def _hedge(rng: np.random.Generator, count: int) -> Shape:
    """Cards with a twig on each, in a box 1.1 m wide, 1 m high and 0.4 m deep above the origin."""
    card = quad([(-0.16, 0.0, 0.0), (0.16, 0.0, 0.0), (0.16, 0.32, 0.0), (-0.16, 0.32, 0.0)])
    cards = []
    for _ in range(count):
        turned = card.turned("x", float(rng.uniform(-50, 50))).turned("y", float(rng.uniform(-75, 75)))
        x, y, z = rng.uniform((-0.55, 0.05, -0.2), (0.55, 0.75, 0.2)).tolist()
        cards.append(turned.moved(x, y, z))
    return join(cards)


def build(*, animate: bool = False) -> Scene:
    """With ``animate`` the lamp slides and a gate of wire swings."""
    stage = stage_with_paints(animate, "white", "red", "blue", "green")
    stage.material("wallpaper", linear("#d9dcbf"), stage.texture("wallpaper", textures.wallpaper()))
    stage.material("parquet", (1.0, 1.0, 1.0), stage.texture("parquet", textures.parquet()))
    stage.material("wood", (0.35, 0.22, 0.12))
    stage.material("steel", (0.35, 0.36, 0.38))
    twig, coverage = textures.twig()
    stage.material("twig", (1.0, 1.0, 1.0), stage.texture("twig", twig, coverage), cutoff=0.5)
    stage.material("lamp", (0.5, 0.5, 0.5), emission=(11.0, 10.0, 8.5))
    rng = np.random.default_rng(5)
    stage.add("room", room(6.0, 2.6, 5.0, "wallpaper", "red", "blue", "parquet"))
    stage.add("fence", [(shape.moved(z=2.2), material) for shape, material in _fence(-2.6, 26)])
    stage.add("mesh", [(shape.moved(1.1, 0.015, 1.1), material) for shape, material in _mesh(1.6, 1.5, 0.05)])
    stage.add("gate", _mesh(0.9, 1.2, 0.06), swing((0.35, 0.015, 2.2), "y", 40.0, CYCLE))
    leaves, stems = _shrub(rng, 26)
    stage.add("shrub", [(leaves.moved(-1.3, 0.0, 1.1), "green"), (stems.moved(-1.3, 0.0, 1.1), "wood")])
    stage.add("hedge", [(_hedge(rng, 110).moved(1.9, 0.0, 2.0), "twig")])
    stage.add("grass", [(_grass(rng, 420), "green")])
    stage.add("lamp", [(panel(1.6, 1.0), "lamp")], slide((0.0, 2.55, 2.9), (0.7, 0.0, 0.0), CYCLE))
    flight = swaying(_EYE, _TARGET, 0.8, 0.9, 40.0)
    return stage.scene("thin", flight(0.0), flight)
