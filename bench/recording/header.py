"""``camera_matrices.h`` of the BMFR data set: a C header, which is read as text and never compiled.

It declares ``position_limit_squared``, ``normal_limit_squared``, ``camera_matrices[N][4][4]`` and
``pixel_offsets[N][2]``. A matrix is projection times view for row vectors: clip_j = sum over k of p_k M[k][j] with
p = (x, y, z, 1); y = -1 in normalised device coordinates is image row 0, the top one, so that the usual OpenGL matrix
is flipped in y. An offset says where in its pixel a camera ray passes, from the lower left corner; (0.5, 0.5) is the
centre.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from errors import UserError, did_you_mean
from storage import replace_file

F32 = NDArray[np.float32]

LARGEST: Final = 1 << 28
"""Bytes that a header may have: more is no header."""

_SHAPES: Final = {
    "position_limit_squared": (),
    "normal_limit_squared": (),
    "camera_matrices": (None, 4, 4),
    "pixel_offsets": (None, 2),
}
"""Names that must be declared, with their dimensions; None is the number of frames."""

_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_DECLARATION = re.compile(
    r"\b(?:const|constexpr|static|float|double)\s+(?:(?:const|constexpr|static|float|double)\s+)*"
    r"(?P<name>[A-Za-z_]\w*)\s*(?P<dimensions>(?:\[[^\]]*\]\s*)*)=(?P<value>[^;]*);"
)
_TOKEN = re.compile(
    r"\s+|(?P<brace>[{},])|(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)[fFlL]?(?![\w.])|(?P<other>.)"
)


@dataclass(frozen=True)
class Header:
    """What a ``camera_matrices.h`` says of a sequence of N frames.

    ``matrices`` (N, 4, 4) float32, ``offsets`` (N, 2) float32: as described above. The limits, squared, are those of
    the distance between positions (scene units) and between normals up to which BMFR keeps a history.
    """

    position_limit_squared: float
    normal_limit_squared: float
    matrices: F32
    offsets: F32

    @property
    def frames(self) -> int:
        return len(self.matrices)


class _MistakeError(Exception):
    """What is wrong with the text, and at which character."""

    def __init__(self, text: str, at: int) -> None:
        super().__init__(text)
        self.at = at


def read_header(path: Path) -> Header:
    """The header in ``path``. Raises UserError, with the line, where it cannot be read or does not say what it must."""
    try:
        if path.stat().st_size > LARGEST:
            raise UserError(f"{path}: {path.stat().st_size / 1e6:.0f} MB are too much for a header")
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from error
    # Comments become as many spaces, so that places in the text stay what they are.
    text = _COMMENT.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)
    try:
        return _header(text)
    except _MistakeError as mistake:
        line = text.count("\n", 0, mistake.at) + 1
        raise UserError(f"{path}, line {line}: {mistake}", "docs/recording.md tells what must be there") from mistake


def _header(text: str) -> Header:
    found = {match["name"]: match for match in _DECLARATION.finditer(text)}
    values: dict[str, F32] = {}
    for name, shape in _SHAPES.items():
        if name not in found:
            raise _MistakeError(f"{name} is not declared{did_you_mean(name, found)}", len(text))
        values[name] = _array(name, found[name], shape)
    matrices, offsets = values["camera_matrices"], values["pixel_offsets"]
    if len(matrices) != len(offsets):
        at = found["pixel_offsets"].start()
        raise _MistakeError(f"{len(matrices)} camera_matrices, but {len(offsets)} pixel_offsets", at)
    return Header(float(values["position_limit_squared"]), float(values["normal_limit_squared"]), matrices, offsets)


def _array(name: str, match: re.Match[str], shape: tuple[int | None, ...]) -> F32:
    start = match.start("value")
    try:
        value = _whole_value(_tokens(match["value"], start), start)
    except _MistakeError as mistake:
        raise _MistakeError(f"{name}: {mistake}", mistake.at) from mistake
    try:
        array = np.array(value, dtype=np.float64)
    except ValueError as error:
        raise _MistakeError(f"{name}: its rows are not equally long", start) from error
    wanted = " x ".join("N" if side is None else str(side) for side in shape) or "one number"
    fits = array.ndim == len(shape) and all(
        side in (None, length) for side, length in zip(shape, array.shape, strict=True)
    )
    if not fits or array.size == 0:
        has = " x ".join(map(str, array.shape)) or "one number"
        raise _MistakeError(f"{name} must be {wanted}, but is {has}", start)
    declared = re.findall(r"\[\s*(\d+)\s*\]", match["dimensions"])
    if len(declared) == array.ndim and tuple(map(int, declared)) != array.shape:
        raise _MistakeError(f"{name}[{']['.join(declared)}] has {' x '.join(map(str, array.shape))} values", start)
    with np.errstate(over="ignore"):
        single = array.astype(np.float32)
    if not np.isfinite(single).all():
        raise _MistakeError(f"{name}: a number is too large for a float", start)
    return single


def _tokens(text: str, start: int) -> Iterator[tuple[str, int]]:
    """Braces, commas and numbers with their places."""
    for match in _TOKEN.finditer(text):
        if match["other"]:
            raise _MistakeError(
                f"{text[match.start() : match.start() + 12].split()[0]!r} is no number", start + match.start()
            )
        token = match["brace"] or match["number"]
        if token:
            yield token, start + match.start()


def _whole_value(tokens: Iterator[tuple[str, int]], at: int) -> Any:
    """The value that all ``tokens`` make."""
    value = _value(tokens, at)
    if (rest := next(tokens, None)) is not None:
        raise _MistakeError(f"{rest[0]!r} stands after the value", rest[1])
    return value


def _value(tokens: Iterator[tuple[str, int]], at: int) -> Any:
    """One number or, in braces, a list of values."""
    token, at = next(tokens, ("", at))
    if not token:
        raise _MistakeError("a value is missing", at)
    if token not in "{},":
        return float(token)
    if token != "{":
        raise _MistakeError(f"a value is missing before {token!r}", at)
    stack: list[list[Any]] = [[]]
    separated = True
    for token, at in tokens:
        if token == ",":
            if separated:
                raise _MistakeError("a value is missing before ','", at)
            separated = True
            continue
        if token == "}":
            closed = stack.pop()
            separated = False
            if not stack:
                return closed
            continue
        if not separated:
            raise _MistakeError(f"a comma is missing before {token!r}", at)
        if token == "{":
            stack[-1].append([])
            stack.append(stack[-1][-1])
        else:
            stack[-1].append(float(token))
            separated = False
    raise _MistakeError("a closing brace is missing", at)


def write_header(path: Path, header: Header, comment: Sequence[str] = ()) -> None:
    """Write ``header``, from which :func:`read_header` reads the same numbers, to the bit.

    ``comment``: lines for people. Raises UserError where the file cannot be written.
    """
    count = header.frames
    lines = [*(f"// {line}" for line in comment)]
    lines.append(f"const float position_limit_squared = {_literal(header.position_limit_squared)};")
    lines.append(f"const float normal_limit_squared = {_literal(header.normal_limit_squared)};")
    lines.append(f"const float camera_matrices[{count}][4][4] = {{")
    for matrix in header.matrices:
        rows = ", ".join(f"{{{', '.join(_literal(value) for value in row)}}}" for row in matrix)
        lines.append(f"    {{{rows}}},")
    lines += ["};", f"const float pixel_offsets[{count}][2] = {{"]
    lines += [f"    {{{_literal(x)}, {_literal(y)}}}," for x, y in header.offsets]
    text = "\n".join([*lines, "};", ""])
    replace_file(path, lambda target: target.write_text(text, encoding="utf-8"))


def _literal(value: float | np.floating) -> str:
    """The number as a C literal of type float, the shortest that stands for the same."""
    text = str(np.float32(value))
    return f"{text}f" if "." in text or "e" in text else f"{text}.0f"
