"""Shader files to one text that OpenGL takes, and its line numbers back to files. No OpenGL here.

Why not moderngl's ``#include``: it is one level deep and fires inside comments. Why no ``#line``: it can carry a number
but no file name, and Mesa drops even the number. So everything is pasted into one text without ``#line``, the driver
counts the lines of that text, and :class:`Source` remembers where each of them came from.

Rules for shader files: no ``#version`` (the expander writes ``#version 430 core``); ``#include "common/x.glsl"`` with a
path below the shader folder, not inside ``#if``; each file is pasted at most once.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from errors import UserError, did_you_mean

VERSION: Final = "#version 430 core"

_COMMENT_OR_STRING = re.compile(r'//[^\n]*|/\*.*?(?:\*/|\Z)|"[^"\n]*"', re.DOTALL)
_DIRECTIVE = re.compile(r"\s*#\s*(\w+)\s*(.*)")
# What drivers write before a message: "0:12(5): " Mesa, "0(12) : " NVIDIA, "ERROR: 0:12: " AMD, Intel, Apple.
_LOG_LINE = re.compile(r"(?:(?P<kind>ERROR|WARNING):\s*)?\d+[:(](?P<line>\d+)\)?(?:\(\d+\))?\s*:\s*(?P<text>.*)")


class ShaderError(UserError):
    """A shader cannot be used. The message has one line per mistake, each with the file and line to look at."""


@dataclass(frozen=True, slots=True)
class Source:
    """A shader with its includes pasted in.

    Attributes:
        path: of the main file, below the shader folder.
        text: what OpenGL compiles.
        origins: for each line of ``text`` its file and 1-based line there; line 0 stands for a line written by
            the expander.
        files: every file that went in, below the shader folder, the main file first.
    """

    path: str
    text: str
    origins: tuple[tuple[str, int], ...]
    files: tuple[str, ...]

    def where(self, line: int) -> str:
        """``"common/x.glsl:12"`` for the 1-based ``line`` of :attr:`text`."""
        if not 1 <= line <= len(self.origins):
            return self.path
        file, number = self.origins[line - 1]
        if number:
            return f"{file}:{number}"
        added = self.text.split("\n")[line - 1]
        return f"{file} (line added in front: {added})"

    def explain(self, log: str) -> str:
        """A compiler's log with the real files and lines, and below each message the line it is about."""
        lines = self.text.split("\n")
        explained: list[str] = []
        for raw in filter(None, map(str.strip, log.splitlines())):
            found = _LOG_LINE.fullmatch(raw)
            if not found:
                explained.append(raw)
                continue
            number = int(found["line"])
            kind = f"{found['kind'].lower()}: " if found["kind"] else ""
            explained.append(f"{self.where(number)}: {kind}{found['text']}")
            if 1 <= number <= len(lines):
                explained.append(f"    {lines[number - 1].strip()}")
        return "\n".join(explained)


def strip_comments(text: str) -> str:
    """``text`` with its comments blanked out, every other character on its old line and column."""

    def blank(match: re.Match[str]) -> str:
        found = match[0]
        return found if found.startswith('"') else re.sub(r"[^\n]", " ", found)

    return _COMMENT_OR_STRING.sub(blank, text)


def expand(root: Path, path: str, defines: Mapping[str, str] | None = None, text: str | None = None) -> Source:
    """Read a shader, paste its includes in, and put the version and the defines in front.

    Args:
        root: the shader folder.
        path: of the main file, below ``root``.
        defines: become ``#define NAME value``, in this order.
        text: the main file's content, instead of reading it; for shaders made on the spot.

    Raises:
        ShaderError: a file is missing, or breaks one of the rules above.
    """
    expander = _Expander(root, path)
    expander.emit(VERSION, path, 0)
    for name, value in (defines or {}).items():
        expander.emit(f"#define {name} {value}", path, 0)
    expander.paste(path, _read(root, path, "") if text is None else text)
    return Source(path, "\n".join(expander.lines) + "\n", tuple(expander.origins), tuple(expander.files))


class _Expander:
    def __init__(self, root: Path, path: str) -> None:
        self.root = root
        self.files = [path]
        self.lines: list[str] = []
        self.origins: list[tuple[str, int]] = []

    def emit(self, line: str, file: str, number: int) -> None:
        self.lines.append(line)
        self.origins.append((file, number))

    def paste(self, path: str, text: str) -> None:
        conditions = 0
        text = text.removesuffix("\n")
        for number, (line, code) in enumerate(zip(text.split("\n"), strip_comments(text).split("\n"), strict=True), 1):
            here = f"{path}:{number}"
            directive = _DIRECTIVE.match(code)
            word = directive[1] if directive else ""
            if word in ("if", "ifdef", "ifndef"):
                conditions += 1
            elif word == "endif":
                conditions -= 1
            elif word in ("version", "line"):
                raise ShaderError(f"{here}: #{word} is not allowed in shader files; {VERSION!r} is added by itself")
            elif directive and word == "include":
                if conditions > 0:
                    raise ShaderError(f"{here}: #include inside #if; each file is pasted once, so include it always")
                self.include(directive[2].strip(), here)
                continue
            self.emit(line, path, number)

    def include(self, argument: str, here: str) -> None:
        quoted = re.fullmatch(r'"([^"]+)"', argument)
        if not quoted:
            raise ShaderError(f'{here}: expected #include "folder/file.glsl", got #include {argument}')
        path = quoted[1]
        if path not in self.files:
            self.files.append(path)
            self.paste(path, _read(self.root, path, f"{here}: "))


def _read(root: Path, path: str, context: str) -> str:
    try:
        return (root / path).read_text(encoding="utf-8")
    except FileNotFoundError:
        known = sorted(str(file.relative_to(root)) for file in root.rglob("*.*"))
        raise ShaderError(
            f"{context}there is no shader file {path!r} below {root}{did_you_mean(path, known)}"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise ShaderError(f"{context}shader file {path!r} cannot be read: {error}") from None
