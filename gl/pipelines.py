"""One function per denoiser, each reading from top to bottom like the figure in its paper; :func:`build` joins them.

Switching a stage off is a Python ``if`` here and a rebuild, never a branch in a shader.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from config import Config
from gl.graph import Graph, Tex
from gl.passes import display
from gl.passes.svgf import svgf
from gl.passes.taa import taa
from gl.passes.temporal import Guides, accumulate, reproject

DENOISERS = {
    "none": "the noisy frame, one path per pixel",
    "accumulate": "temporal accumulation alone",
    "svgf": "spatiotemporal variance-guided filtering (Schied et al. 2017)",
    "reference": "mean of many paths per pixel of the same frame",
}
"""Name -> what it is. In the order of the window's keys."""


@dataclass(frozen=True)
class FrameTraits:
    """What the graph needs to know of a frame besides its textures.

    ``moving``: objects move, so there is a ``frame.prev_normal``. ``pixel_size``: scene units a pixel is wide at depth
    1.
    """

    moving: bool = False
    pixel_size: float = 1e-3


class Signals:
    """The frame's noisy illumination and what turns it into radiance."""

    def __init__(self, g: Graph) -> None:
        self.direct = g.import_("frame.direct", "rgba32f")
        self.indirect = g.import_("frame.indirect", "rgba32f")
        self.albedo = g.import_("frame.albedo", "rgba32f")
        self.emission = g.import_("frame.emission", "rgba32f")


def _none(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    s = Signals(g)
    return g.add(
        display.Modulate(), in_direct=s.direct, in_indirect=s.indirect, in_albedo=s.albedo, in_emission=s.emission
    ).out_radiance


def _accumulate(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    s = Signals(g)
    both = g.add(display.Combine(), in_direct=s.direct, in_indirect=s.indirect).out_color
    with g.scope("accumulate"):
        found = reproject(g, Guides(g, traits.moving), "accumulate", config.svgf, traits.pixel_size)
        # Single precision: a running mean over hundreds of frames adds steps that a half would round away.
        history = g.history("accumulate.color", "rgba32f")
        mean, _ = accumulate(g, both, found, history, config.svgf, fmt="rgba32f")
        g.feed(history, mean)
    return g.add(display.Modulate(), in_direct=mean, in_albedo=s.albedo, in_emission=s.emission).out_radiance


def _svgf(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    s, p = Signals(g), config.svgf
    albedo_before = {} if p.demodulate else {"in_albedo": s.albedo}
    albedo_after = {"in_albedo": s.albedo} if p.demodulate else {}
    if p.separate:
        signals = {"direct": s.direct, "indirect": s.indirect}
        if albedo_before:
            signals = {
                name: g.add(display.Combine(), f"modulate_{name}", in_direct=noisy, **albedo_before).out_color
                for name, noisy in signals.items()
            }
    else:
        both = g.add(display.Combine(), in_direct=s.direct, in_indirect=s.indirect, **albedo_before).out_color
        signals = {"both": both}
    clean = list(svgf(g, signals, Guides(g, traits.moving), p, traits.pixel_size).values())
    second = {"in_indirect": clean[1]} if p.separate else {}
    return g.add(display.Modulate(), in_direct=clean[0], in_emission=s.emission, **second, **albedo_after).out_radiance


def _reference(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    return g.import_("frame.reference", "rgba32f")


_BUILDERS: dict[str, Callable[[Graph, Config, FrameTraits], Tex]] = {
    "none": _none,
    "accumulate": _accumulate,
    "svgf": _svgf,
    "reference": _reference,
}


def build(config: Config, denoiser: str, traits: FrameTraits) -> Graph:
    """The graph of one frame. Outputs: ``radiance`` (linear, before anti-aliasing) and ``display`` (8-bit sRGB).

    ``denoiser``: a key of :data:`DENOISERS`. The noisy frame and the reference are shown as they are: no anti-aliasing
    over time.
    """
    g = Graph()
    radiance = _BUILDERS[denoiser](g, config, traits)
    g.output("radiance", radiance)
    color = display.tonemap(g, radiance, config.display)
    if config.taa.enabled and denoiser not in ("none", "reference"):
        color = taa(g, color, Guides(g, traits.moving), config.taa, denoiser)
    g.output("display", g.add(display.Encode(), in_color=color).out_color)
    return g
