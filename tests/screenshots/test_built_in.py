"""One picture of each built-in scene, in motion, against pictures that someone has looked at; cornell's are in
:mod:`tests.screenshots.test_screenshots`.

``make references`` writes the pictures anew.
"""

from __future__ import annotations

import pytest

from assets import SCENES
from gl.renderer import Renderer
from tests.screenshots.compare import REFERENCES, SHARE, check, difference, load
from tests.screenshots.filming import film

pytestmark = pytest.mark.usefixtures("shared_loops")

DENOISERS = {
    "interior": "svgf",  # bright to the corners, textures upright; leaves, rug and books as sharp as pixels allow
    "metals": "svgf",  # polished on the left, rough on the right; copper, green and steel keep their colours
    "penumbra": "svgf",  # columns on the floor, not above it; bars of the grille and spokes of the wheel one by one
    "thin": "bmfr",  # pickets with gaps between them, a hedge with holes, wires where a pixel can hold one
    "mirrorish": "svgf",  # the floor shows block, ball and the right tube upside down; the metal ball has all in it
    "hard": "bmfr",  # direct light on the right wall only; one ball is white, the other all but black
}
CURVED = 0.01
"""Share of the pixels that may differ where balls are mirrors: they magnify what rounding changes in a ray. Camera rays
that were off by the last bit changed up to 0.26 % here and 0.11 % in any other picture."""


def test_every_scene_has_its_picture() -> None:
    assert set(DENOISERS) | {"cornell", "far"} == set(SCENES)


@pytest.mark.parametrize("scene", DENOISERS)
def test_picture(renderer: Renderer, scene: str, regenerate: bool) -> None:
    share = CURVED if scene == "metals" else SHARE
    check(f"scene_{scene}", film(renderer, scene, DENOISERS[scene], camera="flight"), regenerate, share=share)


def test_far_looks_as_the_interior_does(renderer: Renderer) -> None:
    """10^5 m away single precision would have 8 mm to spare: it must not be used before the origin is subtracted."""
    away = film(renderer, "far", DENOISERS["interior"], camera="flight")
    found = difference(away, load(REFERENCES / "scene_interior.png"))
    assert found.passes()
