"""Scenes that have what well-known ones have, written as files, small enough to be traced in a test.

Each says in its docstring what of the real one is in it. Everything is generated here; nobody's file is copied.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assets.shapes import Shape, block, join, quad
from assets.surfaces import ball, lathe
from raytrace.camera import Camera
from tests.scene_files.model import Model, grain, letter_f, matrix_of, write_sky
from tests.unit.gltf_files import png

Point = tuple[float, float, float]
U8 = NDArray[np.uint8]
Texels = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True)
class LookAlike:
    """What a user gives to ``--scene``, ``--environment``, ``--camera`` and ``--environment-rotation``."""

    scene: Path
    environment: Path | None = None
    camera: Path | None = None
    turned: float = 0.0


def rectangle(centre: Point, right: Point, up: Point) -> Shape:
    """A rectangle whose front is where ``right`` x ``up`` points; both are half its sides."""
    c, r, u = np.array(centre), np.array(right), np.array(up)
    return quad([c - r - u, c + r - u, c + r + u, c - r + u])


# -- a hall with a staircase ------------------------------------------------------------------------------------------


def stairs(folder: Path) -> LookAlike:
    """An interior as modelling programs export them, in world space: 13 objects that emit, among them panels behind
    openings, spots in the ceiling, and lights in the wall at mirrored nodes; a tiled floor half metal, wooden treads
    with gloss, brushed steel, glass with three extensions of its own; walls without normals, triangles without area;
    and a camera of 70 degrees. The ball that rolls is none of the real one's: it tries an animation, and lets this
    scene share the tracer's compiled loops with another.
    """
    m = Model()
    wall = m.paint("wall", (0.89, 0.89, 0.89))
    m.show("walls", _hall(), wall, normals=False)
    tiles = np.full((64, 64, 3), (158, 132, 96), np.uint8)
    tiles[:2] = tiles[:, :2] = (214, 196, 150)
    floor = rectangle((0, 0, 0), (4, 0, 0), (0, 0, -3)).mapped((8, 6))
    flat = np.array([[0, 1, 1], [2, 2, 2], [0, 2, 0]], np.int32)
    m.show("floor", Shape(floor.vertices, np.concatenate([floor.faces, flat]), floor.normals, floor.uvs),
           m.paint("tiles", metallic=0.745, roughness=0.5, image=tiles))  # fmt: skip
    wood = m.paint("wood", roughness=0.316, image=grain(64, 64, ((0.42, 0.17, 0.1), (0.55, 0.26, 0.15)), 1))
    treads = [block((1.6 - 0.42 * k, 0.1 + 0.25 * k, -3.0), (2.0 - 0.42 * k, 0.2 + 0.25 * k, -1.6)) for k in range(12)]
    m.show("treads", join(treads), wood, normals=False)
    m.show("skirting", block((-3.98, 0.0, -2.98), (3.98, 0.12, -2.96)), wood)
    glass = {
        "KHR_materials_transmission": {"transmissionFactor": 1.0},
        "KHR_materials_ior": {"ior": 1.5},
        "KHR_materials_volume": {"thicknessFactor": 1.0},
    }
    m.show("pane", block((-0.6, 0.0, -1.56), (0.9, 0.9, -1.54)), m.paint("glass", roughness=0.0, extensions=glass))
    chrome = m.paint("chrome", (0.69, 0.65, 0.69), roughness=0.316, metallic=1.0)
    for k in range(5):
        spot = lathe([(0.16, 0.0), (0.0, 0.0)], 16).moved(-2.8 + 1.3 * k, 2.98, 1.0)
        m.show(f"spot {k + 1}", spot, m.lamp((1.5, 1.5, 1.5)), normals=False)
    for k in range(4):
        # The node mirrors it in x, so that it is counter-clockwise as the file stores it and must be turned over.
        at = (-(1.5 - 1.2 * k), 0.75 + 0.72 * k, -2.97)
        m.show(f"step light {k + 1}", rectangle(at, (0.1, 0, 0), (0, 0.1, 0)), m.lamp((6.0, 6.0, 6.0)),
               scale=[-1, 1, 1])  # fmt: skip
        m.show(f"rim {k + 1}", rectangle((-at[0], at[1], -2.98), (0.16, 0, 0), (0, 0.16, 0)), chrome)
    warm = (4.575, 3.59, 1.55)
    m.show("door", rectangle((-3.98, 1.1, 1.4), (0, 0, -0.8), (0, 1.1, 0)), m.lamp(warm))
    m.show("window", rectangle((-1.0, 1.6, 2.98), (-1.6, 0, 0), (0, 1.2, 0)), m.lamp(warm))
    m.show("skylight", rectangle((0.0, 4.98, -2.0), (3.0, 0, 0), (0, 0, 0.6)), m.lamp((1.6, 1.6, 1.6)))
    m.show("cellar", rectangle((-1.6, 0.02, -2.3), (0.8, 0, 0), (0, 0, -0.5)), m.lamp((3.27, 3.27, 3.27)))
    m.show("ball", ball(0.25, 24), m.paint("rubber", (0.1, 0.3, 0.7)), translation=[-1.0, 0.25, 0.6])
    m.roll("ball", [(0.0, (-1.0, 0.25, 0.6)), (1.0, (1.0, 0.25, 0.6))])
    m.camera(Camera.look_at((3.5, 1.65, 2.4), (-1.0, 1.35, -1.2), yfov_degrees=70.0))
    used = ["emissive_strength", "transmission", "ior", "volume"]
    m.json["extensionsUsed"] = [f"KHR_materials_{name}" for name in used]
    return LookAlike(m.write_glb(folder / "stairs.glb"))


def _hall() -> Shape:
    """Walls and two ceilings, that over the stairs at 5 m and the rest at 3 m, with the wall between them."""
    return join([
        rectangle((0, 2.5, -3), (4, 0, 0), (0, 2.5, 0)),
        rectangle((0, 2.5, 3), (-4, 0, 0), (0, 2.5, 0)),
        rectangle((-4, 2.5, 0), (0, 0, -3), (0, 2.5, 0)),
        rectangle((4, 2.5, 0), (0, 0, 3), (0, 2.5, 0)),
        rectangle((0, 3, 0.9), (4, 0, 0), (0, 0, 2.1)),
        rectangle((0, 5, -2.1), (4, 0, 0), (0, 0, 0.9)),
        rectangle((0, 4, -1.2), (-4, 0, 0), (0, 1, 0)),
    ])  # fmt: skip


# -- a classroom ------------------------------------------------------------------------------------------------------


def classroom(folder: Path) -> LookAlike:
    """Rows of desks and chairs of bars 3 cm thick in a room of 3 m on a ground of 222 m, everything without normals;
    no light in the file, so that it comes from a sky with a sun, through windows with bars, one of which shows its
    tower; and a camera path of one matrix for each frame.

    The real one has neither normal nor roughness maps nor a sign that glows, too little to light a scene: with them
    this one shares the tracer's compiled loops with :func:`bottle`.
    """
    m = Model()
    shell = [
        block((-3.2, 0.0, -4.0), (-3.0, 0.9, 4.0)),
        block((-3.2, 2.4, -4.0), (-3.0, 3.0, 4.0)),
        *(block((-3.2, 0.9, z - 0.15), (-3.0, 2.4, z + 0.15)) for z in (-3.85, -1.3, 1.3, 3.85)),
        block((3.0, 0.0, -4.0), (3.2, 3.0, 4.0)),
        block((-3.2, 0.0, -4.2), (3.2, 3.0, -4.0)),
        block((-3.2, 0.0, 4.0), (3.2, 3.0, 4.2)),
        block((-3.2, 3.0, -4.2), (3.2, 3.2, 4.2)),
    ]
    m.show("walls", join(shell), m.paint("walls", (0.65, 0.67, 0.8)), normals=False)
    planks = rectangle((0, 0, 0), (3, 0, 0), (0, 0, -4)).mapped((3, 4))
    bumpy: dict[str, Any] = {"normalTexture": {"index": m.texture(png(_seams()[::-1]))}}
    m.show("floor", planks, m.paint("floor", (0.66, 0.59, 0.52), **bumpy), normals=False)
    ground = rectangle((0, -0.05, 0), (111, 0, 0), (0, 0, -111))
    m.show("ground", ground, m.paint("ground", (0.45, 0.45, 0.5)), normals=False)
    chalk = np.full((48, 96, 3), (30, 58, 44), np.uint8)
    chalk[:, 24:72][letter_f(48, 48)] = 235
    board = rectangle((0, 1.6, -3.98), (1.8, 0, 0), (0, 0.7, 0))
    m.show("board", board, m.paint("board", image=chalk), normals=False)
    glow = np.zeros((24, 24, 3), np.uint8)
    glow[letter_f(24, 24)] = (0, 110, 40)
    emissive: dict[str, Any] = {
        "emissiveFactor": [1.0, 1.0, 1.0],
        "emissiveTexture": {"index": m.texture(png(glow[::-1]))},
    }
    sign = rectangle((2.4, 2.5, -3.98), (0.3, 0, 0), (0, 0.3, 0))
    m.show("sign", sign, m.paint("sign", (0.0, 0.0, 0.0), **emissive), normals=False)
    wood = m.paint("wood", roughness=0.8, image=grain(32, 64, ((0.6, 0.4, 0.2), (0.75, 0.55, 0.32)), 2))
    worn = np.zeros((32, 64, 3), np.uint8)
    worn[..., 1] = np.random.default_rng(3).integers(60, 120, (32, 64))
    m.json["materials"][wood]["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {"index": m.texture(png(worn))}
    steel = m.paint("steel", (0.7, 0.69, 0.69), roughness=0.316, metallic=1.0)
    seats = [(-1.8 + 1.2 * column, -2.2 + 1.4 * row) for column in range(4) for row in range(4)]
    for name, pieces in (("desk", _desk()), ("chair", _chair())):
        for part, material in zip(pieces, (wood, steel), strict=True):
            m.show(f"{name} {material}", join([part.moved(x, 0.0, z) for x, z in seats]), material, normals=False)
    sashes = [block((-3.12, 0.9, z), (-3.08, 2.4, z + 0.04)) for z in np.arange(-3.6, 3.7, 0.6)]
    rails = [block((-3.12, y, -3.7), (-3.08, y + 0.04, 3.7)) for y in (0.9, 1.6, 2.36)]
    m.show("windows", join([*sashes, *rails]), steel, normals=False)
    m.camera(Camera.look_at((1.7, 1.3, 3.8), (-0.6, 0.9, -2.0), yfov_degrees=50.0))
    frames = []
    for k in range(12):
        turn = 0.02 * k
        camera = Camera.look_at((2.4 - turn, 1.6, 3.4 - 2 * turn), (-1.4 - turn, 0.9, -2.0), yfov_degrees=55.0)
        frames.append({"frame": k, "camera_to_world_gl": matrix_of(camera).tolist(),
                       "yfov_deg": math.degrees(camera.yfov), "resolution": [1280.0, 720.0]})  # fmt: skip
    path = folder / "camera_path.json"
    path.write_text(json.dumps({"source": "generated", "frames": frames}))
    sky = write_sky(folder / "sky.hdr", azimuth=-20.0)
    return LookAlike(m.write_glb(folder / "classroom.glb"), sky, path, turned=58.0)


def _seams() -> U8:
    """Normals of planks along v, with grooves between them."""
    image = np.full((32, 32, 3), (128, 128, 255), np.uint8)
    image[:, ::8], image[:, 1::8] = (200, 128, 230), (56, 128, 230)
    return image


def _desk() -> tuple[Shape, Shape]:
    """Top, and frame of bars."""
    legs = [block((x, 0.0, z), (x + 0.03, 0.68, z + 0.03)) for x in (-0.3, 0.27) for z in (-0.25, 0.22)]
    bars = [block((x, 0.12, -0.25), (x + 0.03, 0.15, 0.25)) for x in (-0.3, 0.27)]
    return block((-0.35, 0.68, -0.28), (0.35, 0.71, 0.28), 0.5), join([*legs, *bars])


def _chair() -> tuple[Shape, Shape]:
    """Seat and back, and frame of bars; 0.55 m behind the desk."""
    seat = block((-0.2, 0.42, 0.4), (0.2, 0.44, 0.78), 0.5)
    back = block((-0.2, 0.65, 0.76), (0.2, 0.85, 0.78), 0.5)
    front = [block((x, 0.0, 0.42), (x + 0.025, 0.42, 0.445)) for x in (-0.2, 0.175)]
    rear = [block((x, 0.0, 0.78), (x + 0.025, 0.85, 0.805)) for x in (-0.2, 0.175)]
    return join([seat, back]), join([*front, *rear])


# -- a bottle ---------------------------------------------------------------------------------------------------------


def bottle(folder: Path) -> LookAlike:
    """A native ``.gltf`` beside its ``.bin`` and four PNG maps, 0.26 m high: a metal body, a rough red cap, ribs that
    only the normal map has, a ring that glows; with tangents, a turned node, and neither camera nor lamp.
    """
    m = Model()
    profile = [(0.0, -0.13), (0.052, -0.13), (0.054, -0.12), (0.054, 0.05), (0.03, 0.085), (0.03, 0.09), (0.034, 0.092),
               (0.034, 0.128), (0.03, 0.13), (0.0, 0.13)]  # fmt: skip
    shape = lathe(profile, 48)
    maps = {"baseColor": _label(), "emissive": _glow(), "normal": _ribs(), "occlusionRoughnessMetallic": _finish()}
    for name, image in maps.items():
        (folder / f"Bottle_{name}.png").write_bytes(png(image[::-1]))
        m.add("textures", {"source": m.add("images", {"uri": f"Bottle_{name}.png"})})
    surface = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 3}}
    material = m.add("materials", {
        "name": "bottle",
        "pbrMetallicRoughness": surface,
        "normalTexture": {"index": 2},
        "occlusionTexture": {"index": 3},
        "emissiveFactor": [1.0, 1.0, 1.0],
        "emissiveTexture": {"index": 1},
    })  # fmt: skip
    m.show("bottle", shape, material, rotation=[0.0, 1.0, 0.0, 0.0])
    n = shape.normals
    around = np.stack([n[:, 2], np.zeros(len(n)), -n[:, 0], np.ones(len(n))], axis=1)
    around[:, :3] /= np.maximum(np.linalg.norm(around[:, :3], axis=1, keepdims=True), 1e-6)
    m.json["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = m.accessor(around)
    return LookAlike(m.write_gltf(folder / "Bottle.gltf"), write_sky(folder / "sky.hdr", azimuth=100.0, elevation=40.0))


_BODY, _CAP = (0.18, 0.64), 0.8
"""Where along the profile the body lies between, and the cap begins."""


def _along(height: int = 128, width: int = 256) -> Texels:
    """Places around and along the bottle, in [0, 1], of the texels of its maps, row 0 = bottom."""
    v, u = (np.mgrid[0:height, 0:width] + 0.5) / np.array([height, width])[:, None, None]
    return u, v


def _label() -> U8:
    """Base colour: yellow metal, a red cap, a white label with the letter F four times around."""
    _, v = _along()
    image = np.full((*v.shape, 3), (214, 196, 92), np.uint8)
    image[v > _CAP] = (120, 14, 16)
    image[(v > 0.36) & (v < 0.6)] = (230, 230, 225)
    rows = np.flatnonzero((v[:, 0] > 0.36) & (v[:, 0] < 0.6))
    for k in range(4):
        image[rows[0] : rows[-1] + 1, 64 * k : 64 * k + 64][letter_f(len(rows), 64)] = (20, 40, 150)
    return image


def _glow() -> U8:
    """Emission: a blue-green ring below the label."""
    _, v = _along()
    image = np.zeros((*v.shape, 3), np.uint8)
    image[abs(v - 0.32) < 0.015] = (40, 255, 200)
    return image


def _ribs() -> U8:
    """Normals: upright ribs around the lower body, as a sine of the surface's height; flat elsewhere."""
    u, v = _along()
    slope = np.where((v > _BODY[0]) & (v < 0.29), 0.8 * np.sin(2 * np.pi * 16 * u), 0.0)
    normal = np.stack([-slope, np.zeros_like(slope), np.ones_like(slope)], axis=2)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    image: U8 = np.rint(255 * (0.5 + 0.5 * normal)).astype(np.uint8)
    return image


def _finish() -> U8:
    """Red: occlusion, which the tracer leaves out; green: roughness; blue: metal but for the cap and the label."""
    _, v = _along()
    printed = (v > 0.36) & (v < 0.6)
    roughness = np.where(v > _CAP, 0.7, np.where(printed, 0.5, 0.3))
    metal = np.where((v > _CAP) | printed, 0.0, 1.0)
    image: U8 = np.rint(255 * np.stack([0.5 + 0.5 * v, roughness, metal], axis=2)).astype(np.uint8)
    return image


LOOK_ALIKES: dict[str, Callable[[Path], LookAlike]] = {"stairs": stairs, "classroom": classroom, "bottle": bottle}
"""Each writes its files into a folder."""
