"""The interior's lights. Emissive parts are few triangles, because a path tracer picks among them."""

from __future__ import annotations

from assets.shapes import Shape, join
from assets.stage import Part
from assets.surfaces import curve, lathe, ring, rod


def pendant(drop: float) -> list[Part]:
    """An enamelled shade that hangs from the origin on a cord; its glowing disc is ``drop`` below and looks down."""
    outside = curve([(0.24, 0.0), (0.225, 0.06), (0.15, 0.14), (0.05, 0.18), (0.032, 0.23)], 14)
    inside = curve([(0.04, 0.17), (0.14, 0.125), (0.215, 0.055), (0.234, 0.0)], 10)
    shade = lathe([(0.0, 0.172), *inside.tolist(), *outside.tolist(), (0.0, 0.235)], 40)
    disc = lathe([(0.0, 0.022), (0.2, 0.022)], 24)
    cord = rod(0.004, drop - 0.2, 8).moved(y=0.215)
    rose = lathe([(0.0, drop - 0.03), (0.03, drop - 0.028), (0.05, drop + 0.01), (0.0, drop + 0.01)], 24)
    parts: list[Part] = [(shade, "enamel"), (disc, "pendant light"), (join([cord, rose]), "brass")]
    return [(shape.moved(y=-drop), material) for shape, material in parts]


def plafond() -> list[Part]:
    """A shallow ceiling lamp: a brass ring with a glowing bowl below it; y = 0 is the ceiling."""
    bowl = lathe([(0.0, -0.095), (0.14, -0.078), (0.225, -0.02)], 16, 180.0)
    rim = lathe([(0.0, -0.024), (0.245, -0.024), (0.25, -0.018), (0.25, 0.01), (0.0, 0.01)], 40)
    return [(bowl, "ceiling light"), (rim, "brass")]


def _shade(low: float, high: float, height: float) -> list[Part]:
    """A glowing drum about the y axis from y = 0, with a cloth hem above and below and a bright opening each way."""
    drum = lathe([(low, 0.0), (high, height)], 20, 180.0)
    hems = [ring(low, 0.008, 40, 8), ring(high, 0.008, 40, 8).moved(y=height)]
    below = lathe([(0.0, 0.012), (low - 0.001, 0.012)], 20)
    above = lathe([(high - 0.001, height - 0.012), (0.0, height - 0.012)], 20)
    return [(drum, "shade light"), (join([below, above]), "bulb light"), (join(hems), "cream")]


def standing_lamp() -> list[Part]:
    """A floor lamp, 1.62 m high."""
    pole = [(0, -0.001), (0.15, -0.001), (0.152, 0.012), (0.13, 0.022), (0.025, 0.034), (0.012, 0.06), (0.012, 0.7)]
    pole += [(0.02, 0.715), (0.02, 0.735), (0.012, 0.75), (0.012, 1.36), (0.0, 1.36)]
    return [(lathe(pole, 32), "brass"), *_raised(_shade(0.215, 0.15, 0.28), 1.34)]


def table_lamp(foot: str) -> list[Part]:
    """A lamp on a pot-bellied foot, 0.52 m high; y = 0 is the table."""
    belly = curve([(0.055, 0.0), (0.06, 0.012), (0.05, 0.03), (0.1, 0.11), (0.085, 0.19), (0.03, 0.25), (0.026, 0.28)], 18)
    base = lathe([(0.0, -0.001), (0.055, -0.001), *belly[1:].tolist(), (0.0, 0.281)], 40)
    neck = rod(0.01, 0.06, 12).moved(y=0.275)
    return [(base, foot), (neck, "brass"), *_raised(_shade(0.165, 0.115, 0.2), 0.315)]


def _raised(parts: list[Part], y: float) -> list[Part]:
    moved: list[tuple[Shape, str]] = [(shape.moved(y=y), material) for shape, material in parts]
    return moved
