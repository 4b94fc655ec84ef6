"""One picture of every scene, built in or from a file, against pictures that someone has looked at.

Files are opened as a user's are: the Cornell box is its author's, the others are look-alikes of well-known scenes
(:mod:`tests.scene_files.look_alikes` says what they have of them), written to disk and read back. The built-in cornell
is in :mod:`tests.screenshots.test_screenshots`. ``make references`` writes the pictures anew.

All in one file, so that one process has the loops compiled that they share.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from assets import SCENES
from config import Surroundings
from gl.renderer import Renderer
from tests.scene_files.look_alikes import LOOK_ALIKES
from tests.screenshots.compare import REFERENCES, SHARE, check, difference, load
from tests.screenshots.filming import film

pytestmark = pytest.mark.usefixtures("shared_loops")

BUILT_IN = {
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

CORNELL = Path(__file__).parents[1] / "scene_files" / "cornell_bitterli.glb"
FILES = {
    "stairs": "svgf",  # lit by door and window, spots and lights beside the steps all white, tiles lead to the door
    "classroom": "bmfr",  # the F on the board, the red tower in the middle window, sun on the floor, legs of desks
    "bottle": "svgf",  # the F on the label, a dull red cap, shining metal, ribs below the ring that glows
}


def test_every_scene_has_its_picture() -> None:
    assert set(BUILT_IN) | {"cornell", "far"} == set(SCENES)
    assert set(FILES) == set(LOOK_ALIKES)


@pytest.mark.parametrize("scene", BUILT_IN)
def test_built_in(renderer: Renderer, scene: str, regenerate: bool) -> None:
    share = CURVED if scene == "metals" else SHARE
    check(f"scene_{scene}", film(renderer, scene, BUILT_IN[scene], camera="flight"), regenerate, share=share)


def test_far_looks_as_the_interior_does(renderer: Renderer) -> None:
    """10^5 m away single precision would have 8 mm to spare: it must not be used before the origin is subtracted."""
    away = film(renderer, "far", BUILT_IN["interior"], camera="flight")
    found = difference(away, load(REFERENCES / "scene_interior.png"))
    assert found.passes(), found


def test_cornell_box(renderer: Renderer, regenerate: bool) -> None:
    """Red on the left, green on the right; compare with cornell_bitterli.exr, which has every bounce.

    Were both sides even, the diagonals' pixels would look exactly into the edges of the box, whose walls have no point
    in common: whether a ray slips through is then a matter of rounding.
    """
    check("file_cornell", film(renderer, str(CORNELL), "svgf", size=(97, 96)), regenerate)


@pytest.mark.parametrize("name", FILES)
def test_look_alike(renderer: Renderer, tmp_path: Path, name: str, regenerate: bool) -> None:
    what = LOOK_ALIKES[name](tmp_path)
    surroundings = Surroundings(file=what.environment, rotation=what.turned)
    camera = None if what.camera is None else str(what.camera)
    picture = film(renderer, str(what.scene), FILES[name], camera=camera, surroundings=surroundings)
    check(f"file_{name}", picture, regenerate)
