"""The documentation agrees with the program: tables, commands, links, examples."""

from __future__ import annotations

import contextlib
import importlib
import io
import math
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import app
import cli
import config
from bench.files import write_json
from bench.machine import describe
from bench.results import QualityResult, Report
from bench.running import MethodResult
from bench.timing import Summary
from bench.tracing import TracingResult
from errors import UserError
from gl.interface import wanted_declarations
from gl.pipelines import FrameTraits, build
from tests.unit.documents import DOCUMENTS, ROOT, anchors, blocks, commands, links, prose, read, table
from tools import readme_picture, readme_tables
from ui import keys

COMMANDS = [(document, command) for document in DOCUMENTS for command in commands(document)]
LINKS = [(document, target) for document in DOCUMENTS for target in links(document)]


# ------------------------------------------------------------------------------------------------- generated parts


def test_generated_parts_are_up_to_date():
    """If not: `python -m tools.readme_tables`."""
    text = read("README.md")
    parts = {"keys": keys.markdown(), "parameters": readme_tables.parameters(), "presets": readme_tables.presets()}
    assert readme_tables.updated(text, parts) == text
    assert readme_tables.run(["--check"]) == 0


def test_every_key_and_parameter_is_there():
    text = read("README.md")
    assert all(binding.help in text for binding in keys.BINDINGS)
    assert all(f"| `{row.section}.{row.key}` | `{row.default}` |" in text for row in config.describe())


def test_there_is_a_place_for_what_was_measured():
    before = read("README.md")
    after = readme_tables.updated(before, {"bench": "numbers"})
    assert "<!-- bench:start -->\nnumbers\n<!-- bench:end -->" in after
    assert readme_tables.updated(after, {"bench": "numbers"}) == after


def test_a_readme_without_a_marker_is_refused_and_left_as_it_is(tmp_path):
    readme = tmp_path / "README.md"
    readme.write_text("nothing here\n")
    with pytest.raises(UserError, match="'keys' must stand there once"):
        readme_tables.run([], readme)
    assert readme.read_text() == "nothing here\n"


def test_what_is_out_of_date_is_found_and_written_anew(tmp_path, capsys):
    readme = tmp_path / "README.md"
    readme.write_text(read("README.md").replace("`svgf.alpha`", "`svgf.beta`"))
    assert readme_tables.run(["--check"], readme) == 1
    assert "tools.readme_tables" in capsys.readouterr().err
    assert readme_tables.run([], readme) == 0
    assert readme.read_text() == read("README.md")


# -------------------------------------------------------------------------------------------------- what was measured


def report_file(path: Path, quick: bool = False) -> Path:
    """A report of two methods and one traced case, written as the benchmark does."""
    times = Summary(41.26, 50.0, 3)
    noisy = MethodResult("noisy", 2.04, times, (), 0.0, 0.75, 1.0, 0.3125, 1.0)
    clean = MethodResult("SVGF", 187.66, times, (), 0.0, 0.0375, 0.05, math.nan, math.nan)
    quality = QualityResult("cornell", "moving camera", (640, 360), 1024, 0.0234, 0.0156, 9.0, (noisy, clean))
    traced = TracingResult(
        "cornell",
        "moving camera",
        False,
        (640, 360),
        1234,
        900_000,
        times,
        times,
        times,
        Summary(7.5, 8, 3),
        21.8,
        25.0,
        "x",
    )
    machine = describe({"GL_RENDERER": "some renderer", "GL_VERSION": "4.5 core"}, 2)
    write_json(path, Report(machine, config.Config(), quick, (quality,), (traced,), None, 100.0, 0.0))
    return path


def test_the_measured_table_has_the_report_s_numbers(tmp_path):
    readme = tmp_path / "README.md"
    readme.write_text(read("README.md"))
    assert readme_tables.run([str(report_file(tmp_path / "bench.json"))], readme) == 0
    part = readme.read_text().partition("<!-- bench:start -->\n")[2].partition("\n<!-- bench:end -->")[0]
    assert part.startswith("some renderer (OpenGL 4.5 core); ")
    assert "Preset `best`" in part.splitlines()[0]
    assert "`cornell`, moving camera, 640x360, against 1024 paths per pixel:" in part
    rows = [line for line in part.splitlines() if line.startswith("| ")]
    assert "| noisy | 2.0 | 0.7500 | 1.0000 | 0.3125 | 1.0000 |" in rows
    assert "| SVGF | 187.7 | 0.0375 | 0.0500 | – | – |" in rows
    assert "| noise of the reference |  | 0.0234 |  | 0.0156 |  |" in rows
    assert "| `cornell`, moving camera, 640x360 | 1,234 | 41.3 | 7.5 | 21.8 |" in rows
    assert len({line.count("|") for line in rows[:5]}) == len({line.count("|") for line in rows[5:]}) == 1


def test_what_is_no_full_report_is_refused(tmp_path):
    with pytest.raises(UserError, match="--quick"):
        readme_tables.measured(readme_tables.read_report(report_file(tmp_path / "quick.json", quick=True)))
    with pytest.raises(UserError, match="cannot be read"):
        readme_tables.read_report(tmp_path / "none.json")
    for text, message in (("{", "not valid JSON"), ("[]", "not a report"), ("{}", "not a report")):
        (tmp_path / "bad.json").write_text(text)
        with pytest.raises(UserError, match=message):
            readme_tables.read_report(tmp_path / "bad.json")


# -------------------------------------------------------------------------------------------------------- packages


def test_every_pinned_package_has_a_sentence_on_why():
    pinned = re.findall(r"^([\w.-]+)==", read("requirements.txt"), re.MULTILINE)
    rows = table("README.md", "Packages")
    assert [name for name, _, _ in rows] == pinned
    for _, why, licence in rows:
        assert why.endswith(".")
        assert len(why.split()) >= 4
        assert licence


