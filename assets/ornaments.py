"""Small things of the interior, and those that can move: toy train, globe, longcase clock."""

from __future__ import annotations

import math

import numpy as np

from assets.shapes import Shape, block, box, join, prism, rounded_box
from assets.stage import Part, placed
from assets.surfaces import ball, curve, lathe, ring, rod, tube


def vase(height: float, glaze: str) -> list[Part]:
    """A vase with a wall of its own thickness, y = 0 is what it stands on."""
    h = height
    outside = curve([(0.2, 0.0), (0.3, 0.2), (0.34, 0.45), (0.22, 0.72), (0.13, 0.86), (0.19, 1.0)], 15) * h
    inside = curve([(0.17, 0.995), (0.11, 0.86), (0.19, 0.72), (0.3, 0.45), (0.26, 0.2), (0.14, 0.05)], 8) * h
    return [(lathe([(0.0, 0.0), *outside.tolist(), *inside.tolist(), (0.0, 0.05 * h)], 28).moved(y=-0.001), glaze)]


def teapot() -> list[Part]:
    """A round teapot, 0.17 m high, spout towards +x."""
    body = curve([(0.05, 0.0), (0.075, 0.02), (0.09, 0.06), (0.07, 0.105), (0.04, 0.122)], 16).tolist()
    lid = [(0.042, 0.124), (0.03, 0.135), (0.012, 0.142), (0.008, 0.148), (0.015, 0.157), (0.01, 0.166), (0.0, 0.168)]
    pot = lathe([(0.0, 0.0), *body, *lid], 36).moved(y=-0.001)
    spout = tube(
        curve([(0.07, 0.045, 0), (0.105, 0.06, 0), (0.12, 0.1, 0), (0.145, 0.122, 0)], 16),
        np.linspace(0.02, 0.009, 16),
        16,
    )
    handle = tube(
        curve([(-0.072, 0.1, 0), (-0.11, 0.112, 0), (-0.135, 0.08, 0), (-0.115, 0.045, 0), (-0.08, 0.035, 0)], 24),
        0.007,
        12,
    )
    return [(pot.mapped((1.0, 0.7)), "porcelain"), (join([spout, handle]), "china")]


def cup() -> list[Part]:
    """A tea cup on its saucer."""
    saucer = lathe(
        [(0, 0), (0.03, 0), (0.034, 0.004), (0.066, 0.012), (0.066, 0.015), (0.034, 0.008), (0.0, 0.007)], 40
    ).moved(y=-0.001)
    wall = [(0.0, 0.006), (0.02, 0.006), (0.022, 0.01), (0.034, 0.03), (0.04, 0.06), (0.038, 0.06), (0.031, 0.032)]
    bowl = lathe([*wall, (0.0, 0.02)], 40)
    handle = tube(curve([(0.034, 0.05, 0), (0.055, 0.05, 0), (0.056, 0.03, 0), (0.031, 0.025, 0)], 14), 0.004, 10)
    tea = lathe([(0, 0.045), (0.0352, 0.045), (0.0354, 0.0455), (0.0, 0.046)], 32)
    return [(join([saucer, bowl, handle]), "china"), (tea, "tea")]


def fruit_bowl(seed: int) -> list[Part]:
    """A wooden bowl with oranges and apples."""
    rng = np.random.default_rng(seed)
    wall = (
        curve([(0.05, 0.0), (0.11, 0.03), (0.15, 0.085)], 14).tolist()
        + curve([(0.143, 0.085), (0.1, 0.035), (0.0, 0.018)], 14).tolist()
    )
    wall[-1] = [0.0, 0.018]
    parts: list[Part] = [(lathe([(0.0, 0.0), *wall], 48).moved(y=-0.001), "walnut")]
    places = [(0.07 * math.cos(1.257 * k), 0.075, 0.07 * math.sin(1.257 * k)) for k in range(5)] + [(0.0, 0.125, 0.0)]
    for k, (x, y, z) in enumerate(places):
        size = rng.uniform(0.034, 0.039)
        fruit = ball(size, 16).turned("x", rng.uniform(-40, 40))
        parts.append((fruit.moved(x, y, z), ("orange", "apple")[k % 2]))
    return parts


