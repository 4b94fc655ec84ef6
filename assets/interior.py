"""A living room by night, of our own making: lamps, a fire, books, a toy train."""

from __future__ import annotations

import math

import numpy as np

from assets import books, furniture, lamps, ornaments, palette, plants, room
from assets.motion import spin, swing
from assets.room import Wall, against
from assets.stage import Stage, placed
from raytrace.camera import Camera
from raytrace.scene import Scene

_FLIGHT = 8.0  # seconds
_CYCLE = 12.0  # seconds: everything that moves is back; the shorter periods below divide it
_YFOV = 50.0  # degrees
_TABLE_X, _TABLE_Y, _TABLE_Z = -0.45, 0.44, -0.15  # middle of the table's top


def _seating(stage: Stage) -> None:
    for name, parts in (("sofa", furniture.sofa()), ("sofa pillows", furniture.sofa_pillows())):
        stage.add(name, placed(parts, 90.0, -2.25, 0.0, -0.15))
    stage.add("armchair", placed(furniture.armchair(), -66.0, 1.45, 0.0, -0.75))
    stage.add("rug", placed(furniture.rug(2.6, 2.05), 0.0, _TABLE_X, 0.0, _TABLE_Z))
    stage.add("table", placed(furniture.round_table(0.46, _TABLE_Y), 0.0, _TABLE_X, 0.0, _TABLE_Z))
    stage.add("side table", placed(furniture.side_table(0.52), 0.0, 1.0, 0.0, -1.5))
    stage.add("sideboard", against(furniture.sideboard(), "right", -0.35))
    stage.add("chest", against(furniture.sideboard(), "front", -1.1))


def _library(stage: Stage) -> None:
    rng = np.random.default_rng(2024)
    cases: tuple[tuple[str, Wall, float, float, int], ...] = (
        ("left", "back", -2.057, 1.7, 6),
        ("right", "back", 2.197, 1.42, 6),
        ("third", "front", 1.2, 1.1, 5),
    )
    for name, wall, along, width, shelves in cases:
        case, volumes = books.filled_bookcase(rng, width, 2.25, 0.3, shelves)
        stage.add(f"{name} bookcase", against(case, wall, along))
        stage.add(f"{name} books", against(volumes, wall, along))


def _on_the_table(stage: Stage) -> None:
    x, y, z = _TABLE_X, _TABLE_Y, _TABLE_Z
    rng = np.random.default_rng(77)
    stage.add("teapot", placed(ornaments.teapot(), 200.0, x - 0.02, y, z - 0.17))
    stage.add("cups", [
        *placed(ornaments.cup(), 30.0, x + 0.17, y, z - 0.08),
        *placed(ornaments.cup(), 130.0, x - 0.2, y, z + 0.02),
    ])  # fmt: skip
    stage.add("fruit bowl", placed(ornaments.fruit_bowl(3), 0.0, x + 0.02, y, z + 0.14))
    stage.add("book pile", placed(books.pile(rng, 3), 25.0, 1.02, 0.52, -1.52))


def _around(stage: Stage) -> None:
    """Mantelpiece, pictures, plants, and the ornaments on sideboard and bookcases."""
    mantel = 1.159
    stage.add("mantelpiece", [
        *against(ornaments.candlestick(0.24), "back", room.FIREPLACE_X - 0.72, mantel, 0.42),
        *against(ornaments.candlestick(0.18), "back", room.FIREPLACE_X - 0.58, mantel, 0.46),
        *against(ornaments.vase(0.3, "porcelain"), "back", room.FIREPLACE_X + 0.68, mantel, 0.45),
        *against(ornaments.vase(0.16, "celadon"), "back", room.FIREPLACE_X + 0.47, mantel, 0.48),
    ])  # fmt: skip
    hills = furniture.picture(1.05, 0.86, (0, 0), 0.0, "gold")
    stage.add("hills", against(hills, "back", room.FIREPLACE_X, 1.87, 0.34))
    stage.add("sea", against(furniture.picture(0.5, 0.5, (0, 1), 0.05, "black"), "right", -0.62, 1.58))
    stage.add("herbarium", against(furniture.picture(0.4, 0.5, (1, 1), 0.04, "gold"), "right", -0.02, 1.58))
    stage.add("circles", against(furniture.picture(1.0, 1.0, (1, 0), 0.0, "black"), "front", -1.1, 1.6))
    stage.add("palm", placed(plants.palm(6, 1.02), 0.0, 2.12, 0.0, -1.5))
    stage.add("rubber tree", placed(plants.rubber_tree(8, 1.75), 0.0, -2.5, 0.0, 1.55))
    stage.add("ivy", against(plants.ivy(5, 6, 0.75), "back", -1.5, 2.299, 0.22))
    stage.add("vases", [
        *against(ornaments.vase(0.34, "celadon"), "right", -0.82, 0.785, 0.2),
        *against(ornaments.vase(0.24, "cobalt"), "right", -0.6, 0.785, 0.24),
        *against(ornaments.vase(0.28, "terracotta"), "back", 1.85, 2.3, 0.2),
        *against(ornaments.vase(0.3, "porcelain"), "front", -1.65, 0.785, 0.2),
        *against(ornaments.vase(0.22, "porcelain"), "back", 2.3, 2.3, 0.2),
        *against(ornaments.vase(0.26, "cobalt"), "back", -2.4, 2.3, 0.2),
    ])  # fmt: skip


