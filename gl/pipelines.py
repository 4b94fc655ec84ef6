"""One function per denoiser, each reading from top to bottom like the figure in its paper; :func:`build` joins them.

Switching a stage off is a Python ``if`` here and a rebuild, never a branch in a shader.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from config import Config, Display, Svgf
from gl.graph import Graph, Tex
from gl.passes import display
from gl.passes.asvgf import Samples, asvgf, change_of
from gl.passes.bad_pixels import mark_bad
from gl.passes.bmfr import View, bmfr, part_count, thread_count
from gl.passes.exposure import auto_exposure
from gl.passes.firefly import reject_fireflies
from gl.passes.spatial import SPATIAL, spatial
from gl.passes.svgf import svgf
from gl.passes.taa import taa
from gl.passes.temporal import Guides, accumulate, reproject
from raytrace.frame import STANDARD_BASIS, STILL, Basis, CameraStep, FramePacket

DENOISERS = {
    "none": "the noisy frame, one path per pixel",
    "accumulate": "temporal accumulation alone",
    "svgf": "spatiotemporal variance-guided filtering (Schied et al. 2017)",
    "asvgf": "adaptive SVGF, which forgets light that has changed (Schied et al. 2018)",
    "bmfr": "blockwise multi-order feature regression (Koskela et al. 2019)",
    "gaussian": "Gaussian blur",
    "bilateral": "bilateral filter (Tomasi and Manduchi 1998)",
    "joint": "joint bilateral filter on depth and normals (Petschnigg et al. 2004)",
    "joint-separable": "joint bilateral filter, approximated by rows and columns (Pham and van Vliet 2005)",
    "atrous": "à-trous wavelet with edges set by hand (Dammertz et al. 2010)",
    "atrous-jitter": "à-trous wavelet with edges set by hand and few taps, drawn at random",
    "guided": "guided filter on depth and normals (He et al. 2010, Bauszat et al. 2011)",
    "reference": "mean of many paths per pixel of the same frame",
}
"""Name -> what it is. In the order of the window's keys."""

SECTIONS_OF: dict[str, tuple[str, ...]] = {
    "none": (),
    "accumulate": ("svgf",),
    "svgf": ("svgf",),
    "asvgf": ("asvgf",),
    "bmfr": ("bmfr",),
    **{denoiser: (denoiser.partition("-")[0], "spatial") for denoiser in SPATIAL},
    "reference": (),
}
"""Denoiser -> the configuration's sections that are its own, that with most of its parameters first."""


@dataclass(frozen=True)
class FrameTraits:
    """What the graph needs to know of a frame besides its textures.

    ``moving``: objects move, so there is a ``frame.prev_normal``. ``specular``: something is metallic or glossy, so
    there are a ``frame.specular`` and a ``frame.specular_albedo``. ``pixel_size``: scene units a pixel is wide at depth
    1. ``basis``, ``jitter``, ``index``, ``camera_step``: as in the :class:`FramePacket`. ``software``: the renderer
    runs on the CPU.
    """

    moving: bool = False
    pixel_size: float = 1e-3
    basis: Basis = STANDARD_BASIS
    jitter: tuple[float, float] = (0.0, 0.0)
    index: int = 0
    software: bool = True
    specular: bool = False
    camera_step: CameraStep | None = STILL

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
            specular=packet.specular is not None,
            camera_step=packet.camera_step,
        )


Builder = Callable[[Graph, Config, FrameTraits], Tex]
"""Adds a denoiser to a graph and returns the radiance."""