def candlestick(height: float) -> list[Part]:
    """A turned brass candlestick with an unlit candle."""
    profile = [(0, -0.001), (0.045, -0.001), (0.046, 0.008), (0.02, 0.02), (0.009, 0.05), (0.015, 0.3 * height)]
    profile += [(0.008, 0.5 * height), (0.008, 0.85 * height), (0.024, 0.95 * height), (0.024, height), (0, height)]
    candle = lathe([(0, height - 0.01), (0.011, height - 0.01), (0.011, height + 0.16), (0, height + 0.165)], 20)
    return [(lathe(profile, 32), "brass"), (candle, "cream")]


GLOBE_CENTRE = (0.0, 0.72, 0.0)
GLOBE_TILT = -23.5


def globe_stand() -> list[Part]:
    """The stand of a floor globe: three feet, a turned pillar, a meridian ring about :data:`GLOBE_CENTRE`."""
    pillar = [
        (0, 0.1),
        (0.03, 0.1),
        (0.042, 0.14),
        (0.02, 0.2),
        (0.03, 0.3),
        (0.018, 0.4),
        (0.02, 0.44),
        (0.05, 0.462),
        (0, 0.47),
    ]
    feet = []
    for k in range(3):
        path = curve([(0.0, 0.16, 0.0), (0.1, 0.13, 0.0), (0.19, 0.04, 0.0), (0.24, 0.018, 0.0)], 14)
        feet.append(tube(path, np.linspace(0.02, 0.015, 14), 12).turned("y", 120.0 * k + 20))
    x, y, z = GLOBE_CENTRE
    meridian = ring(0.245, 0.014, 56, 8).turned("x", 90.0).moved(x, y, z)
    pins = join([rod(0.006, 0.03, 8).moved(y=0.218), rod(0.006, 0.03, 8).moved(y=-0.248)])
    return [
        (join([lathe(pillar, 32), *feet]), "walnut"),
        (join([meridian, pins.turned("z", GLOBE_TILT).moved(x, y, z)]), "brass"),
    ]


def globe() -> list[Part]:
    """The ball of the globe about its own centre, poles on the y axis."""
    return [(ball(0.22, 48), "globe")]


TRACK_RADIUS = 0.86


def track() -> list[Part]:
    """A circular toy railway of radius :data:`TRACK_RADIUS` on y = 0."""
    rails = [ring(TRACK_RADIUS + side * 0.022, 0.005, 96, 5).moved(y=0.012) for side in (-1, 1)]
    count = 72
    sleepers = [
        box((0.075, 0.006, 0.016)).moved(TRACK_RADIUS, 0.006, 0.0).turned("y", 360.0 * k / count) for k in range(count)
    ]
    return [(join(rails), "steel"), (join(sleepers), "walnut dark")]


def train() -> list[Part]:
    """A locomotive and four wagons on the circle of :func:`track`, about the circle's centre.

    It is one rigid body that turns about the y axis, anticlockwise seen from above.
    """
    parts: list[Part] = []
    # Each vehicle is made at the origin, driving towards -z, which is where +x goes under a positive turn about y.
    for k, vehicle in enumerate([_locomotive(), _wagon("train green"), _wagon("train yellow"), _wagon("train blue")]):
        parts += placed(placed(vehicle, 0.0, TRACK_RADIUS), -11.6 * k)
    return parts


def _wheels(offsets: tuple[float, ...], radius: float) -> list[Shape]:
    wheel = rod(radius, 0.008, 12).turned("z", 90.0)
    return [wheel.moved(x, 0.0145 + radius, z) for z in offsets for x in (-0.018, 0.026)]


