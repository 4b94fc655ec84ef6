"""Mouse and keyboard in the real window where a panel is over the picture: who gets what."""

from __future__ import annotations

import re
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest

from tests.window.desktop import STILL, App, application, difference, plan, wait_for
from tests.window.hand import Box, Hand, watching

pytestmark = pytest.mark.window

WINDOW = 1200, 760  # large enough for the settings to be open at first
SLIDER = "##svgf.alpha"


@pytest.fixture(scope="module")
def shared(display: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    with application(display, tmp_path_factory.mktemp("panel"), "--no-animate", size="64x36") as app:
        app.xdotool("windowsize", app.window, *WINDOW)
        app.await_passes(plan("svgf"))
        app.settled()
        app.ask("g", "hud on")
        yield app


@pytest.fixture
def app(shared: App) -> Iterator[App]:
    yield shared
    assert shared.process.poll() is None, shared.stderr()
    assert shared.stderr() == ""


@pytest.fixture
def slider(ctx: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> Box:
    """Where the slider is, by the panel drawn at the same size without a window."""
    hand = Hand(ctx, WINDOW)
    with watching(hand, monkeypatch):
        box = hand.boxes[SLIDER]
    hand.release()
    assert box.bottom < WINDOW[1]
    return box


def move_to(app: App, place: tuple[float, float]) -> None:
    app.xdotool("mousemove", "--window", app.window, *map(round, place), "sleep", 0.2)


def edit(app: App, slider: Box) -> None:
    """Ctrl-click a slider: its number can be typed then."""
    move_to(app, slider.at(0.5))
    before = look_of(app, slider)
    app.xdotool("windowfocus", app.window, "keydown", "ctrl", "click", 1, "sleep", 0.3, "keyup", "ctrl")
    wait_for(lambda: difference(before, look_of(app, slider)) > 0.01, "the number to be marked")


def look_of(app: App, box: Box) -> np.ndarray:
    left, top, right, bottom = map(round, box)
    return app.screen()[top:bottom, left:right]


@pytest.mark.parametrize(("start", "end"), [(0.2, 0.8), (0.8, 0.1)])
def test_a_slider_is_dragged(app: App, slider: Box, start: float, end: float) -> None:
    since = len(app.stdout())
    move_to(app, slider.at(start))
    app.xdotool("mousedown", 1, "sleep", 0.3)
    move_to(app, slider.at(end))
    app.xdotool("mouseup", 1, "sleep", 0.3)  # a key that comes with it, in the same frame, is the slider's
    values = [float(value) for value in re.findall(r"svgf\.alpha = ([\d.]+)$", app.stdout()[since:], re.MULTILINE)]
    assert values[-1] == pytest.approx(end, abs=0.1)


def test_what_is_typed_into_a_slider_does_nothing_else(app: App, slider: Box) -> None:
    def look() -> np.ndarray:
        """The mean of some pictures: with a share of 0.1 of every new frame a single one keeps some of the noise."""
        app.settled()
        mean: np.ndarray = np.mean([app.picture() for _ in range(8)], axis=0)
        return mean

    before = look()
    edit(app, slider)
    since = len(app.stdout())
    app.press("0", "period", "1", "1", *["w"] * 8, "Return")
    app.hear(r"svgf\.alpha = 0\.11$", since)
    heard = [line.partition(": ")[2] for line in app.stdout()[since:].splitlines()]
    assert heard == ["svgf.alpha = 0.11"], "no key meant what it means elsewhere"
    assert difference(before, look()) < STILL, "nor did the camera move"


def test_escape_leaves_the_number_and_not_the_program(app: App, slider: Box) -> None:
    edit(app, slider)
    since = len(app.stdout())
    app.press("0", "period", "9", "Escape")
    app.xdotool("sleep", 0.5)
    app.ask("0", "one path per pixel")
    app.await_passes(plan("none", "display.mark_bad=on"))
    app.ask("1", "spatiotemporal")
    assert "svgf.alpha" not in app.stdout()[since:]


def test_the_wheel_scrolls_what_it_is_over(app: App, slider: Box) -> None:
    move_to(app, (WINDOW[0] / 2, WINDOW[1] / 2))
    speed = float(app.click(4, r"flight speed ([\d.]+)")[1])
    assert float(app.click(5, r"flight speed ([\d.]+)")[1]) == pytest.approx(speed / 1.25, rel=0.01)
    move_to(app, slider.at(0.5))
    before, since = look_of(app, slider), len(app.stdout())
    app.xdotool("click", "--repeat", 3, 5)
    wait_for(lambda: difference(before, look_of(app, slider)) > 0.01, "the panel to scroll")
    app.xdotool("click", "--repeat", 9, 4)
    wait_for(lambda: difference(before, look_of(app, slider)) < 0.01, "the panel to scroll back")
    assert "flight speed" not in app.stdout()[since:]


def test_the_right_button_over_the_panel_does_not_take_the_mouse(app: App, slider: Box) -> None:
    before = app.settled()
    move_to(app, slider.at(0.5))
    app.xdotool("mousedown", 3, "sleep", 0.3, "mousemove_relative", "--", -90, 0, "sleep", 0.3)
    app.xdotool("mouseup", 3)
    assert difference(before, app.settled()) < STILL
    assert abs(app.mouse()[0] - round(slider.at(0.5)[0] - 90)) <= 1, "the mouse went where it was moved to"
