"""SVGF. Schied et al. 2017, "Spatiotemporal Variance-Guided Filtering: Real-Time Reconstruction for Path-Traced Global
Illumination"; the wavelet after Dammertz et al. 2010, "Edge-Avoiding À-Trous Wavelet Transform".

Deviations from the paper, in every preset:

* Accumulation as described in :mod:`gl.passes.temporal`.
* The variance estimated in space is exaggerated by 4 / h while the history h is shorter than four frames, as the known
  implementations do; the paper gives no factor.
* The denominator of the depth weight has a floor of a tenth of a pixel's width per pixel of distance: with the paper's
  constant a surface facing the camera, whose depth gradient is 0, would not be filtered at all.
* Two parameters correct the paper's use of the variance, and are neutral in the preset ``paper``. It steers every
  iteration by the variance of one sample although the colour is a mean of many: ``accumulated_variance`` scales it down
  after the first iteration. Before that a tight luminance weight makes pixels shun the rare bright samples of their
  neighbours; where that iteration feeds the history, frame after frame, and the picture darkens (1.7 % on the back wall
  of the Cornell box). ``first_sigma_l`` loosens it there.
* ``feedback_level`` -1, the default, feeds the history with what was accumulated and not yet filtered. What a filter
  blurs then never becomes the next frame's input: 13 % less error in the Cornell box, 5 % in the interior, and 6 % more
  flicker in the former, which a smaller ``alpha`` takes away again (one signal, ``best`` otherwise).
* ``normal_history``, after Q2RTX: the exponent of the normals' weight grows with the history. Where surfaces are small
  and bent no neighbour faces quite the same way, and a pixel without a history would keep its noise.
* What travels between the iterations is the standard deviation, since a variance leaves the range of half precision.

The preset ``reference`` has the constants of the best-known implementation, the pass SVGFPass of NVIDIA's Falcor. It
departs from the paper in structure, too. One such departure is a parameter, ``prefilter``: while the variance is
estimated in space, the colour is replaced by the mean of the same window. That leaves 5 % less error in the interior
and 1 % more in the Cornell box, where hardly anything is disoccluded. The others are not followed:

* Its weight of depth takes the larger component of the gradient for all directions, three times that in the estimate in
  space: 1 % less error in the interior, 1 % more in the Cornell box.
* Its estimate in space also weighs luminance, by exp(-|Δl| / 10): a constant in units of light, so that what is
  filtered depends on the exposure.
* Its depth weight has no floor. Its tests of the history accept depth differences of up to a tenth of a scene unit
  anywhere, test the screen's edge for the rounded position instead of each texel, know no motion in depth, and read the
  history's length from one texel. These are defects; every preset has the floor, and the tests of
  :mod:`gl.passes.temporal`.
* It stores variances in single precision.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from config import Svgf
from gl.graph import FragmentPass, Graph, In, Out, Tex, Uniform
from gl.passes.display import GLOSSY
from gl.passes.temporal import REPROJECTION, Change, Guides, reproject
from gl.passes.variance import GLOSS, estimate


class Atrous(FragmentPass):
    """One iteration of the wavelet, 5x5 taps at a distance of ``step`` pixels (sec. 4.3 and 4.4, eq. 3 to 5)."""

    shader = "svgf/atrous.frag"
    in_color = In("rgb: irradiance; a: standard deviation of its luminance")
    in_surface = In("xyz: shading normal, world; w: depth, scene units")
    in_gradient = In("depth change per pixel, scene units")
    in_reprojection = In(REPROJECTION, optional=True)
    out_color = Out("rgba16f", "filtered: rgb: irradiance; a: standard deviation of its luminance")
    u_accumulated_variance = Uniform("float", "[0;1] variance of the accumulated colour in variances of one sample")
    u_sigma_z = Uniform("float", "> 0, depth edge-stopping")
    u_sigma_n = Uniform("float", "> 0, exponent of the normals' cosine")
    u_sigma_l = Uniform("float", "> 0, luminance edge-stopping in standard deviations")
    u_pixel_size = Uniform("float", "> 0, scene units a pixel is wide at depth 1")

    def __init__(self, p: Svgf, step: int, pixel_size: float, raw: bool = False) -> None:
        declared = self.ports.uniforms
        extra: dict[str, Any] = {}
        if "u_sigma_r" in declared:
            extra |= {"u_sigma_r": p.sigma_r, "u_reach": p.reach}
        if "u_normal_history" in declared:
            extra["u_normal_history"] = float(p.normal_history)
        super().__init__(
            defines={
                "STEP": step,
                "SIGMA_N_SQUARINGS": squarings(p.sigma_n),
                "LUMINANCE_STOP": int(p.variance_guided),
                "RAW": int(raw),
                **(GLOSSY if "u_sigma_r" in extra else {}),
                **({"GROWING": 1} if "u_normal_history" in extra else {}),
            },
            u_accumulated_variance=p.alpha / (2.0 - p.alpha),
            u_sigma_z=p.sigma_z,
            u_sigma_n=float(p.sigma_n),
            u_sigma_l=p.sigma_l * (p.first_sigma_l if step == 1 else 1.0),
            u_pixel_size=pixel_size,
            **extra,
        )


class GlossyAtrous(Atrous):
    """The same for specular light, in which only surfaces of the same roughness have a part.

    What a narrow lobe reflects has edges that no guide shows, and less noise than a wide one: the distance over which
    it is averaged grows with the lobe's width, as in NVIDIA's NRD.
    """

    in_specular_albedo = In(GLOSS)
    u_sigma_r = Uniform("float", "> 0, roughness edge-stopping")
    u_reach = Uniform("float", "> 0, pixels per squared roughness")


class AtrousGrowing(Atrous):
    """The same, but the exponent of the normals' cosine grows with the history."""

    in_length = In("w: length N of the history, frames")
    u_normal_history = Uniform("float", "> 0, frames until the exponent is u_sigma_n")


