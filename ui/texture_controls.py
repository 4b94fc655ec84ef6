"""The part of the panel that says what a texture of the graph is, and chooses how it is looked at."""

from __future__ import annotations

import math
from typing import Final

from imgui_bundle import ImVec2, ImVec4, imgui

from gl.passes.temporal import REJECTIONS
from gl.plan import Plan, texture_bytes, texture_size
from ui import keys, theme, widgets
from ui.state import PICTURE, State, TextureLook
from ui.status import Status
from ui.textures import (
    AUTOMATIC,
    FULL_MOTION,
    INFINITE_COLOR,
    NAN_COLOR,
    NEGATIVE_INFINITE_COLOR,
    RAMP,
    RAMP_END,
    REJECTION_COLORS,
    Color,
    Subject,
    View,
    find_subject,
)

_LABELS: Final = 5.5  # em that the names of the widgets take
_MOST_EXPOSURE: Final = 10.0  # EV
_MOST_ZOOM: Final = 24


def draw_controls(state: State, status: Status) -> None:
    """The widgets for ``state.view`` and ``state.look``, in the current window; for the picture only a magnifier."""
    plan = status.result.plan if status.result is not None else None
    subject = find_subject(plan, state.view) if plan is not None else None
    if plan is None or subject is None or state.view == PICTURE:
        _magnifier(state.look)
        return
    view = subject.view(state.look.channels)
    _neighbours(state)
    _describe(subject, plan, status.size)
    _channels(state.look, subject, view)
    if view.mode in ("RANGE", "MOTION"):
        _exposure(state.look)
    if view.mode == "RANGE":
        _range(state.look)
    _magnifier(state.look)
    with widgets.font_size(theme.SMALL):
        _legend(view)


def _neighbours(state: State) -> None:
    """Buttons to the texture before and the one after."""
    for key, arrow in (("V", imgui.Dir.left), ("B", imgui.Dir.right)):
        if imgui.arrow_button(f"##{key}", arrow):
            state.perform(keys.BY_KEY[key])
        widgets.tooltip(f"{key}: {keys.BY_KEY[key].help}")
        imgui.same_line()
    where = state.textures.index(state.view) + 1 if state.view in state.textures else 0
    imgui.align_text_to_frame_padding()
    widgets.text(f"{where} of {len(state.textures)}", theme.DIM)


def _describe(subject: Subject, plan: Plan, size: tuple[int, int]) -> None:
    """What the texture is and holds."""
    tex = subject.tex
    width, height = texture_size(size, tex.divisor)
    megabytes = texture_bytes(size, tex.fmt, tex.divisor) / 1e6
    widgets.text(subject.doc, wrap=True)
    origin = f"written by {subject.writer}" if subject.writer else "from the tracer"
    feeds = plan.feeds.get(tex)
    kept = f", kept for the next frame as {feeds.name}" if feeds is not None else ""
    with widgets.font_size(theme.SMALL):
        widgets.text(f"{origin}{kept}", theme.DIM, wrap=True)
        widgets.text(f"{tex.fmt}, {width} x {height}, {megabytes:.3g} MB", theme.DIM)


def _channels(look: TextureLook, subject: Subject, view: View) -> None:
    choices = {AUTOMATIC: f"{AUTOMATIC}: {view.label}"} | {choice.key: choice.label for choice in subject.views}
    chosen = look.channels if look.channels in choices else AUTOMATIC
    _label("channels")
    if imgui.begin_combo("##channels", choices[chosen]):
        if imgui.is_key_pressed(imgui.Key.escape):
            imgui.close_current_popup()
        for key, label in choices.items():
            if imgui.selectable(label, key == chosen)[0]:
                look.channels = key
        imgui.end_combo()


def _exposure(look: TextureLook) -> None:
    _label("exposure")
    _, look.exposure = imgui.slider_float("##exposure", look.exposure, -_MOST_EXPOSURE, _MOST_EXPOSURE, "%+.1f EV")
    if imgui.is_item_clicked(imgui.MouseButton_.right):
        look.exposure = 0.0
    widgets.tooltip("exposure, on top of the range", note="right click: 0")


