"""Wavefront MTL material libraries."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from errors import UserError
from raytrace.resources import read_bytes

Color = tuple[float, float, float]

_PLACING = ("-o", "-s", "-t")  # options of a texture with one to three numbers
_TWO_VALUES = ("-mm",)
_REFLECTING = range(3, 10)  # illumination models that trace reflected or refracted rays


@dataclass
class MtlMaterial:
    """``diffuse`` and ``emission`` are linear, None where the library says nothing; textures are paths as written,
    relative to ``folder``. The flags tell what a diffuse surface cannot show."""

    name: str
    folder: Path
    diffuse: Color | None = None
    emission: Color | None = None
    diffuse_texture: str = ""
    emission_texture: str = ""
    glossy: bool = False
    transparent: bool = False
    bumpy: bool = False
    placed: bool = False


def read_mtl(path: Path) -> dict[str, MtlMaterial]:
    """Materials by name. Raises UserError, with the line, for values that are not numbers."""
    materials: dict[str, MtlMaterial] = {}
    current: MtlMaterial | None = None
    text = read_bytes(path).decode("utf-8", errors="replace").replace("\t", " ")
    for number, line in enumerate(text.splitlines(), 1):
        keyword, _, rest = line.strip().partition(" ")
        rest = rest.strip()
        if keyword.lower() == "newmtl":
            current = materials.setdefault(rest, MtlMaterial(rest, path.parent))
        elif current is not None and rest:
            _read_statement(current, keyword.lower(), rest, f"{path}, line {number}")
    return materials


def _read_statement(material: MtlMaterial, keyword: str, rest: str, where: str) -> None:
    match keyword:
        case "kd":
            material.diffuse = _color(rest, where)
        case "ke":
            material.emission = _color(rest, where)
        case "map_kd":
            material.diffuse_texture = _texture(material, rest)
        case "map_ke":
            material.emission_texture = _texture(material, rest)
        case "ks":
            material.glossy |= max(_color(rest, where)) > 0.0
        case "illum":
            material.glossy |= _numbers(rest, where)[0] in _REFLECTING
        case "pm":
            material.glossy |= _numbers(rest, where)[0] > 0.0
        case "d":
            material.transparent |= _numbers(rest.removeprefix("-halo"), where)[0] < 1.0
        case "tr":
            material.transparent |= _numbers(rest, where)[0] > 0.0
        case "map_d":
            material.transparent = True
        case "bump" | "map_bump" | "norm" | "disp":
            material.bumpy = True


def _numbers(text: str, where: str) -> list[float]:
    """At least one number; what follows a # is a comment."""
    try:
        values = [float(word) for word in text.partition("#")[0].split()]
    except ValueError:
        values = []
    if not values or not all(-1e30 < value < 1e30 for value in values):
        raise UserError(
            f"{where}: {text!r} is not a list of numbers", "write colours as three numbers, such as Kd 0.8 0.8 0.8"
        )
    return values


def _color(text: str, where: str) -> Color:
    """Three numbers; one stands for all three. Spectral curves and CIE XYZ, which hardly any file has, are refused."""
    values = _numbers(text, where)
    r, g, b = values if len(values) == 3 else [values[0]] * 3
    return r, g, b


def _texture(material: MtlMaterial, text: str) -> str:
    """File name of a texture statement, options skipped: the name is the last thing and may contain spaces."""
    while text.startswith("-"):
        option, _, text = text.partition(" ")
        most = 3 if option in _PLACING else 2 if option in _TWO_VALUES else 1
        material.placed |= option in _PLACING
        for nth in range(most):
            value, _, after = text.strip().partition(" ")
            if nth > 0 and not _is_number(value):
                break
            text = after
        text = text.strip()
    return text


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
