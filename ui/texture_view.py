"""Any texture of the graph on the screen: channels, exposure, range, decoded meanings, and a magnifier."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import moderngl
import numpy as np

from gl.executor import SHADER_ROOT
from gl.formats import lookup
from gl.programs import FULLSCREEN
from gl.shader import expand
from images import value_range
from ui import textures
from ui.present import BORDER, Box, Size, letterbox
from ui.state import State, TextureLook
from ui.status import Status
from ui.textures import Color, Subject, View, find_subject

_SHADER: Final = Path(__file__).with_name("texture_view.frag")

SAMPLES: Final = (128, 72)
"""At most so many texels, in x and y, tell a texture's range."""

RANGE_EVERY: Final = 16
"""Pictures between two looks at a texture's range: each waits until the GPU has finished."""

LENS_TEXELS: Final = 17
"""Texels on each side of the magnifier; odd, so that one is in the middle."""

_FRAME: Final = 2  # pixels around the magnifier
_FRAME_COLOR: Final = (0.85, 0.85, 0.85)

ProgramKey = tuple[str, View, bool]


class TextureView:
    """Draws textures into framebuffers of any size. One program for each kind of view, made when it is first used."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._programs: dict[ProgramKey, _Program] = {}
        self._samples = ctx.texture(SAMPLES, 4, dtype="f4")
        self._sampler = ctx.framebuffer([self._samples])
        self._ranged: tuple[str, View] | None = None
        self._age = 0

    def draw(self, state: State, status: Status, target: moderngl.Framebuffer, size: Size) -> bool:
        """Fill ``target``, ``size`` pixels, with the texture ``state.view`` of the frame in ``status``, and a border.

        :data:`ui.state.PICTURE` is the picture itself. Row 0 is at the bottom. Where ``look.automatic`` is set,
        ``look.low`` and ``look.high`` follow the texture.

        Returns:
            Whether the frame has that texture, and nothing was written over it; if not, nothing is drawn.
        """
        result, look = status.result, state.look
        subject = find_subject(result.plan, state.view) if result is not None else None
        if result is None or subject is None or subject.tex.name not in result.plan.final_textures():
            return False
        texture = result.texture(subject.tex.name)
        view = subject.view(look.channels)
        if look.automatic and view.mode == "RANGE":
            self._follow_range(texture, subject, view, look)
        program = self._program(subject, view)
        program.set(look, status.size)
        box = letterbox(status.size, size)
        # The box has the picture's shape. A texture of half as many texels, rounded up, may stick out by half of one.
        scale = [pixels / subject.tex.divisor / side for pixels, side in zip(status.size, box[2:], strict=True)]
        self._ctx.enable_only(moderngl.NOTHING)
        target.use()
        target.viewport = (0, 0, *size)
        target.clear(*BORDER)
        program.draw(target, texture, box, box[:2], scale)
        if look.zoom and status.cursor is not None:
            self._magnify(program, texture, subject, look.zoom, target, box, status)
        target.viewport = (0, 0, *size)
        return True

    def release(self) -> None:
        """Free every GL object."""
        for program in self._programs.values():
            program.release()
        self._programs.clear()
        self._sampler.release()
        self._samples.release()

    def _magnify(
        self,
        program: _Program,
        texture: moderngl.Texture,
        subject: Subject,
        zoom: int,
        target: moderngl.Framebuffer,
        box: Box,
        status: Status,
    ) -> None:
        assert status.cursor is not None
        middle = [box[k] + (status.cursor[k] + 0.5) * box[2 + k] / status.size[k] for k in (0, 1)]
        pixel = status.cursor[0] // subject.tex.divisor, status.cursor[1] // subject.tex.divisor
        side = LENS_TEXELS * zoom
        x, y = (round(m - side / 2) for m in middle)
        target.clear(*_FRAME_COLOR, viewport=(x - _FRAME, y - _FRAME, side + 2 * _FRAME, side + 2 * _FRAME))
        origin = [corner - (at - LENS_TEXELS // 2) * zoom for corner, at in zip((x, y), pixel, strict=True)]
        program.draw(target, texture, (x, y, side, side), origin, (1 / zoom, 1 / zoom), pixel, zoom)

    def _follow_range(self, texture: moderngl.Texture, subject: Subject, view: View, look: TextureLook) -> None:
        """Set the range of ``look`` to that of some texels of ``texture``, once in :data:`RANGE_EVERY` calls."""
        if lookup(subject.tex.fmt).dtype == "f1":
            look.low, look.high = 0.0, 1.0  # there are no other values
            return
        self._age += 1
        if self._ranged == (subject.tex.name, view) and self._age < RANGE_EVERY:
            return
        self._ranged, self._age = (subject.tex.name, view), 0
        program = self._program(subject, view._replace(mode="SAMPLE"))
        width, height = (min(side, most) for side, most in zip(texture.size, SAMPLES, strict=True))
        area = (0, 0, width, height)
        self._ctx.enable_only(moderngl.NOTHING)
        self._sampler.use()
        program.draw(self._sampler, texture, area, (0, 0), (texture.width / width, texture.height / height))
        components = len(set(view.swizzle))  # grey is one channel three times
        values = np.frombuffer(self._sampler.read(area, components, dtype="f4"), np.float32)
        look.low, look.high = value_range(values)

    def _program(self, subject: Subject, view: View) -> _Program:
        fmt = lookup(subject.tex.fmt)
        # Eight bits are for the screen: sRGB already.
        key = (fmt.sampler, view._replace(key="", label=""), fmt.dtype != "f1")
        if key not in self._programs:
            self._programs[key] = _Program(self._ctx, *key)
        return self._programs[key]


class _Program:
    """``texture_view.frag`` for one kind of texture and one view."""

    def __init__(self, ctx: moderngl.Context, sampler: str, view: View, encode: bool) -> None:
        defines = {
            "SAMPLER": sampler,
            "MODE": view.mode,
            "SWIZZLE": view.swizzle,
            "ALL": view.swizzle.ljust(4, view.swizzle[-1]),
            "ENCODE": str(int(encode)),
            "RAMP": _array(textures.RAMP),
            "RAMP_END": f"{textures.RAMP_END:.1f}",
            "REJECTED": _array([color for _, color in sorted(textures.REJECTION_COLORS.items(), reverse=True)]),
            "FULL_MOTION": f"{textures.FULL_MOTION:.1f}",
            "OUTSIDE": _vec3(BORDER),
            "NAN_COLOR": _vec3(textures.NAN_COLOR),
            "INFINITE_COLOR": _vec3(textures.INFINITE_COLOR),
            "NEGATIVE_INFINITE_COLOR": _vec3(textures.NEGATIVE_INFINITE_COLOR),
        }
        if view.reason:
            defines["REASON"] = view.reason
        source = expand(SHADER_ROOT, _SHADER.name, defines, _SHADER.read_text(encoding="utf-8"))
        self._code: Any = ctx.program(expand(SHADER_ROOT, FULLSCREEN).text, source.text)
        self._triangle = ctx.vertex_array(self._code, [])

    def set(self, look: TextureLook, size: Size) -> None:
        """How to show what :meth:`draw` draws. ``size``: of the frame in pixels."""
        self._set(u_low=look.low, u_high=look.high, u_gain=2.0**look.exposure, u_size=size)

    def draw(
        self,
        target: moderngl.Framebuffer,
        texture: moderngl.Texture,
        area: Box,
        origin: Sequence[float],
        scale: Sequence[float],
        pixel: tuple[int, int] = (0, 0),
        grid: int = 0,
    ) -> None:
        """Fill ``area`` of ``target``, which is in use, with ``texture``, one corner of which lies at ``origin``.

        ``scale``: texels per pixel. ``grid``: pixels per texel if lines are to be drawn between them, and around
        ``pixel``.
        """
        self._set(u_origin=tuple(origin), u_scale=tuple(scale), u_pixel=pixel, u_grid=float(grid))
        target.viewport = area
        texture.use(0)
        self._triangle.render(moderngl.TRIANGLES, 3)

    def release(self) -> None:
        self._triangle.release()
        self._code.release()

    def _set(self, **values: object) -> None:
        for name, value in values.items():
            uniform = self._code.get(name, None)
            if uniform is not None:  # not every view reads everything
                uniform.value = value


def _vec3(color: Color) -> str:
    return f"vec3({', '.join(map(str, color))})"


def _array(colors: Sequence[Color]) -> str:
    return f"vec3[]({', '.join(map(_vec3, colors))})"
