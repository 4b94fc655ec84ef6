"""Flags and commands: what they turn into, what their help says, and what is refused with which advice."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import cli
from errors import UserError
from gl.pipelines import DENOISERS
from tests.cli.runner import App


def test_the_defaults_are_those_of_the_manual() -> None:
    args = cli.parse(["render"])
    assert (args.command, args.scene, args.denoiser, args.frames, args.camera) == (
        "render",
        "cornell",
        "svgf",
        32,
        "still",
    )
    assert (args.size, args.spp, args.seed, args.set, args.show) == (None, None, None, [], "")
    assert (args.animate, args.jitter, args.exr, args.out) == (False, False, False, Path("out/shot.png"))
    window = cli.parse([])
    assert (window.command, window.out, window.camera, window.no_animate) == (cli.WINDOW, Path("out"), None, False)


def test_values_arrive_as_what_they_are() -> None:
    words = "render --size 12x34 --seed 7 --frames 3 --spp 9 --set a.b=1 --set=c.d=2 --out x/y.PNG --denoiser none"
    args = cli.parse(words.split())
    assert (args.size, args.seed, args.frames, args.spp) == ((12, 34), 7, 3, 9)
    assert (args.set, args.out, args.denoiser) == (["a.b=1", "c.d=2"], Path("x/y.PNG"), "none")


def test_the_denoisers_on_the_command_line_are_those_there_are() -> None:
    assert tuple(DENOISERS) == cli.DENOISERS


@pytest.mark.parametrize("text", ["640x360", "640X360", "640×360", " 1x1 ", "16384x16384"])
def test_sizes(text: str) -> None:
    assert cli.size_of(text) == tuple(int(side) for side in re.findall(r"\d+", text))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("rendr", "rendr: there is no such command, did you mean 'render'?"),
        ("paint", "there are: render, graph, explain, bench, record, replay, scenes, doctor"),
        ("--sizee 3x3", "--sizee: unknown flag, did you mean '--size'?"),
        ("render --frmaes=3", "--frmaes=3: unknown flag, did you mean '--frames'?"),
        ("render --frame 3", "did you mean '--frames'?"),  # a prefix is no flag either
        ("render -q", "-q: unknown flag\n  see: app.py render --help"),
        ("render out.png", "out.png: flag expected"),
        ("--size 8x8 render", "render: a command comes before its flags\n  as in: app.py render --help"),
        ("render --frames", "--frames: expected one argument\n  see: app.py render --help"),
        ("render --denoiser svfg", "--denoiser svfg: there is no such denoiser, did you mean 'svgf'?"),
        ("--denoiser reference", "there are: none, accumulate, svgf"),
        ("render --size 0x360", "--size 0x360: each side must be in [1;16384] pixels"),
        ("render --size 640x0", "each side"),
        ("render --size 16385x1", "each side"),
        ("render --size 640", "--size 640: must be WIDTHxHEIGHT in pixels, as in 640x360"),
        ("render --size=-4x4", "WIDTHxHEIGHT"),
        ("render --size axb", "WIDTHxHEIGHT"),
        ("render --size 1e3x10", "WIDTHxHEIGHT"),
        ("--size ٣x٣", "WIDTHxHEIGHT"),
        ("render --frames 0", "--frames 0: must be a whole number in [1;1000000]"),
        ("render --frames -1", "--frames -1: must be"),
        ("render --frames x", "--frames x: must be"),
        ("render --frames 1.5", "--frames 1.5: must be"),
        ("render --frames 99999999999999999999", "--frames"),
        ("render --spp 0", "--spp 0: must be a whole number in [1;10000000]"),
        ("render --spp many", "--spp many: must be"),
        ("render --seed -1", "--seed -1: must be a whole number in [0;2147483647]"),
        ("render --seed 2147483648", "--seed 2147483648: must be"),
        ("bench --size 1", "--size 1: must be"),
        ("render --out shot.jpg", "--out shot.jpg: must end in .png"),
        ("render --out shot", "--out shot: must end in .png"),
        ("render --out shot.exr --exr", "written beside the PNG"),
    ],
)
def test_what_cannot_be_is_refused_with_advice(app: App, words: str, message: str) -> None:
    assert message in app(*words.split()).error()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--set svgf.alhpa=1", "--set svgf.alhpa=1: unknown key, did you mean 'alpha'?"),
        ("--set svfg.alpha=1", "unknown section 'svfg', did you mean 'svgf'?"),
        ("--set iterations=3", "did you mean 'svgf.iterations'?"),
        ("--set svgf.iterations=many", 'must be a whole number in [0;8], not "many"'),
        ("--set svgf.iterations=9", "must be in [0;8], not 9"),
        ("--set svgf.alpha=nan", "must be in [0;1], not nan"),
        ("--set svgf.separate=1", "must be true or false, not 1"),
        ("--set display.tonemap=acse", "did you mean 'aces'?"),
        ("--set", "--set: expected one argument"),
        ("--config nowhere.toml", "nowhere.toml: cannot be read"),
    ],
)
@pytest.mark.parametrize("command", ["render", "graph", "bench", ""])
def test_parameters_that_cannot_be_are_refused_by_every_command(
    app: App, command: str, words: str, message: str
) -> None:
    assert message in app(*command.split(), *words.split()).error()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[svgf]\nalhpa = 1\n", "[svgf] alhpa: unknown key, did you mean 'alpha'?"),
        ("[sgvf]\n", "[sgvf]: unknown section, did you mean 'svgf'?"),
        ("[svgf]\nalpha = 2\n", "[svgf] alpha: must be in [0;1], not 2"),
        ('[render]\nwidth = "wide"\n', "[render] width: must be a whole number"),
        ("[svgf\n", "is not valid TOML"),
        ("alpha = 1\n", "stands outside a section"),
    ],
)
def test_a_wrong_parameter_file_is_named(app: App, tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    error = app("graph", "--config", path).error()
    assert "mine.toml" in error
    assert message in error


@pytest.mark.parametrize("command", ["", *cli.COMMANDS])
def test_help_explains_every_flag_and_ends_well(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        cli.parse([*command.split(), "--help"])
    text = capsys.readouterr().out
    assert left.value.code == 0
    assert text.startswith("usage: app.py")
    assert max(map(len, text.splitlines())) <= 120
    parser = cli.COMMANDS[command][1]() if command else cli.window_parser()
    assert parser.description
    assert all(action.help for action in parser._actions)
    assert all(flag in text for action in parser._actions for flag in action.option_strings)
    assert all(name in text for name in cli.COMMANDS if not command)


def examples() -> list[str]:
    """Command lines in the help texts, after ``app.py``."""
    parsers = [cli.window_parser(), *(make() for _, make in cli.COMMANDS.values())]
    lines = [line for parser in parsers for line in (parser.epilog or "").splitlines() if line.startswith("  app.py")]
    return [re.split(r"  +| \| ", line.strip())[0].removeprefix("app.py").strip() for line in lines]


@pytest.mark.parametrize("words", examples())
def test_the_examples_of_the_help_can_be_typed(words: str) -> None:
    assert cli.parse(words.split()).command in (cli.WINDOW, *cli.COMMANDS)


def test_there_is_an_example_of_each_command() -> None:
    told = {cli.parse(words.split()).command for words in examples()}
    assert told == {cli.WINDOW, "render", "graph", "explain", "bench", "record", "replay"}


def test_a_parser_refuses_before_it_runs_anything() -> None:
    with pytest.raises(UserError, match="no such denoiser"):
        cli.parse(["render", "--denoiser", "median", "--scene", "interior"])
