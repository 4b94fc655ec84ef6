"""Firefly rejection: bright outliers are cut from the noisy illumination before any filter sees them.

Haines and Akenine-Möller (eds.), "Ray Tracing Gems", 2019: a fixed limit (ch. 17), or one that follows from mean and
variance (ch. 25), excess = max(0, L - (0.1 + mean + 8 sqrt(max(1e-5, variance)))).

* What is cut is the illumination, which is the radiance that a white surface would have: a filter takes it from dark
  surfaces to bright ones. Nothing is divided by the albedo, so black surfaces and the sky need no care.
* Mean and variance are those of the 7x7 pixels around, without the pixel itself, in this frame. The book takes them
  over time; in space they exist in the first frame, without motion vectors, and without any filter at all.
  One other pixel of the 48 that is as bright, b, lets both pass: mean + 8 deviations of the 48 are 1.16 b. Edges of
  surfaces and of shadows are therefore left alone, and guides are not needed.
* 0.1, the deviation sqrt(1e-5) and the fixed limit are radiances on the screen: they are divided by 2^exposure, so that
  the same picture in other units of light loses the same. An automatic exposure is not known yet and does not count.
* Both act on each channel by itself: what is cut loses saturation.
* A sample that is NaN or infinite stays: accumulation knows how to do without it. It counts in no mean.

Both are biased: light is lost. Measured on the flights through the two scenes of the program, as parts of the radiance
and of the noisy frames' error, the filter being SVGF:

=====================  ==========  =========  =====================
mode                   light lost  RMSE left  RMSE left by filter
=====================  ==========  =========  =====================
cornell, off           0           1          0.0570
cornell, clamp 10      0           1          0.0570
cornell, variance      0.3 %       0.976      0.0579
interior, off          0           1          0.1914
interior, clamp 10     0.4 %       0.962      0.1862
interior, clamp 5      3.0 %       0.866      0.1889
interior, variance     2.6 %       0.912      0.1858
=====================  ==========  =========  =====================

The mean of 5x5 or 3x3 pixels in place of 7x7 loses 3.8 % or 9.1 % in the interior.
"""

from __future__ import annotations

from config import Firefly
from gl.graph import FragmentPass, Graph, In, Out, Tex, Uniform

LEAST_VARIANCE = 1e-5
"""Radiance squared, at exposure 0: neighbours that vary less count as if they varied so much."""


class CutRadiance(FragmentPass):
    """Bound each channel by a constant."""

    shader = "firefly/radiance.frag"
    in_color = In("this frame's sample, demodulated irradiance")
    out_color = Out("rgba32f", "the same, bounded")
    u_max_radiance = Uniform("float", "> 0, radiance")


class CutOutliers(FragmentPass):
    """Bound each channel by what its neighbours' mean and standard deviation allow."""

    shader = "firefly/outliers.frag"
    in_color = In("this frame's sample, demodulated irradiance")
    out_color = Out("rgba32f", "the same, bounded")
    u_deviations = Uniform("float", ">= 0, accepted distance from the mean in standard deviations")
    u_least_variance = Uniform("float", ">= 0, radiance squared, lower bound of the variance")
    u_margin = Uniform("float", ">= 0, radiance accepted beyond that distance")


def reject_fireflies(g: Graph, name: str, color: Tex, p: Firefly, exposure: float) -> Tex:
    """``color`` (noisy irradiance, called ``name``) without its outliers, or itself where ``p.mode`` is "off".

    ``exposure``: EV at which the picture is shown; the radiances among the parameters refer to 0.
    """
    unit = 2.0**-exposure
    with g.scope("firefly"):
        if p.mode == "clamp":
            return g.add(CutRadiance(u_max_radiance=p.max_radiance * unit), name, in_color=color).out_color
        if p.mode == "variance":
            cut = CutOutliers(
                u_deviations=p.deviations, u_least_variance=LEAST_VARIANCE * unit**2, u_margin=p.margin * unit
            )
            return g.add(cut, name, in_color=color).out_color
    return color
