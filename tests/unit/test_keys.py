"""The key table and what its actions change."""

from __future__ import annotations

import glfw
import pytest

import config
from config import SECTIONS, parameters
from gl.pipelines import DENOISERS
from ui import keys
from ui.camera_control import DIRECTIONS, FAST
from ui.keys import BINDINGS, BY_KEY, Action
from ui.state import State


def state(denoiser: str = "svgf", *overrides: str) -> State:
    return State(config.load(None, overrides), denoiser)


def press(target: State, *names: str) -> State:
    for name in names:
        target.perform(BY_KEY[name])
    return target


@pytest.mark.parametrize("binding", BINDINGS, ids=lambda binding: binding.key)
def test_every_line_of_the_table_means_something_that_exists(binding):
    assert hasattr(glfw, f"KEY_{binding.key}") or hasattr(glfw, f"KEY_LEFT_{binding.key}")
    assert binding.help
    match binding.action:
        case Action.SHOW:
            assert binding.value in DENOISERS
        case Action.TOGGLE:
            section, key = binding.value.split(".")
            assert isinstance(parameters(SECTIONS[section])[key].default, bool)
        case Action.FLY:
            assert binding.value in {*DIRECTIONS, FAST}
        case _:
            assert binding.value == ""


def test_no_key_has_two_meanings_and_no_action_is_without_a_key():
    assert len(BY_KEY) == len(BINDINGS)
    assert {binding.action for binding in BINDINGS} == set(Action)
    assert {b.value for b in BINDINGS if b.action is Action.FLY} == {*DIRECTIONS, FAST}


def test_tables_name_every_key_and_the_mouse():
    for text in (keys.markdown(), keys.text()):
        assert all(binding.label in text and binding.help in text for binding in BINDINGS)
        assert "right button" in text
        assert "wheel" in text
    assert keys.markdown().count("\n") == 1 + len(keys.rows())
    assert BY_KEY["ESCAPE"].label == "Esc"
    assert BY_KEY["TAB"].label == "Tab"


def test_methods_and_the_way_back():
    s = press(state(), "0")
    assert s.denoiser == "none"
    assert press(s, "TAB").denoiser == "svgf"
    assert press(s, "TAB").denoiser == "none"
    assert press(s, "0", "TAB").denoiser == "svgf", "the same key twice does not forget the method before"
    assert press(state("none"), "TAB").denoiser == "svgf"
    assert press(state("accumulate"), "1", "TAB").denoiser == "accumulate"


def test_a_toggle_changes_one_value_and_back():
    s = state()
    before = s.config
    press(s, "F5")
    assert not s.config.taa.enabled
    assert "taa.enabled = false" in s.news
    assert s.config.svgf is before.svgf
    assert press(s, "F5").config == before


@pytest.mark.parametrize(
    ("wish", "denoiser", "taa", "expected"),
    [
        ("auto", "svgf", True, True),
        ("auto", "svgf", False, False),
        ("auto", "none", True, False),
        ("auto", "accumulate", True, True),
        ("on", "none", False, True),
        ("off", "svgf", True, False),
    ],
)
def test_jitter_is_on_where_taa_averages_it(wish, denoiser, taa, expected):
    s = state(denoiser, f"render.jitter={wish}", f"taa.enabled={str(taa).lower()}")
    assert s.jitter is expected


def test_wishes():
    s = press(state(), "SPACE")
    assert not s.animate
    assert press(s, "SPACE").animate
    assert (s.home, s.reset, s.screenshot) == (False, "", False)
    press(s, "R", "H", "F12")
    assert s.home
    assert s.reset
    assert s.screenshot


def test_escape_lets_go_of_the_mouse_before_it_quits():
    s = state()
    s.looking = True
    press(s, "ESCAPE")
    assert (s.looking, s.closing) == (False, False)
    press(s, "ESCAPE")
    assert s.closing


def test_flying_keys_do_nothing_when_merely_pressed():
    s = state()
    assert press(s, "W", "SHIFT") == state()
