"""The tables of hard cases for the page, where this installation measures them (bench/hard/)."""

from __future__ import annotations

import importlib
import importlib.util
from dataclasses import dataclass
from typing import Any

from bench.methods import NewRenderer

_LONG = "time"
"""The group of cases that takes longest: 10^5 frames."""


@dataclass(frozen=True)
class HardTable:
    """One group of hard cases as text: its heading, and a row for each case."""

    group: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def hard_cases(new_renderer: NewRenderer, quick: bool) -> tuple[HardTable, ...]:
    """Measure the hard cases, with ``quick`` without those that take long; nothing where there are none."""
    if importlib.util.find_spec("bench.hard") is None:
        return ()
    cases: Any = importlib.import_module("bench.hard.cases")
    renderer = new_renderer()
    try:
        groups = tuple(group for group in cases.GROUPS if not (quick and group == _LONG))
        found = cases.measure(renderer, groups)
    finally:
        renderer.release()
    return tuple(
        HardTable(group, tuple(cases.HEADER), tuple(tuple(cases.cells(row)) for row in rows))
        for group, rows in found.items()
    )
