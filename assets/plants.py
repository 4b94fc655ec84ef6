"""Pot plants. Every leaf is a thin closed sheet."""

from __future__ import annotations

import math

import numpy as np

from assets.shapes import Shape, join
from assets.stage import Part
from assets.surfaces import curve, lathe, sheet, tube
from raytrace.scene import F64


def leaf(length: float, width: float, droop: float, fold: float, rows: int = 6, columns: int = 5) -> Shape:
    """A leaf from the origin towards +z, its upper side towards +y.

    ``droop``: angle in radians by which the tip is bent down; ``fold``: rise of the edges above the midrib, as a
    fraction of their distance from it.
    """
    t = np.linspace(0.0, 1.0, rows)
    bend = droop * (t[1:] + t[:-1]) / 2
    steps = length / (rows - 1) * np.stack([np.sin(bend), np.cos(bend)], axis=1)  # down, forward
    spine = np.concatenate([[[0.0, 0.0]], np.cumsum(steps, axis=0)])
    half = width / 2 * (0.12 + 0.88 * np.sin(math.pi * t**0.75) ** 0.8 * (1 - 0.12 * t))
    side = np.linspace(-1.0, 1.0, columns)
    points: F64 = np.empty((rows, columns, 3))
    points[..., 0] = half[:, None] * side
    points[..., 1] = -spine[:, :1] + fold * half[:, None] * np.abs(side)
    points[..., 2] = spine[:, 1:]
    return sheet(points, 0.0012)


def pot(radius: float, height: float) -> list[Part]:
    """A flowerpot with earth in it, standing a millimetre in y = 0; its rim is at ``height``."""
    wall = [(0.0, -0.001), (0.72 * radius, -0.001), (0.74 * radius, 0.01), (0.93 * radius, 0.78 * height)]
    wall += [(radius, 0.79 * height), (1.02 * radius, 0.99 * height), (0.99 * radius, height), (0.92 * radius, height)]
    wall += [(0.9 * radius, 0.86 * height), (0.0, 0.85 * height)]
    earth = lathe(
        [(0.0, 0.84 * height), (0.905 * radius, 0.84 * height), (0.6 * radius, 0.9 * height), (0, 0.91 * height)], 32
    )
    return [(lathe(wall, 48), "terracotta"), (earth, "earth")]


def rubber_tree(seed: int, height: float) -> list[Part]:
    """Broad leaves in a spiral around three stems."""
    rng = np.random.default_rng(seed)
    parts = pot(0.19, 0.34)
    stems, leaves = [], []
    for k in range(3):
        way, tall = 2.1 * k + 0.4, height * (1.0 - 0.17 * k)
        lean = rng.uniform(0.08, 0.16)
        t = np.linspace(0.0, 1.0, 14)
        path = np.stack(
            [
                0.05 * np.cos(way) + lean * np.cos(way) * t**1.5,
                0.27 + (tall - 0.27) * t,
                0.05 * np.sin(way) + lean * np.sin(way) * t**1.5,
            ],
            axis=1,
        )
        stems.append(tube(path, np.linspace(0.013, 0.005, 14), 8))
        count = int(26 * (tall - 0.4))
        for i in range(count):
            up = 0.22 + 0.78 * (i + 0.5) / count
            x, y, z = (float(np.interp(up, t, path[:, axis])) for axis in range(3))
            size = rng.uniform(0.2, 0.27) * (1.1 - 0.45 * up)
            blade = leaf(size, 0.46 * size, rng.uniform(0.5, 1.1), 0.22)
            pitch = -65.0 * up + 18.0 + rng.uniform(-12, 12)
            leaves.append(blade.moved(z=0.035).turned("x", pitch).turned("y", 137.5 * i + 40 * k).moved(x, y, z))
    return [*parts, (join(stems), "stem"), (join(leaves), "leaf")]