def _locomotive() -> list[Part]:
    boiler = rod(0.026, 0.1, 24).turned("x", -90.0).moved(0.0, 0.07, 0.025)
    cab = rounded_box((0.066, 0.06, 0.05), 0.004, 1).moved(0.0, 0.076, 0.045)
    roof = rounded_box((0.078, 0.008, 0.064), 0.003, 1).moved(0.0, 0.109, 0.045)
    frame = box((0.056, 0.016, 0.15)).moved(0.0, 0.042, -0.005)
    buffer = (
        prism([(-0.03, 0.0), (0.03, 0.0), (0.03, 0.012), (-0.03, 0.012)], 0.03).turned("x", 25.0).moved(0, 0.02, -0.1)
    )
    chimney = lathe([(0, 0), (0.008, 0), (0.008, 0.03), (0.014, 0.045), (0.01, 0.046), (0, 0.04)], 20).moved(
        0, 0.092, -0.05
    )
    dome = lathe([(0, 0), (0.011, 0), (0.011, 0.01), (0.007, 0.017), (0, 0.019)], 20).moved(0, 0.09, -0.015)
    return [
        (join([boiler, cab]), "train red"),
        (join([roof, frame, buffer, chimney]), "iron"),
        (dome, "brass"),
        (join(_wheels((-0.05, -0.005, 0.045), 0.018)), "iron"),
    ]


def _wagon(paint: str) -> list[Part]:
    body = rounded_box((0.062, 0.045, 0.12), 0.004, 1).moved(0.0, 0.068, 0.0)
    frame = box((0.05, 0.012, 0.134)).moved(0.0, 0.042, 0.0)
    roof = rounded_box((0.068, 0.008, 0.128), 0.003, 1).moved(0.0, 0.093, 0.0)
    hook = block((-0.004, 0.038, -0.09), (0.004, 0.044, 0.0))
    return [(body, paint), (join([frame, hook, *_wheels((-0.035, 0.035), 0.013)]), "iron"), (roof, "cream")]


PENDULUM_PIVOT = (0.0, 1.52, 0.13)


def clock_case() -> list[Part]:
    """A longcase clock against z = 0, 2.08 m high, its trunk open in front to show the pendulum."""
    wood = [
        block((-0.25, -0.004, -0.005), (0.25, 0.4, 0.25), 0.6),
        block((-0.265, -0.003, -0.004), (0.265, 0.07, 0.265), 0.6),
        block((-0.262, 0.385, -0.004), (0.262, 0.415, 0.262), 0.6),
        block((-0.2, 0.41, -0.003), (-0.165, 1.6, 0.21), 0.6),
        block((0.165, 0.41, -0.003), (0.2, 1.6, 0.21), 0.6),
        block((-0.17, 0.412, 0.185), (0.17, 0.47, 0.207), 0.6),
        block((-0.17, 1.5, 0.16), (0.17, 1.598, 0.207), 0.6),
        block((-0.262, 1.585, -0.004), (0.262, 1.615, 0.262), 0.6),
        block((-0.24, 1.61, -0.005), (0.24, 2.02, 0.235), 0.6),
        block((-0.27, 2.015, -0.004), (0.27, 2.045, 0.27), 0.6),
        block((-0.2, 2.04, -0.003), (0.2, 2.08, 0.2), 0.6),
    ]
    back = block((-0.17, 0.405, -0.004), (0.17, 1.605, 0.036), 0.6)
    rim = ring(0.185, 0.024, 48, 8).turned("x", 90.0).moved(0, 1.815, 0.236)
    knobs = [ball(0.03, 20).moved(x, 2.075, 0.22) for x in (-0.22, 0.22)]
    return [(join(wood), "walnut"), (back, "walnut dark"), (_face(), "dial"), (join([rim, *knobs]), "brass")]


def _face() -> Shape:
    """The dial, a disc 4 mm in front of the hood."""
    turn = np.linspace(0.0, 2 * math.pi, 64, endpoint=False)
    disc = prism(0.18 * np.stack([np.cos(turn), np.sin(turn)], axis=1), 0.009)
    uvs = (disc.vertices[:, :2] / 0.36 + 0.5).astype(np.float32)
    return Shape(disc.vertices, disc.faces, disc.normals, uvs).moved(0, 1.815, 0.23)


def pendulum() -> list[Part]:
    """Rod and bob, hanging from the origin in the xy plane."""
    bob = lathe([(0, -0.012), (0.05, -0.01), (0.075, 0.0), (0.05, 0.01), (0, 0.012)], 40, 60.0).turned("x", 90.0)
    return [(join([rod(0.004, 0.86, 8).moved(y=-0.86), bob.moved(y=-0.86)]), "brass")]
