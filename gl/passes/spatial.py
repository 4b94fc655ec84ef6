"""Filters in space on their own, the baselines: every one of them is d(p) = Σ w c / Σ w with another weight w.

* **Gaussian**: w falls with distance only.
* **Bilateral** (Tomasi and Manduchi 1998, "Bilateral Filtering for Gray and Color Images"): and with the difference of
  colour, which noise has as well as edges.
* **Joint bilateral** (Petschnigg et al. 2004, "Digital Photography with Flash and No-Flash Image Pairs"; Eisemann and
  Durand 2004): with the difference of noise-free guides instead, here of depth and normal by the weights of Schied et
  al. 2017, sec. 4.4. Its separable approximation (Pham and van Vliet 2005) filters rows, then columns.
* **À-trous** (Dammertz et al. 2010, "Edge-Avoiding À-Trous Wavelet Transform for Fast Global Illumination Filtering"):
  five iterations of few taps, farther and farther apart, and besides a weight of luminance, set by hand and halved in
  every iteration; all 24 taps around the centre, or some drawn at random.
* The guided filter is in :mod:`gl.passes.guided`.

They filter the sum of direct and indirect light, this frame's before it is blended with the history, or what was
blended (``spatial.order``). With SVGF's weights and without its variance, they show what the variance is good for.

Deviations from the papers:

* Pixels without a finite sample and without a surface take no part, and the others are averaged without them.
* Dammertz et al. weigh positions instead of depths, and squared distances of colour; the weights here are SVGF's, so
  that the two differ in nothing but the variance.
* Random taps are not in the papers. Each iteration draws its taps with the kernel's own probability, so that their
  weights are alike, and moves them within the gap before the next tap, so that no pixel is skipped for ever.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from config import Config
from gl.graph import FragmentPass, Graph, In, Out, Tex, Uniform
from gl.passes.guided import guided
from gl.passes.temporal import SAMPLE as COLOR
from gl.passes.temporal import Guides, blend, reproject

ROW = "rgb: mean along the row; a: weight that was there, of all that there might be"
SURFACE = "xyz: shading normal, world; w: depth, scene units"
GRADIENT = "depth change per pixel, scene units"

REACH: Final = 3.0
"""Half the side of a window in widths (standard deviations) of its Gaussian: 1 % of the weight is at its edge."""


class Sample(FragmentPass):
    """Direct and indirect light together, and where there is any."""

    shader = "spatial/sample.frag"
    in_direct = In("irradiance")
    in_indirect = In("irradiance, to be added", optional=True)
    in_surface = In(SURFACE)
    in_albedo = In("divisor of the irradiance, where the filter is to see it", optional=True)
    out_color = Out("rgba16f", COLOR)


class Gaussian(FragmentPass):
    """Gaussian blur; ``AXIS`` 0: whole, 1: rows, 2: columns."""

    shader = "spatial/gaussian.frag"
    in_color = In(COLOR)
    in_surface = In(SURFACE)
    in_sample = In("what is filtered, for pixels on no surface; of the columns only", optional=True)
    out_color = Out("rgba16f", COLOR)
    u_radius = Uniform("int", "> 0, half the window's side, pixels")
    u_sigma_d = Uniform("float", "> 0, width of the Gaussian, pixels")


class Bilateral(FragmentPass):
    """Bilateral filter."""

    shader = "spatial/bilateral.frag"
    in_color = In(COLOR)
    in_surface = In(SURFACE)
    out_color = Out("rgba16f", COLOR)
    u_radius = Uniform("int", "> 0, half the window's side, pixels")
    u_sigma_d = Uniform("float", "> 0, width of the Gaussian, pixels")
    u_sigma_r = Uniform("float", "> 0, tolerance for colour, irradiance")


class JointBilateral(FragmentPass):
    """Joint bilateral filter; ``AXIS`` 0: whole, 1: rows, 2: columns."""

    shader = "spatial/joint.frag"
    in_color = In(COLOR)
    in_surface = In(SURFACE)
    in_gradient = In(GRADIENT)
    out_color = Out("rgba16f", COLOR)
    u_radius = Uniform("int", "> 0, half the window's side, pixels")
    u_sigma_d = Uniform("float", "> 0, width of the Gaussian, pixels")
    u_sigma_z = Uniform("float", "> 0, depth edge-stopping")
    u_sigma_n = Uniform("float", "> 0, exponent of the normals' cosine")
    u_pixel_size = Uniform("float", "> 0, scene units a pixel is wide at depth 1")


class AtrousByHand(FragmentPass):
    """One iteration of the wavelet, 5x5 taps at a distance of ``STEP`` pixels, or ``TAPS`` of them drawn at random."""

    shader = "spatial/atrous.frag"
    in_color = In(COLOR)
    in_surface = In(SURFACE)
    in_gradient = In(GRADIENT)
    out_color = Out("rgba16f", COLOR)
    u_sigma_z = Uniform("float", "> 0, depth edge-stopping")
    u_sigma_n = Uniform("float", "> 0, exponent of the normals' cosine")
    u_sigma_l = Uniform("float", "> 0, tolerance for luminance, irradiance")
    u_pixel_size = Uniform("float", "> 0, scene units a pixel is wide at depth 1")
    u_seed = Uniform("uint", "of the taps, another one for each frame and iteration")


def window(sigma_d: float) -> dict[str, Any]:
    """The parameters of a window that holds a Gaussian of width ``sigma_d``, pixels."""
    return {"u_radius": math.ceil(REACH * sigma_d), "u_sigma_d": sigma_d}


class Filter:
    """A filter with what it needs to be added anywhere: guides, parameters, and the frame's number ``index``."""

    def __init__(self, guides: Guides, config: Config, pixel_size: float, index: int) -> None:
        self._guides, self._config, self._pixel_size, self._index = guides, config, pixel_size, index

    def add(self, g: Graph, denoiser: str, color: Tex) -> Tex:
        """Filter ``color`` as ``denoiser``, a key of :data:`SPATIAL`, does; returns the filtered one."""
        return SPATIAL[denoiser](self, g, color)

    @property
    def _surface(self) -> dict[str, Tex]:
        return {"in_surface": self._guides.surface}

    @property
    def _shape(self) -> dict[str, Tex]:
        return {**self._surface, "in_gradient": self._guides.gradient}

    @property
    def _edges(self) -> dict[str, Any]:
        p = self._config.spatial
        return {"u_sigma_z": p.sigma_z, "u_sigma_n": float(p.sigma_n), "u_pixel_size": self._pixel_size}

    def gaussian(self, g: Graph, color: Tex) -> Tex:
        p, sample = self._config.gaussian, color
        for name, axis in _axes(p.separable):
            work = Gaussian(**window(p.sigma_d), defines={"AXIS": axis})
            columns = {"in_sample": sample} if name == "columns" else {}
            color = g.add(work, name, in_color=color, **self._surface, **columns).out_color
        return color

    def bilateral(self, g: Graph, color: Tex) -> Tex:
        p = self._config.bilateral
        return g.add(Bilateral(**window(p.sigma_d), u_sigma_r=p.sigma_r), in_color=color, **self._surface).out_color

    def joint(self, g: Graph, color: Tex, separable: bool = False) -> Tex:
        for name, axis in _axes(separable):
            work = JointBilateral(**window(self._config.joint.sigma_d), **self._edges, defines={"AXIS": axis})
            color = g.add(work, name, in_color=color, **self._shape).out_color
        return color

    def joint_separable(self, g: Graph, color: Tex) -> Tex:
        return self.joint(g, color, separable=True)

    def atrous(self, g: Graph, color: Tex, taps: int = 0) -> Tex:
        p = self._config.atrous
        for i in range(p.iterations):
            work = AtrousByHand(
                **self._edges,
                u_sigma_l=p.sigma_l * (0.5**i if p.halve else 1.0),
                u_seed=8 * self._index + i,
                defines={"STEP": 1 << i, "TAPS": taps},
            )
            color = g.add(work, f"atrous{i}", in_color=color, **self._shape).out_color
        return color

    def atrous_jitter(self, g: Graph, color: Tex) -> Tex:
        return self.atrous(g, color, self._config.atrous.taps)

    def guided(self, g: Graph, color: Tex) -> Tex:
        return guided(g, color, self._guides.surface, self._config.guided, self._pixel_size)


