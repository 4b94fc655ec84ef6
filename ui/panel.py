"""The panel: numbers on the left, on the right everything that can be changed, made from the parameters' metadata."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from imgui_bundle import imgui

import assets
from config import SECTIONS, preset_values
from errors import UserError
from gl.pipelines import DENOISERS
from parameter import Param, Value, parameters
from presets import PRESETS
from ui import hud, theme, widgets
from ui.keys import BINDINGS, Action
from ui.state import PICTURE, State
from ui.status import Status
from ui.switches import uses
from ui.texture_controls import draw_controls

WIDTH: Final = 22.0
"""In em."""

_ROOM: Final = 60.0
"""Width of the screen, in em, that lets the middle of the picture be seen between the windows."""

_DECADES: Final = 1e3
"""Ratio of the ends of a range from which on its slider is logarithmic."""

_DIGITS: Final = 4

_ICONS: Final[dict[Action, Callable[[State], str]]] = {
    Action.ANIMATE: lambda state: "\uf04c" if state.animate else "\uf04b",
    Action.STEP: lambda _: "\uf051",
    Action.RESET_HISTORY: lambda _: "\uf12d",
    Action.RESET_CAMERA: lambda _: "\uf015",
    Action.SCREENSHOT: lambda _: "\uf030",
    Action.RECORD: lambda state: "\uf04d" if state.recording else "\uf111",
}


def draw(state: State, status: Status) -> None:
    """Everything of the panel. Changes nothing but ``state``."""
    hud.draw(state, status)
    # On a small screen it would hide the picture: there it is a title, until somebody opens it.
    small = imgui.get_io().display_size.x < widgets.em(_ROOM)
    imgui.set_next_window_collapsed(small, imgui.Cond_.once)
    with widgets.window(f"settings##{small}", (1.0, 0.0), WIDTH) as opened:
        if opened:
            _buttons(state)
            _places(state, status)
            for section in sections(state):
                _section(state, section)


def _buttons(state: State) -> None:
    for binding in BINDINGS:
        if binding.action in _ICONS:
            if imgui.button(f"{_ICONS[binding.action](state)}##{binding.key}"):
                state.perform(binding)
            widgets.tooltip(f"{binding.label}: {binding.help}")
            imgui.same_line()
    imgui.new_line()


def _places(state: State, status: Status) -> None:
    """Which method, which scene, and which of its textures."""
    method = _choose("method", state.denoiser, {name: DENOISERS[name] for name in DENOISERS if name != "reference"})
    if method is not None:
        state.show(method)
    scene = _choose("scene", status.scene, {name: info.description for name, info in assets.SCENES.items()})
    if scene is not None:
        state.scene = scene
    shown = "picture"
    view = _choose("view", state.view or shown, dict.fromkeys((shown, *state.textures), ""))
    if view is not None:
        state.view = PICTURE if view == shown else view
    draw_controls(state, status)


def _choose(name: str, now: str, names: dict[str, str]) -> str | None:
    """A list of ``names``, each with a line about it; returns the one just chosen."""
    chosen = None
    imgui.align_text_to_frame_padding()
    widgets.text(name, theme.DIM)
    imgui.same_line(widgets.em(4.0))
    imgui.set_next_item_width(-1.0)
    if imgui.begin_combo(f"##{name}", now, imgui.ComboFlags_.height_large):
        if imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        for other, about in names.items():
            if imgui.selectable(other, other == now)[0] and other != now:
                chosen = other
            if about:
                widgets.tooltip(about)
        imgui.end_combo()
    return chosen


def sections(state: State) -> list[str]:
    """The sections of the configuration: the method's own, others that it reads, the rest; tracing comes last."""

    def order(name: str) -> tuple[bool, int]:
        own = state.sections.index(name) if name in state.sections else len(state.sections) + (not uses(state, name))
        return name == "render", own

    return sorted(SECTIONS, key=order)


def _section(state: State, section: str) -> None:
    """The parameters of one section of the configuration; open at first if the method shown reads it."""
    specs = {key: spec for key, spec in parameters(SECTIONS[section]).items() if spec.live}
    if not specs:
        return
    back = originals(state, section)
    changed = [key for key in specs if state.value(f"{section}.{key}") != back[key]]
    # The method is part of the identity: each has sections of its own open or closed.
    flags = imgui.TreeNodeFlags_.default_open if uses(state, section) else 0
    imgui.set_next_item_allow_overlap()
    opened = imgui.collapsing_header(f"{section}###{section} of {state.denoiser}", flags)
    widgets.tooltip((SECTIONS[section].__doc__ or "").partition("\n")[0])
    if changed and _reset_button(f"{section}.*", f"all {len(changed)} changed ones back"):
        for key in changed:
            _set(state, f"{section}.{key}", back[key])
    if opened and imgui.begin_table(f"##{section}", 3):
        imgui.table_setup_column("name", imgui.TableColumnFlags_.width_stretch, 0.54)
        imgui.table_setup_column("value", imgui.TableColumnFlags_.width_stretch, 0.46)
        imgui.table_setup_column("reset", imgui.TableColumnFlags_.width_fixed, widgets.em(1.3))
        for key, spec in specs.items():
            if spec.heading:
                imgui.table_next_row()
                imgui.table_next_column()
                with widgets.font_size(theme.SMALL):
                    widgets.text(spec.heading, theme.ACCENT)
            _row(state, f"{section}.{key}", spec, back[key])
        imgui.end_table()


