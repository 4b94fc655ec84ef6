"""Parameters: frozen dataclasses, the only state there is. TOML file and ``--set`` in, :class:`Config` out.

A parameter is written once, with :func:`param`: default, range and documentation travel as metadata of its dataclass
field and feed the loader, the help and the README's tables (:func:`describe`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from errors import UserError
from parameter import Section, Value, as_toml, from_file, from_override, param, parameters, require_known
from presets import PRESETS


@dataclass(frozen=True)
class Render(Section):
    """Size of the picture and how it is sampled."""

    width: int = param(640, 1, 16384, "[1;16384] width of the picture, in pixels", structural=True, live=False)
    height: int = param(360, 1, 16384, "[1;16384] height of the picture, in pixels", structural=True, live=False)
    seed: int = param(0, 0, 2**31 - 1, "[0;2147483647] seed of every random number", live=False)
    sequence: str = param(
        "halton",
        choices=("halton", "hash"),
        doc="random numbers: 16 Halton points scrambled per pixel, or the Wang hash",
        live=False,
    )
    jitter: str = param(
        "auto",
        choices=("auto", "on", "off"),
        doc="sub-pixel camera jitter; auto: in the window, while TAA is on",
    )
    threads: int = param(0, 0, 256, "[0;256] threads that trace; 0: one for each core", live=False)
    tile: int = param(10240, 256, 1048576, "[256;1048576] pixels traced by one thread in one go", live=False)
    regularize: bool = param(
        True, doc="widen narrow specular lobes at a path's second hit; never in references", live=False
    )


@dataclass(frozen=True)
class Firefly(Section):
    """Rejection of outliers in the noisy illumination (Ray Tracing Gems 2019, ch. 17 and 25)."""

    mode: str = param(
        "off",
        choices=("off", "clamp", "variance"),
        doc="cut outliers: at a fixed radiance, or at one that the pixels around allow",
        structural=True,
    )
    max_radiance: float = param(
        10.0, 0.01, 65000, "[0.01;65000] clamp: largest radiance of a white surface, at exposure 0"
    )
    deviations: float = param(8.0, 0, 100, "[0;100] variance: largest distance from the mean, in standard deviations")
    margin: float = param(0.1, 0, 100, "[0;100] variance: radiance accepted beyond that distance, at exposure 0")


@dataclass(frozen=True)
class Svgf(Section):
    """Spatiotemporal variance-guided filter (Schied et al. 2017)."""

    preset: str = param(
        "best", choices=("paper", "reference", "best"), doc="values for the keys of this section that are not set"
    )
    separate: bool = param(True, doc="filter direct and indirect light apart", structural=True)
    demodulate: bool = param(True, doc="filter illumination, without the surfaces' albedo", structural=True)
    max_history: int = param(255, 10, 255, "[10;255] longest history counted, in frames", heading="reprojection")
    depth_tolerance: float = param(0.01, 0, 1, "[0;1] largest depth difference accepted in history, part of the depth")
    normal_tolerance: float = param(0.9, -1, 1, "[-1;1] smallest cosine between normals accepted in history")
    temporal: bool = param(True, doc="accumulate over time", structural=True, heading="accumulation")
    alpha: float = param(0.07, 0, 1, "[0;1] smallest share of the new frame in the accumulated colour; 0: running mean")
    alpha_moments: float = param(0.2, 0, 0.5, "[0;0.5] smallest share of the new frame in the luminance moments")
    feedback_level: int = param(
        -1, -1, 7, "[-1;7] iteration that feeds the history, at most the last; -1: the unfiltered one", structural=True
    )
    color_clamp: bool = param(
        False, doc="bound the accumulated colour by this frame's colours around the pixel", structural=True
    )
    color_clamp_sigma: float = param(
        1.0, 0, 10, "[0;10] reach of that bound around their mean, in their standard deviations"
    )
    fast_clamp: bool = param(
        False, doc="bound the accumulated colour by the mean of the last few frames around the pixel", structural=True
    )
    fast_frames: int = param(6, 1, 32, "[1;32] those last frames")
    fast_sigma: float = param(2.0, 0, 10, "[0;10] reach of that bound, in their standard deviations")
    variance_guided: bool = param(
        True, doc="steer the luminance weight by the variance", structural=True, heading="variance"
    )
    variance: str = param(
        "raw",
        choices=("raw", "raw-mean", "welford", "welford-mean", "spatial", "spatial-temporal", "exaggerated"),
        doc="how it is estimated: over time from raw or centred moments, in space, in both, or a hundredfold",
        structural=True,
    )
    accumulated_variance: bool = param(
        True, doc="scale the variance to that of the accumulated colour after the first iteration", structural=True
    )
    prefilter: bool = param(
        True, doc="begin with the mean of 7x7 pixels where the history is shorter than four frames", structural=True
    )
    iterations: int = param(
        3, 0, 8, "[0;8] à-trous iterations; number i takes every 2^i-th pixel", structural=True, heading="wavelet"
    )
    sigma_z: float = param(1.0, 0.01, 100, "[0.01;100] tolerance for depth, in depth slopes of the surface")
    sigma_n: int = param(64, 1, 1024, "[1;1024] exponent of the cosine between normals; more: sharper")
    normal_history: int = param(
        32,
        0,
        255,
        "[0;255] frames in which that exponent grows from 1, with the history; 0: it does not",
        structural=True,
    )
    sigma_l: float = param(6.0, 0.01, 1000, "[0.01;1000] tolerance for luminance, in standard deviations of the noise")
    first_sigma_l: float = param(4.0, 0.1, 1000, "[0.1;1000] sigma_l of the first iteration, in sigma_l of the others")
    sigma_r: float = param(0.1, 0.001, 100, "[0.001;100] tolerance for roughness, of specular light only")
    reach: float = param(
        15.0, 1, 1e6, "[1;1000000] distance over which specular light is averaged, pixels per squared roughness"
    )

    @property
    def feedback(self) -> int:
        """``feedback_level`` bounded by the iterations there are, so that fewer of them never cut the feedback."""
        return min(self.feedback_level, self.iterations - 1)

    @property
    def clamp(self) -> float | None:
        """``color_clamp_sigma``, None where the colour is not clamped."""
        return self.color_clamp_sigma if self.color_clamp else None


@dataclass(frozen=True)
class Asvgf(Svgf):
    """Adaptive SVGF (Schied et al. 2018): everything that SVGF has, and temporal gradients that cut its history."""

    preset: str = param(
        "best", choices=("paper", "reference", "best"), doc="values for the keys of this section that are not set"
    )
    remember: str = param(
        "random",
        choices=("random", "brightest"),
        doc="which pixel of 3x3 is shaded again in the next frame",
        heading="gradients",
    )
    gradient_iterations: int = param(
        3, 1, 8, "[1;8] à-trous iterations that spread the gradients over 3x3 pixels and more", structural=True
    )
    gradient_guided: bool = param(True, doc="let luminance steer how gradients are spread", structural=True)
    gradient_sigma_l: float = param(4.0, 0.01, 1000, "[0.01;1000] tolerance for luminance there, in deviations of it")
    gain: float = param(1.0, 0, 1000, "[0;1000] share of the history that is void, per relative change of light")
    follow: bool = param(
        True, doc="let the history follow the light, by the factor that gradients tell", structural=True
    )
    widen: bool = param(False, doc="take the largest such share of 3x3 neighbours", structural=True)
    cut: str = param(
        "harmonic",
        choices=("harmonic", "power"),
        doc="length left of a history: as the sample's weight implies, or a power of what is not void",
        structural=True,
    )
    power: float = param(10.0, 0, 100, "[0;100] that power")


@dataclass(frozen=True)
class Bmfr(Section):
    """Blockwise multi-order feature regression (Koskela et al. 2019)."""

    preset: str = param(
        "best", choices=("paper", "reference", "best"), doc="values for the keys of this section that are not set"
    )
    separate: bool = param(False, doc="fit diffuse and specular light apart", structural=True)
    demodulate: bool = param(True, doc="fit illumination, without the surfaces' albedo", structural=True)
    temporal: bool = param(True, doc="accumulate over time, samples and fits", structural=True, heading="accumulation")
    max_history: int = param(255, 10, 255, "[10;255] longest history counted, in frames")
    position_tolerance: float = param(
        4.0, 0.5, 1000, "[0.5;1000] largest distance between points of a history, in widths of a pixel on the surface"
    )
    normal_tolerance: float = param(0.1, 0, 4, "[0;4] largest squared distance between normals of a history")
    follow_motion: bool = param(
        True, doc="look for the history of what moves where it was, not where it is now", structural=True
    )
    round_history: bool = param(True, doc="round the history's length before it is used", structural=True)
    alpha: float = param(0.2, 0, 1, "[0;1] smallest share of the new frame before the fit; 0: running mean")
    alpha_fit: float = param(0.1, 0, 1, "[0;1] smallest share of the new fit; 0: running mean")
    fast_clamp: bool = param(
        False, doc="bound the accumulated colour by the mean of the last few frames around the pixel", structural=True
    )
    fast_frames: int = param(6, 1, 32, "[1;32] those last frames")
    fast_sigma: float = param(2.0, 0, 10, "[0;10] reach of that bound, in their standard deviations")
    adaptive: bool = param(
        False, doc="cut both histories where light has changed, by A-SVGF's gradients and parameters", structural=True
    )
    gain: float = param(3.0, 0, 1000, "[0;1000] asvgf.gain of these histories, which are longer than A-SVGF's")
    fit: bool = param(
        True, doc="fit blocks by features; off: what was accumulated before", structural=True, heading="regression"
    )
    features: str = param(
        "1,n,w,w2",
        words=("1", "n", "w", "w2", "w3", "albedo", "roughness", "depth"),
        doc="what a block is fitted by: constant, normal, position with its square and cube; first the constant",
        structural=True,
    )
    block: int = param(24, 8, 64, "[8;64] side of a block, in pixels", structural=True)
    part: int = param(
        12,
        0,
        32,
        "[0;32] side of the parts that are fitted again: what of half or a quarter of the block is nearer; 0: none",
        structural=True,
    )
    caution: float = param(
        1.5, 0, 100, "[0;100] doubt in a part's own fit: variances that noise is expected to explain in each feature"
    )
    short_history: int = param(
        0,
        0,
        16,
        "[0;16] frames: parts whose samples have fewer are doubted as fresh_caution says; 0: as all are",
        structural=True,
    )
    fresh_caution: float = param(1.0, 0, 100, "[0;100] that doubt; less: smaller blocks where the history is short")
    unit_scale: bool = param(False, doc="scale positions to [0, 1] in every block, not to [-1, 1]", structural=True)
    regularization: str = param(
        "both",
        choices=("noise", "rank", "both"),
        doc="against features that depend on each other: noise added to them, a rank test, or both",
        structural=True,
    )
    noise: float = param(0.01, 0.0001, 1, "[0.0001;1] largest noise added to a feature")
    rank_tolerance: float = param(
        1e-4, 1e-6, 0.1, "[1e-06;0.1] rank test: what of a feature may be neglected, root of the mean square"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        names = self.features.split(",")
        if names[0] != "1":
            raise UserError(f'[bmfr] features: must begin with the constant, "1", not {names[0]!r}')

    @property
    def part_side(self) -> int:
        """``part`` as far as the block can be cut so: the nearer of its half and its quarter, 0 if there are none."""
        sides = [self.block // n for n in (2, 4) if self.block % n == 0]
        return min(sides, key=lambda side: abs(side - self.part), default=0) if self.part else 0


@dataclass(frozen=True)
class Spatial(Section):
    """What the filters in space have in common: when they blend over time, and the edges that stop them."""

    demodulate: bool = param(True, doc="filter illumination, without the surfaces' albedo", structural=True)
    temporal: bool = param(True, doc="accumulate over time", structural=True, heading="accumulation")
    order: str = param(
        "filter-first",
        choices=("filter-first", "blend-first"),
        doc="blend filtered frames over time, or filter what was blended",
        structural=True,
    )
    alpha: float = param(0.1, 0, 1, "[0;1] smallest share of the new frame; 0: running mean")
    max_history: int = param(255, 10, 255, "[10;255] longest history counted, in frames")
    depth_tolerance: float = param(0.01, 0, 1, "[0;1] largest depth difference accepted in history, part of the depth")
    normal_tolerance: float = param(0.9, -1, 1, "[-1;1] smallest cosine between normals accepted in history")
    sigma_z: float = param(
        1.0,
        0.01,
        100,
        "[0.01;100] joint, à-trous: tolerance for depth, in depth slopes of the surface",
        heading="edges",
    )
    sigma_n: int = param(128, 1, 1024, "[1;1024] joint, à-trous: exponent of the cosine between normals; more: sharper")


@dataclass(frozen=True)
class Gaussian(Section):
    """Gaussian blur, which knows no edges."""

    sigma_d: float = param(2.0, 0.5, 8, "[0.5;8] width, in pixels: standard deviation")
    separable: bool = param(True, doc="rows, then columns: the same picture for fewer taps", structural=True)


@dataclass(frozen=True)
class Bilateral(Section):
    """Bilateral filter (Tomasi and Manduchi 1998)."""

    sigma_d: float = param(3.0, 0.5, 8, "[0.5;8] width, in pixels: standard deviation")
    sigma_r: float = param(1.0, 0.001, 1000, "[0.001;1000] tolerance for colour, in radiance of a white surface")


@dataclass(frozen=True)
class Joint(Section):
    """Joint bilateral filter (Petschnigg et al. 2004, Eisemann and Durand 2004), whole or approximated separably."""

    sigma_d: float = param(4.0, 0.5, 8, "[0.5;8] width, in pixels: standard deviation")


@dataclass(frozen=True)
class Atrous(Section):
    """Edge-avoiding à-trous wavelet with tolerances set by hand (Dammertz et al. 2010), all taps or some of them."""

    iterations: int = param(5, 0, 8, "[0;8] à-trous iterations; number i takes every 2^i-th pixel", structural=True)
    sigma_l: float = param(
        1.0, 0.001, 1000, "[0.001;1000] tolerance for luminance in the first iteration, in radiance of a white surface"
    )
    halve: bool = param(True, doc="halve the tolerance for luminance in every iteration")
    taps: int = param(8, 1, 24, "[1;24] atrous-jitter: taps of an iteration besides the centre", structural=True)


@dataclass(frozen=True)
class Guided(Section):
    """Guided filter (He et al. 2010, Bauszat et al. 2011)."""

    radius: int = param(8, 1, 32, "[1;32] half a window's side, in pixels")
    epsilon: float = param(
        0.01, 1e-6, 1, "[1e-06;1] doubt in the guides: variance of a guide below which it says little"
    )


@dataclass(frozen=True)
class Taa(Section):
    """Temporal anti-aliasing (Karis 2014)."""

    enabled: bool = param(True, doc="blend the tone-mapped picture with the previous ones", structural=True)
    alpha: float = param(0.1, 0.01, 1, "[0.01;1] share of the new frame")
    clip: bool = param(True, doc="clip the previous picture to the colours around the pixel", structural=True)


@dataclass(frozen=True)
class Display(Section):
    """From linear radiance to the screen."""

    exposure: float = param(0.0, -20, 20, "[-20;20] exposure, in EV (stops)")
    tonemap: str = param("aces", choices=("none", "reinhard", "aces"), doc="tone curve", structural=True)
    auto_exposure: bool = param(
        False, doc="expose so that the mean becomes middle grey; exposure comes on top", structural=True
    )
    adaptation: float = param(
        0.1, 0.01, 1, "[0.01;1] share of the way to a new automatic exposure that a frame goes; 1: all of it"
    )
    mark_bad: str = param(
        "auto",
        choices=("auto", "on", "off"),
        doc="paint NaN and infinity red, and count them; auto: while the window's HUD is on",
        structural=True,
    )


@dataclass(frozen=True)
class Surroundings:
    """The picture of light from all around that a scene gets instead of its own sky; ``file`` None: none.

    ``strength`` multiplies it; ``rotation``: degrees about the y axis, counter-clockwise seen from above. No section
    of the file: it goes with a scene, not with the program, and has flags of its own.
    """

    file: Path | None = None
    strength: float = 1.0
    rotation: float = 0.0


@dataclass(frozen=True)
class Config:
    """Every parameter. Immutable and hashable: a changed one is a new Config (``dataclasses.replace``)."""

    render: Render = field(default_factory=Render)
    firefly: Firefly = field(default_factory=Firefly)
    svgf: Svgf = field(default_factory=Svgf)
    asvgf: Asvgf = field(default_factory=Asvgf)
    bmfr: Bmfr = field(default_factory=Bmfr)
    spatial: Spatial = field(default_factory=Spatial)
    gaussian: Gaussian = field(default_factory=Gaussian)
    bilateral: Bilateral = field(default_factory=Bilateral)
    joint: Joint = field(default_factory=Joint)
    atrous: Atrous = field(default_factory=Atrous)
    guided: Guided = field(default_factory=Guided)
    taa: Taa = field(default_factory=Taa)
    display: Display = field(default_factory=Display)
    surroundings: Surroundings = field(default_factory=Surroundings)


SECTIONS: dict[str, type[Section]] = {
    "render": Render,
    "firefly": Firefly,
    "svgf": Svgf,
    "asvgf": Asvgf,
    "bmfr": Bmfr,
    "spatial": Spatial,
    "gaussian": Gaussian,
    "bilateral": Bilateral,
    "joint": Joint,
    "atrous": Atrous,
    "guided": Guided,
    "taa": Taa,
    "display": Display,
}


class Row(NamedTuple):
    """One line of a parameter table; every column is text."""

    section: str
    key: str
    type: str
    default: str
    range: str
    doc: str


def describe() -> list[Row]:
    """Every parameter, in the order of declaration; ``doc`` without the range that has a column of its own."""
    return [
        Row(section, name, type(spec.default).__name__, as_toml(spec.default), spec.range, spec.text)
        for section, group in SECTIONS.items()
        for name, spec in parameters(group).items()
    ]


def preset_values(section: str, preset: str) -> dict[str, Value]:
    """Every key that any preset of ``section`` owns, with what ``preset`` makes of it: its own value, or the default.

    Hence going from one preset to another leaves nothing of the first.
    """
    specs = parameters(SECTIONS[section])
    owned = (key for values in PRESETS[section].values() for key in values)
    return {key: specs[key].default for key in owned} | PRESETS[section][preset]


def apply_preset(config: Config, section: str, preset: str) -> Config:
    """``config`` after a change of preset in ``section``: the keys of :func:`preset_values` are set, others stay.

    Explicit values of those keys are lost, unlike in :func:`load`. Raises UserError: no presets there, or not this one.
    """
    require_known(section, PRESETS, f"[{section}]: has no presets")
    require_known(preset, PRESETS[section], f"[{section}] preset: unknown preset {preset!r}")
    values: dict[str, Any] = {**preset_values(section, preset), "preset": preset}
    group = dataclasses.replace(getattr(config, section), **values)
    changed: dict[str, Any] = {section: group}
    return dataclasses.replace(config, **changed)


def load(path: Path | None = None, overrides: Sequence[str] = ()) -> Config:
    """Defaults, then the presets' values, then the keys of the TOML file, then ``section.key=value`` overrides.

    ``path`` None reads no file. An override's value is written as in TOML; a bare word counts as a string.
    Raises UserError: unreadable file, broken TOML, unknown section or key, wrong type, value out of range.
    """
    explicit: dict[str, dict[str, Value]] = {section: {} for section in SECTIONS}
    for source in (from_file(path, SECTIONS) if path else (), (from_override(text, SECTIONS) for text in overrides)):
        for section, key, value in source:
            explicit[section][key] = value
    groups: dict[str, Any] = {}
    for section, group in SECTIONS.items():
        values = explicit[section]
        preset: Mapping[str, Value] = {}
        if section in PRESETS:
            preset = preset_values(section, str(values.get("preset", parameters(group)["preset"].default)))
        groups[section] = group(**{**preset, **values})
    return Config(**groups)