# -------------------------------------------------------------------------------------------------------- commands


def accepted(command: str) -> None:
    """Raises unless the program takes this command line; nothing is run."""
    words = shlex.split(command.partition("|")[0])
    match words:
        case ["make", *rest]:
            targets = re.findall(r"^([a-z]+):", read("Makefile"), re.MULTILINE)
            for word in rest:
                if word.startswith("ARGS="):
                    accepted(f"app.py {word.removeprefix('ARGS=')}")
                else:
                    assert word in targets
        case ["app.py", *rest] | [".venv/bin/python", "app.py", *rest]:
            check_arguments(rest)
        case [".venv/bin/python", "-m", "pytest", *rest]:
            assert all((ROOT / word).exists() for word in rest if word.startswith("tests"))
        case [".venv/bin/python", "-m", module, *rest] if module.startswith(("tools.", "bench.")):
            importlib.import_module(module).build_parser().parse_args(rest)
        case _:
            raise AssertionError(f"what is {command!r}?")


def check_arguments(words: list[str]) -> None:
    args = cli.parse(words)
    if args.command in ("scenes", "doctor"):
        return
    settings = app.load_config(args)
    if getattr(args, "show", ""):
        plan = build(settings, args.denoiser, FrameTraits()).compile()
        assert args.show in {tex.name for tex in (*plan.imports, *plan.slot_of, *plan.feeds)}


@pytest.mark.parametrize(("document", "command"), COMMANDS, ids=[command for _, command in COMMANDS])
def test_commands_are_understood(document, command):
    accepted(command)


@pytest.mark.parametrize(
    "command",
    [
        "make nonsense",
        'make run ARGS="--scenery x"',
        "app.py rendr",
        ".venv/bin/python app.py render --frames 0",
        ".venv/bin/python app.py render --set svgf.alhpa=1",
        ".venv/bin/python app.py render --show svgf.nothing",
        ".venv/bin/python -m pytest tests/nowhere",
        ".venv/bin/python -m tools.readme_tables --chekc",
        "rm -rf out",
    ],
)
def test_the_check_of_commands_finds_mistakes(command, capsys):
    with pytest.raises((AssertionError, SystemExit, UserError)):
        accepted(command)


def test_the_documents_name_the_commands_that_matter():
    named = "\n".join(commands("README.md"))
    for command in ("make run", "make test", "app.py render", "app.py graph", "app.py scenes", "app.py doctor"):
        assert command in named
    assert "make references" in "\n".join(commands("CONTRIBUTING.md"))


# --------------------------------------------------------------------------------------------------- links and files


@pytest.mark.parametrize(("document", "target"), LINKS)
def test_links_lead_somewhere(document, target):
    path, _, anchor = target.partition("#")
    if path.startswith("https://"):
        return
    found = (ROOT / document).parent / path if path else ROOT / document
    assert found.exists()
    if anchor:
        assert anchor in anchors(str(found.resolve().relative_to(ROOT)))


@pytest.mark.parametrize("document", DOCUMENTS)
def test_files_that_are_named_exist(document):
    """Code spans with a folder and an ending; `out/` is made by running, the example's files are not in the tree."""
    spans = re.findall(r"`([\w./-]+/[\w.-]*)`", prose(document))
    named = [span for span in spans if not re.match(r"out/|\.cache/|path/to/|.*despeckle", span)]
    roots = (ROOT, (ROOT / document).parent, ROOT / "gl" / "shaders")
    assert [span for span in named if not any((root / span).exists() for root in roots)] == []


def test_the_source_tree_is_that_of_the_checkout():
    (tree,) = (block.text for block in blocks("README.md") if "app.py  " in block.text)
    listed = [line.split()[0] for line in tree.splitlines()]
    assert all((ROOT / name).exists() for name in listed)
    source = {f"{path.parent.name}/" for path in ROOT.glob("[a-z]*/*.py")}
    assert source <= set(listed)


def test_the_picture_is_small_and_shows_three_frames_of_one_size():
    assert readme_picture.PICTURE.stat().st_size < 900_000
    with Image.open(readme_picture.PICTURE) as picture:
        shown = readme_picture.COLUMNS.stop - readme_picture.COLUMNS.start
        assert picture.size == (3 * shown + 2 * 4, 360)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_markers_come_in_pairs(document):
    text = prose(document)
    assert re.findall(r"<!-- (\w+):start -->", text) == re.findall(r"<!-- (\w+):end -->", text)


# -------------------------------------------------------------------------------------------------------- examples


@pytest.fixture(scope="module")
def example() -> dict[str, Any]:
    """Names that the README's example of a graph defines, and what it prints as ``printed``."""
    code = next(block.text for block in blocks("README.md") if block.language == "python")
    names: dict[str, Any] = {}
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, "README.md", "exec"), names)
    return names | {"printed": out.getvalue()}


def test_the_example_prints_what_stands_below_it(example):
    found = blocks("README.md")
    number = next(i for i, block in enumerate(found) if block.language == "python")
    assert found[number + 1].language == "text"
    assert example["printed"].strip() == found[number + 1].text.strip()


def test_the_declarations_are_those_that_the_program_asks_for(example):
    (node,) = example["g"].compile().passes
    written = next(block.text for block in blocks("docs/graph.md") if block.language == "glsl")
    assert sorted(written.splitlines()) == sorted(wanted_declarations(node).values())


def test_the_calls_of_the_graph_exist(example):
    calls = re.findall(r"`(?:with )?g\.(\w+)\(", read("docs/graph.md"))
    assert len(set(calls)) >= 7
    assert all(callable(getattr(example["g"], call)) for call in calls)
