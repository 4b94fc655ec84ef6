"""Automatic exposure. Reinhard et al. 2002, "Photographic Tone Reproduction for Digital Images", sec. 3.1: the picture
is scaled so that its log-average luminance, the key of the scene, becomes middle grey.

Deviations from the paper:

* Black pixels, such as a sky without light, are left out, where the paper adds a small constant to all; so are NaN and
  infinity.
* The exposure follows the measured one over several frames, in stops, as the eye adapts (Pattanaik et al. 2000).
"""

from __future__ import annotations

from typing import Final

from config import Display
from gl.graph import ONE_TEXEL, ComputePass, Graph, In, Out, Prev, Tex, Uniform

TILE: Final = 32
"""Side in pixels of what one work group sums up, with one invocation per column."""


class LogLuminance(ComputePass):
    """Sum the logarithm of the luminance over tiles, in columns that meet in shared memory."""

    shader = "display/log_luminance.comp"
    group = (1, 1)
    in_radiance = In("linear radiance")
    out_sum = Out("rg32f", "x: sum of log2 luminance; y: number of pixels in it", divisor=TILE)


class Exposure(ComputePass):
    """The exposure that makes the frame's mean middle grey, approached from that of the frame before."""

    shader = "display/exposure.comp"
    group = (1, 1)
    in_sum = In("x: sum of log2 luminance; y: number of pixels in it; for each tile")
    prev_exposure = Prev("the last frame's exposure, EV")
    out_exposure = Out("r32f", "exposure, EV", divisor=ONE_TEXEL)
    u_adaptation = Uniform("float", "[0.01;1] share of the way to the measured exposure gone in this frame")


def auto_exposure(g: Graph, radiance: Tex, p: Display) -> Tex:
    """Add the measurement of ``radiance``; returns the exposure in EV, one texel.

    Its history belongs to the display, not to the method that made ``radiance``: they all show the same light.
    """
    with g.scope("exposure"):
        sums = g.add(LogLuminance(defines={"TILE": TILE}), in_radiance=radiance).out_sum
        history = g.history("exposure", "r32f", ONE_TEXEL)
        adapted = g.add(
            Exposure(u_adaptation=p.adaptation, defines={"THREADS": 64}), "adapt", in_sum=sums, prev_exposure=history
        )
        g.feed(history, adapted.out_exposure)
        return adapted.out_exposure
