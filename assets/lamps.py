"""The interior's lights.

Emissive parts are few triangles, because a path tracer picks among them, and they keep their distance from whatever
they shine on: next-event estimation at a point close to a light is an unbounded 1/r².
"""

from __future__ import annotations

from assets.shapes import Shape, join
from assets.stage import Part, placed
from assets.surfaces import curve, lathe, rod


def _disc(radius: float, y: float) -> tuple[Shape, Shape]:
    """A flat disc that looks down, and the shallow cone that closes it behind, which need not glow."""
    return lathe([(0.0, y), (radius, y)], 24), lathe([(radius, y), (0.0, y + 0.004)], 24)


def pendant(drop: float) -> list[Part]:
    """An enamelled shade hanging from the origin on a cord; its mouth, ``drop`` below, is closed by a glowing disc."""
    outside = curve([(0.24, 0.0), (0.225, 0.06), (0.15, 0.14), (0.05, 0.18), (0.032, 0.23)], 16)
    shade = lathe([(0.0, 0.004), (0.236, 0.004), *outside.tolist(), (0.0, 0.235)], 48)
    disc, back = _disc(0.232, -0.001)
    cord = rod(0.004, drop - 0.2, 8).moved(y=0.215)
    parts: list[Part] = [(join([shade, back]), "enamel"), (disc, "pendant light"), (cord, "brass")]
    return placed(parts, y=-drop)


def rose() -> list[Part]:
    """The brass cup that hides where a cord leaves the ceiling, which is at y = 0."""
    return [(lathe([(0.0, -0.03), (0.03, -0.028), (0.05, 0.01), (0.0, 0.01)], 24), "brass")]


def plafond() -> list[Part]:
    """A flat ceiling lamp, a glowing disc in a brass ring; y = 0 is the ceiling."""
    disc, back = _disc(0.26, -0.037)
    rim = lathe([(0.0, -0.03), (0.262, -0.03), (0.27, -0.036), (0.284, -0.034), (0.29, 0.01), (0.0, 0.01)], 48)
    return [(disc, "ceiling light"), (join([rim, back]), "brass")]


def _shade(low: float, high: float, height: float) -> list[Part]:
    """A glowing drum about the y axis from y = 0, brighter above, closed below, where its foot is too near."""
    drum = lathe([(low, 0.0), (high, height)], 24, 180.0)
    above = lathe([(high, height), (0.0, height)], 24)
    below = lathe([(0.0, 0.0), (low, 0.0)], 24)
    return [(drum, "shade light"), (above, "bulb light"), (below, "cream")]


def standing_lamp() -> list[Part]:
    """A floor lamp, 1.62 m high."""
    pole = [(0, -0.001), (0.15, -0.001), (0.152, 0.012), (0.13, 0.022), (0.025, 0.034), (0.012, 0.06), (0.012, 0.7)]
    pole += [(0.02, 0.715), (0.02, 0.735), (0.012, 0.75), (0.012, 1.36), (0.0, 1.36)]
    return [(lathe(pole, 32), "brass"), *placed(_shade(0.2, 0.155, 0.28), y=1.34)]


def table_lamp(foot: str) -> list[Part]:
    """A lamp on a pot-bellied foot, 0.55 m high; y = 0 is the table."""
    belly = curve(
        [(0.055, 0.0), (0.06, 0.012), (0.05, 0.03), (0.1, 0.11), (0.085, 0.19), (0.03, 0.25), (0.026, 0.28)], 18
    )
    base = lathe([(0.0, -0.001), (0.055, -0.001), *belly[1:].tolist(), (0.0, 0.281)], 40)
    neck = rod(0.01, 0.09, 12).moved(y=0.275)
    return [(base, foot), (neck, "brass"), *placed(_shade(0.145, 0.11, 0.19), y=0.35)]
