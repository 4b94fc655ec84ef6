"""One picture of each scene file, opened as a user's file is, against pictures that someone has looked at.

The Cornell box is its author's; the others are look-alikes of well-known scenes (:mod:`tests.scene_files.look_alikes`
says what they have of them), written to disk and read back. ``make references`` writes the pictures anew.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from config import Surroundings
from gl.renderer import Renderer
from tests.scene_files.look_alikes import LOOK_ALIKES
from tests.screenshots.compare import check
from tests.screenshots.filming import film

CORNELL = Path(__file__).parents[1] / "scene_files" / "cornell_bitterli.glb"

pytestmark = pytest.mark.usefixtures("shared_loops")

DENOISERS = {
    "stairs": "svgf",  # lit by door and window, spots and lights beside the steps all white, tiles lead to the door
    "classroom": "bmfr",  # the F on the board, the red tower in the middle window, sun on the floor, legs of desks
    "bottle": "svgf",  # the F on the label, a dull red cap, shining metal, ribs below the ring that glows
}


def test_cornell_box(renderer: Renderer, regenerate: bool) -> None:
    """Red on the left, green on the right; compare with cornell_bitterli.exr, which has every bounce.

    Were both sides even, the diagonals' pixels would look exactly into the edges of the box, whose walls have no point
    in common: whether a ray slips through is then a matter of rounding.
    """
    check("file_cornell", film(renderer, str(CORNELL), "svgf", size=(97, 96)), regenerate)


@pytest.mark.parametrize("name", LOOK_ALIKES)
def test_look_alike(renderer: Renderer, tmp_path: Path, name: str, regenerate: bool) -> None:
    what = LOOK_ALIKES[name](tmp_path)
    surroundings = Surroundings(file=what.environment, rotation=what.turned)
    camera = None if what.camera is None else str(what.camera)
    picture = film(renderer, str(what.scene), DENOISERS[name], camera=camera, surroundings=surroundings)
    check(f"file_{name}", picture, regenerate)
