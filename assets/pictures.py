"""Procedural textures that show something: rug, book spines, paintings, globe, porcelain, clock face.

Same conventions as :mod:`assets.textures`: (h, w, 3) uint8, sRGB-encoded, row 0 = bottom row.
"""

from __future__ import annotations

import math

import numpy as np

from assets.textures import Pixels, blend, colour, coordinates, noise, pixels, step
from raytrace.scene import F32

SPINE_COLUMNS, SPINE_ROWS = 16, 4
"""The atlas of :func:`spines` in cells."""

_CANVAS = 320  # pixels along a side of each painting


def rug() -> Pixels:
    """A knotted rug, 1024 x 768: a medallion on a red field within three borders."""
    rng = np.random.default_rng(101)
    # One quarter is drawn, in metres from the middle of a rug of 4 m x 3 m; `inset` is the distance from the edge.
    u, v = coordinates(384, 512)
    x, y = 2 * u, np.float32(1.5) * v
    inset = np.minimum(2.0 - x, 1.5 - y)
    red, navy, ivory = colour("#8c2a25"), colour("#1d2b4a"), colour("#e2d3b0")
    gold, teal = colour("#bf8f45"), colour("#3d6f73")

    lattice = np.cos(2 * math.pi * 3 * x) * np.cos(2 * math.pi * 3 * y)
    field = blend(red, navy, 0.9 * step(0.55, lattice, 0.06))
    field = blend(field, gold, step(0.86, lattice, 0.04))
    vine = np.abs(np.sin(3 * math.pi * (x + y)) * np.sin(3 * math.pi * (x - y)))
    field = blend(field, colour("#b5523f"), 0.8 * (1 - step(0.05, vine, 0.03)))

    angle = np.arctan2(y * 1.25, x)
    radius = np.hypot(x, y * 1.25) * (1 + 0.09 * np.cos(12 * angle))
    for limit, tint in ((0.98, ivory), (0.94, navy), (0.68, gold), (0.65, teal), (0.42, ivory), (0.39, red)):
        field = blend(field, tint, 1 - step(limit, radius, 0.02))
    field = blend(field, gold, 1 - step(0.0, radius - np.cos(6 * angle) * 0.09 - 0.2, 0.02))
    rosette = np.abs(((12 * angle / math.pi) % 2.0) - 1.0)
    field = blend(field, gold, 0.9 * (np.abs(radius - 0.81) < 0.07) * step(0.5, rosette, 0.2))

    along = np.where(2.0 - x < 1.5 - y, y, x)
    bud = np.abs((4 * along) % 1.0 - 0.5) + 3.2 * np.abs(inset - 0.25)
    border = navy
    for limit, tint in ((0.36, teal), (0.2, ivory), (0.1, red)):
        border = blend(border, tint, 1 - step(limit, bud, 0.04))
    image = blend(border, field, step(0.5, inset, 0.01))
    for edge, thickness, tint in ((0.47, 0.05, gold), (0.42, 0.02, ivory), (0.07, 0.04, gold), (0.025, 0.06, red)):
        image = blend(image, tint, step(thickness / 2, thickness - np.abs(inset - edge), 0.006))
    image = np.concatenate([image[:, :, ::-1], image], axis=2)
    image = np.concatenate([image[:, ::-1], image], axis=1)
    wool = noise(rng, 768, 1024, 384, 512) * noise(rng, 768, 1024, 96, 4, 2)
    return pixels(image * (0.84 + 0.34 * wool))


