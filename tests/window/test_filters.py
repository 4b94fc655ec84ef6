"""Which graph a frame of the window runs through while shaders are compiled. Needs no display."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace

import moderngl
import pytest

import config
from gl import background
from gl.executor import SHADER_ROOT, Result
from gl.pipelines import DENOISERS, FrameTraits, build
from gl.renderer import Renderer
from tests.passes.room import room
from ui import filters
from ui.filters import Filters
from ui.state import State

SIZE = (40, 24)


@pytest.fixture(autouse=True)
def _one_shader_per_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """However fast this machine compiles, or finds what it has compiled before."""
    monkeypatch.setattr(background, "TAKE_OVER", 0.0)


@pytest.fixture
def made(ctx: moderngl.Context) -> Iterator[Filters]:
    made = Filters(ctx, None, lambda: None)
    yield made
    made.release()


def state_of(denoiser: str = "svgf", *overrides: str) -> State:
    return State(config.load(None, overrides), denoiser)


def methods(result: Result) -> set[str]:
    """The denoisers whose passes ran."""
    return {node.name.partition(".")[0] for node in result.plan.passes} & set(DENOISERS)


def until_shown(made: Filters, state: State, method: str, first: int = 0, size: tuple[int, int] = SIZE) -> list[Result]:
    """Every picture up to the first one of ``method``."""
    results: list[Result] = []
    for index in range(first, first + 200):
        result = made.run(room(index, size), state)
        if result is not None:
            results.append(result)
            if methods(result) == {method}:
                return results
    pytest.fail(f"{method} is never shown")


def test_the_noisy_frame_is_shown_until_the_method_is_compiled(made):
    state = state_of()
    results = until_shown(made, state, "svgf")
    assert methods(results[0]) == set()
    assert len(results) > 2, "compiled one shader at a time"
    assert made.progress == ""
    assert "svgf.reproject.out_reprojection" in state.textures


def test_the_old_method_goes_on_until_the_new_one_is_there_and_back_is_at_once(made):
    state = state_of()
    until_shown(made, state, "svgf")
    state.show("bmfr")
    results = until_shown(made, state, "bmfr", 300)
    assert len(results) > 1
    assert methods(results[0]) == {"svgf"}
    state.show("svgf")
    assert methods(results_of(made, state, 600)) == {"svgf"}


def results_of(made: Filters, state: State, index: int, size: tuple[int, int] = SIZE) -> Result:
    result = made.run(room(index, size), state)
    assert result is not None
    return result


def test_what_is_waited_for_is_told(made):
    state = state_of()
    made.run(room(0, SIZE), state)
    assert made.progress.startswith("compiling ")


def test_a_picture_stays_where_no_graph_is_ready_for_a_new_size(made):
    state = state_of()
    until_shown(made, state, "svgf")
    waits = 0
    for index in range(300, 500):
        result = made.run(room(index, (64, 32)), state)  # sides that are powers of two
        if result is None:
            waits += 1
            continue
        assert methods(result) == {"svgf"}
        assert result.outputs["display"].size == (64, 32)
        break
    assert waits > 0


def test_methods_on_keys_are_compiled_ahead(made):
    state = state_of()
    until_shown(made, state, "svgf")
    for index in range(300, 700):
        results_of(made, state, index)
    state.show("bmfr")
    assert methods(results_of(made, state, 800)) == {"bmfr"}


def test_a_texture_that_the_method_does_not_have_is_no_longer_looked_at(made):
    state = state_of()
    until_shown(made, state, "svgf")
    state.view = "svgf.direct.variance.out_color"
    result = until_shown(made, state, "svgf", 300)[-1]
    assert "svgf.direct.variance.out_color" in result.plan.final_textures()
    state.show("none")
    results_of(made, state, 600)
    assert state.view == ""
    assert "svgf.direct.variance.out_color" in state.news


def test_the_panel_costs_nothing_while_it_is_hidden(made):
    state = state_of()
    hidden = until_shown(made, state, "svgf")[-1]
    assert made.profile is None
    assert hidden.plan.text() == plan_text(state)


def test_the_panel_brings_times_and_counters(made):
    state = state_of("accumulate")
    state.hud = True
    shown = until_shown(made, state, "accumulate")[-1]
    assert made.profile is not None
    assert {row.name for row in made.profile.rows()} >= {"upload", "mark_bad"}
    assert "bad" in shown.outputs


def plan_text(state: State) -> str:
    return build(state.config, state.denoiser, FrameTraits.of(room(0, SIZE))).compile().text()


def test_split_adds_the_noisy_picture_but_not_to_itself(made):
    state = state_of("none")
    state.split = True
    assert "noisy" not in results_of(made, state, 0).outputs
    state.show("svgf")
    assert "noisy" in until_shown(made, state, "svgf", 1)[-1].outputs


def test_a_broken_shader_leaves_the_old_picture_and_a_message(ctx, tmp_path, monkeypatch):
    root = tmp_path / "shaders"
    shutil.copytree(SHADER_ROOT, root)
    (root / "svgf" / "atrous.frag").write_text("void main() { nonsense }\n")

    def renderer(context: moderngl.Context) -> Renderer:
        made = Renderer(context)
        made.executor.release()
        made.executor = type(made.executor)(context, root)
        return made

    monkeypatch.setattr(filters, "Renderer", renderer)
    made = Filters(ctx, None, lambda: None)
    try:
        state = state_of("accumulate")
        until_shown(made, state, "accumulate")
        state.show("svgf")
        for index in range(300, 360):
            result = results_of(made, state, index)
            assert methods(result) == {"accumulate"}
            if any("atrous.frag" in error for error in made.errors):
                break
        assert any("svgf/atrous.frag" in error for error in made.errors)
        state.config = replace(state.config, svgf=replace(state.config.svgf, iterations=0))
        assert methods(until_shown(made, state, "svgf", 400)[-1]) == {"svgf"}, "what needs no such shader works"
    finally:
        made.release()