class Signals:
    """The frame's noisy illumination, without its fireflies if that is asked for, and what turns it into radiance.

    ``specular``, ``specular_albedo``: None where ``traits`` say that nothing is metallic or glossy.
    """

    def __init__(self, g: Graph, config: Config, traits: FrameTraits) -> None:
        def noisy(name: str) -> Tex:
            sample = g.import_(f"frame.{name}", "rgba32f")
            return reject_fireflies(g, name, sample, config.firefly, config.display.exposure)

        self.direct = noisy("direct")
        self.indirect = noisy("indirect")
        self.albedo = g.import_("frame.albedo", "rgba32f")
        self.emission = g.import_("frame.emission", "rgba32f")
        self.specular = noisy("specular") if traits.specular else None
        self.specular_albedo = g.import_("frame.specular_albedo", "rgba32f") if traits.specular else None

    @property
    def gloss(self) -> dict[str, Tex]:
        """Ports of a pass that takes the specular part of the surface, too: its noisy signal and its albedo."""
        return named(in_specular=self.specular, in_specular_albedo=self.specular_albedo)

    @property
    def albedos(self) -> dict[str, Tex]:
        """Ports of the divisors of :meth:`together`."""
        return named(in_albedo=self.albedo, in_specular_albedo=self.specular_albedo)

    def together(self, g: Graph, demodulate: bool = True) -> Tex:
        """All signals as one: divided by the surface's whole albedo, or unless ``demodulate`` as radiance."""
        diffuse = {"in_direct": self.direct, "in_indirect": self.indirect}
        if not demodulate:
            return display.combine(g, "combine", **diffuse, in_albedo=self.albedo, **self.gloss)
        if not self.gloss:
            return display.combine(g, "combine", **diffuse)
        return g.add(display.Total(), **diffuse, in_albedo=self.albedo, **self.gloss).out_color


def named(**textures: Tex | None) -> dict[str, Tex]:
    """Those that there are, by port."""
    return {port: texture for port, texture in textures.items() if texture is not None}


