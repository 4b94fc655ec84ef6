"""Procedural textures of building materials, drawn with NumPy from fixed seeds.

Every function returns (h, w, 3) uint8, sRGB-encoded, row 0 = bottom row, and repeats without a seam in both directions
unless it says otherwise. While a texture is being drawn it is an image of float32 planes, (3, h, w), mixed in sRGB as
on a painter's palette. Pictures (rug, paintings, globe, ...) are in :mod:`assets.pictures`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from raytrace.scene import F32

Pixels = NDArray[np.uint8]
I64 = NDArray[np.int64]
Field = NDArray[np.float32] | NDArray[np.float64] | NDArray[np.bool_]
"""One number per pixel, (h, w): a height, a distance, a mask."""


def colour(hex_code: str) -> F32:
    """(3, 1, 1) float32 sRGB-encoded colour in [0, 1] from ``"#rrggbb"``, an image of one pixel."""
    channels = [int(hex_code[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    return np.array(channels, dtype=np.float32)[:, None, None]


def linear(hex_code: str) -> tuple[float, float, float]:
    """Linear Rec. 709 reflectance of an sRGB colour ``"#rrggbb"`` (IEC 61966-2-1)."""
    encoded = [int(hex_code[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in encoded)
    return (r, g, b)


def pixels(image: F32) -> Pixels:
    """Quantise an image: (3, h, w) float32 planes, sRGB-encoded, to (h, w, 3) uint8; what is outside [0, 1] is cut."""
    quantised = (np.clip(image, 0.0, 1.0) * np.float32(255.0) + np.float32(0.5)).astype(np.uint8)
    return np.ascontiguousarray(quantised.transpose(1, 2, 0))


def blend(a: F32, b: F32, amount: Field) -> F32:
    """``a`` where ``amount`` (h, w) is 0, ``b`` where it is 1; both (3, h, w) images or :func:`colour`."""
    return a + (b - a) * np.clip(amount, 0.0, 1.0).astype(np.float32)


def step(edge: float, x: Field, softness: float) -> F32:
    """0 below ``edge``, 1 above it, a linear ramp of width ``softness`` between."""
    return np.clip((x - edge) / softness + 0.5, 0.0, 1.0).astype(np.float32)


def coordinates(height: int, width: int) -> tuple[F32, F32]:
    """u and v of the pixel centres in [0, 1], (h, w) float32 each."""
    u, v = np.meshgrid(
        (np.arange(width, dtype=np.float32) + np.float32(0.5)) / np.float32(width),
        (np.arange(height, dtype=np.float32) + np.float32(0.5)) / np.float32(height),
    )
    return u, v


def noise(rng: np.random.Generator, height: int, width: int, cells_v: int, cells_u: int, octaves: int = 1) -> F32:
    """Value noise in [0, 1], (h, w) float32, repeating in both directions; each octave has twice the cells, half the
    weight."""
    total = np.zeros((height, width), dtype=np.float32)
    weight, weights = 1.0, 0.0
    for _ in range(octaves):
        lattice = rng.random((cells_v, cells_u), dtype=np.float32)
        low, high, fade = _lattice_steps(height, cells_v)
        rows = lattice[low] + (lattice[high] - lattice[low]) * fade[:, None]
        low, high, fade = _lattice_steps(width, cells_u)
        left = rows[:, low]
        total += np.float32(weight) * (left + (rows[:, high] - left) * fade)
        weights += weight
        weight, cells_v, cells_u = weight / 2, min(2 * cells_v, height), min(2 * cells_u, width)
    return total / np.float32(weights)


def _lattice_steps(length: int, cells: int) -> tuple[I64, I64, F32]:
    """For each pixel of a row: the lattice cells to its left and right and the smooth weight of the right one."""
    position = np.arange(length) * cells / length
    low = position.astype(np.int64)
    t = (position - low).astype(np.float32)
    return low, (low + 1) % cells, t * t * (3 - 2 * t)


def parquet() -> Pixels:
    """Oak in herringbone, 1024²: 32 planks' widths across, each plank four times as long as wide."""
    rng = np.random.default_rng(11)
    size, cells, aspect = 1024, 32, 4
    width = size // cells
    cell_y, cell_x = np.mgrid[0:cells, 0:cells]
    lag = (cell_x - cell_y) % (2 * aspect)
    lying = lag < aspect
    first = np.where(lying, lag, 2 * aspect - 1 - lag)  # cells between this one and its plank's first
    plank = np.where(lying, cell_y * cells + (cell_x - first) % cells, (cell_y - first) % cells * cells + cell_x)

    # Every cell is cut out of the grain at its plank's own place, and turned where the plank stands.
    grain = noise(rng, size, size, 256, 8, 2)
    places = rng.integers(0, size - aspect * width, (cells * cells, 2))
    tones, warmths = rng.random((2, cells * cells), dtype=np.float32)
    tone = np.empty((cells, width, cells, width), dtype=np.float32)
    joint = np.zeros((cells, width, cells, width), dtype=np.float32)
    for y, x in np.ndindex(cells, cells):
        row, column = places[plank[y, x]]
        column += first[y, x] * width
        piece = grain[row : row + width, column : column + width] + np.float32(0.9) * tones[plank[y, x]]
        seam = np.zeros((width, width), dtype=np.float32)
        seam[[0, -1]] = 0.6
        if first[y, x] == 0:
            seam[:, 0] = 0.6
        elif first[y, x] == aspect - 1:
            seam[:, -1] = 0.6
        tone[y, :, x], joint[y, :, x] = (piece, seam) if lying[y, x] else (piece.T, seam.T)
    warmth = np.repeat(np.repeat(warmths[plank], width, axis=0), width, axis=1)
    oak = blend(colour("#a06f40"), colour("#d2a56c"), 0.55 * tone.reshape(size, size) - 0.02)
    oak = blend(oak, colour("#a5673a"), 0.35 * warmth)
    return pixels(blend(oak, colour("#3e2815"), joint.reshape(size, size)))


