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

    @property
    def range(self) -> str:
        """``[0;8]`` of a number, ``"a" | "b"`` of a choice, ``true | false`` of a switch."""
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
) -> Any:
    """A dataclass field with its range and documentation. The parameter's type is that of ``default``.

    ``doc`` of a number opens with its range, as in ``"[0;20] reach, in pixels"``. ``structural`` marks a parameter
    that changes which passes exist or what they are compiled to; any other is only a number the next frame reads.
    """
    return field(default=default, metadata={"param": Param(default, lo, hi, doc, choices, structural)})


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

    width: int = param(640, 1, 16384, "[1;16384] width of the picture, in pixels", structural=True)
    height: int = param(360, 1, 16384, "[1;16384] height of the picture, in pixels", structural=True)
    seed: int = param(0, 0, 2**31 - 1, "[0;2147483647] seed of every random number")
    sequence: str = param(
        "halton",
        choices=("halton", "hash"),
        doc="random numbers: 16 Halton points scrambled per pixel, or the Wang hash",
    )
    jitter: str = param(
        "auto",
        choices=("auto", "on", "off"),
        doc="sub-pixel camera jitter; auto: in the window, while TAA is on",
    )
    threads: int = param(0, 0, 256, "[0;256] threads that trace; 0: one for each core")
    tile: int = param(16384, 256, 1048576, "[256;1048576] pixels traced by one thread in one go")


@dataclass(frozen=True)
class Svgf(Section):
    """Spatiotemporal variance-guided filter (Schied et al. 2017)."""

    preset: str = param("best", choices=("paper", "best"), doc="values for the keys of this section that are not set")
    alpha: float = param(0.2, 0, 1, "[0;1] smallest share of the new frame in the accumulated colour; 0: running mean")
    alpha_moments: float = param(0.2, 0, 0.5, "[0;0.5] smallest share of the new frame in the luminance moments")
    max_history: int = param(255, 10, 255, "[10;255] longest history counted, in frames")
    iterations: int = param(5, 0, 8, "[0;8] à-trous iterations; number i takes every 2^i-th pixel", structural=True)
    feedback_level: int = param(
        0, -1, 7, "[-1;7] iteration that feeds the history, at most the last; -1: the unfiltered one", structural=True
    )
    sigma_z: float = param(1.0, 0.01, 100, "[0.01;100] tolerance for depth, in depth slopes of the surface")
    sigma_n: int = param(128, 1, 1024, "[1;1024] exponent of the cosine between normals; more: sharper")
    sigma_l: float = param(4.0, 0.01, 1000, "[0.01;1000] tolerance for luminance, in standard deviations of the noise")
    first_sigma_l: float = param(4.0, 0.1, 1000, "[0.1;1000] sigma_l of the first iteration, in sigma_l of the others")
    accumulated_variance: bool = param(
        True, doc="scale the variance to that of the accumulated colour after the first iteration", structural=True
    )
    separate: bool = param(True, doc="filter direct and indirect light apart", structural=True)
    temporal: bool = param(True, doc="accumulate over time", structural=True)
    variance_guided: bool = param(True, doc="steer the luminance weight by the variance", structural=True)
    demodulate: bool = param(True, doc="filter illumination, without the surfaces' albedo", structural=True)
    depth_tolerance: float = param(0.01, 0, 1, "[0;1] largest depth difference accepted in history, part of the depth")
    normal_tolerance: float = param(0.9, -1, 1, "[-1;1] smallest cosine between normals accepted in history")

    @property
    def feedback(self) -> int:
        """``feedback_level`` bounded by the iterations there are, so that fewer of them never cut the feedback."""
        return min(self.feedback_level, self.iterations - 1)


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


@dataclass(frozen=True)
class Config:
    """Every parameter. Immutable and hashable: a changed one is a new Config (``dataclasses.replace``)."""

    render: Render = field(default_factory=Render)
    svgf: Svgf = field(default_factory=Svgf)
    taa: Taa = field(default_factory=Taa)
    display: Display = field(default_factory=Display)


SECTIONS: dict[str, type[Section]] = {"render": Render, "svgf": Svgf, "taa": Taa, "display": Display}

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
        # What measured best in error at equal time on the Cornell flight (gl/passes/svgf.py, deviations).
        "best": {"first_sigma_l": 4.0, "accumulated_variance": True},
    },
}
"""section -> value of its ``preset`` key -> values of the keys it owns. A key set by file or ``--set`` wins over it."""


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
            preset = PRESETS[section][str(values.get("preset", parameters(group)["preset"].default))]
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
