"""The materials of the interior."""

from __future__ import annotations

from assets import pictures, textures
from assets.stage import Stage
from assets.textures import linear


def add_materials(stage: Stage) -> None:
    """Add every material of the room to a stage: paints and cloths as sRGB codes, lights as radiance in W/(m² sr)."""
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
        ("linen", "#d8cbb4"), ("leather", "#94492e"), ("mustard", "#d09a2e"), ("teal", "#2f7377"),
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
    stage.material("palm leaf", linear("#bcd3a6"), leaf)
    stage.material("ivy leaf", linear("#f4f6d0"), leaf)
    for name, code in (
        ("pages", "#e8dfc8"), ("night", "#141c2c"), ("brass", "#c79a4b"), ("iron", "#2c2b2b"), ("bark", "#3a2a20"),
        ("enamel", "#2b5a50"), ("gold", "#b98d43"), ("black", "#242220"), ("card", "#f2ede0"), ("earth", "#37281e"),
        ("terracotta", "#b9663f"), ("stem", "#5d6b35"), ("china", "#f2f0e8"), ("celadon", "#8fb59f"),
        ("cobalt", "#2f4f9a"), ("tea", "#7a3d14"), ("orange", "#e5862a"), ("apple", "#b5302a"), ("steel", "#8d8f92"),
        ("train red", "#bf2f26"), ("train green", "#3f7d4a"), ("train yellow", "#e0b13a"), ("train blue", "#33639a"),
    ):  # fmt: skip
        stage.material(name, linear(code))
    for name, radiance in (
        ("pendant light", (66.0, 52.0, 36.0)), ("ceiling light", (66.0, 54.0, 40.0)), ("shade light", (7.5, 4.9, 2.5)),
        ("bulb light", (30.0, 22.0, 13.0)), ("flame", (10.0, 3.6, 0.6)),
    ):  # fmt: skip
        stage.material(name, (0.5, 0.5, 0.5), emission=radiance)
