"""The list of keys over the picture, the table of the README."""

from __future__ import annotations

from itertools import zip_longest
from typing import Final

from imgui_bundle import imgui

from ui import theme, widgets
from ui.keys import rows

WIDTH: Final = 64.0
"""In em."""

_OPACITY: Final = 0.97  # it may lie over other windows


def draw() -> None:
    """Keys and mouse in the middle of the screen, in two blocks to be read one after the other."""
    lines = rows()
    half = -(-len(lines) // 2)
    imgui.set_next_window_bg_alpha(_OPACITY)
    with (
        widgets.window("keys and mouse", (0.5, 0.5), WIDTH, imgui.WindowFlags_.no_collapse, (0.98, 1.0)),
        widgets.font_size(theme.SMALL),
    ):
        imgui.internal.bring_window_to_display_front(imgui.internal.get_current_window())
        if imgui.begin_table("keys", 4, imgui.TableFlags_.row_bg | imgui.TableFlags_.sizing_stretch_prop):
            for _ in range(2):
                imgui.table_setup_column("key", imgui.TableColumnFlags_.width_fixed, widgets.em(7.0))
                imgui.table_setup_column("what it does", imgui.TableColumnFlags_.width_stretch)
            for left, right in zip_longest(lines[:half], lines[half:], fillvalue=("", "")):
                for key, does in (left, right):
                    imgui.table_next_column()
                    widgets.text(key, theme.ACCENT)
                    imgui.table_next_column()
                    widgets.text(does, wrap=True)
            imgui.end_table()
