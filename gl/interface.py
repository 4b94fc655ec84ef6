"""Do a shader's declarations and its pass's ports agree? Checked in both directions and without OpenGL.

OpenGL would not tell: to moderngl a misspelt uniform and one that was optimised away look the same, and an image bound
with another format than its shader's raises nothing at all.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from errors import did_you_mean
from gl.formats import FORMATS
from gl.plan import Node
from gl.ports import HISTORY_FLAG, ComputePass
from gl.preprocessor import preprocess
from gl.shader import ShaderError, Source, expand

COMMON: Final = "common/"
"""Folder of the files that many shaders include; they hold pure functions only."""

_STORAGE: Final = frozenset(["uniform", "in", "out", "buffer", "shared"])
_PRECISION: Final = frozenset(["highp", "mediump", "lowp", "precise", "invariant"])
_INTERPOLATION: Final = frozenset(["flat", "smooth", "noperspective", "centroid"])
_MEMORY: Final = frozenset(["readonly", "writeonly", "coherent", "volatile", "restrict"])
_KEYWORDS: Final = _STORAGE | _PRECISION | _INTERPOLATION | _MEMORY
_LAYOUT = re.compile(r"\blayout\s*\(([^)]*)\)")
_NAME = re.compile(r"(\w+)\s*((?:\[[^]]*\])*)")


@dataclass(frozen=True, slots=True)
class Declaration:
    """One global ``uniform``, ``in``, ``out``, ``buffer`` or ``shared`` of a shader.

    Attributes:
        storage: which of them.
        type: GLSL type, with brackets if it is an array; empty for a block.
        name: identifier; for a block the block's name.
        layout: what stands in ``layout(...)``: ``{"location": "0", "rgba16f": ""}``.
        writeonly: the qualifier is there.
        line: 1-based line in the expanded text.
        where: file and line of the real file.
        file: the real file.
    """

    storage: str
    type: str
    name: str
    layout: dict[str, str]
    writeonly: bool
    line: int
    where: str
    file: str


def declarations(source: Source) -> list[Declaration]:
    """The global interface declarations that are active under the defines of ``source``, in order.

    Raises:
        ShaderError: preprocessing fails, or a uniform has an initialiser (Python sets every uniform).
    """
    found: list[Declaration] = []
    for line, statement, is_block in _global_statements(preprocess(source)):
        found += _parse(source, line, statement, is_block)
    return found


def _global_statements(text: str) -> Iterator[tuple[int, str, bool]]:
    """Line, text and whether a ``{`` block follows, of every statement outside of braces."""
    depth = 0
    start = 0
    for mark in re.finditer(r"[{};]", text):
        char, end = mark[0], mark.end()
        if depth == 0 and char in "{;":
            statement = text[start : mark.start()]
            first = start + len(statement) - len(statement.lstrip())
            yield text.count("\n", 0, first) + 1, statement.strip(), char == "{"
        depth += {"{": 1, "}": -1, ";": 0}[char]
        if depth == 0:
            start = end


def _parse(source: Source, line: int, statement: str, is_block: bool) -> list[Declaration]:
    layout: dict[str, str] = {}
    for inside in _LAYOUT.findall(statement):
        for entry in inside.split(","):
            key, _, value = entry.partition("=")
            layout[key.strip()] = value.strip()
    rest = _LAYOUT.sub(" ", statement)
    words = rest.split("(")[0].split("=")[0].split()
    storage = next((word for word in words if word in _STORAGE), "")
    if not storage or ("(" in rest and "=" not in rest):
        return []  # a function, a constant, a precision statement
    where, file = source.where(line), source.origins[line - 1][0]
    writeonly = "writeonly" in words
    names = [word for word in words if word not in _KEYWORDS]
    if is_block:
        return [Declaration(storage, "", names[-1] if names else "", layout, writeonly, line, where, file)]
    if not names:
        return []  # layout(local_size_x = 8) in;
    if "=" in rest:
        raise ShaderError(f"{where}: {names[-1]!r} has an initialiser; Python gives every uniform its value")
    return [
        Declaration(storage, names[0] + array.replace(" ", ""), name, layout, writeonly, line, where, file)
        for name, array in _NAME.findall(" ".join(names[1:]))
    ]


def wanted_declarations(node: Node) -> dict[str, str]:
    """The GLSL declaration of every port of ``node`` by name, as it should be written in the shader."""
    work = node.work
    wanted = {port: f"uniform {FORMATS[tex.fmt].sampler} {port};" for port, tex in node.reads.items()}
    wanted |= {port: f"uniform {FORMATS[history.fmt].sampler} {port};" for port, history in node.prevs.items()}
    if node.prevs:
        wanted[HISTORY_FLAG] = f"uniform bool {HISTORY_FLAG};"
    wanted |= {name: f"uniform {uniform.type} {name};" for name, uniform in work.ports.uniforms.items()}
    for index, (port, name) in enumerate(work.formats.items()):
        fmt = FORMATS[name]
        if isinstance(work, ComputePass):
            wanted[port] = f"layout({name}, binding = {index}) writeonly uniform {fmt.image} {port};"
        else:
            wanted[port] = f"layout(location = {index}) out {fmt.vector(4)} {port};"
    return wanted


def check(source: Source, node: Node) -> None:
    """Compare the shader's declarations with the ports of ``node``.

    Raises:
        ShaderError: they differ; one line per difference, with what should be written.
    """
    wanted = wanted_declarations(node)
    there = declarations(source)
    problems = [problem for declaration in there for problem in _judge(declaration, node, wanted)]
    names = {declaration.name for declaration in there}
    problems += [
        f"{source.path}: {text!r} is missing for {type(node.work).__name__}.{name}{did_you_mean(name, names)}"
        for name, text in wanted.items()
        if name not in names
    ]
    if problems:
        raise ShaderError("\n".join(problems))


def _judge(found: Declaration, node: Node, wanted: dict[str, str]) -> Iterator[str]:
    """What is wrong with one declaration."""
    title = type(node.work).__name__
    if found.file.startswith(COMMON):
        yield f"{found.where}: {found.storage} {found.name!r}: files in {COMMON} have pure functions only"
    elif found.storage == "shared" and isinstance(node.work, ComputePass):
        return
    elif found.storage in ("in", "buffer", "shared") or not found.type:
        yield f"{found.where}: {found.storage} {found.name!r}: ports are plain uniforms, samplers, images and outputs"
    elif found.name in node.work.ports.ins and found.name not in wanted:
        macro = f"HAS_{found.name.upper()}"
        yield f"{found.where}: optional input {found.name!r} is not connected; put its declaration in #if {macro}"
    elif found.name not in wanted:
        yield f"{found.where}: {found.name!r} is no port of {title}{did_you_mean(found.name, wanted)}"
    elif not _agrees(found, node, wanted[found.name]):
        yield f"{found.where}: {found.name!r} does not match {title}, write {wanted[found.name]!r}"


def _agrees(found: Declaration, node: Node, wanted: str) -> bool:
    if found.name not in node.work.formats:
        return f"{found.storage} {found.type} {found.name};" == wanted
    index = str(list(node.work.formats).index(found.name))
    fmt = FORMATS[node.work.formats[found.name]]
    if isinstance(node.work, ComputePass):
        kind = ("uniform", fmt.image, True)
        agreed = (found.storage, found.type, found.writeonly) == kind and found.layout.get("binding") == index
        return agreed and fmt.name in found.layout
    # More components than the texture has are dropped; with fewer, the missing ones would be undefined.
    types = [fmt.vector(n) for n in range(fmt.components, 5)]
    return found.storage == "out" and found.type in types and found.layout.get("location") == index


def load(root: Path, node: Node) -> Source:
    """The shader of ``node``, expanded with its defines and checked against its ports.

    Args:
        root: the shader folder.

    Raises:
        ShaderError: a file is missing or malformed, or the interface does not agree.
    """
    source = expand(root, node.work.shader, node.defines())
    check(source, node)
    return source
