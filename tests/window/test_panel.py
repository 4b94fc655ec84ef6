"""The panel, by hand: what its widgets change in the state, and nothing else."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import assets
from config import SECTIONS, apply_preset
from errors import UserError
from gl.pipelines import DENOISERS
from parameter import parameters
from tests.window.hand import TALL, Hand, watching
from ui import panel, theme
from ui.glfw_window import Char, Cursor, Key, MouseButton
from ui.keys import BINDINGS, Action
from ui.state import State

LIVE = [
    (section, key, spec) for section, group in SECTIONS.items() for key, spec in parameters(group).items() if spec.live
]
FIXED = [
    f"{section}.{key}"
    for section, group in SECTIONS.items()
    for key, spec in parameters(group).items()
    if not spec.live
]
NUMBERS = [(section, key, spec) for section, key, spec in LIVE if spec.lo is not None]


@pytest.fixture
def hand(ctx, monkeypatch):
    made = Hand(ctx)
    with watching(made, monkeypatch):
        yield made
    made.release()


def open_all(hand: Hand) -> None:
    """Open every section that is closed."""
    for section in SECTIONS:
        shown = any(label.startswith(f"##{section}.") for label in hand.boxes)
        if not shown and (header := header_of(hand, section)) in hand.boxes:
            hand.click(header, 0.2)


def header_of(hand: Hand, section: str) -> str:
    return f"{section}###{section} of {hand.state.denoiser}"


def without(state: State, *names: str) -> dict[str, object]:
    """The state's fields but those named: what must not have changed."""
    fields = {field.name: getattr(state, field.name) for field in dataclasses.fields(state)}
    return {name: value for name, value in fields.items() if name not in (*names, "news")}


# ------------------------------------------------------------------------------------------------- every parameter


def test_every_live_parameter_has_a_widget_and_no_other_has(hand):
    hand.size = hand.pixels = (TALL[0], 6000)
    hand.draw(2)
    open_all(hand)
    for section, key, _ in LIVE:
        assert f"##{section}.{key}" in hand.boxes
    headings = {spec.heading for _, _, spec in LIVE if spec.heading}
    assert {"wavelet", "regression"} <= headings <= {text for text, _ in hand.words}
    assert FIXED
    assert not [name for name in FIXED if f"##{name}" in hand.boxes]


@pytest.mark.parametrize("section", sorted({section for section, _, _ in NUMBERS}))
def test_sliders_go_from_one_end_of_the_range_to_the_other(hand, section):
    hand.size = hand.pixels = (TALL[0], 6000)
    hand.draw(2)
    open_all(hand)
    before = without(hand.state, "config")
    for key, spec in ((key, spec) for home, key, spec in NUMBERS if home == section):
        name = f"{section}.{key}"
        hand.drag(f"##{name}", 0.5, -0.1)
        assert hand.state.value(name) == pytest.approx(spec.lo), name
        hand.drag(f"##{name}", 0.02, 1.1)
        assert hand.state.value(name) == pytest.approx(spec.hi), name
        assert type(hand.state.value(name)) is type(spec.default), name
    assert without(hand.state, "config") == before, "above all no history is reset"


# -------------------------------------------------------------------------------------------- one widget of each kind


def test_moving_a_slider_changes_one_number_and_nothing_else(hand):
    before, config = without(hand.state, "config"), hand.state.config
    hand.drag("##svgf.alpha", 0.2, 0.7)
    assert 0.6 < hand.state.config.svgf.alpha < 0.8
    assert hand.state.news.startswith("svgf.alpha = 0.")
    assert len(str(hand.state.config.svgf.alpha)) <= 7, "no digits of single precision that nobody chose"
    assert dataclasses.replace(hand.state.config.svgf, alpha=config.svgf.alpha) == config.svgf
    assert dataclasses.replace(hand.state.config, svgf=config.svgf) == config
    assert without(hand.state, "config") == before