def _none(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    s = Signals(g, config, traits)
    diffuse = {"in_direct": s.direct, "in_indirect": s.indirect, "in_albedo": s.albedo}
    return display.modulate(g, **diffuse, in_emission=s.emission, **s.gloss)


def _accumulate(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    s = Signals(g, config, traits)
    both = s.together(g)
    with g.scope("accumulate"):
        found = reproject(g, Guides(g, traits.moving), "accumulate", config.svgf, traits.pixel_size)
        # Single precision: a running mean over hundreds of frames adds steps that a half would round away.
        history = g.history("accumulate.color", "rgba32f")
        mean, _ = accumulate(g, both, found, history, config.svgf, fmt="rgba32f", clamp=config.svgf.clamp)
        g.feed(history, mean)
    return display.modulate(g, in_direct=mean, in_emission=s.emission, **s.albedos)


def _svgf(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    p = config.svgf

    def work(signals: dict[str, Tex], s: Signals) -> dict[str, Tex]:
        return svgf(g, signals, Guides(g, traits.moving), p, traits.pixel_size, specular_albedo=s.specular_albedo)

    return _by_signals(g, Signals(g, config, traits), p, work)


def _asvgf(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    p = config.asvgf

    def work(signals: dict[str, Tex], s: Signals) -> dict[str, Tex]:
        noisy, guides = (s.direct, s.indirect), Guides(g, traits.moving)
        return asvgf(g, signals, noisy, guides, p, traits.pixel_size, s.specular_albedo)

    return _by_signals(g, Signals(g, config, traits), p, work)


def _by_signals(g: Graph, s: Signals, p: Svgf, work: Callable[[dict[str, Tex], Signals], dict[str, Tex]]) -> Tex:
    """Split the light into the signals that ``p`` wants, let ``work`` filter them, and put them together again."""
    if not p.separate:
        clean = work({"both": s.together(g, p.demodulate)}, s)["both"]
        albedos = s.albedos if p.demodulate else {}
        return display.modulate(g, in_direct=clean, in_emission=s.emission, **albedos)
    signals, albedos = named(direct=s.direct, indirect=s.indirect, specular=s.specular), s.albedos
    if not p.demodulate:
        factors = {"direct": s.albedo, "indirect": s.albedo, "specular": s.specular_albedo}
        signals = {
            name: display.combine(g, f"modulate_{name}", in_direct=noisy, **named(in_albedo=factors[name]))
            for name, noisy in signals.items()
        }
        albedos = {}
    clean_signals = {f"in_{name}": texture for name, texture in work(signals, s).items()}
    return display.modulate(g, **clean_signals, in_emission=s.emission, **albedos)


def _bmfr(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    s, p = Signals(g, config, traits), config.bmfr
    if not traits.specular:  # one roughness for all: a second constant
        p = replace(p, features=",".join(name for name in p.features.split(",") if name != "roughness"))
    threads = thread_count(p.features, traits.software, part_count(p))
    step = None if p.follow_motion or not traits.moving else traits.camera_step
    view = View(traits.basis, traits.jitter, traits.pixel_size, traits.index, threads, step)
    guides, features = Guides(g, traits.moving), named(albedo=s.albedo, roughness=s.specular_albedo)
    signals, albedos = {"direct": s.direct, "indirect": s.indirect}, s.albedos
    second: dict[str, Tex] = {}

    def change(samples: Samples, method: str = "bmfr") -> Tex | None:
        if not (p.adaptive and p.temporal):
            return None
        with g.scope(method):
            gradients = replace(config.asvgf, gain=p.gain)
            return change_of(g, samples, guides, gradients, traits.pixel_size, joint=len(samples.light) > 1)

    samples = Samples((s.direct, s.indirect))
    if not p.demodulate:
        signals, albedos = {"direct": s.together(g, demodulate=False)}, {}
        samples = samples if s.specular is None else Samples.whole(signals["direct"])
    elif s.specular is not None and p.separate:
        apart, name = {"direct": s.specular}, "bmfr.specular"
        second["in_specular"] = bmfr(
            g, apart, features, guides, p, view, name, change(Samples.specular(s.specular), name)
        )
    elif s.specular is not None:
        signals = {"direct": s.together(g)}
        samples = Samples.whole(signals["direct"])
    clean = bmfr(g, signals, features, guides, p, view, change=change(samples))
    return display.modulate(g, in_direct=clean, in_emission=s.emission, **second, **albedos)


def _spatial(denoiser: str) -> Builder:
    """What builds a filter in space, by its name."""

    def builder(g: Graph, config: Config, traits: FrameTraits) -> Tex:
        s, demodulate = Signals(g, config, traits), config.spatial.demodulate
        noisy = {"in_direct": s.direct, "in_indirect": s.indirect, **({} if demodulate else {"in_albedo": s.albedo})}
        if s.gloss:
            noisy = {"in_direct": s.together(g, demodulate)}
        clean = spatial(g, denoiser, noisy, Guides(g, traits.moving), config, traits.pixel_size, traits.index)
        return display.modulate(g, in_direct=clean, in_emission=s.emission, **(s.albedos if demodulate else {}))

    return builder


def _reference(g: Graph, config: Config, traits: FrameTraits) -> Tex:
    return g.import_("frame.reference", "rgba32f")


_BUILDERS: dict[str, Builder] = {
    "none": _none,
    "accumulate": _accumulate,
    "svgf": _svgf,
    "asvgf": _asvgf,
    "bmfr": _bmfr,
    **{denoiser: _spatial(denoiser) for denoiser in SPATIAL},
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
        marked = mark_bad(g, color, radiance, {} if denoiser == "reference" else _samples(g, traits))
        color = marked.out_color
        g.output("bad", marked.out_count)
    g.output("display", g.add(display.Encode(), in_color=color).out_color)
    if split:
        g.output("noisy", _noisy(g, p, traits, exposure))
    return g


def remembered(config: Config, denoiser: str) -> str:
    """Which pixels the tracer is to remember for ``denoiser``: one of :data:`raytrace.gradients.RULES`, "" for none."""
    wanted = {"asvgf": config.asvgf.temporal, "bmfr": config.bmfr.adaptive and config.bmfr.temporal}.get(
        denoiser, False
    )
    return config.asvgf.remember if wanted else ""


def _samples(g: Graph, traits: FrameTraits) -> dict[str, Tex]:
    """The noisy illumination as it came, before anything rejects a part of it."""
    names = ("direct", "indirect", *(("specular",) if traits.specular else ()))
    return {f"in_{name}": g.import_(f"frame.{name}", "rgba32f") for name in names}


def _noisy(g: Graph, p: Display, traits: FrameTraits, exposure: Tex | None) -> Tex:
    """The frame as it came, made ready for the screen: what the filtered one is compared with."""
    with g.scope("noisy"):
        names = ("albedo", "emission", *(("specular_albedo",) if traits.specular else ()))
        factors = {f"in_{name}": g.import_(f"frame.{name}", "rgba32f") for name in names}
        modulated = display.modulate(g, **_samples(g, traits), **factors)
        color = display.tonemap(g, modulated, p, exposure)
        if p.mark_bad == "on":
            color = mark_bad(g, color, modulated, {}).out_color
        return g.add(display.Encode(), in_color=color).out_color
