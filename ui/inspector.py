"""The pixel under the mouse in numbers: the texture looked at, the tracer's guides, and what became of its history."""

from __future__ import annotations

from typing import Final, NamedTuple

import moderngl
import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui
from numpy.typing import NDArray

from gl.executor import Result
from gl.formats import lookup
from gl.passes.temporal import REJECTIONS
from gl.plan import Plan
from gl.resources import VALID
from images import to_srgb8
from raytrace.frame import FramePacket
from ui import theme, widgets
from ui.state import PICTURE, State
from ui.status import Status
from ui.texture_view import LENS_TEXELS
from ui.textures import REJECTION_COLORS, REPROJECTION_PORT, Color, find_subject, parts, reprojection_of

Pixel = tuple[int, int]

_BESIDE_MOUSE: Final = 1.2  # em
_WIDEST_TEXT: Final = 19.0  # em; longer texts take several lines


class Reading(NamedTuple):
    """One line of the inspector. ``swatch``: an sRGB colour that goes with it."""

    label: str
    text: str
    swatch: Color | None = None


def wanted_textures(state: State, plan: Plan) -> tuple[str, ...]:
    """Names to ``keep`` so that viewer and inspector find their textures after the frame.

    ``plan``: of the same configuration as the frame that is to be run; another's may have other names.
    """
    wanted = [state.view] if state.view != PICTURE and find_subject(plan, state.view) is not None else []
    finder = reprojection_of(plan)
    if state.inspect and finder is not None:
        wanted.append(finder.writes[REPROJECTION_PORT].name)
    return tuple(dict.fromkeys(wanted))


def read_texel(texture: moderngl.Texture, pixel: Pixel) -> NDArray[np.generic]:
    """The components of one texel, (C,) of the texture's own type: uint8, float16, float32, uint32 or int32.

    Waits for the GPU, but copies nothing else.
    """
    framebuffer = texture.ctx.framebuffer([texture])
    try:
        data = framebuffer.read((*pixel, 1, 1), texture.components, dtype=texture.dtype, alignment=1)
    finally:
        framebuffer.release()
    return np.frombuffer(data, {"f1": np.uint8, "f2": np.float16}.get(texture.dtype, texture.dtype))


def inspect(state: State, status: Status) -> list[list[Reading]]:
    """What there is to say about the pixel ``status.cursor``, in groups; nothing outside the picture."""
    packet, result, pixel = status.packet, status.result, status.cursor
    if packet is None or result is None or pixel is None:
        return []
    groups = [texture_readings(result, state.view, pixel), packet_readings(packet, pixel)]
    return [group for group in groups if group] + [[history_reading(result, pixel)]]


