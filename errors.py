"""Errors and notices meant for people.

A :class:`UserError` is a mistake the user can mend (a bad file, a bad flag, a missing library). Its text says what was
wrong, where, and what to do; ``app.py`` prints it as one message and exits with code 2, never with a traceback.
Anything else that is raised is a bug of ours and keeps its traceback.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class UserError(Exception):
    """What was wrong, where, and what to do, in one message. ``hint`` is printed on a line of its own."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message if not hint else f"{message}\n  {hint}")


class Notices:
    """Things that were repaired or approximated: kept in order, each text once."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def add(self, text: str) -> None:
        if text not in self.lines:
            self.lines.append(text)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """``", did you mean 'alpha'?"`` for the nearest known name, or the empty string when none is near."""
    match = difflib.get_close_matches(name, list(known), 1, 0.5)
    return f", did you mean {match[0]!r}?" if match else ""
