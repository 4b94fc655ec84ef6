"""Wavefront OBJ text as arrays.

trimesh 5.2 drops lines such as ``v<TAB>x y z``, counts relative indices from the end of the file instead of the current
line, mistakes a hexagon for three ``v/vt`` corners, and takes twice as long; none of it is reported. So the text is read
here: lines are sorted by their keyword and each kind is converted at once.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from itertools import compress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from errors import UserError
from raytrace.parts import F64, I64
from raytrace.resources import read_bytes

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*([eE][-+]?\d+)?|\.\d+([eE][-+]?\d+)?|nan|inf|infinity)", re.IGNORECASE)
_CORNER = re.compile(r"-?\d+(/-?\d*){0,2}")


@dataclass(frozen=True)
class ObjText:
    """``positions`` (V, 3), ``uvs`` (T, 2), ``normals`` (N, 3) float64 as in the file.

    ``corners`` (F, 3, 3) int64: per triangle and corner the index of position, texture coordinate and normal from 0,
    -1 where there is none. ``objects`` and ``materials`` (F,) int64 index ``object_names`` and ``material_names``.
    ``libraries`` are the MTL files as written; ``lines`` counts faces with fewer than three corners, which are left out;
    ``has_colors``: positions are followed by vertex colours.
    """

    positions: F64
    uvs: F64
    normals: F64
    corners: I64
    objects: I64
    materials: I64
    object_names: list[str]
    material_names: list[str]
    libraries: list[str]
    lines: int
    has_colors: bool


def read_obj_text(path: Path) -> ObjText:
    """Raises UserError, with the line, for what is not a number and for indices that nothing is at."""
    return _Parser(path).parse()


class _Parser:
    def __init__(self, path: Path) -> None:
        self.path = path
        text = read_bytes(path).decode("utf-8", errors="replace").replace("\r\n", "\n").replace("\r", "\n")
        text = text.replace("\\\n", "  ").replace("\t", " ")
        self.text_lines = text.split("\n")
        if "\n " in text or text.startswith(" "):
            self.text_lines = [line.lstrip() for line in self.text_lines]
        self.kinds = np.array([line[:2] for line in self.text_lines], dtype="U2")

    def error(self, line: int, message: str) -> UserError:
        shown = self.text_lines[line][:60]
        return UserError(
            f"{self.path}, line {line + 1}: {message}: {shown!r}", "export the file again, or mend the line"
        )

    def parse(self) -> ObjText:
        defined = {
            what: self.kinds == key for what, key in (("vertex", "v "), ("texture coordinate", "vt"), ("normal", "vn"))
        }
        position_values, has_colors = self._floats(defined["vertex"], 3)
        uv_values, _ = self._floats(defined["texture coordinate"], 2)
        normal_values, _ = self._floats(defined["normal"], 3)
        is_face = self.kinds == "f "
        face_lines = np.flatnonzero(is_face)
        flat, sizes = self._corners(is_face)
        for column, (what, lines) in enumerate(defined.items()):
            flat[:, column] = self._absolute(flat[:, column], np.repeat(face_lines, sizes), lines, what)
        corners, faces = _fan(flat, sizes)
        directives = self._directives()
        use_groups = not any(keyword == "o" for _, keyword, _ in directives)
        objects, object_names = _in_force(directives, "g" if use_groups else "o", face_lines[faces])
        materials, material_names = _in_force(directives, "usemtl", face_lines[faces])
        return ObjText(
            positions=position_values,
            uvs=uv_values,
            normals=normal_values,
            corners=corners,
            objects=objects,
            materials=materials,
            object_names=object_names,
            material_names=material_names,
            libraries=[name for _, keyword, name in directives if keyword == "mtllib"],
            lines=int((sizes < 3).sum()),
            has_colors=has_colors,
        )

    def _directives(self) -> list[tuple[int, str, str]]:
        """Line, keyword and the rest of it, for each line that names something."""
        result = []
        for line in np.flatnonzero(np.isin(self.kinds, ["o ", "g ", "g", "us", "mt"])):
            keyword, _, rest = self.text_lines[line].partition(" ")
            result.append((int(line), keyword, rest.strip()))
        return result

    def _data(self, mask: NDArray[np.bool_]) -> list[str]:
        """The chosen lines without keyword and comment."""
        lines = [line[2:] for line in compress(self.text_lines, mask)]
        return [line.partition("#")[0] for line in lines] if any("#" in line for line in lines) else lines

    def _floats(self, mask: NDArray[np.bool_], width: int) -> tuple[F64, bool]:
        """First ``width`` numbers of each chosen line, missing ones 0, (n, width); whether they look followed by colours."""
        lines = self._data(mask)
        if not lines:
            return np.zeros((0, width)), False
        counts = np.array([len(line.split()) for line in lines])
        least = int(counts.min())
        if least != counts.max() or least < width:
            if least < (1 if width == 2 else width):
                short = np.flatnonzero(mask)[counts.argmin()]
                raise self.error(int(short), f"{width} numbers are needed")
            lines = [" ".join((line.split() + ["0"])[:width]) for line in lines]
        values = _converted(" ".join(lines), np.float64)
        if values is None or values.size % len(lines):
            raise self._bad_line(mask, _NUMBER)
        return np.ascontiguousarray(values.reshape(len(lines), -1)[:, :width]), bool(counts.max() >= 6)

    def _bad_line(self, mask: NDArray[np.bool_], word: re.Pattern[str]) -> UserError:
        for line in np.flatnonzero(mask):
            if not all(word.fullmatch(part) for part in self.text_lines[line].split()[1:]):
                return self.error(int(line), "cannot be understood")
        return UserError(f"{self.path}: cannot be understood", "export the file again")

    def _corners(self, mask: NDArray[np.bool_]) -> tuple[I64, I64]:
        """Indices as written, (n, 3), 0 where absent, and the number of corners of each face."""
        lines = self._data(mask)
        if any("/ " in line or line.endswith("/") for line in lines):  # "1/" and "1//" mean "1"
            lines = [re.sub(r"/+(?= |$)", "", line) for line in lines]
        sizes = np.array([len(line.split()) for line in lines], dtype=np.int64)
        slashes = np.array([line.count("/") for line in lines], dtype=np.int64)
        double = np.array(["//" in line for line in lines], dtype=bool)
        flat = np.zeros((int(sizes.sum()), 3), dtype=np.int64)
        known = np.zeros(len(lines), dtype=bool)
        forms = (
            ([0], ~double & (slashes == 0)),
            ([0, 1], ~double & (slashes == sizes) & (sizes > 0)),
            ([0, 2], double & (slashes == 2 * sizes)),
            ([0, 1, 2], ~double & (slashes == 2 * sizes) & (sizes > 0)),
        )
        for columns, form in forms:
            if not form.any():
                continue
            chosen = lines if form.all() else list(compress(lines, form))
            values = _converted(" ".join(chosen).replace("/", " "), np.int64)
            if values is None or values.size != sizes[form].sum() * len(columns):
                raise self._bad_line(mask, _CORNER)
            flat[np.ix_(np.repeat(form, sizes), columns)] = values.reshape(-1, len(columns))
            known |= form
        if not known.all():
            raise self.error(int(np.flatnonzero(mask)[known.argmin()]), "its corners are not written alike")
        return flat, sizes

    def _absolute(self, written: I64, lines: I64, defined: NDArray[np.bool_], what: str) -> I64:
        """Indices from 0; a negative one counts back from what is defined above its own line. -1 stays for absent."""
        absent = written == 0
        if what == "vertex" and absent.any():
            raise self.error(int(lines[absent.argmax()]), "indices start at 1")
        count = int(defined.sum())
        if (written < 0).any():
            so_far = np.cumsum(defined)[lines]
            absolute = np.where(written < 0, written + so_far, written - 1)
        else:
            absolute = written - 1
        wrong = ~absent & ((absolute < 0) | (absolute >= count))
        if wrong.any():
            first = int(wrong.argmax())
            raise self.error(int(lines[first]), f"{what} {written[first]} is not among the {count} of the file")
        return np.where(absent, -1, absolute)


def _converted(text: str, dtype: type[np.float64] | type[np.int64]) -> NDArray[np.float64] | NDArray[np.int64] | None:
    """All numbers of ``text``; None where something in it is no number."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # how fromstring says that it stopped halfway
        try:
            return np.fromstring(text, sep=" ", dtype=dtype)
        except (DeprecationWarning, ValueError):
            return None


def _fan(flat: I64, sizes: I64) -> tuple[I64, I64]:
    """Polygons as triangle fans: corners (F, 3, 3) and the polygon each triangle is of (F,)."""
    fans = np.maximum(sizes - 2, 0)
    polygon = np.repeat(np.arange(len(sizes)), fans)
    start = (np.cumsum(sizes) - sizes)[polygon]
    nth = np.arange(len(polygon)) - (np.cumsum(fans) - fans)[polygon]
    return flat[np.stack([start, start + nth + 1, start + nth + 2], axis=1)], polygon


def _in_force(directives: list[tuple[int, str, str]], keyword: str, lines: I64) -> tuple[I64, list[str]]:
    """For each of ``lines`` the number of the name that the last directive above it set; number 0 is "", for none."""
    numbers = {"": 0}
    chosen = [(line, numbers.setdefault(name, len(numbers))) for line, word, name in directives if word == keyword]
    at = np.searchsorted(np.array([line for line, _ in chosen], dtype=np.int64), lines)
    return np.array([0] + [number for _, number in chosen], dtype=np.int64)[at], list(numbers)