def _range(look: TextureLook) -> None:
    """The values shown as black and as white; changing one switches the automatic range off."""
    _label("range")
    _, look.automatic = imgui.checkbox("##automatic", look.automatic)
    widgets.tooltip("automatic", "Includes 0, leaves out the highest and lowest hundredth. [0, 1] where that will do.")
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    speed = max(look.high - look.low, 1e-6) / 200.0
    changed, low, high = imgui.drag_float_range2("##range", look.low, look.high, speed, 0.0, 0.0, "%.4g", "%.4g")
    if changed:
        look.low, look.high, look.automatic = low, max(high, low), False
    widgets.tooltip("values shown as black and as white")


def _magnifier(look: TextureLook) -> None:
    _label("magnifier")
    text = "%d pixels per texel" if look.zoom else "off"
    _, look.zoom = imgui.slider_int("##magnifier", look.zoom, 0, _MOST_ZOOM, text, imgui.SliderFlags_.always_clamp)


def _label(name: str) -> None:
    """The name of the widget that comes next, which takes the rest of the line."""
    imgui.align_text_to_frame_padding()
    widgets.text(name, theme.DIM)
    imgui.same_line(widgets.em(_LABELS))
    imgui.set_next_item_width(-1.0)


def _legend(view: View) -> None:
    """What the colours mean."""
    if view.mode == "HISTORY":
        _ramp()
        if view.reason:
            for reason, text in REJECTIONS.items():
                _swatch(REJECTION_COLORS[reason], text)
    elif view.mode == "MOTION":
        text = f"hue: direction; brightness: length, full at {FULL_MOTION} pixels and exposure 0"
        widgets.text(text, theme.DIM, wrap=True)
    elif view.mode == "IDENTITY":
        widgets.text("one colour for each number, black where there is none", theme.DIM, wrap=True)
    bad = ((NAN_COLOR, "NaN"), (INFINITE_COLOR, "infinite"), (NEGATIVE_INFINITE_COLOR, "-infinite"))
    for index, (color, text) in enumerate(bad):
        if index:
            imgui.same_line()
        _swatch(color, text)


def _ramp() -> None:
    """A bar with the colours of history lengths, and lengths below it."""
    start, width, height = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x, widgets.em(0.7)
    draw, pieces = imgui.get_window_draw_list(), len(RAMP) - 1
    paints = [imgui.color_convert_float4_to_u32(ImVec4(*color, 1.0)) for color in RAMP]
    for index in range(pieces):
        left, right = (start.x + width * (index + k) / pieces for k in (0, 1))
        a, b = paints[index], paints[index + 1]
        draw.add_rect_filled_multi_color(ImVec2(left, start.y), ImVec2(right, start.y + height), a, b, b, a)
    imgui.dummy(ImVec2(width, height))
    base = imgui.get_cursor_pos_x()
    for length in (1, 4, 16, 64, RAMP_END):
        text = f"{length} frame" if length == 1 else str(length)
        room = width - imgui.calc_text_size(text).x
        imgui.set_cursor_pos_x(base + room * math.log2(length) / math.log2(RAMP_END))
        widgets.text(text, theme.DIM)
        if length != RAMP_END:
            imgui.same_line()


def _swatch(color: Color, text: str) -> None:
    side = imgui.get_text_line_height()
    start = imgui.get_cursor_screen_pos()
    box = ImVec2(start.x, start.y + 0.15 * side), ImVec2(start.x + 0.7 * side, start.y + 0.85 * side)
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(*box, imgui.color_convert_float4_to_u32(ImVec4(*color, 1.0)), 0.15 * side)
    draw.add_rect(*box, imgui.color_convert_float4_to_u32(theme.FAINT), 0.15 * side)
    imgui.dummy(ImVec2(0.7 * side, side))
    imgui.same_line()
    widgets.text(text, theme.DIM, wrap=True)
