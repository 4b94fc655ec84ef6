"""Writes the generated parts of README.md: keys, parameters, presets, and what `app.py bench` measured.

    python -m tools.readme_tables                  keys, parameters and presets
    python -m tools.readme_tables out/bench.json   the measured table as well
    python -m tools.readme_tables --check          write nothing; exit code 1 if a part is out of date

A part lies between ``<!-- name:start -->`` and ``<!-- name:end -->``; nothing else is touched.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import config
from errors import UserError
from parameter import parameters as parameters_of
from presets import PRESETS
from ui import keys

README: Final = Path(__file__).resolve().parent.parent / "README.md"

Report = dict[str, Any]
"""The JSON that :func:`bench.report.write_json` writes."""


def table(header: Sequence[str], rows: Iterable[Sequence[str]], numbers: int = 0) -> str:
    """A Markdown table, the last ``numbers`` columns of which are aligned right."""
    rule = ["---"] * (len(header) - numbers) + ["--:"] * numbers
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (header, rule, *rows))


def parameters() -> str:
    """Every parameter with its default and range."""
    rows = []
    for row in config.describe():
        choices = ", ".join(f"`{choice}`" for choice in row.range.split(" | "))  # a bare | would end the cell
        rows.append((f"`{row.section}.{row.key}`", f"`{row.default}`", choices, row.doc.replace("|", "\\|")))
    return table(("parameter", "default", "range", "meaning"), rows)


def presets() -> str:
    """The keys in which the presets of a section differ, with the value that each gives them."""
    rows = []
    for section in PRESETS:
        loaded = {name: getattr(_loaded(section, name), section) for name in PRESETS[section]}
        for key in parameters_of(config.SECTIONS[section]):
            values = [json.dumps(getattr(group, key)) for group in loaded.values()]
            if key != "preset" and len(set(values)) > 1:
                rows.append((f"`{section}.{key}`", *(f"`{value}`" for value in values)))
    names = dict.fromkeys(name for section in PRESETS.values() for name in section)
    return table(("parameter", *(f'`"{name}"`' for name in names)), rows)


def _loaded(section: str, preset: str) -> config.Config:
    return config.load(None, (f"{section}.preset={preset}",))


def measured(report: Report) -> str:
    """Machine, error and time of the methods, and the tracer's speed, of one report of ``app.py bench``.

    Raises UserError for a quick run.
    """
    if report["quick"]:
        raise UserError("a report of bench --quick: its numbers mean nothing", "measure without --quick")
    machine, preset, seed = report["machine"], report["config"]["svgf"]["preset"], report["config"]["render"]["seed"]
    packages = ", ".join(f"{name} {number}" for name, number in machine["packages"].items())
    circumstances = (
        f"{machine['renderer']} (OpenGL {machine['opengl']}); {machine['cpu']}, {machine['threads']} threads; "
        f"{machine['system']}; Python {machine['python']}, {packages}. "
        f"Preset `{preset}` unless said otherwise, seed {seed}, {machine['date'][:10]}."
    )
    return "\n\n".join([circumstances, *map(_quality, report["quality"]), _tracing(report["tracing"])])


def _quality(result: Report) -> str:
    """Time and error of every method of one sequence."""
    rows = [
        (
            m["name"],
            _number(m["milliseconds"], 1),
            *(_number(m[key], 4) for key in ("rmse", "rmse_ratio", "temporal", "temporal_ratio")),
        )
        for m in result["methods"]
        if not (m["method"] and m["method"]["stage"])  # those are for the report
    ]
    noise, temporal_noise = _number(result["noise"], 4), _number(result["temporal_noise"], 4)
    rows.append(("noise of the reference", "", noise, "", temporal_noise, ""))
    heads = ("method", "ms per frame", "RMSE", "of noisy", "temporal error", "of noisy")
    title = f"`{result['scene']}`, {result['motion']}, {_size(result)}, against {result['samples']} paths per pixel:"
    return f"{title}\n\n{table(heads, rows, numbers=5)}"


def _tracing(results: Sequence[Report]) -> str:
    rows = [
        (
            f"`{t['scene']}`, {t['motion']}, {_size(t)}",
            f"{t['triangles']:,}",
            _number(t["frame"]["median"], 1),
            _number(t["outside"]["median"], 1),
            _number(t["mrays_frame"], 1),
        )
        for t in results
    ]
    heads = ("tracing, one path per pixel", "triangles", "ms per frame", "of it outside Embree", "10⁶ rays/s")
    return table(heads, rows, numbers=4)


def _size(result: Report) -> str:
    return "{}x{}".format(*result["size"])


def _number(value: float | None, digits: int) -> str:
    """A report has null for what is not finite."""
    return "–" if value is None else f"{value:.{digits}f}"


def read_report(path: Path) -> Report:
    """Raises UserError when ``path`` cannot be read or is no JSON object."""
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})", "`app.py bench` writes it") from error
    except ValueError as error:
        raise UserError(f"{path}: is not valid JSON ({error})", "`app.py bench` writes it") from error
    if not isinstance(report, dict) or not {"machine", "config", "quick", "quality", "tracing"} <= report.keys():
        raise UserError(f"{path}: is not a report of `app.py bench`", "`app.py bench` writes one to out/bench.json")
    return report


def updated(text: str, parts: Mapping[str, str]) -> str:
    """``text`` with new content between the markers of every part. Raises UserError unless each is there once."""
    for name, content in parts.items():
        pattern = rf"(<!-- {name}:start -->\n).*?(<!-- {name}:end -->)"
        pieces = re.split(pattern, text, flags=re.DOTALL)
        if len(pieces) != 4:
            raise UserError(f"README.md: part {name!r} must stand there once, between its :start and :end markers")
        before, start, end, after = pieces
        text = f"{before}{start}{content}\n{end}{after}"
    return text


def build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="readme_tables", description="Write the generated parts of README.md.")
    parser.add_argument("report", nargs="?", type=Path, metavar="JSON", help="what app.py bench wrote")
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if a part is out of date")
    return parser


def run(argv: Sequence[str], readme: Path = README) -> int:
    """Returns the exit code. Raises UserError."""
    args = build_parser().parse_args(argv)
    parts = {"keys": keys.markdown(), "parameters": parameters(), "presets": presets()}
    if args.report:
        parts["bench"] = measured(read_report(args.report))
    before = readme.read_text(encoding="utf-8")
    after = updated(before, parts)
    if args.check:
        if after != before:
            print(f"{readme.name} is out of date: run `python -m tools.readme_tables`", file=sys.stderr)
        return int(after != before)
    readme.write_text(after, encoding="utf-8")
    return 0


def main() -> int:
    try:
        return run(sys.argv[1:])
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
