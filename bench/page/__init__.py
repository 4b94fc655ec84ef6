"""The report as one self-contained HTML page: diagrams, tables, and pictures to flip between. No network needed.

The diagrams are drawn by Plotly, whose JavaScript travels compressed inside the page; the rest is page.html, page.css
and the scripts beside this file. What they show is JSON made by :mod:`bench.page.gather`.
"""

from __future__ import annotations

import base64
import gzip
import json
from pathlib import Path
from typing import Any, Final

from bench.page.gather import content
from bench.results import Report
from storage import replace_file

_FOLDER: Final = Path(__file__).resolve().parent

_SCRIPTS: Final = ("common.js", "charts.js", "viewer.js", "tables.js", "main.js")


def write(path: Path, report: Report) -> None:
    """Write the page. Raises UserError where that fails."""
    text = render(content(report))
    replace_file(path, lambda target: target.write_text(text, encoding="utf-8"))


def render(data: dict[str, Any]) -> str:
    """The page that shows ``data`` (:func:`bench.page.gather.content`)."""
    from plotly.offline import get_plotlyjs

    library = base64.b64encode(gzip.compress(get_plotlyjs().encode(), mtime=0)).decode("ascii")
    parts = {
        "css": (_FOLDER / "page.css").read_text(encoding="utf-8"),
        "scripts": "\n".join((_FOLDER / name).read_text(encoding="utf-8") for name in _SCRIPTS),
        "library": library,
        "data": embedded(data),
    }
    text = (_FOLDER / "page.html").read_text(encoding="utf-8")
    for name, part in parts.items():
        text = text.replace(f"{{{{{name}}}}}", part)
    return text


def embedded(data: dict[str, Any]) -> str:
    """JSON that ends no script element, whatever a scene is called."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
