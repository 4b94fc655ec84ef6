"""What the parts of the panel are put together from."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from imgui_bundle import ImVec2, ImVec4, imgui

from ui import theme


def em(count: float) -> float:
    """``count`` times the height of the text, in screen coordinates."""
    return count * imgui.get_font_size()


@contextmanager
def window(
    name: str, corner: tuple[float, float], width: float, flags: int = 0, limits: tuple[float, float] = (0.48, 1.0)
) -> Iterator[bool]:
    """A window in a corner or at an edge of the screen, as high as its content asks for; yields whether it is open.

    ``corner``: (0, 0) is the top left, (1, 1) the bottom right. ``width``: in em. ``limits``: the parts of the screen's
    width and height that it takes at most; what is higher scrolls.
    """
    screen, margin = imgui.get_io().display_size, em(theme.MARGIN / theme.FONT_SIZE)
    x, y = (margin + at * (side - 2.0 * margin) for at, side in zip(corner, screen, strict=True))
    wide = min(em(width), limits[0] * screen.x)
    imgui.set_next_window_pos(ImVec2(x, y), pivot=ImVec2(*corner))
    imgui.set_next_window_size_constraints(
        ImVec2(wide, 0.0), ImVec2(wide, max(limits[1] * (screen.y - 2.0 * margin), em(2.0)))
    )
    opened, _ = imgui.begin(name, None, flags | theme.FIXED | imgui.WindowFlags_.always_auto_resize)
    yield opened
    imgui.end()


@contextmanager
def font_size(size: float) -> Iterator[None]:
    """Text of ``size`` pixels of an ordinary screen."""
    imgui.push_font(None, size)
    yield
    imgui.pop_font()


@contextmanager
def tight() -> Iterator[None]:
    """Less space between the lines, where there are many."""
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(imgui.get_style().item_spacing.x, round(em(0.18))))
    yield
    imgui.pop_style_var()


def text(content: str, color: ImVec4 = theme.TEXT, wrap: bool = False) -> None:
    """Plain text: no character in it means anything to ImGui."""
    imgui.push_style_color(imgui.Col_.text, color)
    if wrap:
        imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(content)
    if wrap:
        imgui.pop_text_wrap_pos()
    imgui.pop_style_color()


def text_right(content: str, color: ImVec4 = theme.TEXT, margin: float = 0.0) -> None:
    """The same in the line begun, at its right end, ``margin`` before it."""
    imgui.same_line()
    room = imgui.get_content_region_avail().x - imgui.calc_text_size(content).x - margin
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))
    text(content, color)


def tooltip(title: str, body: str = "", note: str = "") -> None:
    """Explains the last widget while the mouse rests on it, also where it is switched off."""
    flags = imgui.HoveredFlags_.delay_normal | imgui.HoveredFlags_.allow_when_disabled
    if not imgui.is_item_hovered(flags) or not imgui.begin_tooltip():
        return
    imgui.push_text_wrap_pos(em(24.0))
    text(title)
    if body:
        text(body, theme.DIM)
    if note:
        text(note, theme.ACCENT)
    imgui.pop_text_wrap_pos()
    imgui.end_tooltip()


def heading(title: str) -> None:
    """A line with a small title in it."""
    with font_size(theme.SMALL):
        imgui.push_style_color(imgui.Col_.text, theme.DIM)
        imgui.separator_text(title)
        imgui.pop_style_color()


def bar(share: float) -> None:
    """Fill ``share``, in [0, 1], of the line that is about to be written, whatever its indentation."""
    at, pad = imgui.get_cursor_screen_pos(), imgui.get_style().window_padding.x
    left, right = imgui.get_window_pos().x + pad, at.x + imgui.get_content_region_avail().x
    end = ImVec2(left + (right - left) * min(max(share, 0.0), 1.0), at.y + imgui.get_text_line_height())
    imgui.get_window_draw_list().add_rect_filled(
        ImVec2(left, at.y), end, imgui.color_convert_float4_to_u32(theme.BAR), em(0.15)
    )


def put(x: float, middle: float, content: str, color: ImVec4) -> float:
    """Draw text over the window at ``x``, its middle at ``middle``, both on the screen; returns its width."""
    size = imgui.calc_text_size(content)
    where = ImVec2(round(x), round(middle - 0.5 * size.y))
    imgui.get_window_draw_list().add_text(where, imgui.color_convert_float4_to_u32(color), content)
    return size.x


def key_cap(x: float, middle: float, label: str, color: ImVec4) -> float:
    """Draw a key like one of a keyboard, as :func:`put` does; returns its width."""
    size, pad = imgui.calc_text_size(label), em(0.3)
    top, bottom = round(middle - 0.5 * size.y - em(0.05)), round(middle + 0.5 * size.y + em(0.1))
    imgui.get_window_draw_list().add_rect_filled(
        ImVec2(x, top), ImVec2(x + size.x + 2.0 * pad, bottom), imgui.color_convert_float4_to_u32(theme.CAP), em(0.22)
    )
    put(x + pad, middle, label, color)
    return size.x + 2.0 * pad


def pill(right: float, middle: float, on: bool, color: ImVec4) -> float:
    """Draw a switch that is on or off, its right end at ``right``; returns its width."""
    height = em(0.62)
    width, radius = 1.75 * height, 0.5 * height
    draw = imgui.get_window_draw_list()
    left, top = right - width, middle - radius
    paint = imgui.color_convert_float4_to_u32(color if on else theme.FAINT)
    if on:
        draw.add_rect_filled(ImVec2(left, top), ImVec2(right, top + height), paint, radius)
    else:
        draw.add_rect(ImVec2(left, top), ImVec2(right, top + height), paint, radius)
    knob = ImVec2(right - radius if on else left + radius, middle)
    fill = imgui.color_convert_float4_to_u32(ImVec4(0.05, 0.07, 0.09, 1.0)) if on else paint
    draw.add_circle_filled(knob, radius * (0.62 if on else 0.45), fill)
    return width