SPATIAL: Final[dict[str, Callable[[Filter, Graph, Tex], Tex]]] = {
    "gaussian": Filter.gaussian,
    "bilateral": Filter.bilateral,
    "joint": Filter.joint,
    "joint-separable": Filter.joint_separable,
    "atrous": Filter.atrous,
    "atrous-jitter": Filter.atrous_jitter,
    "guided": Filter.guided,
}
"""Denoiser -> what adds its passes."""


def _axes(separable: bool) -> tuple[tuple[str, int], ...]:
    return (("rows", 1), ("columns", 2)) if separable else (("window", 0),)


def spatial(
    g: Graph, denoiser: str, signals: dict[str, Tex], guides: Guides, config: Config, pixel_size: float, index: int
) -> Tex:
    """Add the filter ``denoiser``; returns the clean sum of ``signals``.

    ``signals``: inputs of :class:`Sample`. ``index``: the frame's number. Histories are named by the method, and by
    whether the albedo is in them.
    """
    p, work = config.spatial, Filter(guides, config, pixel_size, index)
    name = denoiser + ("" if p.demodulate else ".radiance")
    with g.scope(denoiser):
        color = g.add(Sample(), in_surface=guides.surface, **signals).out_color
        if not p.temporal:
            return work.add(g, denoiser, color)
        found = reproject(g, guides, name, p, pixel_size)
        history, last = g.history(name, "rgba16f"), p.order == "filter-first"
        if last:
            color = work.add(g, denoiser, color)
        blended = blend(g, color, found, history, p.alpha)
        g.feed(history, blended)
        return blended if last else work.add(g, denoiser, blended)
