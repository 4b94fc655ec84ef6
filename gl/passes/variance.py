"""The variance of the luminance, as SVGF is steered by it: every estimator that ``svgf.variance`` names.

* ``raw``: first and second moment accumulated over time, sigma^2 = mu2 - mu1^2 (Schied et al. 2017, sec. 4.2). The
  difference cancels where light is bright and nearly free of noise: at a luminance of 1000 single precision leaves an
  error of 0.1 in the variance.
* ``raw-mean``: the same, as the plain mean over the whole history instead of an exponential one.
* ``welford``: mean and variance about it, updated by the difference of each sample from the mean (Welford 1962, "Note
  on a Method for Calculating Corrected Sums of Squares and Products"), exponential. In exact arithmetic it is ``raw``,
  but nothing cancels. Where the history is interpolated, the variance between the texels is added to theirs.
* ``welford-mean``: the same over the whole history, with Bessel's correction.
* ``spatial``: of this frame's samples in 7x7 pixels of the same surface, whatever the history.
* ``spatial-temporal``: the same, averaged over time along the motion vector, then over 3x3 pixels.
* ``exaggerated``: a hundred times ``raw``, and 100 without a history: a fudge that is met with in code, to compare.

The first four take the estimate in space while the history is shorter than four frames, exaggerated by 4 / h.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from config import Svgf
from gl.graph import FragmentPass, Graph, History, In, Out, Prev, Tex, Uniform
from gl.passes.display import GLOSSY
from gl.passes.fast_history import FastHistory
from gl.passes.temporal import REPROJECTION, Change, Guides, accumulate, blend

COLOR = "rgb: irradiance; a: standard deviation"
GLOSS = "of specular light: rgb: its albedo, 0: there is none; a: roughness"
CENTRED: Final = ("welford", "welford-mean")
WHOLE: Final = ("raw-mean", "welford-mean")
IN_SPACE: Final = ("spatial", "spatial-temporal")
"""Values of ``svgf.variance`` by what they are made of: variances about the mean; the whole history; no moments."""


class Variance(FragmentPass):
    """Replace the temporal variance by a spatial estimate where the history is shorter than four frames (sec. 4.2)."""

    shader = "svgf/variance.frag"
    in_color = In("rgb: irradiance; a: standard deviation over time")
    in_moments = In("first and second moment of luminance", optional=True)
    in_surface = In("xyz: shading normal, world; w: depth, scene units")
    in_gradient = In("depth change per pixel, scene units")
    in_reprojection = In(REPROJECTION, optional=True)
    out_color = Out("rgba16f", "rgb: irradiance, unchanged unless PREFILTER; a: standard deviation")
    u_sigma_z = Uniform("float", "> 0, depth edge-stopping")
    u_pixel_size = Uniform("float", "> 0, scene units a pixel is wide at depth 1")


class VarianceInSpace(Variance):
    """The spatial estimate everywhere, of this frame's samples instead of what was accumulated."""

    in_sample = In("this frame's sample, demodulated irradiance")


class GlossyVariance(Variance):
    """The same for specular light, in which only surfaces of the same roughness have a part."""

    in_specular_albedo = In(GLOSS)
    u_sigma_r = Uniform("float", "> 0, roughness edge-stopping")
    u_reach = Uniform("float", "> 0, pixels per squared roughness, over which a colour is averaged")


class GlossyVarianceInSpace(VarianceInSpace, GlossyVariance):
    """Both."""


class VarianceInTime(FragmentPass):
    """Blend the variance with that of the last frame, along the motion vector."""

    shader = "svgf/variance_in_time.frag"
    in_color = In(COLOR)
    in_reprojection = In(REPROJECTION)
    prev_variance = Prev("variance of luminance")
    out_variance = Out("r32f", "variance of luminance; a half would not hold it")
    u_alpha = Uniform("float", "[0;1] smallest weight of the new variance")


class VarianceMean(FragmentPass):
    """Mean of the variance over 3x3 pixels, beside the colour."""

    shader = "svgf/variance_mean.frag"
    in_color = In(COLOR)
    in_variance = In("variance of luminance")
    out_color = Out("rgba16f", COLOR)


class VarianceExaggerated(FragmentPass):
    """A hundred times the variance, and 100 without a history."""

    shader = "svgf/variance_exaggerated.frag"
    in_color = In(COLOR)
    in_reprojection = In(REPROJECTION)
    out_color = Out("rgba16f", COLOR)


class Estimate(NamedTuple):
    """``unfiltered``: the accumulated colour. ``color``: the same with its standard deviation in alpha.

    ``length``: its w is the length N of the history; None: there is none.
    """

    unfiltered: Tex
    color: Tex
    length: Tex | None