def spines() -> Pixels:
    """Backs of 64 books, 1024²: an atlas of ``SPINE_COLUMNS`` x ``SPINE_ROWS`` upright cells.

    The lowest 10 % of a cell is plain cloth, which also covers the boards.
    """
    rng = np.random.default_rng(111)
    cloths = (
        "#7b2d26", "#2f4858", "#33658a", "#5b7553", "#8a6642", "#3a3238", "#a23b3b", "#1f3a2e",
        "#c49a52", "#4c3a5e", "#6d7f8c", "#94553d", "#274060", "#b7a07a", "#5c1f2b", "#456b5a",
    )  # fmt: skip
    cell_h, cell_w = 1024 // SPINE_ROWS, 1024 // SPINE_COLUMNS
    image = np.empty((3, 1024, 1024), dtype=np.float32)
    for cell in range(SPINE_ROWS * SPINE_COLUMNS):
        top, left = cell // SPINE_COLUMNS * cell_h, cell % SPINE_COLUMNS * cell_w
        cloth = colour(cloths[rng.integers(16)]) * rng.uniform(0.8, 1.25) + rng.uniform(-0.03, 0.03, (3, 1, 1))
        image[:, top : top + cell_h, left : left + cell_w] = _spine(rng, cell_h, cell_w, cloth.astype(np.float32))
    return pixels(image * (0.9 + 0.2 * noise(rng, 1024, 1024, 256, 256, 2)))


def _spine(rng: np.random.Generator, height: int, width: int, cloth: F32) -> F32:
    """One cell of the atlas: bands, a label, a title of small strokes."""
    cell = np.broadcast_to(cloth, (3, height, width)).copy()
    foil = colour(("#d9b65c", "#e8e0cc", "#c9c9c9", "#d8a24a")[rng.integers(4)])
    for _ in range(rng.integers(1, 4)):
        at, thick = rng.uniform(0.12, 0.95), rng.integers(2, 7)
        cell[:, int(at * height) : int(at * height) + thick] = foil
    low = int(height * rng.uniform(0.4, 0.6))
    high = low + int(height * rng.uniform(0.18, 0.33))
    style = rng.integers(3)
    ink = foil
    if style == 0:
        cell[:, low:high, 4 : width - 4] = cloth * 0.35
    elif style == 1:
        cell[:, low:high] = foil
        ink = cloth * 0.5
    for row in range(low + 6, high - 8, 11):  # a line of the title: strokes of random length
        column = 12
        while column < width - 14:
            stroke = int(rng.integers(3, 9))
            cell[:, row : row + 5, column : min(column + stroke, width - 12)] = ink
            column += stroke + int(rng.integers(2, 5))
    return cell


def paintings() -> Pixels:
    """Four paintings, 640²: lower left hills at dusk, lower right circles, upper left sea and moon, upper right
    leaves."""
    rng = np.random.default_rng(121)
    lower = np.concatenate([_hills(rng), _circles(rng)], axis=2)
    upper = np.concatenate([_seascape(rng), _herbarium(rng)], axis=2)
    canvas = 0.94 + 0.12 * noise(rng, 2 * _CANVAS, 2 * _CANVAS, 160, 160, 2)
    return pixels(np.concatenate([lower, upper], axis=1) * canvas)


def _hills(rng: np.random.Generator) -> F32:
    u, v = coordinates(_CANVAS, _CANVAS)
    image = blend(colour("#f6c887"), colour("#5a7fa8"), 1.5 * v - 0.55)
    image = blend(image, colour("#fbe3b4"), np.exp(-((u - 0.68) ** 2 + (v - 0.56) ** 2) / 0.02).astype(np.float32))
    image = blend(image, colour("#fff2cc"), 1 - step(0.05, np.hypot(u - 0.68, v - 0.56), 0.01))
    cloud = noise(rng, _CANVAS, _CANVAS, 12, 3, 4)
    image = blend(image, colour("#f0a58a"), 1.4 * (cloud - 0.52) * step(0.5, v, 0.3))
    tints = ("#8b86a3", "#6d7a8f", "#54706c", "#4b6a48", "#3a5232", "#2a3c26")
    for k, tint in enumerate(tints):
        ridge = noise(rng, 1, _CANVAS, 1, 3 + k, 5)[0]
        height = 0.56 - 0.09 * k + (0.26 - 0.025 * k) * (ridge - 0.5)
        image = blend(image, colour(tint), 1 - step(0.0, v - height[None, :], 0.006))
    return image


