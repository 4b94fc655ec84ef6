"""`app.py explain`, and `app.py graph` for a scene: neither needs a GPU or compiles anything."""

from __future__ import annotations

from pathlib import Path

import pytest

import headless
import session
from gl.pipelines import DENOISERS
from raytrace.integrator import Tracer
from tests.cli.runner import App


@pytest.fixture(autouse=True)
def _nothing_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("a context was made, or a frame was traced")

    monkeypatch.setattr(headless, "create_headless", refuse)
    monkeypatch.setattr(Tracer, "for_each_tile", refuse)


@pytest.mark.parametrize("denoiser", DENOISERS)
def test_explain_prints_the_report(app: App, denoiser: str) -> None:
    outcome = app("explain", "--denoiser", denoiser, "--size", "40x30")
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out.startswith("scene cornell\n")
    assert f"\npasses of {denoiser}: " in outcome.out
    assert "per frame of 40x30\n" in outcome.out


def test_explain_follows_flags_and_parameters(app: App) -> None:
    still, moving = app("explain").out, app("explain", "--animate", "--jitter").out
    assert "none moves (--animate lets move what can)" in still
    assert "not made: the scene has no moving objects" in still
    assert " move\n" in moving
    assert "not made: the scene has no moving objects" not in moving
    assert "on: --jitter" in moving
    assert "svgf.both.accumulate  svgf.separate = false" in app("explain", "--set", "svgf.separate=false").out


def test_explain_tells_what_the_loader_has_to_say(app: App, tmp_path: Path) -> None:
    path = tmp_path / "wall.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    outcome = app("explain", "--scene", path, "--animate")
    assert outcome.code == 0
    assert "no light in the file: a constant white sky is added" in outcome.err
    assert "nothing in this scene moves" in outcome.err
    assert "kernel  first_hit                                        with a sky; without" in outcome.out


def test_explain_tells_of_an_environment(app: App, tmp_path: Path) -> None:
    (tmp_path / "grey.hdr").write_bytes(b"#?RADIANCE\n\n-Y 4 +X 8\n" + bytes((128, 128, 128, 129)) * 32)
    outcome = app("explain", "--environment", tmp_path / "grey.hdr")
    assert "environment  grey.hdr, 8x4 texels, " in outcome.out
    assert "with an environment, lamps; without" in outcome.out
    assert "did you mean 'grey.hdr'?" in app("explain", "--environment", tmp_path / "gray.hdr").error()
    for flag, value in (("--environment-strength", "-1"), ("--environment-rotation", "north")):
        assert f"{flag} {value}: must be a number in [" in app("explain", flag, value).error()


@pytest.mark.parametrize("command", ["explain", "graph"])
def test_an_unknown_scene_is_one_message(app: App, command: str) -> None:
    assert "did you mean 'cornell'?" in app(command, "--scene", "cornel").error()


def test_the_graph_of_a_scene(app: App) -> None:
    assert app("graph", "--scene", "cornell").out == app("graph").out
    assert session.find_scene("cornell", animate=True).has_motion
    assert app("graph", "--scene", "cornell", "--animate").out == app("graph", "--animate").out != app("graph").out


def test_in_a_file_nothing_moves(app: App, tmp_path: Path) -> None:
    path = tmp_path / "wall.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert app("graph", "--scene", path, "--animate").out == app("graph").out
