"""The real window: app.py under Xvfb, keys and mouse by xdotool, looked at through F12 and through the X server."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator

import numpy as np
import pytest

from tests.window.desktop import (
    SECONDS,
    START_SECONDS,
    STILL,
    App,
    application,
    difference,
    plan,
    require_tools,
    roughness,
    running,
    screen,
    wait_for,
)

pytestmark = pytest.mark.window


@pytest.fixture(scope="module")
def shared(display: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    with application(display, tmp_path_factory.mktemp("window"), "--no-animate") as app:
        yield app


@pytest.fixture
def app(shared: App) -> Iterator[App]:
    """The window in one and the same condition before each test: 320x180, SVGF, at rest, camera at its beginning."""
    shared.xdotool("windowsize", shared.window, 320, 180)
    shared.press("1", "r", "h")
    shared.await_passes(plan("svgf"))
    yield shared
    assert shared.process.poll() is None, shared.stderr()
    assert "Traceback" not in shared.stderr()


def test_the_cornell_box_is_on_the_screen(app: App) -> None:
    picture = app.settled()
    assert picture.shape == (90, 160, 3)
    left, right, back = picture[40:50, 42:50], picture[40:50, 110:118], picture[25:35, 75:85]
    assert left[..., 0].mean() > 3 * left[..., 1].mean(), "the left wall is red"
    assert right[..., 1].mean() > 1.5 * right[..., 0].mean(), "the right wall is green"
    assert back.min() > 0.05, "the back wall is lit"
    assert picture[5:20, 60:100].max() > 0.9, "the lamp shines"
    twice = np.kron(picture, np.ones((2, 2, 1), np.float32))
    assert difference(app.screen()[:180, :320], twice) < STILL, "the window shows the picture, doubled"


def test_zero_shows_the_noise_one_filters_it_and_tab_goes_back(app: App) -> None:
    filtered = roughness(app.settled())
    app.press("0")
    app.await_title(" none ")
    app.await_passes(plan("none"))
    noisy = roughness(app.picture())
    assert noisy > 3 * filtered
    app.press("Tab")
    app.await_title(r" svgf \+ TAA ")
    app.await_passes(plan("svgf"))
    assert roughness(app.settled()) < 1.5 * filtered
    app.press("Tab")
    app.await_title(" none ")


def test_f5_switches_anti_aliasing(app: App) -> None:
    app.press("F5")
    app.await_title(r"taa.enabled = false .* svgf · ")
    app.press("F5")
    app.await_title(r"taa.enabled = true .* svgf \+ TAA · ")


def test_space_starts_and_stops_what_moves(app: App) -> None:
    rest = app.settled()
    assert difference(rest, app.picture()) < STILL
    app.press("space")
    app.await_title("animation goes on")
    wait_for(lambda: difference(rest, app.picture()) > 2 * STILL, "block and lamp to move")
    app.press("space")
    app.await_title("animation stopped")
    stopped = app.settled()
    assert difference(stopped, app.settled()) < STILL


def test_h_forgets_the_history(app: App) -> None:
    before = app.settled()
    assert difference(before, app.picture()) < STILL / 2
    assert difference(before, app.picture("h")) > STILL, "noisier with fewer frames in it"


def test_w_flies_forward_and_r_goes_back(app: App) -> None:
    before = app.settled()
    app.hold("w", 0.7)
    nearer = app.settled()
    assert difference(before, nearer) > 3 * STILL
    # The box grows from the middle of the picture: what was black beside it is covered now.
    assert (nearer.max(axis=2) > 0.02).mean() > 1.1 * (before.max(axis=2) > 0.02).mean()
    app.press("r")
    app.await_title("camera reset")
    assert difference(before, app.settled()) < STILL


def test_taps_shorter_than_a_frame_move_a_little(app: App) -> None:
    before = app.settled()
    app.press("d", "d", "d")
    step = difference(before, app.settled())
    app.hold("d", 0.5)
    assert STILL < step < difference(before, app.settled()) / 1.5


def test_the_right_button_looks_and_escape_lets_go(app: App) -> None:
    before = app.settled()
    app.xdotool("mousemove", "--window", app.window, 160, 90)
    app.xdotool("mousemove_relative", 30, 0)
    assert difference(before, app.settled()) < STILL, "without the button the mouse turns nothing"
    app.xdotool("mousedown", 3, "sleep", 0.3, "mousemove_relative", "--", -40, 0, "sleep", 0.3)
    turned = app.settled()
    assert difference(before, turned) > 3 * STILL
    # Looking left, the box moves to the right.
    columns = np.arange(160)
    assert turned.sum(axis=(0, 2)) @ columns / turned.sum() > before.sum(axis=(0, 2)) @ columns / before.sum() + 5
    app.press("Escape")
    app.xdotool("mousemove_relative", 60, 10, "mouseup", 3)
    assert difference(turned, app.settled()) < STILL, "the mouse is free, the window is open"


def test_resizing_keeps_the_pictures_shape(app: App) -> None:
    picture = app.settled()
    app.xdotool("windowsize", app.window, 700, 270)

    def letterboxed() -> bool:
        shown = app.screen()[:270, :700]
        # The picture fills the height: 480 pixels wide, with borders of 110 on both sides.
        bars = np.concatenate([shown[:, :108], shown[:, 592:]], axis=1)
        thrice = np.kron(picture, np.ones((3, 3, 1), np.float32))
        return bool(bars.max() < 0.06 and bars.min() > 0.03 and difference(shown[:, 110:590], thrice) < STILL)

    wait_for(letterboxed, "the picture between two borders")
    for size in ((1280, 800), (1, 1), (40, 500)):
        app.xdotool("windowsize", app.window, *size)
        time.sleep(0.2)
    assert difference(picture, app.settled()) < STILL, "the picture itself does not depend on the window"


def test_a_hidden_window_rests_and_comes_back(app: App) -> None:
    before = app.settled()
    app.xdotool("windowunmap", "--sync", app.window)
    time.sleep(0.5)
    start = app.processor_seconds()
    time.sleep(1.0)
    assert app.processor_seconds() - start < 0.15, "neither traces nor spins"
    app.xdotool("windowmap", "--sync", app.window)
    assert difference(before, app.settled()) < STILL
    busy = app.processor_seconds()
    wait_for(lambda: app.processor_seconds() > busy + 0.1, "tracing to go on")


def test_the_flight_goes_on_until_someone_steers_and_escape_quits(display: str, tmp_path) -> None:
    with application(display, tmp_path, "--no-animate", "--camera", "flight") as app:
        first = app.picture()
        wait_for(lambda: difference(first, app.picture()) > 5 * STILL, "the flight")
        app.press("e")
        app.settled()
        app.press("Escape")
        assert app.process.wait(5.0) == 0
        assert "Traceback" not in app.stderr()
        assert "shot_000.png" in app.stdout()


TWICE = """
import sys, threading
from pathlib import Path
import config
from ui import window
for round in range(2):
    settings = config.load(None, ["render.width=64", "render.height=36"])
    window.run(settings, window.Wishes("cornell", "svgf", "still", False, Path(sys.argv[1]), hud=True, calibrate=True))
    print("left:", [thread.name for thread in threading.enumerate()], flush=True)