def estimate(
    g: Graph,
    noisy: Tex,
    reprojection: Tex | None,
    history: History | None,
    guides: Guides,
    p: Svgf,
    pixel_size: float,
    change: Change | None = None,
    gloss: Tex | None = None,
) -> Estimate:
    """Accumulate ``noisy`` into ``history`` and add the estimate of its variance that ``p`` asks for.

    ``change``: what is known of the light's change. ``gloss`` (:data:`GLOSS`): the signal is specular light. Without
    ``reprojection`` and ``history`` nothing is accumulated, and there is no other variance than that in space.
    """
    in_space = _InSpace(g, guides, p, pixel_size, gloss)
    if reprojection is None or history is None:
        return Estimate(noisy, in_space.add(noisy) if p.variance_guided else noisy, None)

    if p.variance_guided and p.variance in IN_SPACE and change is None:
        color = blend(g, noisy, reprojection, history, p.alpha, clamp=p.clamp, raw=True)
        moments, length = None, reprojection
    else:
        color, moments = accumulate(
            g,
            noisy,
            reprojection,
            history,
            p,
            clamp=p.clamp,
            change=change,
            alpha_moments=0.0 if p.variance in WHOLE else p.alpha_moments,
            variance=_defines(p.variance),
        )
        length = reprojection if change is None else moments  # a signal whose light changes has a length of its own
    if p.fast_clamp:
        color = FastHistory(g, history.name, noisy, None, reprojection, p).bound(color)
    if not p.variance_guided:
        return Estimate(color, color, length)
    if p.variance in IN_SPACE:
        x = in_space.add(color, noisy, length=length)
        guided = _over_time(g, x, reprojection, history, p) if p.variance == "spatial-temporal" else x
    elif p.variance == "exaggerated":
        guided = g.add(VarianceExaggerated(), "variance", in_color=color, in_reprojection=length).out_color
    else:
        guided = in_space.add(color, moments=moments, length=length)
    return Estimate(color, guided, length)


def _defines(variance: str) -> dict[str, int]:
    """How accumulation is compiled for an estimator."""
    centred = {"CENTRED": 1} if variance in CENTRED else {}
    return centred | ({"UNBIASED": 1} if variance == "welford-mean" else {})


class _InSpace:
    """Adds :class:`Variance` in the variant that a signal needs."""

    def __init__(self, g: Graph, guides: Guides, p: Svgf, pixel_size: float, gloss: Tex | None) -> None:
        self._g, self._p, self._glossy = g, p, gloss is not None
        self._shape = {"in_surface": guides.surface, "in_gradient": guides.gradient}
        self._uniforms: dict[str, Any] = {"u_sigma_z": p.sigma_z, "u_pixel_size": pixel_size}
        self._defines = {"PREFILTER": 1} if p.prefilter else {}
        if gloss is not None:
            self._shape["in_specular_albedo"] = gloss
            self._uniforms |= {"u_sigma_r": p.sigma_r, "u_reach": p.reach}
            self._defines |= GLOSSY

    def add(self, color: Tex, sample: Tex | None = None, moments: Tex | None = None, length: Tex | None = None) -> Tex:
        """``moments``: those of the history, of the ``length`` that goes with them; without, everything is estimated
        in space, of ``sample`` or else of ``color``."""
        inputs, defines = dict(self._shape), dict(self._defines)
        if moments is not None and length is not None:
            inputs |= {"in_moments": moments, "in_reprojection": length}
            defines |= {"CENTRED": 1} if self._p.variance in CENTRED else {}
        if sample is not None:
            inputs["in_sample"] = sample
            defines["SAMPLE"] = 1
            if self._p.prefilter and length is not None:
                inputs["in_reprojection"] = length
        work = _VARIANTS[sample is not None, self._glossy](**self._uniforms, defines=defines)
        return self._g.add(work, "variance", in_color=color, **inputs).out_color


_VARIANTS: Final[dict[tuple[bool, bool], type[Variance]]] = {
    (False, False): Variance,
    (False, True): GlossyVariance,
    (True, False): VarianceInSpace,
    (True, True): GlossyVarianceInSpace,
}
"""By whether this frame's samples are looked at and whether they are specular light."""


def _over_time(g: Graph, color: Tex, reprojection: Tex, history: History, p: Svgf) -> Tex:
    """The variance in ``color`` averaged over time and then over 3x3 pixels."""
    before = g.history(f"{history.name}.variance", "r32f")
    in_time = VarianceInTime(u_alpha=p.alpha_moments)
    variance = g.add(in_time, in_color=color, in_reprojection=reprojection, prev_variance=before).out_variance
    g.feed(before, variance)
    return g.add(VarianceMean(), in_color=color, in_variance=variance).out_color
