"""Parameters: frozen dataclasses, the only state there is. TOML file and ``--set`` in, :class:`Config` out.

A parameter is written once, with :func:`param`: default, range and documentation travel as metadata of its dataclass
field and feed the loader, the help and the README's tables (:func:`describe`).
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from errors import UserError, did_you_mean

Value = bool | int | float | str


@dataclass(frozen=True)
class Param:
    """What :func:`param` recorded. ``lo`` and ``hi`` are inclusive; None for a bool or a choice."""

    default: Value
    lo: float | None
    hi: float | None
    doc: str
    choices: tuple[str, ...]
    structural: bool
    heading: str
    live: bool
    words: tuple[str, ...]

    @property
    def range(self) -> str:
        """``[0;8]`` of a number, ``"a" | "b"`` of a choice, ``true | false`` of a switch, ``a,b`` of a list."""
        if self.words:
            return ",".join(self.words)
        if self.choices:
            return " | ".join(f'"{choice}"' for choice in self.choices)
        return f"[{self.lo:.12g};{self.hi:.12g}]" if self.lo is not None else "true | false"

    @property
    def text(self) -> str:
        """``doc`` without the range it opens with."""
        return self.doc.removeprefix(f"{self.range} ")


def param(
    default: Value,
    lo: float | None = None,
    hi: float | None = None,
    doc: str = "",
    *,
    choices: tuple[str, ...] = (),
    structural: bool = False,
    heading: str = "",
    live: bool = True,
    words: tuple[str, ...] = (),
) -> Any:
    """A dataclass field with its range and documentation. The parameter's type is that of ``default``.

    ``doc`` of a number opens with its range, as in ``"[0;20] reach, in pixels"``. ``structural`` marks a parameter
    that changes which passes exist or what they are compiled to; any other is only a number the next frame reads.
    ``heading``: what the parameters from this one on are about, for the window's panel. One that is not ``live`` counts
    only when the program starts. ``words``: the value is a list of some of these, none twice, with commas between.
    """
    spec = Param(default, lo, hi, doc, choices, structural, heading, live, words)
    return field(default=default, metadata={"param": spec})


def parameters(section: type[Section]) -> dict[str, Param]:
    """Name -> metadata of each parameter of a section, in the order of declaration."""
    fields = dataclasses.fields(section)  # type: ignore[arg-type]  # Section itself is no dataclass, its heirs are
    return {item.name: item.metadata["param"] for item in fields}


class Section:
    """Base of the groups below: whoever builds one, by hand or by ``dataclasses.replace``, gets its values checked."""

    def __post_init__(self) -> None:
        for name, spec in parameters(type(self)).items():
            _checked(getattr(self, name), spec, f"[{type(self).__name__.lower()}] {name}")


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
    tile: int = param(16384, 256, 1048576, "[256;1048576] pixels traced by one thread in one go", live=False)


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
    alpha: float = param(0.2, 0, 1, "[0;1] smallest share of the new frame in the accumulated colour; 0: running mean")
    alpha_moments: float = param(0.2, 0, 0.5, "[0;0.5] smallest share of the new frame in the luminance moments")
    feedback_level: int = param(
        0, -1, 7, "[-1;7] iteration that feeds the history, at most the last; -1: the unfiltered one", structural=True
    )
    color_clamp: bool = param(
        False, doc="bound the accumulated colour by this frame's colours around the pixel", structural=True
    )
    color_clamp_sigma: float = param(
        1.0, 0, 10, "[0;10] reach of that bound around their mean, in their standard deviations"
    )
    variance_guided: bool = param(
        True, doc="steer the luminance weight by the variance", structural=True, heading="variance"
    )
    accumulated_variance: bool = param(
        True, doc="scale the variance to that of the accumulated colour after the first iteration", structural=True
    )
    prefilter: bool = param(
        False, doc="begin with the mean of 7x7 pixels where the history is shorter than four frames", structural=True
    )
    iterations: int = param(
        5, 0, 8, "[0;8] à-trous iterations; number i takes every 2^i-th pixel", structural=True, heading="wavelet"
    )
    sigma_z: float = param(1.0, 0.01, 100, "[0.01;100] tolerance for depth, in depth slopes of the surface")
    sigma_n: int = param(128, 1, 1024, "[1;1024] exponent of the cosine between normals; more: sharper")
    sigma_l: float = param(4.0, 0.01, 1000, "[0.01;1000] tolerance for luminance, in standard deviations of the noise")
    first_sigma_l: float = param(4.0, 0.1, 1000, "[0.1;1000] sigma_l of the first iteration, in sigma_l of the others")

    @property
    def feedback(self) -> int:
        """``feedback_level`` bounded by the iterations there are, so that fewer of them never cut the feedback."""
        return min(self.feedback_level, self.iterations - 1)

    @property
    def clamp(self) -> float | None:
        """``color_clamp_sigma``, None where the colour is not clamped."""
        return self.color_clamp_sigma if self.color_clamp else None


@dataclass(frozen=True)
class Bmfr(Section):
    """Blockwise multi-order feature regression (Koskela et al. 2019)."""

    preset: str = param(
        "best", choices=("paper", "reference", "best"), doc="values for the keys of this section that are not set"
    )
    max_history: int = param(255, 10, 255, "[10;255] longest history counted, in frames", heading="accumulation")
    position_tolerance: float = param(
        4.0, 0.5, 1000, "[0.5;1000] largest distance between points of a history, in widths of a pixel on the surface"
    )
    normal_tolerance: float = param(0.1, 0, 4, "[0;4] largest squared distance between normals of a history")
    round_history: bool = param(True, doc="round the history's length before it is used", structural=True)
    alpha: float = param(0.2, 0, 1, "[0;1] smallest share of the new frame before the fit; 0: running mean")
    alpha_fit: float = param(0.1, 0, 1, "[0;1] smallest share of the new fit; 0: running mean")
    features: str = param(
        "1,n,w,w2",
        words=("1", "n", "w", "w2", "w3", "albedo", "roughness", "depth"),
        doc="what a block is fitted by: constant, normal, position with its square and cube; first the constant",
        structural=True,
        heading="regression",
    )
    block: int = param(32, 8, 64, "[8;64] side of a block, in pixels", structural=True)
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
        if "roughness" in names:
            raise UserError("[bmfr] features: frames have no roughness yet, every surface is diffuse")


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
class Config:
    """Every parameter. Immutable and hashable: a changed one is a new Config (``dataclasses.replace``)."""

    render: Render = field(default_factory=Render)
    firefly: Firefly = field(default_factory=Firefly)
    svgf: Svgf = field(default_factory=Svgf)
    bmfr: Bmfr = field(default_factory=Bmfr)
    taa: Taa = field(default_factory=Taa)
    display: Display = field(default_factory=Display)


SECTIONS: dict[str, type[Section]] = {
    "render": Render,
    "firefly": Firefly,
    "svgf": Svgf,
    "bmfr": Bmfr,
    "taa": Taa,
    "display": Display,
}

PRESETS: dict[str, dict[str, dict[str, Value]]] = {
    "svgf": {
        # Schied et al. 2017: temporal filter (sec. 4.1), iterations and feedback (4.3), edge-stopping functions (4.4).
        "paper": {
            "alpha": 0.2,
            "alpha_moments": 0.2,
            "iterations": 5,
            "feedback_level": 0,
            "sigma_z": 1.0,
            "sigma_n": 128,
            "sigma_l": 4.0,
            "first_sigma_l": 1.0,
            "accumulated_variance": False,
            "separate": True,
            "temporal": True,
            "variance_guided": True,
            "demodulate": True,
        },
        # Falcor's SVGFPass, the best-known implementation; gl/passes/svgf.py tells what else is different there.
        "reference": {
            "alpha": 0.05,
            "alpha_moments": 0.2,
            "max_history": 32,
            "iterations": 4,
            "feedback_level": 1,
            "sigma_z": 1.0,
            "sigma_n": 128,
            "sigma_l": 10.0,
            "first_sigma_l": 1.0,
            "accumulated_variance": False,
            "separate": False,
            "temporal": True,
            "variance_guided": True,
            "demodulate": True,
            "prefilter": True,
        },
        # What measured best in error at equal time on the Cornell flight (gl/passes/svgf.py, deviations).
        "best": {"first_sigma_l": 4.0, "accumulated_variance": True},
    },
    "bmfr": {
        # Koskela et al. 2019: accumulation (sec. 3.1), features and regularisation (3.3), second accumulation (3.4).
        "paper": {
            "round_history": True,
            "alpha": 0.2,
            "alpha_fit": 0.1,
            "features": "1,n,w,w2",
            "block": 32,
            "unit_scale": False,
            "regularization": "noise",
            "noise": 0.01,
        },
        # The authors' OpenCL code, where it differs from the paper.
        "reference": {
            "round_history": False,
            "alpha": 0.2,
            "alpha_fit": 0.1,
            "features": "1,n,w,w2",
            "block": 32,
            "unit_scale": True,
            "regularization": "noise",
            "noise": 0.01,
        },
        "best": {"regularization": "both"},
    },
}
"""section -> value of its ``preset`` key -> values of the keys it owns. A key set by file or ``--set`` wins over it.