def texture_readings(result: Result, view: str, pixel: Pixel) -> list[Reading]:
    """Every channel of the texture looked at, exactly: the shortest decimal that stands for no other number."""
    subject = find_subject(result.plan, view)
    if subject is None or subject.tex.name not in result.plan.final_textures():
        return []
    divisor = subject.tex.divisor
    values = read_texel(result.texture(subject.tex.name), (pixel[0] // divisor, pixel[1] // divisor))
    meanings = {part.channels: part.meaning.partition(",")[0] for part in parts(subject.doc)}
    unit = " / 255" if lookup(subject.tex.fmt).dtype == "f1" else ""
    return [
        Reading(f"{channel}  {meanings.get(channel, '')}".rstrip(), str(value) + unit)
        for channel, value in zip("rgba", values, strict=False)
    ]


def packet_readings(packet: FramePacket, pixel: Pixel) -> list[Reading]:
    """What the tracer says: one noisy sample, and the guides."""
    at = pixel[1], pixel[0]
    albedo, surface, motion = packet.albedo[at], packet.surface[at], packet.motion[at]
    radiance = (packet.direct[at] + packet.indirect[at])[:3] * albedo[:3] + packet.emission[at][:3]
    gloss: list[Reading] = []
    if packet.specular is not None and packet.specular_albedo is not None:
        reflected = packet.specular_albedo[at]
        radiance = radiance + packet.specular[at][:3] * reflected[:3]
        gloss = [
            Reading("specular albedo", _numbers(reflected[:3]), _swatch(reflected)),
            Reading("roughness", f"{reflected[3]:.3g}"),
        ]
    rows = [Reading("noisy radiance", _numbers(radiance), _swatch(radiance))]
    if motion[3] < 0.0:
        return [*rows, Reading("object", "none: the ray left the scene")]
    return [
        *rows,
        Reading("albedo", _numbers(albedo[:3]), _swatch(albedo)),
        *gloss,
        Reading("normal", _numbers(surface[:3])),
        Reading("depth", f"{surface[3]:.5g}"),
        Reading("motion, pixels", _numbers(motion[:2] * packet.size)),
        Reading("object", f"{motion[3]:.0f}"),
    ]


def history_reading(result: Result, pixel: Pixel) -> Reading:
    """How many frames the pixel's history holds, or why there is none."""
    finder = reprojection_of(result.plan)
    if finder is None:
        return Reading("history", "this method keeps none")
    name = finder.writes[REPROJECTION_PORT].name
    if name not in result.plan.final_textures():
        return Reading("history", "from the next frame on")  # this one was begun before anybody asked
    _, _, mask, length = (float(value) for value in read_texel(result.texture(name), pixel))
    if mask >= 0.0:
        return Reading("history", "1 frame" if length == 1.0 else f"{length:.0f} frames")
    reason = round(mask)
    text = REJECTIONS.get(reason, f"reason {reason}")
    causes = {result.histories[history.name] for history in finder.prevs.values()} - {VALID}
    if reason == -1 and causes:
        text = f"{text} ({', '.join(sorted(causes))})"
    return Reading("no history", text, REJECTION_COLORS.get(reason))


def draw_inspector(state: State, status: Status) -> None:
    """Show it beside the mouse, or beside the magnifier around it, unless the mouse is over a panel or looks around."""
    io = imgui.get_io()
    groups = [] if state.looking or io.want_capture_mouse else inspect(state, status)
    if not groups or status.cursor is None:
        return
    mouse, screen = imgui.get_mouse_pos(), io.display_size
    lens = 0.5 * LENS_TEXELS * state.look.zoom / max(io.display_framebuffer_scale.x, 1e-3)
    away = max(widgets.em(_BESIDE_MOUSE), lens + widgets.em(0.5))
    # On the side where there is more room: 1 is the left of the mouse, and above it.
    sides = [float(at > 0.5 * whole) for at, whole in zip(mouse, screen, strict=True)]
    aside, below = (away * (1.0 - 2.0 * side) for side in sides)
    corner = ImVec2(mouse.x + aside, mouse.y + (0.0 if lens else below))
    imgui.set_next_window_pos(corner, pivot=ImVec2(*sides))
    flags = imgui.WindowFlags_
    imgui.begin("pixel", None, theme.FIXED | flags.no_decoration | flags.always_auto_resize | flags.no_inputs)
    widgets.text(f"{status.cursor[0]}, {status.cursor[1]}", theme.ACCENT)
    widgets.text_right(state.view or "the picture", theme.DIM)
    labels = max(imgui.calc_text_size(reading.label).x for group in groups for reading in group) + widgets.em(0.8)
    for index, group in enumerate(groups):
        if index:
            imgui.separator()
        for reading in group:
            _draw_reading(reading, labels)
    imgui.end()


def _draw_reading(reading: Reading, labels: float) -> None:
    """One line; ``labels``: the width that the labels of all take."""
    left = imgui.get_cursor_pos_x() + labels
    widgets.text(reading.label, theme.DIM)
    imgui.same_line(left)
    if reading.swatch is not None:
        side = imgui.get_text_line_height()
        flags = imgui.ColorEditFlags_.no_tooltip | imgui.ColorEditFlags_.no_border
        imgui.color_button(f"##{reading.label}", ImVec4(*reading.swatch, 1.0), flags, ImVec2(side, side))
        imgui.same_line()
    imgui.push_text_wrap_pos(left + widgets.em(_WIDEST_TEXT))
    widgets.text(reading.text)
    imgui.pop_text_wrap_pos()


def _numbers(values: NDArray[np.floating]) -> str:
    return "  ".join(f"{value:.4g}" for value in values)


def _swatch(linear: NDArray[np.floating]) -> Color:
    red, green, blue = to_srgb8(linear[None, None, :3])[0, 0] / 255.0
    return float(red), float(green), float(blue)
