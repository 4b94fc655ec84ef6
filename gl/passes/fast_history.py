"""A second, short history that bounds a long one: what is gone from the last few frames is gone from the mean.

After NVIDIA's NRD, whose RELAX and REBLUR keep such a pair. It needs no temporal gradients, hence nothing from the
tracer, and works on recorded frames. The price is noise: what bounds is the mean of a few frames.
"""

from __future__ import annotations

from typing import Final, Protocol

from gl.graph import FragmentPass, Graph, In, Out, Prev, Tex, Uniform
from gl.passes.temporal import REPROJECTION

RADIUS: Final = 2
"""Of the window whose mean and deviation bound the long history, in pixels."""


class FastSettings(Protocol):
    """The parameters of the pair, which the sections of SVGF and BMFR have."""

    @property
    def fast_frames(self) -> int: ...
    @property
    def fast_sigma(self) -> float: ...


class FastAccumulate(FragmentPass):
    """Blend a signal into its short history."""

    shader = "temporal/fast.frag"
    in_color = In("this frame's sample, demodulated irradiance")
    in_second = In("what is added to it", optional=True)
    in_reprojection = In(REPROJECTION)
    prev_color = Prev("rgb: what this pass wrote in the last frame")
    out_color = Out("rgba16f", "rgb: mean irradiance of the last few frames")
    u_frames = Uniform("float", "[1;32] frames that count")


class FastClamp(FragmentPass):
    """Bring the long history within the short one's colours around the pixel."""

    shader = "temporal/fast_clamp.frag"
    in_color = In("rgb: accumulated irradiance; a: anything, left alone")
    in_fast = In("rgb: mean irradiance of the last few frames")
    out_color = Out("rgba16f", "rgb: accumulated irradiance, bounded; a: as it was")
    u_sigma = Uniform("float", "[0;10] reach in standard deviations")


class FastHistory:
    """The short history of one signal, and what it bounds."""

    def __init__(self, g: Graph, name: str, color: Tex, second: Tex | None, reprojection: Tex, p: FastSettings) -> None:
        """Add its accumulation, from the sample ``color`` plus ``second``. ``name``: of the signal's long history."""
        history = g.history(f"{name}.fast", "rgba16f")
        more = {} if second is None else {"in_second": second}
        work = FastAccumulate(u_frames=float(p.fast_frames))
        self._fast = g.add(work, in_color=color, in_reprojection=reprojection, prev_color=history, **more).out_color
        g.feed(history, self._fast)
        self._g, self._sigma = g, p.fast_sigma

    def bound(self, color: Tex) -> Tex:
        """Add the clamp of ``color``."""
        work = FastClamp(u_sigma=self._sigma, defines={"RADIUS": RADIUS})
        return self._g.add(work, in_color=color, in_fast=self._fast).out_color