A key that another preset of the section owns has its default: see :func:`preset_values`.
"""


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
        Row(section, name, type(spec.default).__name__, _toml(spec.default), spec.range, spec.text)
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
    _known(section, PRESETS, f"[{section}]: has no presets")
    _known(preset, PRESETS[section], f"[{section}] preset: unknown preset {preset!r}")
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
    for source in (_from_file(path) if path else (), map(_from_override, overrides)):
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


def _from_file(path: Path) -> Iterator[tuple[str, str, Value]]:
    """Checked (section, key, value) of every key in a TOML file."""
    relative = os.path.relpath(path)
    shown = str(path) if relative.startswith("..") else relative
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8-sig"))  # editors may begin a file with a mark
    except OSError as error:
        raise UserError(f"{shown}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise UserError(f"{shown}: is not text in UTF-8 (byte {error.start})") from error
    except (ValueError, RecursionError) as error:  # an integer may have too many digits
        raise UserError(f"{shown}: is not valid TOML: {error}") from error
    for section, table in tables.items():
        where = f"{shown} [{section}]"
        if section not in SECTIONS and not isinstance(table, dict):
            raise UserError(f"{shown} {section}: stands outside a section; sections are {', '.join(SECTIONS)}")
        _known(section, SECTIONS, f"{where}: unknown section")
        if not isinstance(table, dict):
            raise UserError(f"{where}: must be a section, written [{section}] on a line of its own")
        for key, value in table.items():
            yield section, key, _checked_key(section, key, value, f"{where} {key}")


def _from_override(text: str) -> tuple[str, str, Value]:
    """Checked (section, key, value) of one ``section.key=value``."""
    name, equals, written = (part.strip() for part in text.partition("="))
    section, dot, key = name.partition(".")
    if not (equals and dot and key):
        homes = [f"{home}.{name}" for home, group in SECTIONS.items() if name in parameters(group)]
        hint = f", did you mean {homes[0]!r}?" if homes else ", as in svgf.iterations=3"
        raise UserError(f"--set {text}: must be section.key=value{hint}")
    _known(section, SECTIONS, f"--set {text}: unknown section {section!r}")
    try:
        parsed = tomllib.loads(f"value = {written}")
        value = parsed.pop("value")
    except (ValueError, RecursionError) as error:
        if not re.fullmatch(r"[^\W\d][\w-]*", written):
            raise UserError(f"--set {text}: {written!r} is not a value; write 3, 0.5, true or a word") from error
        parsed, value = {}, written
    if parsed:  # a line break in the value smuggled in a second key
        raise UserError(f"--set {text}: must be one section.key=value")
    return section, key, _checked_key(section, key, value, f"--set {text}")


def _checked_key(section: str, key: str, value: object, where: str) -> Value:
    known = parameters(SECTIONS[section])
    _known(key, known, f"{where}: unknown key")
    return _checked(value, known[key], where)


def _checked(value: object, spec: Param, where: str) -> Value:
    """``value`` as the parameter's type. Raises UserError, opening with ``where``, if it is no value for it."""
    written = _toml(value)
    if spec.choices:
        if not (isinstance(value, str) and value in spec.choices):
            hint = did_you_mean(value, spec.choices) if isinstance(value, str) else ""
            raise UserError(f"{where}: must be {spec.range}, not {written}{hint}")
        return value
    if spec.words:
        return _checked_words(value, spec, where)
    if isinstance(spec.default, bool):
        if not isinstance(value, bool):
            raise UserError(f"{where}: must be true or false, not {written}")
        return value
    whole = isinstance(spec.default, int)
    if isinstance(value, bool) or not isinstance(value, int if whole else (int, float)):
        raise UserError(f"{where}: must be a {'whole ' if whole else ''}number in {spec.range}, not {written}")
    if spec.lo is None or spec.hi is None or not spec.lo <= value <= spec.hi:  # NaN is in no range
        raise UserError(f"{where}: must be in {spec.range}, not {written} ({spec.text})")
    return value if whole else float(value)


def _checked_words(value: object, spec: Param, where: str) -> str:
    """``value`` without spaces. Raises UserError if it is no list of different words of ``spec``."""
    if not isinstance(value, str):
        raise UserError(f'{where}: must be names with commas between, as in "{spec.default}", not {_toml(value)}')
    names = [name.strip() for name in value.split(",")]
    for i, name in enumerate(names):
        if name not in spec.words:
            hint = did_you_mean(name, spec.words) or f"; known are {', '.join(spec.words)}"
            raise UserError(f"{where}: unknown name {name!r}{hint}")
        if name in names[:i]:
            raise UserError(f"{where}: {name!r} is there twice")
    return ",".join(names)


def _known(name: str, known: Mapping[str, object], message: str) -> None:
    """Raises UserError with the nearest known name, or all of them, unless ``name`` is one."""
    if name not in known:
        raise UserError(message + (did_you_mean(name, known) or f"; known are {', '.join(known)}"))


def _toml(value: object) -> str:
    """``value`` as a person would write it in TOML, shortened where it is long."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and value.bit_length() > 128:  # str() refuses to write out very long ones
        return "a number of that size"
    text = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."