def test_wide_ranges_are_logarithmic(hand):
    hand.drag("##svgf.sigma_l", 0.3, 0.5)  # [0.01;1000]
    assert hand.state.config.svgf.sigma_l == pytest.approx(10**0.5, rel=0.3)
    hand.drag("##svgf.depth_tolerance", 0.02, 0.5)  # [0;1] has no logarithm
    assert hand.state.config.svgf.depth_tolerance == pytest.approx(0.5, abs=0.05)
    hand.state.show("bmfr")
    hand.draw(3)
    hand.drag("##bmfr.rank_tolerance", 0.4, 0.2)  # [1e-06;0.1]
    assert hand.state.config.bmfr.rank_tolerance == pytest.approx(1e-5, rel=0.5)


def test_a_button_gives_back_what_the_preset_says(hand):
    reset = f"{theme.RESET}##svgf.first_sigma_l"
    assert reset not in hand.boxes
    hand.drag("##svgf.first_sigma_l", 0.5, 0.9)
    changed = hand.state.config.svgf.first_sigma_l
    hand.click(reset)
    assert hand.state.config.svgf.first_sigma_l == 4.0 != changed
    assert reset not in hand.boxes
    hand.state.config = apply_preset(hand.state.config, "svgf", "paper")
    hand.draw()
    assert reset not in hand.boxes, "nothing differs from the preset"
    hand.drag("##svgf.first_sigma_l", 0.3, 0.9)
    hand.click(reset)
    assert hand.state.config.svgf.first_sigma_l == 1.0
    assert hand.state.config.svgf.preset == "paper"


def test_a_button_gives_a_whole_section_back(hand):
    everything = f"{theme.RESET}##svgf.*"
    assert everything not in hand.boxes
    before = hand.state.config
    hand.drag("##svgf.alpha", 0.2, 0.7)
    hand.click("##svgf.separate")
    hand.drag("##taa.alpha", 0.1, 0.7)
    taa = hand.state.config.taa
    hand.click(everything)
    assert hand.state.config == dataclasses.replace(before, taa=taa)
    assert everything not in hand.boxes


def test_giving_a_section_back_leaves_its_preset(hand):
    paper = hand.state.config = apply_preset(hand.state.config, "svgf", "paper")
    hand.draw()
    assert f"{theme.RESET}##svgf.preset" not in hand.boxes
    hand.drag("##svgf.alpha", 0.2, 0.7)
    hand.click(f"{theme.RESET}##svgf.*")
    assert hand.state.config == paper


def test_a_number_can_be_typed(hand):
    hand.edit("##svgf.alpha")
    assert hand.layer.wants_keyboard
    hand.press("BACKSPACE")
    hand.type("0.123456")
    hand.press("ENTER")
    assert hand.state.config.svgf.alpha == 0.123456
    assert not hand.layer.wants_keyboard


@pytest.mark.parametrize(("typed", "value"), [("7", 1.0), ("-3", 0.0), ("1e99", 1.0), ("wasd", 0.07)])
def test_what_is_typed_stays_in_the_range_and_letters_are_none(hand, typed, value):
    hand.edit("##svgf.alpha")
    if typed != "wasd":
        hand.press("BACKSPACE")
    hand.type(typed)
    hand.press("ENTER")
    assert hand.state.config.svgf.alpha == value


def test_while_a_number_is_typed_every_key_is_meant_for_it(hand):
    assert hand.press("W", "F5", "G", "ESCAPE", "TAB") == [False] * 5
    hand.edit("##svgf.alpha")
    assert hand.press("W", "F5", "G") == [True] * 3
    assert hand.press("ESCAPE") == [True], "Escape ends typing and nothing else"
    assert hand.press("ESCAPE", "W") == [False] * 2
    assert hand.state.config.svgf.alpha == 0.07
    assert not hand.state.closing


def test_tab_and_arrows_stay_keys_of_the_program_after_a_click(hand):
    hand.click("##svgf.separate")
    assert hand.press("TAB", "DOWN", "RIGHT", "SPACE", "ENTER") == [False] * 5
    assert not hand.layer.wants_keyboard


def test_a_checkbox_flips_its_switch(hand):
    hand.click("##taa.enabled")
    assert hand.state.config.taa.enabled is False
    hand.click("##taa.enabled")
    assert hand.state.config.taa.enabled is True


