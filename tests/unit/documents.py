"""What the tests of the documentation read in Markdown files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/graph.md", "docs/recording.md", "assets/README.md")


class Block(NamedTuple):
    """A fenced block: its language, the text inside, and the first `code span` of the paragraph before it."""

    language: str
    text: str
    title: str


def read(document: str) -> str:
    return (ROOT / document).read_text(encoding="utf-8")


def blocks(document: str) -> list[Block]:
    """All fenced blocks, in order."""
    text = read(document)
    found = []
    for match in re.finditer(r"^```(\w*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
        paragraph = text[: match.start()].rstrip().rpartition("\n\n")[2]
        spans = re.findall(r"`([^`]+)`", paragraph)
        found.append(Block(match[1], match[2], spans[0] if spans else ""))
    return found


def prose(document: str) -> str:
    """The text without fenced blocks."""
    return re.sub(r"^```.*?^```$", "", read(document), flags=re.DOTALL | re.MULTILINE)


def commands(document: str) -> list[str]:
    """Shell commands: lines of ``sh`` blocks without comments, and code spans that begin like one."""
    lines = [line for block in blocks(document) if block.language == "sh" for line in block.text.splitlines()]
    spans = [" ".join(span.split()) for span in re.findall(r"`([^`]+)`", prose(document))]
    lines += [span for span in spans if re.match(r"make |app\.py |\.venv/bin/python ", span)]
    return [line for line in (line.partition(" #")[0].strip() for line in lines) if line]


def links(document: str) -> list[str]:
    """Targets of links and images."""
    return re.findall(r"\]\(([^)\s]+)\)", prose(document))


def anchors(document: str) -> set[str]:
    """What a heading is called in a link, by GitHub's rules."""
    headings = re.findall(r"^#+ (.+)$", prose(document), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def table(document: str, heading: str) -> list[list[str]]:
    """Rows of the first table below ``heading``, without its header."""
    section = prose(document).partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    rows = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in rows[2:]]
