"""Books, bookcases and what else stands on their shelves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from assets.pictures import SPINE_COLUMNS, SPINE_ROWS
from assets.shapes import block, join
from assets.stage import Part, placed
from assets.surfaces import sheet

_THICKNESS, _HEIGHT, _DEPTH = 0.03, 0.24, 0.17  # metres, of the book that all others are stretched from


def _pattern() -> list[Part]:
    """The book that all others are stretched from; its texture coordinates fill one cell of the atlas of spines."""
    t, h, d = _THICKNESS, _HEIGHT, _DEPTH
    turn = np.linspace(-math.pi / 2, math.pi / 2, 4)
    points = np.empty((2, 4, 3))
    points[:, :, 0] = -(t / 2 - 0.0012) * np.sin(turn)
    points[:, :, 1] = np.array([[0.0], [h]])
    points[:, :, 2] = (0.16 * t + 0.002) * np.cos(turn) - 0.0025
    spine = sheet(points, 0.0024).mapped((-0.96, 0.98), (0.98, 0.01))  # seen from outside its columns run to the left
    boards = [
        block((x - 0.0012, 0.0, -d), (x + 0.0012, h - 0.001, -0.0045)).mapped((0.0, 0.0), (0.5, 0.05))
        for x in (-t / 2 + 0.0014, t / 2 - 0.0014)
    ]
    pages = block((-t / 2 + 0.002, 0.004, -d + 0.006), (t / 2 - 0.002, h - 0.006, -0.003))
    return [(join([spine, *boards]), "spines"), (pages, "pages")]


_PATTERN = _pattern()


def book(rng: np.random.Generator, thickness: float, height: float, depth: float) -> list[Part]:
    """An upright book on y = 0: x across its thickness, the rounded spine towards +z, the middle of its back at 0.

    Its cloth is a random cell of the atlas of spines.
    """
    column, line = int(rng.integers(SPINE_COLUMNS)), int(rng.integers(SPINE_ROWS))
    return [
        (
            shape.stretched(thickness / _THICKNESS, height / _HEIGHT, depth / _DEPTH).mapped(
                (1 / SPINE_COLUMNS, 1 / SPINE_ROWS), (column / SPINE_COLUMNS, line / SPINE_ROWS)
            ),
            material,
        )
        for shape, material in _PATTERN
    ]


def pile(rng: np.random.Generator, count: int, size: float = 0.24) -> list[Part]:
    """Books lying on each other from y = 0 upwards, a little askew; ``size`` is the lowest one's height."""
    parts: list[Part] = []
    level = -0.001
    for k in range(count):
        thickness, height = rng.uniform(0.02, 0.042), size * (1 - 0.07 * k) * rng.uniform(0.93, 1.0)
        lying = [(shape.turned("z", -90.0), name) for shape, name in book(rng, thickness, height, 0.72 * height)]
        parts += placed(lying, rng.uniform(-14, 14), -height / 2, level + thickness / 2, 0.36 * height)
        level += thickness + 0.0006
    return parts


@dataclass
class _Series:
    """Volumes of one make: how many are still to come, and their sizes in metres."""

    left: int
    thickness: float
    height: float
    depth: float
    binding: int | None
    """Seed of the cloth where all volumes wear the same."""

    @staticmethod
    def start(rng: np.random.Generator, headroom: float, depth: float) -> _Series:
        binding = int(rng.integers(1 << 30)) if rng.random() < 0.35 else None
        height = headroom * rng.uniform(0.62, 0.93)
        return _Series(
            int(rng.integers(2, 8)), rng.uniform(0.018, 0.046), height, depth * rng.uniform(0.62, 0.95), binding
        )

    def volume(self, rng: np.random.Generator) -> tuple[float, list[Part]]:
        """The next one: its thickness and its parts."""
        self.left -= 1
        thickness = self.thickness * rng.uniform(0.85, 1.15)
        cloth = rng if self.binding is None else np.random.default_rng(self.binding)
        return thickness, book(cloth, thickness, self.height * rng.uniform(0.97, 1.0), self.depth)


def row(rng: np.random.Generator, length: float, headroom: float, depth: float) -> list[Part]:
    """Books on a shelf, from x = 0 to ``length``, backs at z = 0, standing a millimetre into y = 0.

    Mostly upright and in series, now and then a gap, a pile, or a book that leans on the one before.
    """
    parts: list[Part] = []
    series = _Series.start(rng, headroom, depth)
    x = 0.004
    while x < length - 0.06:
        chance = rng.random()
        if chance < 0.03 and x < length - 0.3:
            parts += placed(pile(rng, int(rng.integers(3, 6)), 0.2), 0.0, x + 0.11, 0.0, -0.1)
            x += 0.24
        elif chance < 0.05:
            x += rng.uniform(0.04, 0.1)
        elif chance < 0.08 and 0.1 < x < length - 0.2:
            lean = rng.uniform(7.0, 13.0)
            thickness, volume = series.volume(rng)
            leaning = [(shape.moved(thickness / 2).turned("z", lean), material) for shape, material in volume]
            x += series.height * math.sin(math.radians(lean)) + 0.002
            parts += placed(leaning, 0.0, x, -0.001, -0.01)
            x += thickness / math.cos(math.radians(lean)) + 0.002
        else:
            thickness, volume = series.volume(rng)
            if x + thickness > length:
                break
            parts += placed(volume, 0.0, x + thickness / 2, -0.001, rng.uniform(-0.02, 0.0))
            x += thickness + 0.0012
        if series.left == 0:
            series = _Series.start(rng, headroom, depth)
    return parts


def bookcase(width: float, height: float, depth: float, shelves: int) -> tuple[list[Part], list[tuple[float, float]]]:
    """A bookcase against z = 0, its middle at x = 0, and its shelves as (top of the board, headroom)."""
    half, board = width / 2, 0.028
    boards = [
        block((-half, -0.005, -0.006), (-half + board, height, depth), 0.6),
        block((half - board, -0.005, -0.006), (half, height, depth), 0.6),
        block((-half - 0.02, height - 0.005, -0.01), (half + 0.02, height + 0.03, depth + 0.025), 0.6),
        block((-half - 0.035, height + 0.028, -0.012), (half + 0.035, height + 0.05, depth + 0.04), 0.6),
        block((-half + 0.012, -0.004, 0.012), (half - 0.012, 0.085, depth - 0.01), 0.6),
    ]
    back = block((-half + 0.01, 0.05, -0.01), (half - 0.01, height - 0.002, 0.034), 0.6)
    levels = np.linspace(0.1, height - 0.006, shelves + 1)
    tops = []
    for k in range(shelves):
        boards.append(block((-half + 0.02, levels[k] - board, 0.02), (half - 0.02, levels[k], depth - 0.006), 0.6))
        tops.append((float(levels[k]), float(levels[k + 1] - levels[k]) - board))
    return [(join(boards), "walnut"), (back, "walnut dark")], tops


def filled_bookcase(
    rng: np.random.Generator, width: float, height: float, depth: float, shelves: int
) -> tuple[list[Part], list[Part]]:
    """A bookcase and its books, both against z = 0 with the middle at x = 0."""
    case, tops = bookcase(width, height, depth, shelves)
    books: list[Part] = []
    inside = width - 0.075
    for level, headroom in tops:
        books += placed(row(rng, inside, headroom, depth - 0.1), 0.0, -inside / 2, level, depth - 0.04)
    return case, books
