"""One function per denoiser, each reading from top to bottom like the figure in its paper; :func:`build` joins them.

Switching a stage off is a Python ``if`` here and a rebuild, never a branch in a shader.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from config import Config, Display, Svgf
from gl.graph import Graph, Tex
from gl.passes import display
from gl.passes.asvgf import asvgf, change_of
from gl.passes.bad_pixels import mark_bad
from gl.passes.bmfr import View, bmfr, part_count, thread_count
from gl.passes.exposure import auto_exposure
from gl.passes.firefly import reject_fireflies
from gl.passes.svgf import svgf
from gl.passes.taa import taa
from gl.passes.temporal import Guides, accumulate, reproject
from raytrace.frame import STANDARD_BASIS, Basis, FramePacket

DENOISERS = {
    "none": "the noisy frame, one path per pixel",
    "accumulate": "temporal accumulation alone",
    "svgf": "spatiotemporal variance-guided filtering (Schied et al. 2017)",
    "asvgf": "adaptive SVGF, which forgets light that has changed (Schied et al. 2018)",
    "bmfr": "blockwise multi-order feature regression (Koskela et al. 2019)",
    "reference": "mean of many paths per pixel of the same frame",
}
"""Name -> what it is. In the order of the window's keys."""


@dataclass(frozen=True)
class FrameTraits:
    """What the graph needs to know of a frame besides its textures.

    ``moving``: objects move, so there is a ``frame.prev_normal``. ``pixel_size``: scene units a pixel is wide at depth
    1. ``basis``, ``jitter``, ``index``: as in the :class:`FramePacket`. ``software``: the renderer
    runs on the CPU.
    """

    moving: bool = False
    pixel_size: float = 1e-3
    basis: Basis = STANDARD_BASIS
    jitter: tuple[float, float] = (0.0, 0.0)
    index: int = 0
    software: bool = True

    @staticmethod
    def of(packet: FramePacket, software: bool = True) -> FrameTraits:
        """What the graph needs to know of ``packet``."""
        return FrameTraits(
            moving=packet.prev_normal is not None,
            pixel_size=packet.pixel_size,
            basis=packet.basis,
            jitter=packet.jitter,
            index=packet.index,
            software=software,
        )


class Signals:
    """The frame's noisy illumination, without its fireflies if that is asked for, and what turns it into radiance."""

    def __init__(self, g: Graph, config: Config) -> None:
        def noisy(name: str) -> Tex:
            sample = g.import_(f"frame.{name}", "rgba32f")
            return reject_fireflies(g, name, sample, config.firefly, config.display.exposure)

        self.direct = noisy("direct")
        self.indirect = noisy("indirect")
        self.albedo = g.import_("frame.albedo", "rgba32f")
        self.emission = g.import_("frame.emission", "rgba32f")


