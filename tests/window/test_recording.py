"""Recorded frames in the real window: they are played like a scene, except that nobody can fly."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.unit.recordings import foreign, opened, recorded
from tests.window.desktop import START_SECONDS, App, difference, plan, roughness, running, wait_for

pytestmark = pytest.mark.window

FRAMES = 6


@pytest.fixture(scope="module")
def app(display: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    folder = tmp_path_factory.mktemp("playback")
    with opened(size=(96, 54)) as shot:
        recorded(folder / "flight", shot, FRAMES)
    words = ("app.py", "replay", str(folder / "flight"), "--window", "--log", "--out", str(folder / "out"))
    with running(display, folder, *words) as app:
        app.await_picture()
        app.ask("g", "hud off")
        yield app
        app.press("Escape")
        assert app.process.wait(30) == 0
        assert app.stderr() == ""


def test_the_frames_go_round(app: App) -> None:
    assert "flight" in app.title
    assert "reading" in app.title
    app.await_passes(plan("svgf"))
    pictures = [app.picture() for _ in range(3)]
    assert pictures[0].shape == (54, 96, 3)
    wait_for(lambda: difference(pictures[0], app.picture()) > 0.01, "another frame")


def test_methods_and_stages_are_on_their_keys(app: App) -> None:
    app.press("0")
    app.await_passes(plan("none"))
    noisy = roughness(app.picture())
    app.press("1")
    app.await_passes(plan("svgf"))
    assert roughness(app.picture()) < 0.7 * noisy
    app.ask("F8", "svgf.separate = false")
    app.await_passes(plan("svgf", "svgf.separate=false"))
    app.ask("F8", "svgf.separate = true")


def test_nobody_flies(app: App) -> None:
    for key in ("w", "r"):
        app.ask(key, "recorded frames: the camera goes as it went$")
    app.click(4, "recorded frames: the camera goes as it went$")
    app.ask("F6", "recorded frames: the jitter is what it was$")
    app.ask("equal", "recorded frames: they have one size$")
    app.ask("F11", "these frames are recorded already$")


def test_a_frame_that_stands_still_does_not_change(app: App) -> None:
    """However often it is filtered: with the history that it had the first time, not with itself."""
    app.ask("space", "animation stopped")
    app.await_passes(plan("svgf"))
    app.ask("period", "one step")
    first = app.picture()
    for _ in range(3):
        again = app.picture("x", "x")
    np.testing.assert_allclose(first, again, atol=1.01 / 255)
    app.ask("0", "noisy frame")
    app.await_passes(plan("none"))
    assert roughness(app.picture()) > 1.2 * roughness(first)
    app.ask("space", "animation goes on")


def test_another_scene_can_be_opened(app: App) -> None:
    since = len(app.stdout())
    app.press("n")
    app.hear("opened cornell", since, START_SECONDS)
    app.ask("r", "camera reset")
    app.ask("1", "spatiotemporal")
    assert "tracing" in app.title


def test_a_broken_frame_ends_it_with_one_message(display: str, tmp_path: Path) -> None:
    foreign(tmp_path / "theirs")
    path = tmp_path / "theirs" / "color2.exr"
    path.write_bytes(path.read_bytes()[:-100])
    with running(display, tmp_path, "app.py", "replay", str(tmp_path / "theirs"), "--window") as app:
        assert app.process.wait(60) == 2
        assert app.stderr().startswith("error: ")
        assert "color2.exr: is only half written" in app.stderr()
