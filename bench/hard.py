"""The table of hard cases, where this installation has one (bench/hard_cases.py)."""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any


def hard_cases() -> dict[str, Any] | None:
    """``{"head": [...], "rows": [[...], ...]}`` of text; None without hard cases."""
    if importlib.util.find_spec("bench.hard_cases") is None:
        return None
    table = importlib.import_module("bench.hard_cases").table()
    return {"head": [str(cell) for cell in table[0]], "rows": [[str(cell) for cell in row] for row in table[1]]}
