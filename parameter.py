"""What a parameter is, and how its value is read: from TOML, from ``section.key=value``, always checked.

The parameters themselves are in :mod:`config`.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from errors import UserError, did_you_mean

Value = bool | int | float | str
Setting = tuple[str, str, Value]
"""Section, key, value."""


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


Sections = Mapping[str, type[Section]]
"""The groups by name."""


def from_file(path: Path, sections: Sections) -> Iterator[Setting]:
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
        if section not in sections and not isinstance(table, dict):
            raise UserError(f"{shown} {section}: stands outside a section; sections are {', '.join(sections)}")
        require_known(section, sections, f"{where}: unknown section")
        if not isinstance(table, dict):
            raise UserError(f"{where}: must be a section, written [{section}] on a line of its own")
        for key, value in table.items():
            yield section, key, _checked_key(sections[section], key, value, f"{where} {key}")


def from_override(text: str, sections: Sections) -> Setting:
    """Checked (section, key, value) of one ``section.key=value``."""
    name, equals, written = (part.strip() for part in text.partition("="))
    section, dot, key = name.partition(".")
    if not (equals and dot and key):
        homes = [f"{home}.{name}" for home, group in sections.items() if name in parameters(group)]
        hint = f", did you mean {homes[0]!r}?" if homes else ", as in svgf.iterations=3"
        raise UserError(f"--set {text}: must be section.key=value{hint}")
    require_known(section, sections, f"--set {text}: unknown section {section!r}")
    try:
        parsed = tomllib.loads(f"value = {written}")
        value = parsed.pop("value")
    except (ValueError, RecursionError) as error:
        if not re.fullmatch(r"[^\W\d][\w-]*", written):
            raise UserError(f"--set {text}: {written!r} is not a value; write 3, 0.5, true or a word") from error
        parsed, value = {}, written
    if parsed:  # a line break in the value smuggled in a second key
        raise UserError(f"--set {text}: must be one section.key=value")
    return section, key, _checked_key(sections[section], key, value, f"--set {text}")


def _checked_key(section: type[Section], key: str, value: object, where: str) -> Value:
    known = parameters(section)
    require_known(key, known, f"{where}: unknown key")
    return _checked(value, known[key], where)


def _checked(value: object, spec: Param, where: str) -> Value:
    """``value`` as the parameter's type. Raises UserError, opening with ``where``, if it is no value for it."""
    written = as_toml(value)
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
        raise UserError(f'{where}: must be names with commas between, as in "{spec.default}", not {as_toml(value)}')
    names = [name.strip() for name in value.split(",")]
    for i, name in enumerate(names):
        if name not in spec.words:
            hint = did_you_mean(name, spec.words) or f"; known are {', '.join(spec.words)}"
            raise UserError(f"{where}: unknown name {name!r}{hint}")
        if name in names[:i]:
            raise UserError(f"{where}: {name!r} is there twice")
    return ",".join(names)


def require_known(name: str, known: Mapping[str, object], message: str) -> None:
    """Raises UserError with the nearest known name, or all of them, unless ``name`` is one."""
    if name not in known:
        raise UserError(message + (did_you_mean(name, known) or f"; known are {', '.join(known)}"))


def as_toml(value: object) -> str:
    """``value`` as a person would write it in TOML, shortened where it is long."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and value.bit_length() > 128:  # str() refuses to write out very long ones
        return "a number of that size"
    text = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."