def _none(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    s = Signals(g, config)
    return g.add(
        display.Modulate(), in_direct=s.direct, in_indirect=s.indirect, in_albedo=s.albedo, in_emission=s.emission
    ).out_radiance


def _accumulate(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    s = Signals(g, config)
    both = g.add(display.Combine(), in_direct=s.direct, in_indirect=s.indirect).out_color
    with g.scope("accumulate"):
        found = reproject(g, Guides(g, traits.moving), "accumulate", config.svgf, traits.pixel_size)
        # Single precision: a running mean over hundreds of frames adds steps that a half would round away.
        history = g.history("accumulate.color", "rgba32f")
        mean, _ = accumulate(g, both, found, history, config.svgf, fmt="rgba32f", clamp=config.svgf.clamp)
        g.feed(history, mean)
    return g.add(display.Modulate(), in_direct=mean, in_albedo=s.albedo, in_emission=s.emission).out_radiance


def _svgf(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    p = config.svgf

    def work(signals: dict[str, Tex], noisy: tuple[Tex, Tex]) -> dict[str, Tex]:
        return svgf(g, signals, Guides(g, traits.moving), p, traits.pixel_size)

    return _by_signals(g, Signals(g, config), p, work)


def _asvgf(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    p = config.asvgf

    def work(signals: dict[str, Tex], noisy: tuple[Tex, Tex]) -> dict[str, Tex]:
        return asvgf(g, signals, noisy, Guides(g, traits.moving), p, traits.pixel_size)

    return _by_signals(g, Signals(g, config), p, work)


def _by_signals(
    g: Graph, s: Signals, p: Svgf, work: Callable[[dict[str, Tex], tuple[Tex, Tex]], dict[str, Tex]]
) -> Tex:
    """Split the light into the signals that ``p`` wants, let ``work`` filter them, and put them together again."""
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
    clean = list(work(signals, (s.direct, s.indirect)).values())
    second = {"in_indirect": clean[1]} if p.separate else {}
    return g.add(display.Modulate(), in_direct=clean[0], in_emission=s.emission, **second, **albedo_after).out_radiance


def _bmfr(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    s, p = Signals(g, config), config.bmfr
    threads = thread_count(p.features, traits.software, part_count(p))
    view = View(traits.basis, traits.jitter, traits.pixel_size, traits.index, threads)
    signals, albedo_after = {"direct": s.direct, "indirect": s.indirect}, {"in_albedo": s.albedo}
    if not p.demodulate:
        both = g.add(display.Combine(), in_direct=s.direct, in_indirect=s.indirect, in_albedo=s.albedo).out_color
        signals, albedo_after = {"direct": both}, {}
    guides, change = Guides(g, traits.moving), None
    if p.adaptive and p.temporal:
        with g.scope("bmfr"):
            gradients = replace(config.asvgf, gain=p.gain)
            change = change_of(g, s.direct, s.indirect, guides, gradients, traits.pixel_size, joint=True)
    clean = bmfr(g, signals, s.albedo, guides, p, view, change)
    return g.add(display.Modulate(), in_direct=clean, in_emission=s.emission, **albedo_after).out_radiance


def _reference(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    return g.import_("frame.reference", "rgba32f")


_BUILDERS: dict[str, Callable[[Graph, Config, FrameTraits], Tex]] = {
    "none": _none,
    "accumulate": _accumulate,
    "svgf": _svgf,
    "asvgf": _asvgf,
    "bmfr": _bmfr,
    "reference": _reference,
}


def build(config: Config, denoiser: str, traits: FrameTraits, split: bool = False) -> Graph:
    """The graph of one frame.

    Outputs: ``radiance`` (linear, before anti-aliasing) and ``display`` (8-bit sRGB); where bad pixels are marked,
    ``bad``, their number by tiles (:class:`gl.passes.bad_pixels.MarkBad`); with ``split``, ``noisy``: the frame as it
    came, exposed and encoded like ``display``.

    ``denoiser``: a key of :data:`DENOISERS`. The noisy frame and the reference are shown as they are: no anti-aliasing
    over time.
    """
    g = Graph()
    p = config.display
    radiance = _BUILDERS[denoiser](g, config, traits)
    g.output("radiance", radiance)
    exposure = auto_exposure(g, radiance, p) if p.auto_exposure else None
    color = display.tonemap(g, radiance, p, exposure)
    if config.taa.enabled and denoiser not in ("none", "reference"):
        color = taa(g, color, Guides(g, traits.moving), config.taa, denoiser)
    if p.mark_bad == "on":
        marked = mark_bad(g, color, radiance, {} if denoiser == "reference" else _samples(g))
        color = marked.out_color
        g.output("bad", marked.out_count)
    g.output("display", g.add(display.Encode(), in_color=color).out_color)
    if split:
        g.output("noisy", _noisy(g, p, exposure))
    return g


def remembered(config: Config, denoiser: str) -> str:
    """Which pixels the tracer is to remember for ``denoiser``: one of :data:`raytrace.gradients.RULES`, "" for none."""
    wanted = {"asvgf": config.asvgf.temporal, "bmfr": config.bmfr.adaptive and config.bmfr.temporal}.get(
        denoiser, False
    )
    return config.asvgf.remember if wanted else ""


def _samples(g: Graph) -> dict[str, Tex]:
    """The noisy illumination as it came, before anything rejects a part of it."""
    return {f"in_{name}": g.import_(f"frame.{name}", "rgba32f") for name in ("direct", "indirect")}


def _noisy(g: Graph, p: Display, exposure: Tex | None) -> Tex:
    """The frame as it came, made ready for the screen: what the filtered one is compared with."""
    with g.scope("noisy"):
        albedo, emission = (g.import_(f"frame.{name}", "rgba32f") for name in ("albedo", "emission"))
        modulated = g.add(display.Modulate(), **_samples(g), in_albedo=albedo, in_emission=emission)
        color = display.tonemap(g, modulated.out_radiance, p, exposure)
        if p.mark_bad == "on":
            color = mark_bad(g, color, modulated.out_radiance, {}).out_color
        return g.add(display.Encode(), in_color=color).out_color