def _circles(rng: np.random.Generator) -> F32:
    u, v = coordinates(_CANVAS, _CANVAS)
    image = colour("#efe4cf")
    tints = ("#c8452f", "#22577a", "#e0a526", "#3c6e57", "#1f1f2b", "#d88c6a", "#8fb3b0")
    for k in range(16):
        centre_u, centre_v, size = rng.uniform(0.1, 0.9), rng.uniform(0.1, 0.9), rng.uniform(0.04, 0.2)
        distance = np.hypot(u - centre_u, v - centre_v)
        image = blend(image, colour(tints[k % 7]), 0.88 * (1 - step(size, distance, 0.006)))
        image = blend(image, colour(tints[(k + 3) % 7]), 1 - step(0.4 * size, distance, 0.006))
    for _ in range(7):
        angle, offset = rng.uniform(0, math.pi), rng.uniform(-0.3, 0.3)
        line = np.abs((u - 0.5) * math.cos(angle) + (v - 0.5) * math.sin(angle) - offset)
        image = blend(image, colour("#1f1f2b"), 1 - step(0.004, line, 0.004))
    return image


def _seascape(rng: np.random.Generator) -> F32:
    u, v = coordinates(_CANVAS, _CANVAS)
    image = blend(colour("#7fa6b8"), colour("#152a4a"), 1.8 * (v - 0.42))
    moon = np.hypot(u - 0.35, v - 0.74)
    image = blend(image, colour("#c9d6cf"), 0.7 * np.exp(-((moon / 0.16) ** 2)))
    image = blend(image, colour("#f6f1d8"), 1 - step(0.065, moon, 0.008))
    swell = noise(rng, _CANVAS, _CANVAS, 90, 10, 3)
    sea = blend(colour("#12334a"), colour("#3f7385"), 1.3 * swell - 0.2)
    glint = np.exp(-(((u - 0.35) / (0.03 + 0.35 * (0.42 - v))) ** 2)).astype(np.float32)
    sea = blend(sea, colour("#e9e6c4"), glint * step(0.5, swell, 0.15))
    image = blend(image, sea, 1 - step(0.42, v, 0.006))
    for at, size in ((0.68, 0.2), (0.84, 0.1)):
        rise = (v - 0.4) / size
        sail = (rise > 0.15) & (rise < 1.2) & (np.abs(u - at) < 0.32 * size * (1.2 - rise))
        hull = (rise > -0.08) & (rise < 0.1) & (np.abs(u - at) < size * (0.36 + rise))
        image = blend(image, colour("#efe0c2"), sail)
        image = blend(image, colour("#4a2a1e"), hull)
    return image


def _herbarium(rng: np.random.Generator) -> F32:
    u, v = coordinates(_CANVAS, _CANVAS)
    image = blend(colour("#efe6cf"), colour("#f8f2e2"), noise(rng, _CANVAS, _CANVAS, 6, 6, 3))
    bend = 0.5 + 0.06 * np.sin(3.5 * v)
    stem = np.abs(u - bend)
    image = blend(image, colour("#4f6b35"), (1 - step(0.007, stem, 0.004)) * (v > 0.12) * (v < 0.9))
    for k in range(12):
        base_v, side = 0.2 + 0.055 * k, 1 if k % 2 else -1
        length, tilt = 0.27 - 0.014 * k, math.radians(32 + 2 * k)
        x = (u - (0.5 + 0.06 * math.sin(3.5 * base_v))) * side
        y = v - base_v
        along = (x * math.cos(tilt) + y * math.sin(tilt)) / length
        across = np.abs(y * math.cos(tilt) - x * math.sin(tilt)) / length
        outline = 0.24 * np.sqrt(np.clip(along * (1 - along), 0, 1)) * 2 * (1 - 0.4 * along)
        blade = step(0.0, (outline - across), 0.02) * (along > 0) * (along < 1)
        image = blend(image, colour("#6f8f4a" if k % 3 else "#91a552"), blade)
        image = blend(image, colour("#3f5a2a"), blade * (1 - step(0.015, across, 0.012)))
    return image


