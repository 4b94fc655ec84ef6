"""The part of GLSL's preprocessor that decides which declarations of a shader are there: conditions and plain macros.

The interface check needs it (:mod:`gl.interface`); OpenGL never sees its result. Macros with arguments are left alone,
so a declaration must not be written through one.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from typing import Final

from errors import did_you_mean
from gl.shader import ShaderError, Source, strip_comments

PREDEFINED: Final = {"__VERSION__": "430", "GL_core_profile": "1"}

_DIRECTIVE = re.compile(r"\s*#\s*(\w*)\s*(.*)", re.DOTALL)
_DEFINE = re.compile(r"(\w+)(\(?)\s*(.*)", re.DOTALL)
_TOKEN = re.compile(r"\s*(?:(0[xX][0-9a-fA-F]+|\d+)[uU]?|(\w+)|(<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%<>&|^~!()]))")
_WORD = re.compile(r"(?<![\w.])[A-Za-z_]\w*")
_MAX_NESTED_MACROS = 32


def preprocess(source: Source) -> str:
    """``source.text`` without comments, directives and lines that conditions switch off; plain macros are replaced.

    Every line stays on its number, so ``source.where`` holds for the result.

    Raises:
        ShaderError: a condition cannot be evaluated, an ``#endif`` is missing, or an ``#error`` is reached.
    """
    lines = strip_comments(source.text).split("\n")
    macros = dict(PREDEFINED)
    # One entry per open #if: (this branch is active, some branch was taken already, all outer ones are active).
    stack: list[tuple[bool, bool, bool]] = []
    result = [""] * len(lines)
    i = 0
    while i < len(lines):
        start, line = i, lines[i]
        while line.endswith("\\") and i + 1 < len(lines):
            i += 1
            line = line[:-1] + lines[i]
        i += 1
        active = not stack or stack[-1][0]
        directive = _DIRECTIVE.match(line)
        if directive is None:
            result[start] = _replace(line, macros) if active else ""
            continue
        try:
            _obey(directive[1], directive[2].strip(), macros, stack, active)
        except ValueError as error:
            raise ShaderError(f"{source.where(start + 1)}: {error}") from None
    if stack:
        raise ShaderError(f"{source.path}: {len(stack)} #endif missing")
    return "\n".join(result)


def _obey(word: str, rest: str, macros: dict[str, str], stack: list[tuple[bool, bool, bool]], active: bool) -> None:
    """Carry out one directive; what is meant for the compiler (#extension, #pragma) is passed over."""
    if word in ("if", "ifdef", "ifndef"):
        taken = active and _holds(word, rest, macros)
        stack.append((taken, taken, active))
    elif word in ("elif", "else", "endif"):
        if not stack:
            raise ValueError(f"#{word} without #if")
        _, taken_before, outer = stack.pop()
        if word == "elif":
            taken = outer and not taken_before and evaluate(rest, macros) != 0
            stack.append((taken, taken or taken_before, outer))
        elif word == "else":
            stack.append((outer and not taken_before, True, outer))
    elif active and word == "define":
        name, bracket, value = _split_define(rest)
        if not bracket:
            macros[name] = value
    elif active and word == "undef":
        macros.pop(rest, None)
    elif active and word == "error":
        raise ValueError(f"#error {rest}")


def _holds(word: str, rest: str, macros: Mapping[str, str]) -> bool:
    if word == "if":
        return evaluate(rest, macros) != 0
    return (rest in macros) == (word == "ifdef")


def _split_define(rest: str) -> tuple[str, str, str]:
    found = _DEFINE.fullmatch(rest)
    if not found:
        raise ValueError(f"#define {rest}: a name is expected")
    return found[1], found[2], found[3].strip()


def _replace(line: str, macros: Mapping[str, str]) -> str:
    """Replace plain macros in ``line`` until none is left."""
    for _ in range(_MAX_NESTED_MACROS):
        replaced = _WORD.sub(lambda match: macros.get(match[0], match[0]), line)
        if replaced == line:
            return line
        line = replaced
    return line


_BINARY: Final[dict[str, tuple[int, Callable[[int, int], int]]]] = {
    "||": (1, lambda a, b: int(a != 0 or b != 0)),
    "&&": (2, lambda a, b: int(a != 0 and b != 0)),
    "|": (3, operator.or_),
    "^": (4, operator.xor),
    "&": (5, operator.and_),
    "==": (6, operator.eq),
    "!=": (6, operator.ne),
    "<": (7, operator.lt),
    ">": (7, operator.gt),
    "<=": (7, operator.le),
    ">=": (7, operator.ge),
    "<<": (8, operator.lshift),
    ">>": (8, operator.rshift),
    "+": (9, operator.add),
    "-": (9, operator.sub),
    "*": (10, operator.mul),
    "/": (10, lambda a, b: int(a / b)),  # towards zero, as GLSL has it
    "%": (10, lambda a, b: a - b * int(a / b)),
}
_UNARY: Final[dict[str, Callable[[int], int]]] = {
    "-": operator.neg,
    "+": operator.pos,
    "~": operator.invert,
    "!": operator.not_,
}


def evaluate(expression: str, macros: Mapping[str, str]) -> int:
    """The value of the integer expression of an ``#if``.

    Raises:
        ValueError: it is malformed, divides by zero, or uses a name that is not defined; GLSL, unlike C, does not read
            that as 0, and so a misspelt define is found.
    """
    tokens = _expand_tokens(_tokens(expression), macros, 0)
    parser = _Parser(tokens, macros)
    try:
        value = parser.expression(0, needed=True)
    except ZeroDivisionError:
        raise ValueError(f"#if {expression}: division by zero") from None
    if parser.position != len(tokens):
        raise ValueError(f"#if {expression}: did not expect {tokens[parser.position]!r}")
    return int(value)


def _tokens(expression: str) -> list[str]:
    tokens: list[str] = []
    position = 0
    expression = expression.rstrip()
    while position < len(expression):
        found = _TOKEN.match(expression, position)
        if not found:
            raise ValueError(f"#if {expression}: cannot read {expression[position:].strip()!r}")
        tokens.append(found[1] or found[2] or found[3])
        position = found.end()
    return tokens


def _expand_tokens(tokens: list[str], macros: Mapping[str, str], depth: int) -> list[str]:
    """Replace macros by their tokens, but not the name that ``defined`` asks about."""
    expanded: list[str] = []
    for i, token in enumerate(tokens):
        asked = tokens[i - 1 : i] == ["defined"] or tokens[max(i - 2, 0) : i] == ["defined", "("]
        if token in macros and not asked and depth < _MAX_NESTED_MACROS:
            expanded += _expand_tokens(_tokens(macros[token]), macros, depth + 1)
        else:
            expanded.append(token)
    return expanded


class _Parser:
    """Precedence climbing over a list of tokens."""

    def __init__(self, tokens: list[str], macros: Mapping[str, str]) -> None:
        self.tokens = tokens
        self.macros = macros
        self.position = 0

    def take(self) -> str:
        if self.position == len(self.tokens):
            raise ValueError("#if: the expression ends too early")
        self.position += 1
        return self.tokens[self.position - 1]

    def expression(self, floor: int, needed: bool) -> int:
        """An operand and all binary operators above ``floor``. What && and || skip is parsed but not ``needed``."""
        left = self.operand(needed)
        while self.position < len(self.tokens):
            symbol = self.tokens[self.position]
            if symbol not in _BINARY or _BINARY[symbol][0] <= floor:
                break
            self.position += 1
            precedence, apply = _BINARY[symbol]
            skipped = (symbol == "&&" and left == 0) or (symbol == "||" and left != 0)
            right = self.expression(precedence, needed and not skipped)
            left = int(apply(left, right)) if needed else 0
        return left

    def operand(self, needed: bool) -> int:
        token = self.take()
        if token == "(":
            value = self.expression(0, needed)
            if self.take() != ")":
                raise ValueError("#if: a closing bracket is missing")
            return value
        if token in _UNARY:
            return int(_UNARY[token](self.operand(needed)))
        if token == "defined":
            name = self.take()
            if name == "(":
                name = self.take()
                if self.take() != ")":
                    raise ValueError("#if: a closing bracket is missing after defined(")
            return int(name in self.macros)
        if token[0].isdigit():
            return int(token, 16) if token[:2] in ("0x", "0X") else int(token)
        if needed:
            raise ValueError(f"#if: {token!r} is not defined{did_you_mean(token, self.macros)}")
        return 0