def test_a_list_chooses_and_takes_the_preset_s_values_along(hand):
    hand.click("##svgf.preset")
    assert hand.layer.wants_keyboard, "an open list waits for Escape"
    hand.click("paper")
    assert hand.state.config == apply_preset(State(hand.state.config, "svgf").config, "svgf", "paper")
    assert hand.state.config.svgf.first_sigma_l == 1.0
    hand.click("##display.tonemap")
    hand.click("reinhard")
    assert hand.state.config.display.tonemap == "reinhard"


def test_of_a_list_of_words_several_are_chosen(hand):
    hand.state.show("bmfr")
    hand.draw(3)
    hand.click("##bmfr.features")
    hand.click("w3")
    assert hand.state.config.bmfr.features == "1,n,w,w2,w3"
    hand.click("n")
    assert hand.state.config.bmfr.features == "1,w,w2,w3", "the list stays open"
    hand.click("1")
    assert hand.state.config.bmfr.features == "1,w,w2,w3", "without the constant there is no fit"
    assert "constant" in hand.state.news


def test_escape_closes_a_list_and_nothing_else(hand):
    hand.click("##svgf.preset")
    assert "paper" in hand.boxes
    assert hand.press("ESCAPE") == [True]
    hand.draw(2)
    assert "paper" not in hand.boxes
    assert hand.press("ESCAPE") == [False]
    assert hand.state.config.svgf.preset == "best"


def test_what_the_configuration_refuses_is_said_and_changes_nothing(hand, monkeypatch):
    def refuse(self, name, value):
        raise UserError("svgf.separate: not now", "because")

    monkeypatch.setattr(State, "set", refuse)
    before = hand.state.config
    hand.click("##svgf.separate")
    assert hand.state.config is before
    assert hand.state.news == "svgf.separate: not now"


# ---------------------------------------------------------------------------------------------------------- sections


@pytest.mark.parametrize("denoiser", DENOISERS)
def test_the_sections_that_the_method_reads_are_open_at_first(hand, denoiser):
    hand.state.show(denoiser)
    hand.draw(3)
    shown = {label[2:].partition(".")[0] for label in hand.boxes if label.startswith("##") and "." in label}
    assert "display" in shown
    own = {"svgf": "svgf", "accumulate": "svgf"}.get(denoiser, denoiser)
    for section in ("svgf", "bmfr"):
        if section in SECTIONS:
            assert (section in shown) == (section == own)
    assert ("taa" in shown) == (denoiser not in ("none", "reference"))
    if own in SECTIONS:
        assert panel.sections(hand.state)[0] == own
    assert panel.sections(hand.state)[-1] == "render"


def test_a_section_opens_and_closes_and_each_method_has_its_own(hand):
    assert "##svgf.alpha" in hand.boxes
    hand.click(header_of(hand, "svgf"), 0.2)
    assert "##svgf.alpha" not in hand.boxes
    hand.state.show("accumulate")
    hand.draw(3)
    assert "##svgf.alpha" in hand.boxes
    hand.state.show("svgf")
    hand.draw(3)
    assert "##svgf.alpha" not in hand.boxes
    hand.click(header_of(hand, "svgf"), 0.2)
    assert "##svgf.alpha" in hand.boxes


# ------------------------------------------------------------------------------------------------ scene, view, buttons


def test_scenes_are_chosen_from_a_list(hand):
    hand.click("##scene")
    assert set(assets.SCENES) <= set(hand.boxes)
    hand.click("interior")
    assert hand.state.scene == "interior"
    hand.state.scene = ""
    hand.click("##scene")
    hand.click("cornell")
    assert hand.state.scene == "", "the one shown is not opened again"


def test_methods_are_chosen_from_a_list(hand):
    """Also those that have no key."""
    hand.click("##method")
    assert set(DENOISERS) - {"reference"} <= set(hand.boxes)
    hand.click("joint-separable")
    assert (hand.state.denoiser, hand.state.before) == ("joint-separable", "svgf")
    hand.draw(2)
    assert {"##joint.sigma_d", "##spatial.order"} <= set(hand.boxes)
    assert "##gaussian.sigma_d" not in hand.boxes