def palm(seed: int, size: float) -> list[Part]:
    """Arching fronds of narrow leaflets out of one pot."""
    rng = np.random.default_rng(seed)
    parts = pot(0.2, 0.36)
    leaflets = [leaf(1.0, 0.036, droop, 0.3, 4, 3) for droop in (0.45, 0.6, 0.75, 0.9)]
    stems, leaves = [], []
    fronds = 13
    for k in range(fronds):
        turn, inner = 137.5 * k, k / fronds
        length = size * (1.15 - 0.4 * inner) * rng.uniform(0.9, 1.05)
        t = np.linspace(0.0, 1.0, 11)
        pitch = math.radians(86 - 26 * inner) - (0.7 + 0.8 * inner) * t**1.3 * rng.uniform(0.85, 1.15)
        steps = np.diff(t)[:, None] * length * np.stack([np.sin(pitch[1:]), np.cos(pitch[1:])], axis=1)
        spine = np.concatenate([[[0.0, 0.0]], np.cumsum(steps, axis=0)])
        path = np.stack([np.zeros(11), 0.3 + spine[:, 0], 0.03 + spine[:, 1]], axis=1)
        frond = [tube(path, np.linspace(0.008, 0.0025, 11), 6)]
        blades = []
        for i in range(12):
            at = 0.26 + 0.74 * i / 12
            y, z = float(np.interp(at, t, path[:, 1])), float(np.interp(at, t, path[:, 2]))
            slope = math.degrees(float(np.interp(at, t, pitch)))
            reach = 0.3 * size * math.sin(math.pi * (0.12 + 0.84 * at)) ** 0.7
            for side in (-1, 1):
                blade = leaflets[rng.integers(len(leaflets))].stretched(z=reach)
                blades.append(blade.turned("y", side * (58 - 26 * at)).turned("x", -slope).moved(0.0, y, z))
        stems.append(join(frond).turned("y", turn))
        leaves.append(join(blades).turned("y", turn))
    return [*parts, (join(stems), "stem"), (join(leaves), "palm leaf")]


def ivy(seed: int, strands: int, length: float) -> list[Part]:
    """A small pot whose strands fall over the edge in front of it (+z)."""
    rng = np.random.default_rng(seed)
    scale = 0.42
    parts: list[Part] = [(shape.scaled(scale), material) for shape, material in pot(0.19, 0.3)]
    blades = [leaf(0.05, 0.038, droop, 0.15, 4, 3) for droop in (0.25, 0.5, 0.75)]
    stems, leaves = [], []
    for k in range(strands):
        way = math.radians(-70 + 140 * (k + 0.5) / strands + rng.uniform(-8, 8))
        fall, sway = length * rng.uniform(0.45, 1.0), rng.uniform(-0.03, 0.03, 3)
        # Out of the pot, over its edge, down: distance in front of the pot's axis, height, drift to the side.
        controls = [(0.02, 0.11, 0.0), (0.06, 0.15, 0.0), (0.105, 0.13, 0.0), (0.13, 0.04, sway[0])]
        controls += [(0.135, -0.5 * fall, sway[1]), (0.13, 0.1 - fall, sway[2])]
        out, drop, drift = curve(controls, 22).T
        t = np.linspace(0.0, 1.0, 22)
        path = np.stack([out * math.sin(way) + drift, drop, out * max(math.cos(way), 0.55)], axis=1)
        stems.append(tube(path, 0.0018, 5))
        count = int(fall / 0.03)
        for i in range(count):
            at = (i + 1.0) / count
            x, y, z = (float(np.interp(at, t, path[:, axis])) for axis in range(3))
            blade = blades[rng.integers(len(blades))].stretched(z=rng.uniform(0.8, 1.25))
            turn = math.degrees(way) + rng.uniform(-75, 75)
            leaves.append(blade.turned("x", rng.uniform(15, 65)).turned("y", turn).moved(x, y, z))
    return [*parts, (join(stems), "stem"), (join(leaves), "ivy leaf")]
