"""graph, scenes, doctor, and what starts when no command is named."""

from __future__ import annotations

from pathlib import Path

import pytest

import assets
import config
import doctor
import headless
from bench import command as bench
from bench.recording import live
from gl.pipelines import DENOISERS, FrameTraits, build
from tests.cli.runner import App
from ui import window


@pytest.fixture
def no_opengl(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> None:
        raise AssertionError("a context was made")

    monkeypatch.setattr(headless, "create_headless", refuse)


@pytest.mark.usefixtures("no_opengl")
@pytest.mark.parametrize("denoiser", DENOISERS)
@pytest.mark.parametrize("moving", [False, True])
def test_graph_prints_the_plan(app: App, denoiser: str, moving: bool) -> None:
    flags = ("--denoiser", denoiser, *(("--animate",) if moving else ()))
    plan = build(config.load(Path("config.toml")), denoiser, FrameTraits(moving=moving)).compile()
    assert app("graph", *flags).out == plan.text() + "\n"
    assert app("graph", *flags, "--dot").out == plan.dot() + "\n"
    assert plan.dot().startswith("digraph")


@pytest.mark.usefixtures("no_opengl")
def test_graph_follows_the_parameters(app: App) -> None:
    assert "svgf.direct.atrous2" in app("graph").out
    assert "svgf.direct.atrous2" not in app("graph", "--set", "svgf.iterations=2").out
    assert "frame.prev_normal" in app("graph", "--animate").out
    assert "frame.prev_normal" not in app("graph").out


def test_scenes_lists_what_there_is(app: App) -> None:
    lines = app("scenes").out.splitlines()
    assert [line.split()[0] for line in lines] == list(assets.SCENES)
    assert all(info.description in line for info, line in zip(assets.SCENES.values(), lines, strict=True))


@pytest.mark.parametrize(("healthy", "code"), [(True, 0), (False, 2)])
def test_the_doctor_s_verdict_is_the_exit_code(
    app: App, monkeypatch: pytest.MonkeyPatch, healthy: bool, code: int
) -> None:
    monkeypatch.setattr(doctor, "report", lambda: ("all that was found", healthy))
    outcome = app("doctor")
    assert (outcome.code, outcome.out, outcome.err) == (code, "all that was found\n", "")


def test_bench_gets_its_arguments(app: App, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls: list[tuple[object, ...]] = []
    monkeypatch.setattr(bench, "run", lambda settings, *rest: calls.append((settings.render.width, *rest)))
    app("bench")
    app("bench", "--scene", "a.glb", "--scene", "cornell", "--quick", "--html", "--out", tmp_path, "--size", "8x4")
    assert calls == [
        (640, ("cornell", "interior"), False, Path("out/bench.json"), False),
        (8, ("a.glb", "cornell"), True, tmp_path, True),
    ]


@pytest.mark.parametrize("variable", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_with_a_display_there_is_a_window(app: App, monkeypatch: pytest.MonkeyPatch, variable: str) -> None:
    calls: list[tuple[object, ...]] = []
    monkeypatch.setattr(window, "run", lambda settings, *rest: calls.append((settings.render.seed, *rest)))
    monkeypatch.setenv(variable, ":7")
    app()
    flags = ("--scene", "interior", "--denoiser", "none", "--camera", "flight", "--out", "shots", "--seed", 3)
    app(*flags, "--no-animate", "--no-hud", "--log", "--size", "64x36")
    default = window.Wishes(
        scene="cornell",
        denoiser="svgf",
        camera="still",
        animate=True,
        out=Path("out"),
        hud=True,
        calibrate=True,
        log=False,
        recorder=live.new_recorder,
    )
    asked = window.Wishes(
        scene="interior",
        denoiser="none",
        camera="flight",
        animate=False,
        out=Path("shots"),
        hud=False,
        calibrate=False,
        log=True,
        recorder=live.new_recorder,
    )
    assert calls == [(0, default), (3, asked)]


def test_an_empty_variable_is_no_display(app: App, monkeypatch: pytest.MonkeyPatch) -> None:
    import demo

    calls: list[tuple[object, ...]] = []
    monkeypatch.setattr(demo, "run", lambda settings, *rest: calls.append(rest))
    monkeypatch.setenv("DISPLAY", "")
    assert "no display" in app("--scene", "interior").out
    assert calls == [("interior", None, Path("out"))]