def test_textures_are_chosen_from_a_list(hand):
    hand.state.textures = ("frame.direct", "svgf.reproject.out_guide")
    hand.draw()
    hand.click("##view")
    hand.click("svgf.reproject.out_guide")
    assert hand.state.view == "svgf.reproject.out_guide"
    hand.click("##view")
    hand.click("picture")
    assert hand.state.view == ""


@pytest.mark.parametrize(
    ("action", "field", "value"),
    [
        (Action.ANIMATE, "animate", False),
        (Action.STEP, "step", True),
        (Action.RESET_HISTORY, "reset", "by key"),
        (Action.RESET_CAMERA, "home", True),
        (Action.SCREENSHOT, "screenshot", True),
        (Action.RECORD, "recording", True),
    ],
)
def test_buttons_do_what_their_keys_do(hand, action, field, value):
    (key,) = [binding.key for binding in BINDINGS if binding.action is action]
    (label,) = [label for label in hand.boxes if label.endswith(f"##{key}")]
    assert getattr(hand.state, field) != value
    hand.click(label)
    assert getattr(hand.state, field) == value


# ----------------------------------------------------------------------------------------------- place on the screen


def test_the_middle_of_the_picture_stays_free(ctx, monkeypatch):
    made = Hand(ctx, (1280, 720))
    with watching(made, monkeypatch):
        made.status.errors = ["some.frag:1: error\n" * 40]
        made.draw(3)
        picture = made.picture()
    made.release()
    assert not picture[:470, 340:930].any(), "nothing is drawn here"
    for corner in (picture[20:300, 20:300], picture[20:300, 980:1260], picture[600:700, 400:880]):
        assert corner.max() > 0.5


def test_on_a_small_screen_the_settings_are_a_title_until_they_are_opened(hand):
    for size, opened in (((880, 900), False), ((920, 900), True), ((880, 900), False)):
        hand.size = hand.pixels = size
        hand.draw(3)
        assert ("##svgf.alpha" in hand.boxes) == opened
    hand.feed(Cursor(880 - 10 - 22 * 15 + 12, 20.0), MouseButton(0, True))  # the arrow in the title
    hand.feed(MouseButton(0, False))
    hand.draw(2)
    assert "##svgf.alpha" in hand.boxes


def test_sizes_follow_the_screen(ctx, monkeypatch):
    boxes, heights = [], []
    for size, scale, density in ((TALL, 1.0, 1.0), ((2400, 3000), 2.0, 1.0), (TALL, 2.0, 2.0)):
        made = Hand(ctx, size, scale, density)
        with watching(made, monkeypatch):
            boxes.append(np.array(made.boxes["##svgf.alpha"]))
            heights.append(np.flatnonzero(made.picture().max(axis=(1, 2)) > 0.3).max())
        made.release()
    np.testing.assert_allclose(boxes[1], 2.0 * boxes[0], atol=45.0)
    np.testing.assert_allclose(boxes[1][2] - boxes[1][0], 2.0 * (boxes[0][2] - boxes[0][0]), rtol=0.03)
    np.testing.assert_array_equal(boxes[2], boxes[0])
    assert heights[1] == pytest.approx(2 * heights[0], rel=0.05)
    assert heights[2] == pytest.approx(2 * heights[0], rel=0.03)


def test_a_click_in_the_picture_is_not_for_the_panel(hand):
    middle = Cursor(TALL[0] / 2, TALL[1] - 50.0)
    slider = Cursor(*hand.boxes["##svgf.alpha"].at(0.9))
    assert hand.feed(middle, MouseButton(1, True)) == [False, False]
    assert hand.feed(slider) == [False], "the button went down over the picture"
    assert hand.feed(MouseButton(1, False)) == [False]
    assert hand.feed(middle, slider, MouseButton(0, True)) == [False, True, True], "all between two frames"
    assert hand.feed(middle) == [True], "the slider is held"
    assert hand.feed(MouseButton(0, False)) == [True]
    assert hand.feed(middle, Char(ord("x")), Key("X", True), Key("X", False)) == [False, True, False, False]
