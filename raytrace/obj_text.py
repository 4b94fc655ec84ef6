"""Wavefront OBJ text as arrays.

trimesh 5.2 drops lines such as ``v<TAB>x y z``, counts relative indices from the end of the file instead of the line
they are in, mistakes a hexagon for three ``v/vt`` corners, and says nothing about any of it. So the text is read here:
lines are told apart by their keyword, and all lines of a kind are converted at once.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from errors import UserError
from raytrace.parts import F64, I64
from raytrace.resources import read_bytes

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*([eE][-+]?\d+)?|\.\d+([eE][-+]?\d+)?|nan|inf|infinity)", re.IGNORECASE)
_BLANKS = bytes.maketrans(b"\t\v\f", b"   ")
_CORNER = re.compile(r"-?\d+(/-?\d*){0,2}")


@dataclass(frozen=True)
class ObjText:
    """``positions`` (V, 3), ``uvs`` (T, 2), ``normals`` (N, 3) float64 as in the file.

    ``corners`` (F, 3, 3) int64: per triangle and corner the index of position, texture coordinate and normal from 0,
    -1 where there is none. ``objects`` and ``materials`` (F,) int64 index ``object_names`` and ``material_names``.
    ``libraries`` are the MTL files as written; ``lines`` is the number of faces with fewer than three corners, which
    are left out; ``has_colors``: positions are followed by vertex colours.
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
    """``data`` (bytes,) uint8 is the text, tidied; line k is ``data[starts[k] : starts[k + 1]]`` with its newline."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._split(_tidied(read_bytes(path)))
        hashes = np.searchsorted(self.starts, np.flatnonzero(self.data == ord("#")), side="right") - 1
        if np.isin(self.first[hashes], (ord("v"), ord("f"))).any():  # comments behind numbers
            self._split(re.sub(rb"(?m)^((?:v|vt|vn|f) [^#\n]*)#.*$", rb"\1", self.data.tobytes()))

    def _split(self, text: bytes) -> None:
        self.data = np.frombuffer(text, dtype=np.uint8)
        self.starts = np.append(0, np.flatnonzero(self.data == ord("\n")) + 1)
        at = self.starts[:-1]
        last = len(self.data) - 1
        self.first, self.second = self.data[at], self.data[np.minimum(at + 1, last)]
        self.third = self.data[np.minimum(at + 2, last)]

    def _is(self, keyword: str) -> NDArray[np.bool_]:
        """Which lines start with ``keyword``, of one or two letters, and a space."""
        first, second, third = (keyword + "  ").encode()[:3]
        mask: NDArray[np.bool_] = (self.first == first) & (self.second == second)
        return mask if len(keyword) == 1 else mask & (self.third == third)

    def line(self, number: int | np.integer[Any]) -> str:
        return self.data[self.starts[number] : self.starts[number + 1]].tobytes().decode("utf-8", "replace").rstrip()

    def error(self, line: int, message: str) -> UserError:
        return UserError(
            f"{self.path}, line {line + 1}: {message}: {self.line(line)[:60]!r}",
            "export the file again, or mend the line",
        )

    def parse(self) -> ObjText:
        defined = {"vertex": self._is("v"), "texture coordinate": self._is("vt"), "normal": self._is("vn")}
        positions, has_colors = self._floats(defined["vertex"], 3)
        uvs, _ = self._floats(defined["texture coordinate"], 2)
        normals, _ = self._floats(defined["normal"], 3)
        is_face = self._is("f")
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
            positions=positions,
            uvs=uvs,
            normals=normals,
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
        for number in np.flatnonzero(np.isin(self.first, np.frombuffer(b"ogum", dtype=np.uint8))):
            keyword, _, rest = self.line(number).partition(" ")
            if keyword in ("o", "g", "usemtl", "mtllib"):
                result.append((int(number), keyword, rest.strip()))
        return result

    def _block(self, mask: NDArray[np.bool_]) -> tuple[NDArray[np.uint8], I64, I64]:
        """The chosen lines in a row with blanks for keywords: bytes, first byte and number of words of each line."""
        lengths = np.diff(self.starts)
        block = self.data[np.repeat(mask, lengths)]
        starts = np.cumsum(lengths[mask]) - lengths[mask]
        block[starts] = block[starts + 1] = ord(" ")
        return block, starts, _per_line(_word_starts(block), starts)

    def _floats(self, mask: NDArray[np.bool_], width: int) -> tuple[F64, bool]:
        """First ``width`` numbers of each chosen line, (n, width), and whether any are followed by a colour.

        A texture coordinate may be one number only: the second one is 0.
        """
        if not mask.any():
            return np.zeros((0, width)), False
        block, _, counts = self._block(mask)
        if counts.min() != counts.max() or counts[0] < width:
            return self._ragged_floats(mask, width)
        values = _converted(block, np.float64)
        if values is None or len(values) != counts.sum():
            raise self._bad_line(mask, _NUMBER)
        return np.ascontiguousarray(values.reshape(len(counts), -1)[:, :width]), bool(counts[0] >= 6)

    def _ragged_floats(self, mask: NDArray[np.bool_], width: int) -> tuple[F64, bool]:
        """The same, line by line, for lines of different length."""
        rows = []
        longest = 0
        for number in np.flatnonzero(mask):
            words = self.line(number).split()[1:]
            longest = max(longest, len(words))
            if len(words) < (1 if width == 2 else width):
                raise self.error(int(number), f"{width} numbers are needed")
            if not all(_NUMBER.fullmatch(word) for word in words):
                raise self.error(int(number), "cannot be understood")
            rows.append([float(word) for word in [*words, "0"][:width]])
        return np.array(rows), longest >= 6

    def _bad_line(self, mask: NDArray[np.bool_], word: re.Pattern[str]) -> UserError:
        for number in np.flatnonzero(mask):
            if not all(word.fullmatch(part) for part in self.line(number).split()[1:]):
                return self.error(int(number), "cannot be understood")
        return UserError(f"{self.path}: its numbers cannot be understood", "export the file again")

    def _corners(self, mask: NDArray[np.bool_]) -> tuple[I64, I64]:
        """Indices as written, (n, 3), 0 where absent, and the number of corners of each face, (F,)."""
        if not mask.any():
            return np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64)
        block, starts, sizes = self._block(mask)
        slash = block == ord("/")
        slashes = _per_line(slash, starts)
        double = _per_line(slash & np.append(slash[1:], False), starts) > 0
        block[slash] = ord(" ")
        flat = np.zeros((int(sizes.sum()), 3), dtype=np.int64)
        known = np.zeros(len(sizes), dtype=bool)
        lengths = np.diff(np.append(starts, len(block)))
        forms = (
            (slice(0, 1), slashes == 0),
            (slice(0, 2), ~double & (slashes == sizes) & (sizes > 0)),
            (slice(0, 3, 2), double & (slashes == 2 * sizes)),
            (slice(0, 3), ~double & (slashes == 2 * sizes) & (sizes > 0)),
        )
        for columns, form in forms:
            if not form.any():
                continue
            values = _converted(block if form.all() else block[np.repeat(form, lengths)], np.int64)
            width = len(range(3)[columns])
            if values is None or len(values) != sizes[form].sum() * width:
                raise self._bad_line(mask, _CORNER)
            flat[np.repeat(form, sizes), columns] = values.reshape(-1, width)
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


def _tidied(text: bytes) -> bytes:
    """One blank for each tab, one newline for each kind of line end, continued lines joined, no blanks in front."""
    text = text.removeprefix(b"\xef\xbb\xbf")
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    text = text.translate(_BLANKS)
    if b"\\\n" in text:
        text = text.replace(b"\\\n", b" ")
    if b"\n " in text or text.startswith(b" "):
        text = re.sub(rb"(?m)^ +", b"", text)
    if b"/ " in text or b"/\n" in text:
        text = re.sub(rb"(?m)(?<=[0-9])/+(?= |$)", b"", text)  # "1/" and "1//" mean "1"
    return text + b"\n"


def _word_starts(text: NDArray[np.uint8]) -> NDArray[np.bool_]:
    inside = text > ord(" ")
    inside[1:] &= ~inside[:-1].copy()
    return inside


def _per_line(flags: NDArray[np.bool_], starts: I64) -> I64:
    """How many ``flags`` are set from each start to the next."""
    positions = np.flatnonzero(flags)
    return np.diff(np.append(np.searchsorted(positions, starts), len(positions)))


@overload
def _converted(text: NDArray[np.uint8], dtype: type[np.float64]) -> F64 | None: ...
@overload
def _converted(text: NDArray[np.uint8], dtype: type[np.int64]) -> I64 | None: ...
def _converted(text: NDArray[np.uint8], dtype: Any) -> Any:
    """All numbers of ``text``; None where something in it is no number."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # how fromstring says that it stopped halfway
        try:
            return np.fromstring(text.tobytes(), sep=" ", dtype=dtype)
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
