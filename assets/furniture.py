"""Sofa, armchair, tables, rug and picture frames of the interior. Each is made about its own origin, facing +z."""

from __future__ import annotations

import math

import numpy as np

from assets.shapes import Shape, block, cushion, join, rounded_box
from assets.stage import Part
from assets.surfaces import curve, lathe, ring, rod, sheet, tube


def _leg(height: float, top: float = 0.026, foot: float = 0.016) -> Shape:
    """A turned, tapering leg that stands a millimetre in the floor."""
    profile = [
        (0, -0.001),
        (foot, -0.001),
        (foot * 1.1, 0.3 * height),
        (top, 0.85 * height),
        (top, height),
        (0, height),
    ]
    return lathe(profile, 16)


def sofa() -> list[Part]:
    """Three seats, 2.16 m x 0.92 m, facing +z."""
    frame = [
        rounded_box((2.0, 0.2, 0.82), 0.03, texel_metres=0.5).moved(0.0, 0.25, 0.0),
        rounded_box((1.9, 0.6, 0.2), 0.085, 4, texel_metres=0.5).turned("x", -8.0).moved(0.0, 0.56, -0.34),
    ]
    for side in (-1, 1):
        arm = rounded_box((0.22, 0.46, 0.9), 0.1, 4, texel_metres=0.5)
        frame.append(arm.moved(side * 0.97, 0.4, 0.0))
    for k in (-1, 0, 1):
        seat = cushion((0.575, 0.16, 0.68), 0.055, 0.03)
        frame.append(seat.moved(k * 0.58, 0.435, 0.08))
        back = cushion((0.57, 0.15, 0.44), 0.055, 0.045)
        frame.append(back.turned("x", 76.0 + 2 * k).turned("y", 1.5 * k).moved(k * 0.58, 0.7, -0.15))
    legs = [_leg(0.17).moved(x, 0.0, z) for x in (-0.9, 0.9) for z in (-0.33, 0.33)]
    return [(join(frame), "linen"), (join(legs), "walnut")]


def pillow(size: float) -> Shape:
    """A scatter cushion, a square of side ``size`` in the xz plane."""
    return cushion((size, 0.036, size), 0.017, 0.082, inner=6)


def leaning(shape: Shape, tilt: float, turn: float, x: float, y: float, z: float) -> Shape:
    """A pillow set on its edge, tilted back from upright by ``tilt`` degrees and turned about the vertical."""
    return shape.turned("x", 90.0 - tilt).turned("y", turn).moved(x, y, z)


def sofa_pillows() -> list[Part]:
    """Five scatter cushions and a folded throw for :func:`sofa`."""
    place = leaning
    return [
        (place(pillow(0.44), 22, 14, -0.66, 0.72, 0.06), "mustard"),
        (place(pillow(0.4), 26, -4, -0.44, 0.69, 0.17), "teal"),
        (place(pillow(0.44), 22, -16, 0.68, 0.72, 0.06), "rust"),
        (place(pillow(0.38), 28, 6, 0.46, 0.68, 0.18), "cream"),
        (_throw(), "throw"),
    ]


def _throw() -> Shape:
    """A blanket over the sofa's right arm: down its outside, over the top and down its inside."""
    over = curve([(1.1, 0.2), (1.098, 0.5), (1.075, 0.625), (0.97, 0.655), (0.87, 0.625), (0.845, 0.555)], 28)
    rows = np.linspace(-0.22, 0.22, 14)
    points = np.empty((14, 28, 3))
    ripple = 0.004 * np.sin(38 * rows)[:, None] * np.linspace(1.0, 0.3, 28)[None, :]
    points[..., 0] = over[None, :, 0] + ripple
    points[..., 1] = over[None, :, 1] + 0.3 * ripple
    points[..., 2] = rows[:, None] + 0.02 * np.sin(np.linspace(0, 3, 28))[None, :]
    return sheet(points, 0.008, (2.0, 2.0))


def armchair() -> list[Part]:
    """A wing chair, 0.8 m wide, facing +z."""
    shell = [
        rounded_box((0.66, 0.18, 0.66), 0.04, texel_metres=0.5).moved(0.0, 0.29, 0.0),
        rounded_box((0.62, 0.78, 0.16), 0.07, 4, texel_metres=0.5).turned("x", -11.0).moved(0.0, 0.7, -0.31),
        cushion((0.535, 0.15, 0.58), 0.055, 0.04).moved(0.0, 0.44, 0.06),
        cushion((0.5, 0.12, 0.52), 0.05, 0.05).turned("x", 77.0).moved(0.0, 0.76, -0.185),
    ]
    for side in (-1, 1):
        arm = rounded_box((0.14, 0.4, 0.68), 0.065, 4, texel_metres=0.5)
        shell.append(arm.moved(side * 0.34, 0.42, 0.02))
        wing = rounded_box((0.1, 0.46, 0.26), 0.045, 4, texel_metres=0.5)
        shell.append(wing.turned("x", -11.0).turned("y", -side * 8.0).moved(side * 0.335, 0.83, -0.2))
    legs = [_leg(0.22).moved(x, 0.0, z) for x in (-0.27, 0.27) for z in (-0.26, 0.26)]
    return [(join(shell), "leather"), (join(legs), "walnut")]