def _lights(stage: Stage) -> None:
    for k, (x, z) in enumerate(((-1.6, -0.98), (1.6, -0.98), (0.0, 1.85))):
        stage.add(f"ceiling lamp {k + 1}", placed(lamps.plafond(), 0.0, x, room.HEIGHT, z))
    stage.add("standing lamp", placed(lamps.standing_lamp(), 0.0, -2.42, 0.0, -1.68))
    stage.add("table lamp", against(lamps.table_lamp("porcelain"), "right", 0.15, 0.784, 0.26))
    pivot = (_TABLE_X, room.BEAM_UNDERSIDE, _TABLE_Z - 0.1)
    stage.add("ceiling rose", placed(lamps.rose(), 0.0, *pivot))
    stage.add("hanging lamp", lamps.pendant(0.92), swing(pivot, "z", 6.0, _CYCLE / 3))


def _moving(stage: Stage) -> None:
    """Globe, clock and train; what moves is an object of its own."""
    stage.add("globe stand", placed(ornaments.globe_stand(), 0.0, -1.5, 0.0, -1.62))
    x, y, z = ornaments.GLOBE_CENTRE
    stage.add("globe", ornaments.globe(), spin((x - 1.5, y, z - 1.62), _CYCLE, ornaments.GLOBE_TILT))
    stage.add("clock", against(ornaments.clock_case(), "back", 1.17))
    x, y, z = ornaments.PENDULUM_PIVOT
    stage.add("pendulum", ornaments.pendulum(), swing((x + 1.17, y, z - room.DEPTH / 2), "z", 5.0, _CYCLE / 6))
    stage.add("railway", placed(ornaments.track(), 0.0, _TABLE_X, 0.009, _TABLE_Z))
    stage.add("train", ornaments.train(), spin((_TABLE_X, 0.009, _TABLE_Z), _CYCLE))


def _flight(time: float) -> Camera:
    """A closed walk at eye height through the free front of the room, looking from side to side."""
    turn = 2 * math.pi * math.fmod(time / _FLIGHT, 1.0)
    position = (0.75 + 1.15 * math.cos(turn), 1.5 + 0.06 * math.sin(2 * turn), 1.4 + 0.5 * math.sin(turn + 0.4))
    yaw = math.radians(-9.0 - 31.0 * math.cos(turn + 1.05))  # to the right of -z
    ahead = (position[0] + math.sin(yaw), position[1] - 0.16, position[2] - math.cos(yaw))
    return Camera.look_at(position, ahead, yfov_degrees=_YFOV)


def build(*, animate: bool = False) -> Scene:
    """The room; with ``animate`` the train runs, the globe and the pendulum move and the lamp over the table swings."""
    stage = Stage(animate)
    palette.add_materials(stage)
    room.build(stage)
    _seating(stage)
    _library(stage)
    _on_the_table(stage)
    _around(stage)
    _lights(stage)
    _moving(stage)
    still = Camera.look_at((2.25, 1.5, 2.0), (-0.42, 1.0, -1.1), yfov_degrees=_YFOV)
    return stage.scene("interior", still, _flight)
