"""The key table and what its actions change."""

from __future__ import annotations

import glfw
import pytest

import config
from errors import UserError
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
    name, _, step = binding.value.partition(" ")
    match binding.action:
        case Action.SHOW:
            assert binding.value in DENOISERS
        case Action.NEXT:
            found = state().parameter(name)
            assert found is not None
            assert found[1].choices or isinstance(found[1].default, bool)
        case Action.STAGE | Action.COUNT:
            found = state().parameter(name)
            assert found is not None
            assert isinstance(found[1].default, (int, float))
            assert not isinstance(found[1].default, bool)
            assert (float(step or 0) != 0.0) == (binding.action is Action.COUNT)
        case Action.FLIP:
            assert isinstance(getattr(state(), binding.value), bool)
        case Action.VIEW | Action.RESOLUTION:
            assert int(binding.value) in (-1, 1)
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
    ("key", "name"), [("F1", "temporal"), ("F2", "variance_guided"), ("F4", "demodulate"), ("F8", "separate")]
)
def test_stages_of_the_method_shown(key, name):
    s = state()
    press(s, key)
    assert s.config == config.load(None, [f"svgf.{name}=false"])
    assert s.news == f"svgf.{name} = false"
    assert press(s, key).config == state().config
    other = press(state("none"), key)
    assert other.config == state().config, "the noisy frame has no stages"
    assert other.news.startswith("none: has no")


def test_stages_of_a_method_with_two_sections():
    s = press(state("atrous-jitter"), "F1", "F3")
    assert s.config == config.load(None, ["spatial.temporal=false", "atrous.iterations=0"])
    assert press(s, "F8").news.endswith("atrous-jitter: has no separate")


def test_the_wavelet_and_its_iterations():
    s = press(state(), "F3")
    assert s.config.svgf.iterations == 0
    assert press(s, "F3").config.svgf.iterations == 3
    assert press(s, "LEFT", "LEFT").config.svgf.iterations == 1
    assert press(s, "F3", "F3").config.svgf.iterations == 1, "as many as there were"
    assert press(s, *["RIGHT"] * 9).config.svgf.iterations == 8, "not beyond the range"
    assert press(s, *["LEFT"] * 9).config.svgf.iterations == 0
    assert press(s, "F3").config.svgf.iterations > 0


@pytest.mark.parametrize(("key", "name"), [("F1", "temporal"), ("F3", "fit"), ("F4", "demodulate")])
def test_stages_of_bmfr(key, name):
    s = press(state("bmfr"), key)
    assert s.config == config.load(None, [f"bmfr.{name}=false"])
    assert s.news == f"bmfr.{name} = false"
    assert press(s, key).config == state().config


def test_choices_go_round():
    s = state()
    seen = [press(s, "F9").config.display.tonemap for _ in range(4)]
    assert seen == ["none", "reinhard", "aces", "none"]
    seen = [press(s, "F7").config.firefly.mode for _ in range(3)]
    assert seen == ["clamp", "variance", "off"]


def test_a_preset_brings_its_values_along():
    s = press(state("svgf", "svgf.iterations=2"), "P")
    assert s.config.svgf.preset == "paper"
    assert (s.config.svgf.iterations, s.config.svgf.first_sigma_l) == (5, 1.0)
    press(s, "P")
    assert s.config.svgf.preset == "reference"
    assert press(s, "P").config.svgf == config.load().svgf


def test_exposure_goes_in_half_stops():
    s = press(state(), "UP", "UP", "UP", "DOWN")
    assert s.config.display.exposure == 1.0
    assert press(s, *["UP"] * 50).config.display.exposure == 20.0
    assert press(s, "L").config.display.auto_exposure


def test_textures_are_looked_at_in_turn():
    s = state()
    s.textures = ("a", "b")
    assert [press(s, "B").view for _ in range(4)] == ["a", "b", "", "a"]
    assert [press(s, "V").view for _ in range(3)] == ["", "b", "a"]
    s.textures = ("c",)  # another method is shown: what was looked at is gone
    assert press(s, "B").view == "c"


def test_flips_and_resolution():
    s = press(state(), "X", "G", "K", "EQUAL", "EQUAL", "MINUS")
    assert (s.split, s.hud, s.help, s.resolution) == (True, True, True, 1)
    press(s, "X", "G", "K")
    assert (s.split, s.hud, s.help) == (False, False, False)


def test_values_out_of_range_change_nothing():
    s = state()
    with pytest.raises(UserError, match=r"\[0;1\]"):
        s.set("svgf.alpha", 1.5)
    assert s.config == state().config


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


def test_a_camera_path_is_recorded_until_the_key_comes_again():
    s = press(state(), "C")
    assert (s.path, s.news) == (True, "recording the camera's path")
    assert not press(s, "C").path


def test_jitter_is_switched_from_what_it_is():
    s = press(state(), "F6")
    assert (s.jitter, s.config.render.jitter) == (False, "off")
    assert press(s, "F6").jitter
    assert press(state("none"), "F6").jitter


def test_a_single_step_stops_the_animation():
    s = press(state(), "PERIOD")
    assert s.step
    assert not s.animate
    assert press(state(), "N").next_scene


def test_what_was_done_in_one_frame_is_told_together():
    s = press(state(), "H", "R")
    assert s.news == "history reset · camera reset"
    assert press(s, "SPACE", "W", "SPACE").news == "camera reset · animation stopped · animation goes on"
    s.tell("64x36 pixels")
    assert s.news.endswith("goes on · 64x36 pixels")


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
