"""The methods that are measured, one line each: denoisers with settings, and what is compared with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from config import SECTIONS, Config, apply_preset
from gl.pipelines import DENOISERS
from gl.renderer import Renderer
from parameter import from_override

NewRenderer = Callable[[], Renderer]
"""Makes a renderer that is the caller's to release."""

PATH_TRACING = "path tracing"
"""Name and group of the alternative to all filters: more paths in the same time."""


@dataclass(frozen=True)
class Method:
    """A denoiser of gl/pipelines.py with what differs from the user's parameters. ``separate`` None: it has none.

    ``preset``: of the denoiser's section, its values win over the user's; empty: the user's stand. ``settings``:
    ``section.key=value``, applied last. ``group``: under which heading it stands; ``stage``: a variant that shows what
    one stage or choice of the method is worth, in the report but in no short table. ``quality``: that of Open Image
    Denoise, which is no denoiser of ours.
    """

    name: str
    denoiser: str
    taa: bool = False
    separate: bool | None = None
    preset: str = ""
    settings: tuple[str, ...] = ()
    group: str = ""
    stage: bool = False
    quality: str = ""

    def configure(self, config: Config) -> Config:
        """``config`` as this method needs it."""
        if self.preset:
            config = apply_preset(config, self.denoiser, self.preset)
        svgf = config.svgf
        if self.separate is not None:
            svgf = replace(svgf, separate=self.separate)
        config = replace(config, svgf=svgf, taa=replace(config.taa, enabled=self.taa))
        for text in self.settings:
            section, key, value = from_override(text, SECTIONS)
            changed: dict[str, Any] = {section: replace(getattr(config, section), **{key: value})}
            config = replace(config, **changed)
        return config

    @property
    def described(self) -> str:
        """What sets it apart, as one would write it on the command line."""
        if self.quality:
            return f"Open Image Denoise, quality {self.quality}, clean albedo and normal"
        parts = [f"--denoiser {self.denoiser}"]
        if self.preset:
            parts.append(f"--set {self.denoiser}.preset={self.preset}")
        if self.separate is not None:
            parts.append(f"--set svgf.separate={str(self.separate).lower()}")
        parts += [f"--set {text}" for text in self.settings]
        if not self.taa and self.denoiser != "none":
            parts.append("--set taa.enabled=false")
        return " ".join(parts)


def _svgf(name: str, *settings: str, separate: bool = False) -> Method:
    """A variant of the full filter of one signal."""
    return Method(f"SVGF {name}", "svgf", separate=separate, settings=settings, group="SVGF", stage=True)


def _bmfr(name: str, *settings: str) -> Method:
    return Method(f"BMFR {name}", "bmfr", settings=settings, group="BMFR", stage=True)