def wood(dark: str, light: str, seed: int) -> Pixels:
    """Planed wood, 512², the grain along u."""
    rng = np.random.default_rng(seed)
    _, v = coordinates(512, 512)
    drift = noise(rng, 512, 512, 6, 2, 3)
    rings = 0.5 + 0.5 * np.sin(2 * math.pi * (9 * v + 2.2 * drift))
    fibre = noise(rng, 512, 512, 256, 8, 2)
    tone = (0.55 * rings + 0.65 * fibre - 0.1).astype(np.float32)
    return pixels(blend(colour(dark), colour(light), tone))


def plaster() -> Pixels:
    """Hand-smoothed plaster, 512², nearly white: to be tinted by the material's colour."""
    rng = np.random.default_rng(21)
    relief = noise(rng, 512, 512, 8, 8, 5)
    return pixels(blend(colour("#e9e6e0"), colour("#ffffff"), 0.5 + 1.6 * (relief - 0.5)))


def brick() -> Pixels:
    """Red bricks in running bond, 512²: eight courses of four."""
    rng = np.random.default_rng(31)
    u, v = coordinates(512, 512)
    course = np.floor(8 * v).astype(np.int64)
    position = 4 * u + 0.5 * (course % 2)
    index = course * 4 + np.floor(position).astype(np.int64) % 4
    in_u, in_v = position % 1.0, (8 * v) % 1.0
    rough = noise(rng, 512, 512, 32, 32, 4)
    margin = np.minimum(np.minimum(in_u, 1 - in_u) * 2, np.minimum(in_v, 1 - in_v)) + 0.05 * (rough - 0.5)
    tone, smoke = rng.random(32, dtype=np.float32), rng.random(32, dtype=np.float32)
    clay = blend(colour("#8a4a36"), colour("#b86b4c"), 0.7 * tone[index] + 0.6 * (rough - 0.35))
    clay = blend(clay, colour("#5d3a31"), 0.6 * step(0.75, smoke[index], 0.3))
    mortar = blend(colour("#a79b8c"), colour("#c9bfb0"), rough)
    return pixels(blend(mortar, clay, step(0.075, margin.astype(np.float32), 0.03)))


def weave() -> Pixels:
    """A plain weave, 512², light grey: to be tinted. 64 threads each way."""
    rng = np.random.default_rng(41)
    u, v = coordinates(512, 512)
    over = 0.5 + 0.5 * np.sin(64 * math.pi * u) * np.sin(64 * math.pi * v)
    slub = noise(rng, 512, 512, 128, 16, 2) + noise(rng, 512, 512, 16, 128, 2)
    tone = (0.25 * over + 0.45 * slub).astype(np.float32)
    return pixels(blend(colour("#c8c5c0"), colour("#ffffff"), tone))


