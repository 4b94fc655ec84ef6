"""A report as files that programs read: JSON with everything, CSV with a line for each method and scene."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from bench.claims import claims
from bench.goals import GOALS
from bench.results import Report, contenders
from bench.scores import Pictures
from storage import replace_file

CSV_HEADER = (
    "scene", "motion", "width", "height", "method", "group", "settings", "frame_ms", "filter_ms", "filter_p95_ms",
    "rmse", "relmse", "psnr_db", "ssim", "flip", "temporal", "front_rmse", "front_flip", "equal_time_paths",
    "equal_time_rmse", "equal_time_flip",
)  # fmt: skip


def write_json(path: Path, report: Report) -> None:
    """Write the whole report but its pictures; what is not a finite number becomes null.

    Raises UserError where writing fails.
    """
    goals = [{"what": g.what, "unit": g.unit, "limit": g.limit, "value": g.find(report)} for g in GOALS]
    content = plain(report) | {"goals": plain(goals)}
    for result, written in zip(report.quality, content["quality"], strict=True):
        written["contenders"] = plain(contenders(result))
        written["claims"] = plain(claims(result))
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    replace_file(path, lambda target: target.write_text(text, encoding="utf-8"))


def plain(value: Any) -> Any:
    """Dataclasses as dictionaries, without pictures; NumPy's numbers as Python's; NaN and infinity as None."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = (item.name for item in dataclasses.fields(value))
        return {name: plain(getattr(value, name)) for name in names if not isinstance(getattr(value, name), Pictures)}
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_csv(path: Path, report: Report) -> None:
    """Write a line for every method and every number of paths, on every sequence. Raises UserError."""

    def save(target: Path) -> None:
        with target.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(CSV_HEADER)
            for result in report.quality:
                for c in contenders(result):
                    e, equal = c.errors, c.equal
                    errors = (e.rmse, e.relmse, e.psnr, e.ssim, e.flip, e.temporal)
                    writer.writerow(
                        (
                            result.scene,
                            result.motion,
                            *result.size,
                            c.name,
                            c.group,
                            c.described,
                            *(f"{time:.3f}" for time in (c.milliseconds, c.filter_milliseconds, c.p95)),
                            *(f"{error:.6g}" for error in errors),
                            int(c.best_rmse),
                            int(c.best_flip),
                            *((equal.samples, equal.errors.rmse, equal.errors.flip) if equal else ("", "", "")),
                        )
                    )

    replace_file(path, save)