class GlossyAtrousGrowing(AtrousGrowing, GlossyAtrous):
    """Both."""


def squarings(exponent: int) -> int:
    """log2 of a power of two, -1 of any other number: squaring that often costs less than pow()."""
    count = exponent.bit_length() - 1
    return count if exponent == 1 << count else -1


def svgf(
    g: Graph,
    signals: dict[str, Tex],
    guides: Guides,
    p: Svgf,
    pixel_size: float,
    method: str = "svgf",
    changes: Mapping[str, Change] = MappingProxyType({}),
    specular_albedo: Tex | None = None,
) -> dict[str, Tex]:
    """Filter each of ``signals`` (noisy irradiance by name, "direct", "indirect", "specular", or "both" for all as
    one); returns the clean ones. ``specular_albedo`` (:data:`GLOSS`) steers the filter of specular light.

    ``method``: whose passes and histories these are. ``changes``: what is known of each signal's change of light.

    All of them share one reprojection. Histories are named by the set of signals, so that filtering them together
    after filtering them apart begins with a new history, as it must; and by whether the signals hold the albedo.
    """
    names = f"{method}." + "+".join(signals) + ("" if p.demodulate else ".radiance")
    with g.scope(method):
        found = reproject(g, guides, names, p, pixel_size) if p.temporal else None
        clean: dict[str, Tex] = {}
        for signal, noisy in signals.items():
            with g.scope(signal):
                change = changes.get(signal)
                gloss = specular_albedo if signal == "specular" else None
                name = f"{names}.{signal}"
                clean[signal] = _filter_signal(g, name, noisy, found, guides, p, pixel_size, change, gloss)
        return clean


def _filter_signal(
    g: Graph,
    name: str,
    noisy: Tex,
    reprojection: Tex | None,
    guides: Guides,
    p: Svgf,
    pixel_size: float,
    change: Change | None,
    gloss: Tex | None,
) -> Tex:
    history = g.history(name, "rgba16f") if reprojection is not None else None
    unfiltered, x, length = estimate(g, noisy, reprojection, history, guides, p, pixel_size, change, gloss)
    if history is not None and p.feedback < 0:
        g.feed(history, unfiltered)
    growing = p.normal_history > 0 and length is not None
    atrous = _WAVELETS[growing, gloss is not None]
    shape = {"in_surface": guides.surface, "in_gradient": guides.gradient}
    if gloss is not None:
        shape["in_specular_albedo"] = gloss
    if growing and length is not None:
        shape["in_length"] = length
    mean: dict[str, Tex] = {}
    if length is not None and p.variance_guided and p.accumulated_variance:
        mean = {"in_reprojection": length}
    for i in range(p.iterations):
        iteration = atrous(p, 1 << i, pixel_size, raw=x is noisy)
        x = g.add(iteration, f"atrous{i}", in_color=x, **shape, **(mean if i == 0 else {})).out_color
        if history is not None and i == p.feedback:
            g.feed(history, x)  # no copy: x is written into the history's other half
    return x


_WAVELETS: Final[dict[tuple[bool, bool], type[Atrous]]] = {
    (False, False): Atrous,
    (False, True): GlossyAtrous,
    (True, False): AtrousGrowing,
    (True, True): GlossyAtrousGrowing,
}
"""By whether the weight of normals grows with the history, and whether the light is specular."""