def originals(state: State, section: str) -> dict[str, Value]:
    """What a reset gives to each parameter: the value of the section's preset, or the default.

    The preset itself is what others are compared with, so it stays as it is.
    """
    defaults = {key: spec.default for key, spec in parameters(SECTIONS[section]).items()}
    if section not in PRESETS:
        return defaults
    preset = state.value(f"{section}.preset")
    return defaults | preset_values(section, preset) | {"preset": preset}


def _row(state: State, name: str, spec: Param, back: Value) -> None:
    """Name, widget, and a button to take the change back; the name is bright while there is one."""
    before = state.value(name)
    imgui.table_next_row()
    imgui.table_next_column()
    imgui.align_text_to_frame_padding()
    widgets.text(name.partition(".")[2].replace("_", " "), theme.TEXT if before != back else theme.DIM)
    _explain(name, spec)
    if spec.structural:
        imgui.same_line()
        with widgets.font_size(theme.TINY):
            widgets.text(theme.REBUILD, theme.FAINT)
    imgui.table_next_column()
    imgui.set_next_item_width(-1.0)
    value = _widget(f"##{name}", before, spec)
    _explain(name, spec)
    imgui.table_next_column()
    if before != back:
        if imgui.small_button(f"{theme.RESET}##{name}"):
            value = back
        widgets.tooltip(f"back to {back}")
    if value is not None:
        _set(state, name, value)


def _reset_button(name: str, about: str) -> bool:
    """A small button at the right end of the line; returns whether it was clicked."""
    imgui.same_line(imgui.get_window_width() - widgets.em(2.2))
    clicked = imgui.small_button(f"{theme.RESET}##{name}")
    widgets.tooltip(about)
    return clicked


def _widget(label: str, value: Value, spec: Param) -> Value | None:
    """What a parameter is changed with, by its type; returns the new value if it was."""
    if spec.choices:
        return _combo(label, str(value), spec.choices)
    if spec.words:
        return _words(label, str(value), spec.words)
    if isinstance(value, bool):
        changed, on = imgui.checkbox(label, value)
        return on if changed else None
    assert spec.lo is not None  # what is neither a switch nor a choice is a number, and has a range
    assert spec.hi is not None
    wide = spec.lo > 0 and spec.hi / spec.lo >= _DECADES
    # Also what is typed stays within the range.
    flags = imgui.SliderFlags_.always_clamp | (imgui.SliderFlags_.logarithmic if wide else 0)
    if isinstance(value, int):
        changed, whole = imgui.slider_int(label, value, int(spec.lo), int(spec.hi), "%d", flags)
        return whole if changed else None
    # A logarithmic slider takes what the digits shown could not tell from 0 for the end of its range.
    digits = max(_DIGITS, -math.floor(math.log10(spec.lo))) if wide else _DIGITS
    changed, number = imgui.slider_float(label, float(value), spec.lo, spec.hi, f"%.{digits}g", flags)
    # ImGui counts in single precision: the shortest decimal of it is what was meant.
    return float(f"{number:.7g}") if changed else None


def _combo(label: str, value: str, choices: tuple[str, ...]) -> str | None:
    chosen = None
    if imgui.begin_combo(label, value):
        if imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        for choice in choices:
            if imgui.selectable(choice, choice == value)[0] and choice != value:
                chosen = choice
        imgui.end_combo()
    return chosen


def _words(label: str, value: str, words: tuple[str, ...]) -> str | None:
    """A list that stays open, to choose several of ``words`` in their order."""
    names = value.split(",")
    chosen = None
    if imgui.begin_combo(label, value):
        if imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        for word in words:
            if imgui.selectable(word, word in names, imgui.SelectableFlags_.no_auto_close_popups)[0]:
                chosen = ",".join(other for other in words if (other in names) != (other == word))
        imgui.end_combo()
    return chosen


def _explain(name: str, spec: Param) -> None:
    note = "the passes change with it; histories stay" if spec.structural else ""
    range_ = f"\n{spec.range}" if spec.range != "true | false" else ""
    widgets.tooltip(name, f"{spec.text}{range_}", note)


def _set(state: State, name: str, value: Value) -> None:
    try:
        state.set(name, value)
    except UserError as error:  # parameters may exclude one another
        state.news = str(error).partition("\n")[0]
