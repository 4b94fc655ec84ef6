"""Frames to look at: results with textures of any format and documentation, without running a denoiser."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from config import Config
from gl.executor import Result
from gl.formats import lookup
from gl.graph import FragmentPass, Graph, In, Out, Plan, Tex
from gl.renderer import read
from ui.present import Size
from ui.state import State, TextureLook
from ui.status import Status
from ui.texture_view import TextureView

NAME = "seen"


def plan_of(fmt: str, doc: str = "", divisor: int = 1) -> Plan:
    """A frame of one texture, :data:`NAME`, which a pass reads that says ``doc`` of it."""

    class Reader(FragmentPass):
        shader = "none.frag"
        in_seen = In(doc)
        out_picture = Out("rgba8", "sRGB")

    g = Graph()
    g.output("display", g.add(Reader(), in_seen=g.import_(NAME, fmt)).out_picture)
    plan = g.compile()
    return replace(plan, imports=(_with_divisor(plan.imports[0], divisor),)) if divisor != 1 else plan


def _with_divisor(tex: Tex, divisor: int) -> Tex:
    tex.divisor = divisor  # uploads have the frame's size otherwise
    return tex


class Frame:
    """A frame in which ``values`` (h, w, C) is the only texture.

    ``values`` are of the numpy type of ``fmt``; ``size``: of the picture, by default that of ``values``.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        fmt: str,
        values: NDArray[np.generic],
        doc: str = "",
        divisor: int = 1,
        size: Size | None = None,
    ) -> None:
        height, width, channels = values.shape
        assert (values.dtype, channels) == (np.dtype(lookup(fmt).numpy), lookup(fmt).components)
        self.ctx = ctx
        self.texture = ctx.texture((width, height), channels, values.tobytes(), dtype=lookup(fmt).dtype, alignment=1)
        plan = plan_of(fmt, doc, divisor)
        result = Result({}, {}, 0, plan, {plan.imports[0]: self.texture})
        self.state = State(Config(), "svgf", view=NAME)
        self.status = Status("scene", "renderer", size or (width, height), result=result)

    def look(self, **changed: object) -> TextureLook:
        """Look at it as asked, from 0 to 1 unless said otherwise; returns how."""
        self.state.look = replace(TextureLook(automatic=False), **changed)  # type: ignore[arg-type]
        return self.state.look

    def draw(self, view: TextureView, window: Size | None = None) -> NDArray[np.uint8]:
        """(H, W, 3) of what is on the screen, by default one pixel for each of the picture."""
        screen = self.ctx.texture(window or self.status.size, 4)
        target = self.ctx.framebuffer([screen])
        assert view.draw(self.state, self.status, target, screen.size)
        result: NDArray[np.uint8] = np.rint(read(screen)[..., :3] * 255.0).astype(np.uint8)
        self.ctx.detect_framebuffer(0).use()  # moderngl binds the current one again when it makes the next
        target.release()
        screen.release()
        return result

    def release(self) -> None:
        self.texture.release()


def eight_bits(color: Sequence[float]) -> list[int]:
    """An sRGB colour as the screen has it."""
    return [round(255 * value) for value in color]
