"""How the panel looks: colours, sizes, fonts. Sizes are in pixels of an ordinary screen and scaled to the real one."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import imgui_bundle
from imgui_bundle import ImVec2, ImVec4, imgui

TEXT: Final = ImVec4(0.90, 0.92, 0.94, 1.0)
DIM: Final = ImVec4(0.58, 0.62, 0.67, 1.0)
FAINT: Final = ImVec4(0.40, 0.43, 0.47, 1.0)
ACCENT: Final = ImVec4(0.42, 0.76, 1.00, 1.0)
GOOD: Final = ImVec4(0.50, 0.86, 0.58, 1.0)
WARNING: Final = ImVec4(1.00, 0.78, 0.38, 1.0)
BAD: Final = ImVec4(1.00, 0.45, 0.40, 1.0)
BAR: Final = ImVec4(0.42, 0.76, 1.00, 0.22)
LIT: Final = ImVec4(0.42, 0.76, 1.00, 0.38)
CAP: Final = ImVec4(1.00, 1.00, 1.00, 0.09)

FONT_SIZE: Final = 15.0
SMALL: Final = 13.0
TINY: Final = 9.0
LARGE: Final = 21.0
MARGIN: Final = 10.0
"""Between the windows and the edge of the screen."""

FIXED: Final = (
    imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_nav  # Tab and arrows are keys of the program
    | imgui.WindowFlags_.no_focus_on_appearing
)
"""Flags of every window: it stays where it is put, and takes no key but what is typed into a number."""

RESET: Final = "\uf2ea"
REBUILD: Final = "\uf0e8"

_FONTS: Final = Path(imgui_bundle.__file__).parent / "assets" / "fonts"


def load_fonts(atlas: imgui.ImFontAtlas) -> None:
    """The fonts that come with imgui-bundle: one for text and icons, which is the default, and :func:`code_font`."""
    atlas.add_font_from_file_ttf(str(_FONTS / "Roboto" / "Roboto-Regular.ttf"), FONT_SIZE)
    icons = imgui.ImFontConfig()
    icons.merge_mode = True
    icons.glyph_offset = ImVec2(0.0, 1.0)
    atlas.add_font_from_file_ttf(str(_FONTS / "Font_Awesome_6_Free-Solid-900.otf"), SMALL, icons)
    atlas.add_font_from_file_ttf(str(_FONTS / "Inconsolata-Medium.ttf"), FONT_SIZE)


def code_font() -> imgui.ImFont:
    """The font whose letters are equally wide."""
    return imgui.get_io().fonts.fonts[1]


def apply(scale: float) -> None:
    """Give the current context its style. ``scale``: how much larger than on an ordinary screen everything is."""
    style = imgui.get_style()
    style.font_size_base = FONT_SIZE
    style.font_scale_dpi = scale
    for name, size in _SIZES.items():
        setattr(style, name, max(1.0, round(size * scale)) if size else 0.0)
    for name, (x, y) in _PAIRS.items():
        setattr(style, name, ImVec2(round(x * scale), round(y * scale)))
    style.disabled_alpha = 0.45
    style.hover_delay_normal = 0.35
    for index, color in _COLORS.items():
        style.set_color_(index, color)


_SIZES: Final = {
    "window_rounding": 7.0,
    "child_rounding": 4.0,
    "popup_rounding": 5.0,
    "frame_rounding": 4.0,
    "grab_rounding": 3.0,
    "scrollbar_rounding": 6.0,
    "window_border_size": 1.0,
    "popup_border_size": 1.0,
    "frame_border_size": 0.0,
    "grab_min_size": 9.0,
    "scrollbar_size": 9.0,
    "indent_spacing": 12.0,
    "separator_text_border_size": 1.0,
    "log_slider_deadzone": 4.0,
}
_PAIRS: Final = {
    "window_padding": (10.0, 8.0),
    "frame_padding": (6.0, 2.0),
    "item_spacing": (6.0, 4.0),
    "item_inner_spacing": (5.0, 4.0),
    "cell_padding": (3.0, 1.5),
    "separator_text_padding": (2.0, 3.0),
    "display_safe_area_padding": (3.0, 3.0),
}
_CLEAR: Final = ImVec4(0.0, 0.0, 0.0, 0.0)
_COLORS: Final = {
    imgui.Col_.text: TEXT,
    imgui.Col_.text_disabled: DIM,
    imgui.Col_.window_bg: ImVec4(0.055, 0.063, 0.078, 0.86),
    imgui.Col_.popup_bg: ImVec4(0.075, 0.086, 0.106, 0.97),
    imgui.Col_.border: ImVec4(1.0, 1.0, 1.0, 0.09),
    imgui.Col_.frame_bg: ImVec4(1.0, 1.0, 1.0, 0.07),
    imgui.Col_.frame_bg_hovered: ImVec4(1.0, 1.0, 1.0, 0.12),
    imgui.Col_.frame_bg_active: ImVec4(1.0, 1.0, 1.0, 0.16),
    imgui.Col_.title_bg: ImVec4(0.055, 0.063, 0.078, 0.86),
    imgui.Col_.title_bg_active: ImVec4(0.055, 0.063, 0.078, 0.86),
    imgui.Col_.title_bg_collapsed: ImVec4(0.055, 0.063, 0.078, 0.70),
    imgui.Col_.scrollbar_bg: _CLEAR,
    imgui.Col_.scrollbar_grab: ImVec4(1.0, 1.0, 1.0, 0.16),
    imgui.Col_.scrollbar_grab_hovered: ImVec4(1.0, 1.0, 1.0, 0.26),
    imgui.Col_.scrollbar_grab_active: ImVec4(1.0, 1.0, 1.0, 0.34),
    imgui.Col_.check_mark: ACCENT,
    imgui.Col_.slider_grab: ImVec4(0.42, 0.76, 1.00, 0.75),
    imgui.Col_.slider_grab_active: ACCENT,
    imgui.Col_.button: ImVec4(1.0, 1.0, 1.0, 0.08),
    imgui.Col_.button_hovered: ImVec4(1.0, 1.0, 1.0, 0.16),
    imgui.Col_.button_active: ImVec4(0.42, 0.76, 1.00, 0.45),
    imgui.Col_.header: ImVec4(1.0, 1.0, 1.0, 0.07),
    imgui.Col_.header_hovered: ImVec4(1.0, 1.0, 1.0, 0.13),
    imgui.Col_.header_active: ImVec4(0.42, 0.76, 1.00, 0.30),
    imgui.Col_.separator: ImVec4(1.0, 1.0, 1.0, 0.10),
    imgui.Col_.text_selected_bg: ImVec4(0.42, 0.76, 1.00, 0.35),
}
