"""All hard cases in one table."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

from bench.hard import blocks, light, not_finite, over_time, scenes, surfaces, variance
from bench.hard.stage import Row, Stage, number
from console import Progress, table
from gl.context import create_headless
from gl.renderer import Renderer
from storage import replace_file, require_writable

GROUPS: Final[dict[str, Callable[[Stage], list[Row]]]] = {
    "variance": variance.measure,
    "regression": blocks.measure,
    "not finite": not_finite.measure,
    "light": light.measure,
    "surfaces": surfaces.measure,
    "time": over_time.measure,
    "scene": scenes.measure,
}
"""Name -> what measures the cases of a group."""

HEADER: Final = ("case", "method", "exact", "error", "bound", "unguarded", "recovered", "")


def measure(renderer: Renderer, groups: Sequence[str] = tuple(GROUPS)) -> dict[str, list[Row]]:
    """Measure the cases of ``groups`` with ``renderer``; the table of each by its name."""
    stage = Stage(renderer)
    found = {}
    with Progress("hard cases") as progress:
        for done, group in enumerate(groups, 1):
            found[group] = GROUPS[group](stage)
            progress.update(done / len(groups))
    return found


def cells(row: Row) -> tuple[str, ...]:
    """A row as text, in the order of :data:`HEADER`."""
    return (
        row.case,
        row.method,
        row.exact,
        f"{number(row.error)} {row.measure}",
        number(row.bound),
        row.unguarded,
        "" if row.recovery is None else f"after {row.recovery}",
        "" if row.passed else "FAILS",
    )


def text(found: dict[str, list[Row]]) -> str:
    """The tables for a terminal."""
    return "\n\n".join(f"{group}\n{table(HEADER, [cells(row) for row in rows])}" for group, rows in found.items())


def as_json(found: dict[str, list[Row]]) -> list[dict[str, Any]]:
    """Every row as a dictionary; null for an error that is not finite."""
    return [
        {"group": group, **vars(row), "error": row.error if math.isfinite(row.error) else None, "passed": row.passed}
        for group, rows in found.items()
        for row in rows
    ]


def markdown(found: dict[str, list[Row]]) -> str:
    """The tables of docs/hard_cases.md."""
    rule = " | ".join(["---"] * len(HEADER[:-1]))
    tables = []
    for group, rows in found.items():
        lines = [f"### {group.capitalize()}", "", f"| {' | '.join(HEADER[:-1])} |", f"| {rule} |"]
        tables.append("\n".join([*lines, *(f"| {' | '.join(cells(row)[:-1])} |" for row in rows)]))
    return "\n\n".join(tables)


def run(out: Path) -> None:
    """``app.py bench --hard``: measure, print, and write ``out`` (JSON).

    Raises UserError for a place that cannot be written, and without OpenGL.
    """
    require_writable(out)
    with ExitStack() as stack:
        context = create_headless()
        stack.callback(context.release)
        renderer = Renderer(context)
        stack.callback(renderer.release)
        found = measure(renderer)
    print(text(found))
    failed = sum(not row.passed for rows in found.values() for row in rows)
    print(f"\n{failed or 'none'} of {sum(map(len, found.values()))} cases beyond their bounds")
    replace_file(out, lambda path: path.write_text(json.dumps(as_json(found), indent=1) + "\n", encoding="utf-8"))
    print(out)