def wallpaper() -> Pixels:
    """Tone-on-tone blossoms and sprigs in a half-drop repeat, 512², light: to be tinted."""
    rng = np.random.default_rng(51)
    u, v = coordinates(256, 256)
    x, y = u - 0.5, v - 0.5
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    petals = 0.23 + 0.07 * np.cos(8 * angle)
    motif = step(0.0, petals - radius, 0.02) - 0.6 * step(0.0, 0.62 * petals - radius, 0.02)
    motif = np.maximum(motif, step(0.0, 0.06 - radius, 0.02))
    # Four sprigs point to the corners: along and across run in the folded diagonal's direction.
    along, across = (np.abs(x) + np.abs(y)) / math.sqrt(2), np.abs(np.abs(x) - np.abs(y)) / math.sqrt(2)
    blade = 0.075 * np.sqrt(np.clip((along - 0.34) * (0.6 - along), 0.0, 1.0)) / 0.13
    motif = np.maximum(motif, step(0.0, blade - across, 0.015) * (1 - 0.7 * step(0.0, 0.012 - across, 0.012)))
    plain = np.zeros_like(motif)
    tile = np.block([[motif, plain], [plain, motif]])
    linen = noise(rng, 512, 512, 256, 256, 1)
    base = blend(colour("#eae6da"), colour("#f7f4ea"), linen)
    return pixels(blend(base, colour("#cfd0ba"), 0.8 * tile))


def drapery() -> Pixels:
    """Curtain cloth, 512²: broad and narrow stripes along v, light: to be tinted."""
    rng = np.random.default_rng(61)
    u, _ = coordinates(512, 512)
    phase = (4 * u) % 1.0
    broad = step(0.5, phase, 0.01) * (1 - step(0.92, phase, 0.01))
    narrow = step(0.2, phase, 0.01) * (1 - step(0.25, phase, 0.01))
    thread = noise(rng, 512, 512, 64, 256, 2)
    cloth = blend(colour("#d9d9d9"), colour("#ffffff"), thread)
    return pixels(cloth * (1.0 - 0.16 * broad - 0.22 * narrow))


def leaf() -> Pixels:
    """A leaf, 256²: the midrib along v in the middle, veins at a slant. Does not repeat along u."""
    rng = np.random.default_rng(71)
    u, v = coordinates(256, 256)
    off = np.abs(u - 0.5)
    vein_phase = (9 * (v - 0.9 * off)) % 1.0
    veins = 1 - step(0.06, np.minimum(vein_phase, 1 - vein_phase), 0.06)
    midrib = 1 - step(0.02, off, 0.02)
    mottle = noise(rng, 256, 256, 12, 12, 3)
    green = blend(colour("#2f6a2c"), colour("#5e9a40"), 0.9 * mottle + 0.5 * off)
    return pixels(blend(green, colour("#a9c878"), np.maximum(0.45 * veins, 0.8 * midrib)))


def twig() -> tuple[Pixels, NDArray[np.uint8]]:
    """A twig with leaves, 256², growing along v, and its coverage (256, 256) uint8. Does not repeat."""
    u, v = coordinates(256, 256)
    rng = np.random.default_rng(17)
    covered = (np.abs(u - 0.5) < 0.012) & (v < 0.86)
    shade = np.zeros((256, 256), np.float32)
    for k in range(13):
        side = 1.0 if k % 2 else -1.0
        root_v, length, slant = 0.08 + 0.062 * k, 0.3 - 0.008 * k, 0.6 + 0.25 * float(rng.random())
        along = side * (u - 0.5) * math.cos(slant) + (v - root_v) * math.sin(slant)
        across = -side * (u - 0.5) * math.sin(slant) + (v - root_v) * math.cos(slant)
        t = np.clip(along / length, 0.0, 1.0)
        inside = (along > 0.0) & (along < length) & (np.abs(across) < 0.3 * length * np.sin(np.pi * t**0.8))
        shade = np.where(inside, 0.25 + 0.5 * t + 0.2 * (np.abs(across) < 0.006), shade).astype(np.float32)
        covered |= inside
    image = pixels(blend(colour("#2f6a2c"), colour("#86b556"), shade))
    return image, np.where(covered, np.uint8(255), np.uint8(0))
