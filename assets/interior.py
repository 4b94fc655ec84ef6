"""A living room by night, of our own making: lamps, a fire, books, a toy train."""

from __future__ import annotations

import math

import numpy as np

from assets import books, furniture, lamps, ornaments, pictures, plants, room, textures
from assets.motion import spin, swing
from assets.room import against
from assets.stage import Stage, placed
from assets.textures import linear
from raytrace.camera import Camera
from raytrace.scene import Scene

_FLIGHT = 8.0  # seconds
_YFOV = 50.0
_TABLE_X, _TABLE_Z, _TABLE_Y = -0.45, -0.15, 0.44


def _materials(stage: Stage) -> None:
    """Every material of the room; colours of paints and cloths as sRGB codes, lights in W/(m² sr)."""
    grain = stage.texture("walnut", textures.wood("#5a3622", "#93623b", 3))
    oak = stage.texture("oak", textures.wood("#6a4a30", "#a07a52", 4))
    plaster = stage.texture("plaster", textures.plaster())
    cloth = stage.texture("weave", textures.weave())
    paper = stage.texture("wallpaper", textures.wallpaper())
    drapery = stage.texture("drapery", textures.drapery())
    leaf = stage.texture("leaf", textures.leaf())

    stage.material("parquet", (1.0, 1.0, 1.0), stage.texture("parquet", textures.parquet()))
    stage.material("ceiling", linear("#efe9dc"), plaster)
    stage.material("plaster", linear("#e9dfcb"), plaster)
    stage.material("wallpaper", linear("#d9dcbf"), paper)
    stage.material("paint", linear("#e6e0d2"))
    stage.material("beam", linear("#c8b49c"), oak)
    stage.material("brick", (1.0, 1.0, 1.0), stage.texture("brick", textures.brick()))
    stage.material("stone", linear("#8f8a82"), plaster)
    stage.material("soot", (0.035, 0.032, 0.03))
    stage.material("walnut", (1.0, 1.0, 1.0), grain)
    stage.material("walnut dark", (0.55, 0.52, 0.5), grain)
    for name, code in (
        ("linen", "#d8cbb4"), ("leather", "#a4502f"), ("mustard", "#d09a2e"), ("teal", "#2f7377"),
        ("rust", "#b4532f"), ("cream", "#efe6d2"), ("throw", "#7c8f9c"),
    ):  # fmt: skip
        stage.material(name, linear(code), cloth)
    stage.material("drapes", linear("#6a97a3"), drapery)
    stage.material("rug", (1.0, 1.0, 1.0), stage.texture("rug", pictures.rug()))
    stage.material("spines", (1.0, 1.0, 1.0), stage.texture("spines", pictures.spines()))
    stage.material("paintings", (1.0, 1.0, 1.0), stage.texture("paintings", pictures.paintings()))
    stage.material("globe", (1.0, 1.0, 1.0), stage.texture("globe", pictures.globe()))
    stage.material("porcelain", (1.0, 1.0, 1.0), stage.texture("porcelain", pictures.porcelain()))
    stage.material("dial", (1.0, 1.0, 1.0), stage.texture("dial", pictures.dial()))
    stage.material("leaf", (1.0, 1.0, 1.0), leaf)
    stage.material("palm leaf", linear("#d8f0c0"), leaf)
    stage.material("ivy leaf", linear("#f4f6d0"), leaf)
    for name, code in (
        ("pages", "#e8dfc8"), ("night", "#141c2c"), ("brass", "#c79a4b"), ("iron", "#2c2b2b"), ("bark", "#3a2a20"),
        ("enamel", "#2b5a50"), ("gold", "#b98d43"), ("black", "#242220"), ("card", "#f2ede0"), ("terracotta", "#b9663f"),
        ("earth", "#37281e"), ("stem", "#5d6b35"), ("china", "#f2f0e8"), ("celadon", "#8fb59f"), ("cobalt", "#2f4f9a"),
        ("tea", "#7a3d14"), ("orange", "#e5862a"), ("apple", "#b5302a"), ("steel", "#8d8f92"),
        ("train red", "#bf2f26"), ("train green", "#3f7d4a"), ("train yellow", "#e0b13a"), ("train blue", "#33639a"),
    ):  # fmt: skip
        stage.material(name, linear(code))
    for name, radiance in (
        ("pendant light", (75.0, 59.0, 41.0)), ("ceiling light", (80.0, 65.0, 48.0)), ("shade light", (13.0, 8.8, 4.8)),
        ("bulb light", (30.0, 22.0, 13.0)), ("flame", (20.0, 8.0, 1.6)),
    ):  # fmt: skip
        stage.material(name, (0.5, 0.5, 0.5), emission=radiance)


