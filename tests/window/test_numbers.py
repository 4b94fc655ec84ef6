"""The window with nothing over its picture: frames of ``app.py render``, to the bit, and nothing but those passes."""

from __future__ import annotations

import re

import moderngl
import numpy as np
import pytest

from config import load
from gl.renderer import Renderer, read
from session import open_shot
from tests.window.desktop import App, application, plan, running

pytestmark = pytest.mark.window

SETTINGS = ("render.width=96", "render.height=54", "render.seed=7", "render.jitter=off")
FLAGS = ("--no-animate", "--seed", "7", "--set", "render.jitter=off")


def runs(app: App) -> list[tuple[int, list[str]]]:
    """(number of a frame, its passes), for every frame that runs through others than the one before."""
    found = re.findall(r"^frame (\d+): \d+x\d+, \d+ passe?s?: (.*)$", app.stdout(), re.MULTILINE)
    return [(int(number), names.split()) for number, names in found]


def test_a_screenshot_is_the_frame_that_is_rendered_without_a_window(ctx: moderngl.Context, display: str, tmp_path):
    with application(display, tmp_path, *FLAGS, size="96x54") as app:
        app.await_passes(plan("svgf"))
        app.picture("1")
        number = int(app.hear(r"^frame (\d+): saved .*shot_000")[1])
        picture = np.rint(app.picture() * 255.0)
        last = int(app.hear(r"^frame (\d+): saved .*shot_001")[1])
        changes = runs(app)
        app.press("Escape")
        assert app.process.wait(10.0) == 0
        assert app.stderr() == ""
    assert number < last
    # The noisy frame was shown until the filter's programs were there.
    assert [names for _, names in changes] == [plan("none"), plan("svgf")]
    assert changes[0][0] == 0
    config, first = load(None, SETTINGS), changes[1][0]
    shot, renderer = open_shot("cornell", config, "still", animate=True), Renderer(ctx)
    try:
        for index in range(last + 1):
            packet = shot.tracer.frame(index, shot.camera(0), shot.camera(0), shot.size, 0.0, 0.0, cut=index == 0)
            result = renderer.run(packet, config, "none" if index < first else "svgf")
        expected = np.rint(read(result.outputs["display"])[::-1, :, :3] * 255.0)
    finally:
        renderer.release()
        shot.tracer.close()
    np.testing.assert_array_equal(picture, expected)


COUNTING = """
import sys
from pathlib import Path
import config
from gl.profiler import Profiler
from imgui_bundle import imgui
from ui import window

calls = {}
def count(owner, name):
    function = getattr(owner, name)
    def counting(*args, **kwargs):
        calls[name] = calls.get(name, 0) + 1
        return function(*args, **kwargs)
    setattr(owner, name, counting)

count(Profiler, "frame")
for name in ("new_frame", "render", "get_io"):
    count(imgui, name)
count(window, "count_bad")
create = window.Viewer.__init__
def created(*args, **kwargs):
    create(*args, **kwargs)
    calls.clear()  # what it takes to be ready for a panel
window.Viewer.__init__ = created
show = window.Viewer._show
def shown(self, result, fresh):
    print("calls:", "none" if not calls else " ".join(sorted(calls)), flush=True)
    calls.clear()
    show(self, result, fresh)
window.Viewer._show = shown
settings = config.load(None, ["render.width=64", "render.height=36"])
wishes = window.Wishes("cornell", "svgf", "still", True, Path(sys.argv[1]), hud=False, calibrate=False, log=True)
window.run(settings, wishes)
"""


def test_without_panel_nothing_is_measured_and_dear_imgui_rests(display: str, tmp_path) -> None:
    with running(display, tmp_path, "-c", COUNTING, str(tmp_path / "out")) as app:
        app.await_picture()
        app.await_passes(plan("svgf"))
        app.xdotool("mousemove", "--window", app.window, 40, 40, "click", 1, "click", 4)
        app.ask("b", "frame.direct")
        app.ask("v", "the picture")
        assert set(re.findall(r"^calls: (.*)$", app.stdout(), re.MULTILINE)) == {"none"}
        app.ask("g", "hud on")
        app.hear("^calls: count_bad frame get_io new_frame render$")
        app.await_passes(plan("svgf", "display.mark_bad=on"))
        app.ask("g", "hud off")
        app.await_passes(plan("svgf"))
        app.hear("^calls: none$", len(app.stdout()))
