"""What the program shows, on the software renderer, against pictures that someone has looked at.

``make references`` writes the pictures anew.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import assets
from config import Config, Taa, load
from gl.pipelines import remembered
from gl.renderer import Renderer, read
from images import to_srgb8
from raytrace.compiled import compile_scene
from raytrace.frame import FramePacket
from raytrace.integrator import Tracer
from raytrace.shot import Shot
from tests.screenshots.compare import check

U8 = NDArray[np.uint8]
F32 = NDArray[np.float32]

SIZE = (160, 90)
FRAMES = (1, 8, 32)
"""Counted from 1: no history, a short one, a long one."""

METHODS = {
    "noisy": ("none", Config()),
    "svgf": ("svgf", Config(taa=Taa(enabled=False))),
    "svgf_taa": ("svgf", Config()),
    "asvgf": ("asvgf", Config(taa=Taa(enabled=False))),
    "bmfr": ("bmfr", Config(taa=Taa(enabled=False))),
    "bmfr_paper": ("bmfr", load(None, ("bmfr.preset=paper", "taa.enabled=false"))),
}
GUIDES = ("frame.albedo", "frame.surface", "frame.motion", "frame.emission", "svgf.reproject.out_reprojection")


@pytest.fixture(scope="module")
def films() -> dict[str, list[FramePacket]]:
    """A flight through the Cornell box, block and lamp moving, seed 0; by which points of it are remembered."""
    scene = compile_scene(assets.build("cornell", animate=True))
    with Tracer(scene) as tracer:
        shots = {rule: Shot(scene, tracer, SIZE, "flight", animate=True, remember=rule) for rule in ("", "random")}
        return {rule: [shot.frame(index) for index in range(max(FRAMES))] for rule, shot in shots.items()}


@pytest.fixture(scope="module")
def packets(films: dict[str, list[FramePacket]]) -> list[FramePacket]:
    return films[""]


@pytest.mark.parametrize("method", METHODS)
def test_pictures(renderer: Renderer, films: dict[str, list[FramePacket]], method: str, regenerate: bool) -> None:
    denoiser, config = METHODS[method]
    for number, packet in enumerate(films[remembered(config, denoiser)], 1):
        result = renderer.run(packet, config, denoiser)
        if number in FRAMES:
            display = read(result.outputs["display"])[..., :3]
            check(f"{method}_{number:02}", np.rint(display * 255.0).astype(np.uint8), regenerate)


def test_guides(renderer: Renderer, packets: list[FramePacket], regenerate: bool) -> None:
    """Albedo, normal and depth above motion, lamp and length of the history, read back from the GPU at frame 8."""
    for packet in packets[:8]:
        result = renderer.run(packet, Config(), "svgf", keep=GUIDES)
    albedo, surface, motion, emission, reprojection = (read(result.texture(name)) for name in GUIDES)
    tiles = [
        to_srgb8(albedo),
        grey_zero(surface[..., :3]),
        grey(surface[..., 3] / 15.0),
        grey_zero(motion[..., :2] * 10.0),
        to_srgb8(emission / 17.0),
        grey(reprojection[..., 3] / 8.0),
    ]
    rows = [np.concatenate(tiles[i : i + 3], axis=1) for i in (3, 0)]
    check("guides_08", np.concatenate(rows, axis=0), regenerate)


def grey(values: F32) -> U8:
    """(H, W) in [0, 1] as (H, W, 3)."""
    return np.repeat(np.rint(np.clip(values, 0, 1) * 255)[..., None], 3, axis=2).astype(np.uint8)


def grey_zero(values: F32) -> U8:
    """(H, W, 2 or 3) in [-1, 1]; 0 is grey, what is missing black."""
    shown = np.zeros((*values.shape[:2], 3), np.uint8)
    shown[..., : values.shape[2]] = np.rint(127.5 + 127.5 * np.clip(values, -1, 1))
    return shown