NOISY = Method("noisy", "none", group="baseline")
ONE_SIGNAL = Method("SVGF, one signal", "svgf", separate=False, group="SVGF")
APART = Method("SVGF, direct and indirect", "svgf", separate=True, group="SVGF")
ONE_SIGNAL_TAA = replace(ONE_SIGNAL, name=f"{ONE_SIGNAL.name} + TAA", taa=True)
APART_TAA = replace(APART, name=f"{APART.name} + TAA", taa=True)
BMFR = Method("BMFR", "bmfr", group="BMFR")
BMFR_TAA = replace(BMFR, name=f"{BMFR.name} + TAA", taa=True)
BMFR_PAPER = Method("BMFR as published", "bmfr", preset="paper", group="BMFR")
_LISTED = (
    NOISY,
    Method("accumulation", "accumulate", group="baseline"),
    Method("accumulation, the papers' share", "accumulate", settings=("svgf.alpha=0.2",), group="baseline"),
    ONE_SIGNAL,
    ONE_SIGNAL_TAA,
    APART,
    APART_TAA,
    Method("SVGF as published", "svgf", separate=True, preset="paper", group="SVGF"),
    Method("SVGF, reference constants", "svgf", separate=False, preset="reference", group="SVGF"),
    BMFR,
    BMFR_TAA,
    BMFR_PAPER,
    Method("BMFR, reference constants", "bmfr", preset="reference", group="BMFR"),
    Method("A-SVGF", "asvgf", group="A-SVGF"),
    Method("BMFR, adaptive", "bmfr", settings=("bmfr.adaptive=true",), group="BMFR"),
    # Filters in space, over time before or after, as baselines.
    Method("Gaussian blur", "gaussian", group="spatial"),
    Method("bilateral filter", "bilateral", group="spatial"),
    Method("joint bilateral filter", "joint", group="spatial"),
    Method("joint bilateral, separable", "joint-separable", group="spatial"),
    Method("à-trous, edges by hand", "atrous", group="spatial"),
    Method("à-trous, random taps", "atrous-jitter", group="spatial"),
    Method("guided filter", "guided", group="spatial"),
    *(
        Method(f"{name}, blended first", name, settings=("spatial.order=blend-first",), group="spatial", stage=True)
        for name in ("gaussian", "joint", "atrous", "guided")
    ),
    Method("joint, frames alone", "joint", settings=("spatial.temporal=false",), group="spatial", stage=True),
    # Every estimator of the variance that steers SVGF.
    *(
        _svgf(f"with variance {name}", f"svgf.variance={name}")
        for name in ("raw-mean", "welford", "welford-mean", "spatial", "spatial-temporal", "exaggerated")
    ),
    # Each stage switched off in turn, and choices the other way.
    _svgf("without accumulation", "svgf.temporal=false"),
    _svgf("without the variance", "svgf.variance_guided=false"),
    _svgf("without the wavelet", "svgf.iterations=0"),
    _svgf("of five iterations", "svgf.iterations=5"),
    _svgf("without demodulation", "svgf.demodulate=false"),
    _svgf("with one sample's variance", "svgf.accumulated_variance=false", "svgf.first_sigma_l=1.0"),
    _svgf("feeding back the first iteration", "svgf.feedback_level=0"),
    _svgf("without a prefilter", "svgf.prefilter=false"),
    _svgf("with the paper's normals", "svgf.normal_history=0", "svgf.sigma_n=128"),
    _svgf("with a colour clamp", "svgf.color_clamp=true"),
    _svgf("with a running mean", "svgf.alpha=0.0"),
    _svgf("with shorter histories", "svgf.alpha=0.2"),
    _svgf("without fireflies", "firefly.mode=variance"),
    _bmfr("without accumulation", "bmfr.temporal=false"),
    _bmfr("without the fit", "bmfr.fit=false"),
    _bmfr("without demodulation", "bmfr.demodulate=false"),
    _bmfr("without the first accumulation", "bmfr.alpha=1.0"),
    _bmfr("without the second accumulation", "bmfr.alpha_fit=1.0"),
    _bmfr("of whole blocks", "bmfr.part=0"),
    _bmfr("of normals only", 'bmfr.features="1,n"'),
    _bmfr("without squares", 'bmfr.features="1,n,w"'),
    _bmfr("with noise only", "bmfr.regularization=noise"),
    _bmfr("with a rank test only", "bmfr.regularization=rank"),
    _bmfr("of small blocks", "bmfr.block=16"),
    _bmfr("of large blocks", "bmfr.block=32", "bmfr.part=16"),
    _bmfr("without fireflies", "firefly.mode=variance"),
    # Not ours, and only where it is installed (bench/oidn.py).
    *(Method(f"OIDN, {quality}", "oidn", quality=quality, group="OIDN") for quality in ("fast", "balanced", "high")),
)

_KNOWN = {method.denoiser for method in _LISTED} | {"reference"}
METHODS = (*_LISTED, *(Method(name, name, group="others") for name in DENOISERS if name not in _KNOWN))
"""The noisy frame first. A denoiser that has no line of its own is measured with the user's settings."""