def globe() -> Pixels:
    """An invented planet, 1024 x 512, longitude along u, latitude along v, with a graticule every 30 degrees."""
    rng = np.random.default_rng(135)
    u, v = coordinates(512, 1024)
    latitude = np.abs(v - 0.5) * 2
    coast = noise(rng, 512, 1024, 12, 24, 5)
    land = 0.62 * noise(rng, 512, 1024, 3, 5) + 0.38 * coast - 0.1 * step(0.75, latitude, 0.3)
    relief = noise(rng, 512, 1024, 16, 32, 4)
    sea = blend(colour("#1f5a85"), colour("#5fa9ba"), step(0.44, land, 0.2))
    ground = blend(colour("#d0b96c"), colour("#5f8a4a"), 2.2 * relief - 0.6)
    ground = blend(ground, colour("#8a6a44"), 0.8 * step(0.7, land, 0.12))
    image = blend(sea, ground, step(0.52, land, 0.008))
    image = blend(image, colour("#f2f4f2"), step(0.9, latitude + 0.15 * (relief - 0.5), 0.02))
    grid = np.minimum(np.abs((12 * u + 0.5) % 1.0 - 0.5) / 6, np.abs((6 * v + 0.5) % 1.0 - 0.5) / 6)
    return pixels(blend(image, colour("#f3e7c2"), 0.75 * (1 - step(0.0025, grid, 0.002))))


def porcelain() -> Pixels:
    """White glaze with cobalt bands and blossoms, 512²; u runs around the pot, v up its outside."""
    rng = np.random.default_rng(141)
    u, v = coordinates(512, 512)
    cobalt = blend(colour("#1f3f8f"), colour("#3f66b5"), noise(rng, 512, 512, 24, 24, 3))
    x, y = (8 * u) % 1.0 - 0.5, ((v - 0.3) * 6) % 1.0 - 0.5
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    blossom = step(0.0, 0.3 + 0.12 * np.cos(5 * angle) - radius, 0.05) - step(0.0, 0.1 - radius, 0.04)
    motif = blossom * (v > 0.3) * (v < 0.8)
    for low, high in ((0.27, 0.29), (0.81, 0.83), (0.85, 0.88), (0.2, 0.23)):
        motif = np.maximum(motif, (v > low) & (v < high))
    return pixels(blend(colour("#f4f3ee"), cobalt, motif))


def dial() -> Pixels:
    """A clock face at ten past ten, 512²; the disc fills the square."""
    u, v = coordinates(512, 512)
    x, y = 2 * u - 1, 2 * v - 1
    radius, angle = np.hypot(x, y), np.arctan2(x, y)  # clockwise from twelve
    image = blend(colour("#f6efdc"), colour("#e6d8b6"), radius)
    hour = np.abs(((angle / (2 * math.pi) * 12) + 0.5) % 1.0 - 0.5)
    minute = np.abs(((angle / (2 * math.pi) * 60) + 0.5) % 1.0 - 0.5)
    ink = (np.abs(radius - 0.74) < 0.12) & (hour * radius < 0.055)
    ink |= (np.abs(radius - 0.9) < 0.03) & (minute * radius < 0.14)
    ink |= np.abs(radius - 0.96) < 0.012
    for turn, length, half_width in ((10.17 / 12, 0.5, 0.035), (10 / 60, 0.72, 0.024)):
        sin, cos = math.sin(2 * math.pi * turn), math.cos(2 * math.pi * turn)
        along, across = x * sin + y * cos, np.abs(x * cos - y * sin)
        ink |= (along > -0.12) & (along < length) & (across < half_width * (1.15 - along / length))
    ink |= radius < 0.05
    return pixels(blend(image, colour("#201a16"), ink))