"""


def test_closing_releases_everything_and_the_window_opens_again(display: str, tmp_path) -> None:
    with running(display, tmp_path, "-c", TWICE, str(tmp_path / "out")) as app:
        app.await_picture()
        app.press("Escape")
        wait_for(lambda: "left: ['MainThread']" in app.stdout(), "the first window to close")
        app.await_picture()
        app.close_button()
        assert app.process.wait(SECONDS) == 0, app.stderr()
        assert app.stdout().count("left: ['MainThread']") == 2
        assert "Traceback" not in app.stderr()
        assert not re.search("glfw|Warning", app.stderr())


REFUSED = """
import ctypes, sys
from pathlib import Path
import config, glfw
from ui import window
def loop(viewer):
    no_capability = 0xFFFF
    ctypes.CFUNCTYPE(None, ctypes.c_uint)(glfw.get_proc_address("glEnable"))(no_capability)
window.Viewer.loop = loop
settings = config.load(None, ["render.width=64", "render.height=36"])
window.run(settings, window.Wishes("cornell", "none", "still", False, Path(sys.argv[1]), hud=False, calibrate=False))
"""


def test_what_opengl_refused_is_told_at_the_end(display: str, tmp_path) -> None:
    with running(display, tmp_path, "-c", REFUSED, str(tmp_path / "out")) as app:
        assert app.process.wait(START_SECONDS) == 0, app.stderr()
        assert app.stderr().startswith("OpenGL reports GL_INVALID_ENUM")


def fails(display: str, tmp_path, *flags: str) -> str:
    """Standard error of a start that cannot succeed."""
    with running(display, tmp_path, "app.py", "--size", "64x36", *flags) as app:
        assert app.process.wait(60.0) == 2
        assert "Traceback" not in app.stderr()
        return app.stderr()


def test_a_display_that_is_not_there_is_one_message(tmp_path) -> None:
    message = fails(":4094", tmp_path)
    assert message.startswith("error: no window: ")
    assert "DISPLAY" in message or "display" in message
    assert "app.py doctor" in message


def test_a_screen_without_opengl_is_one_message(tmp_path) -> None:
    require_tools()
    with screen("-extension", "GLX") as name:
        message = fails(name, tmp_path)
    assert message.startswith("error: no window with OpenGL 4.3: ")
    assert "app.py doctor" in message


def test_a_scene_that_is_not_there_closes_the_window_again(display: str, tmp_path) -> None:
    assert "cornel" in fails(display, tmp_path, "--scene", "cornel")