def _seating(stage: Stage) -> None:
    for name, parts in (("sofa", furniture.sofa()), ("sofa pillows", furniture.sofa_pillows())):
        stage.add(name, placed(parts, 90.0, -2.25, 0.0, -0.15))
    stage.add("armchair", placed(furniture.armchair(), -66.0, 1.45, 0.0, -0.75))
    stage.add("rug", placed(furniture.rug(2.6, 2.05), 0.0, _TABLE_X, 0.0, _TABLE_Z))
    stage.add("table", placed(furniture.round_table(0.46, _TABLE_Y), 0.0, _TABLE_X, 0.0, _TABLE_Z))
    stage.add("side table", placed(furniture.side_table(0.52), 0.0, 1.0, 0.0, -1.5))
    stage.add("sideboard", against(furniture.sideboard(), "right", -0.35))


def _library(stage: Stage) -> None:
    rng = np.random.default_rng(2024)
    for name, wall, along, width in (("left", "back", -2.06, 1.7), ("right", "back", 2.2, 1.42), ("third", "front", 1.2, 1.1)):
        case, volumes = books.filled_bookcase(rng, width, 2.25, 0.3, 6)
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
    for name, wall, along, y, out, args in (
        ("hills", "back", room.FIREPLACE_X, 1.87, 0.34, (1.05, 0.86, (0, 0), 0.0, "gold")),
        ("sea", "right", -0.62, 1.58, 0.0, (0.5, 0.5, (0, 1), 0.05, "black")),
        ("herbarium", "right", -0.02, 1.58, 0.0, (0.4, 0.5, (1, 1), 0.04, "gold")),
        ("circles", "front", -1.1, 1.6, 0.0, (1.0, 1.0, (1, 0), 0.0, "black")),
    ):
        stage.add(f"picture: {name}", against(furniture.picture(*args), wall, along, y, out))
    stage.add("palm", placed(plants.palm(6, 1.25), 0.0, 2.5, 0.0, -1.6))
    stage.add("rubber tree", placed(plants.rubber_tree(8, 1.75), 0.0, -2.5, 0.0, 1.55))
    stage.add("ivy", against(plants.ivy(5, 7, 0.75), "back", -1.5, 2.299, 0.22))
    stage.add("vases", [
        *against(ornaments.vase(0.34, "celadon"), "right", -0.82, 0.785, 0.2),
        *against(ornaments.vase(0.24, "cobalt"), "right", -0.6, 0.785, 0.24),
        *against(ornaments.vase(0.28, "terracotta"), "back", 1.85, 2.3, 0.2),
        *against(ornaments.vase(0.22, "porcelain"), "back", 2.3, 2.3, 0.2),
        *against(ornaments.vase(0.26, "cobalt"), "back", -2.4, 2.3, 0.2),
    ])  # fmt: skip


def _lights(stage: Stage) -> None:
    for k, (x, z) in enumerate(((-1.6, -0.98), (1.6, -0.98), (0.0, 1.85))):
        stage.add(f"ceiling lamp {k + 1}", placed(lamps.plafond(), 0.0, x, room.HEIGHT, z))
    stage.add("standing lamp", placed(lamps.standing_lamp(), 0.0, -2.42, 0.0, -1.68))
    stage.add("table lamp", against(lamps.table_lamp("porcelain"), "right", 0.15, 0.784, 0.26))
    pivot = (_TABLE_X, room.BEAM_UNDERSIDE, _TABLE_Z - 0.1)
    stage.add("hanging lamp", lamps.pendant(0.92), swing(pivot, "z", 6.0, 4.0))


def _moving(stage: Stage) -> None:
    """Globe, clock and train; what moves is an object of its own."""
    stage.add("globe stand", placed(ornaments.globe_stand(), 0.0, -1.5, 0.0, -1.62))
    x, y, z = ornaments.GLOBE_CENTRE
    stage.add("globe", ornaments.globe(), spin((x - 1.5, y, z - 1.62), 12.0, ornaments.GLOBE_TILT))
    stage.add("clock", against(ornaments.clock_case(), "back", 1.17))
    x, y, z = ornaments.PENDULUM_PIVOT
    stage.add("pendulum", ornaments.pendulum(), swing((x + 1.17, y, z - room.DEPTH / 2), "z", 5.0, 2.0))
    stage.add("railway", placed(ornaments.track(), 0.0, _TABLE_X, 0.009, _TABLE_Z))
    stage.add("train", ornaments.train(), spin((_TABLE_X, 0.009, _TABLE_Z), 12.0))


def _flight(time: float) -> Camera:
    """A closed walk at eye height through the free front of the room."""
    turn = 2 * math.pi * math.fmod(time / _FLIGHT, 1.0)
    position = (1.3 + 0.95 * math.cos(turn), 1.5 + 0.08 * math.sin(2 * turn), 1.55 + 0.5 * math.sin(turn + 0.9))
    target = (-0.6 + 0.4 * math.cos(turn + 0.6), 1.0, -1.1)
    return Camera.look_at(position, target, yfov_degrees=_YFOV)


def build(*, animate: bool = False) -> Scene:
    """The room; with ``animate`` the train runs, the globe and the pendulum move and the lamp over the table swings."""
    stage = Stage(animate)
    _materials(stage)
    room.build(stage)
    _seating(stage)
    _library(stage)
    _on_the_table(stage)
    _around(stage)
    _lights(stage)
    _moving(stage)
    return stage.scene("interior", _flight(0.0), _flight)