def round_table(radius: float, height: float) -> list[Part]:
    """A round table on three splayed legs with a ring between them; its top is at ``height``."""
    edge = [(-0.03, -0.034), (-0.006, -0.022), (0.0, -0.01), (-0.002, -0.003), (-0.008, 0.0)]
    profile = [(0.0, height - 0.034), *((radius + r, height + y) for r, y in edge), (0.0, height)]
    top = lathe(profile, 72, 30.0)
    flat = top.vertices[:, [0, 2]] / 0.9 + 0.5  # the grain runs across the top, not around it
    top = Shape(top.vertices, top.faces, top.normals, flat.astype(np.float32))
    legs = []
    for k in range(3):
        angle = 2 * math.pi * k / 3 + 0.5
        near, far = 0.62 * radius, 0.84 * radius
        path = np.linspace(
            (far * math.cos(angle), -0.004, far * math.sin(angle)),
            (near * math.cos(angle), height - 0.02, near * math.sin(angle)),
            8,
        )
        legs.append(tube(path, np.linspace(0.013, 0.024, 8), 16))
    brace = ring(0.77 * radius, 0.016, 48, 8).moved(y=0.3 * height)
    return [(top, "walnut"), (join(legs), "walnut"), (brace, "brass")]


def side_table(height: float) -> list[Part]:
    """A small pedestal table; its top is at ``height``."""
    profile = [(0, -0.001), (0.14, -0.001), (0.145, 0.012), (0.13, 0.022), (0.04, 0.045), (0.022, 0.09), (0.026, 0.2)]
    profile += [(0.018, 0.3), (0.03, height - 0.12), (0.02, height - 0.06), (0.06, height - 0.025)]
    profile += [(0.22, height - 0.022), (0.226, height - 0.01), (0.22, height), (0, height)]
    return [(lathe(profile, 40), "walnut")]


def sideboard() -> list[Part]:
    """A low cupboard against z = 0, 1.5 m wide, 0.78 m high."""
    body = block((-0.75, 0.12, 0.001), (0.75, 0.76, 0.4), 0.6)
    top = block((-0.77, 0.755, -0.005), (0.77, 0.785, 0.425), 0.6)
    doors, knobs = [], []
    for k in range(3):
        left = -0.73 + 0.49 * k
        doors.append(block((left, 0.15, 0.38), (left + 0.475, 0.73, 0.412), 0.6))
        doors.append(block((left + 0.06, 0.21, 0.39), (left + 0.415, 0.67, 0.418), 0.6))
        knobs.append(rod(0.012, 0.025, 12).turned("x", 90.0).moved(left + 0.44, 0.45, 0.41))
    legs = [_leg(0.14).moved(x, 0.0, z) for x in (-0.68, 0.68) for z in (0.06, 0.35)]
    return [(join([body, top, *doors, *legs]), "walnut"), (join(knobs), "brass")]


def rug(width: float, depth: float) -> list[Part]:
    """A knotted rug on y = 0, about the origin, with fringes at its two short ends (-x and +x)."""
    x, z = np.linspace(-width / 2, width / 2, 16), np.linspace(-depth / 2, depth / 2, 13)
    points = np.empty((len(z), len(x), 3))
    points[..., 0], points[..., 2] = x[None, :], z[:, None]
    points[..., 1] = 0.0055 + 0.0008 * np.sin(5 * x)[None, :] * np.cos(4 * z)[:, None]
    pile = sheet(points, 0.009)
    rng = np.random.default_rng(9)
    # Tassels point to +x; those of the other end are the same turned by half a turn.
    patterns = [
        tube(
            np.array([(-0.004, 0.006, 0), (0.03, 0.005, sway / 2), (0.06, 0.004, sway)]),
            np.array([0.003, 0.004, 0.003]),
            4,
        )
        for sway in (-0.011, -0.004, 0.004, 0.011)
    ]
    tassels = [
        patterns[rng.integers(4)].stretched(x=rng.uniform(0.85, 1.1)).moved(width / 2, 0.0, at).turned("y", turn)
        for turn in (0.0, 180.0)
        for at in np.arange(-depth / 2 + 0.012, depth / 2 - 0.005, 0.024)
    ]
    return [(pile, "rug"), (join(tassels), "cream")]


def picture(width: float, height: float, cell: tuple[int, int], mount: float, frame: str) -> list[Part]:
    """A framed painting, its back at z = 0 and its middle at the origin.

    ``cell``: column and row in the atlas of paintings; ``mount``: width of the card around the painting.
    """
    x, y, rim = width / 2, height / 2, 0.035
    mitre = [
        block((-x - rim, -y - rim, -0.005), (x + rim, -y + 0.004, 0.03), 0.5),
        block((-x - rim, y - 0.004, -0.005), (x + rim, y + rim, 0.03), 0.5),
        block((-x - rim + 0.001, -y - 0.01, -0.004), (-x + 0.004, y + 0.01, 0.029), 0.5),
        block((x - 0.004, -y - 0.01, -0.004), (x + rim - 0.001, y + 0.01, 0.029), 0.5),
    ]
    card = block((-x, -y, -0.003), (x, y, 0.01))
    canvas = _canvas(x - mount - 0.001, y - mount - 0.001).mapped((0.5, 0.5), (0.5 * cell[0], 0.5 * cell[1]))
    return [(join(mitre), frame), (card, "card"), (canvas, "paintings")]


def _canvas(x: float, y: float) -> Shape:
    """A thin slab whose front shows the whole of a texture once."""
    slab = block((-x, -y, 0.002), (x, y, 0.013))
    uvs = (slab.vertices[:, :2] / (2 * np.array([x, y])) + 0.5).astype(np.float32)
    return Shape(slab.vertices, slab.faces, slab.normals, uvs)
