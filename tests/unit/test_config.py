"""config.py: every source of a value, every way to get one wrong."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest

from config import SECTIONS, Config, Svgf, apply_preset, describe, load, preset_values
from errors import UserError
from parameter import parameters
from presets import PRESETS

ROOT = Path(__file__).resolve().parents[2]


def write(folder: Path, text: str) -> Path:
    path = folder / "some.toml"
    path.write_text(text)
    return path


def test_without_sources_the_defaults_hold():
    loaded = load()
    assert loaded == Config()
    assert (loaded.render.width, loaded.render.height, loaded.svgf.alpha, loaded.taa.alpha) == (640, 360, 0.07, 0.1)


def test_file_beats_preset_and_override_beats_file(tmp_path, monkeypatch):
    monkeypatch.setitem(PRESETS["svgf"], "best", {"alpha": 0.5, "sigma_l": 9.0, "iterations": 2})
    path = write(tmp_path, "[svgf]\nsigma_l = 3\niterations = 4\n[display]\nexposure = -1.5\n")
    loaded = load(path, ["svgf.iterations=6", "taa.clip=false"])
    assert (loaded.svgf.alpha, loaded.svgf.sigma_l, loaded.svgf.iterations) == (0.5, 3.0, 6)
    assert loaded.display.exposure == -1.5
    assert loaded.taa.clip is False


def test_the_last_override_of_a_key_wins():
    assert load(None, ["svgf.alpha=0.3", "svgf.alpha=0.4"]).svgf.alpha == 0.4


def test_the_preset_is_chosen_by_the_strongest_source(tmp_path, monkeypatch):
    preset = next(item for item in dataclasses.fields(Svgf) if item.name == "preset")
    wider = dataclasses.replace(preset.metadata["param"], choices=("paper", "other"))
    monkeypatch.setattr(preset, "metadata", {"param": wider})
    monkeypatch.setitem(PRESETS["svgf"], "other", {"alpha": 0.7})
    path = write(tmp_path, '[svgf]\npreset = "other"\n')
    assert load(path).svgf.alpha == 0.7
    assert load(path, ["svgf.preset=paper"]).svgf.alpha == 0.2
    assert load(None, ["svgf.preset=other"]).svgf.alpha == 0.7


def test_override_values_are_toml_and_bare_words_are_strings():
    loaded = load(
        None,
        ["render.sequence=hash", 'render.jitter="off"', "render.seed=0x10", "svgf.temporal=false", " taa.alpha = 1 "],
    )
    assert loaded.render.sequence == "hash"
    assert loaded.render.jitter == "off"
    assert loaded.render.seed == 16
    assert loaded.svgf.temporal is False
    assert loaded.taa.alpha == 1.0


def test_integers_become_floats_where_a_float_is_meant():
    alpha = load(None, ["svgf.alpha=1"]).svgf.alpha
    assert isinstance(alpha, float)
    assert alpha == 1.0


@pytest.mark.parametrize("name", [f"{row.section}.{row.key}" for row in describe() if row.range.startswith("[")])
def test_bounds_are_inclusive_and_hold(name):
    section, key = name.split(".")
    spec = parameters(SECTIONS[section])[key]
    assert spec.lo is not None
    assert spec.hi is not None
    step = 1 if isinstance(spec.default, int) else 1e-6
    for bound, outside in ((spec.lo, spec.lo - step), (spec.hi, spec.hi + step)):
        assert getattr(getattr(load(None, [f"{name}={bound}"]), section), key) == bound
        with pytest.raises(UserError, match=re.escape(f"must be in {spec.range}, not {outside}")):
            load(None, [f"{name}={outside}"])


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("svgf.iterations=99", r"--set svgf.iterations=99: must be in \[0;8\], not 99"),
        ("svgf.alhpa=1", "--set svgf.alhpa=1: unknown key, did you mean 'alpha'?"),
        ("svfg.alpha=1", "--set svfg.alpha=1: unknown section 'svfg', did you mean 'svgf'?"),
        ("zzzzzz.alpha=1", "known are render, firefly, svgf, asvgf, bmfr, "),
        ("svgf.zzzz=1", "unknown key; known are preset, separate,"),
        ("iterations=3", "must be section.key=value, did you mean 'svgf.iterations'?"),
        ("svgf.iterations", "must be section.key=value, as in"),
        ("svgf.=3", "must be section.key=value, as in"),
        ("svgf.alpha=", "'' is not a value"),
        ("svgf.alpha=[", "is not a value"),
        ("svgf.alpha=0.1\nsvgf.alpha=2", "is not a value|one section.key=value"),
        ("svgf.alpha=1\nother=2", "must be one section.key=value"),
        ("svgf.alpha=true", r"must be a number in \[0;1\], not true"),
        ("svgf.alpha=much", r'must be a number in \[0;1\], not "much"'),
        ("svgf.alpha=nan", "not nan"),
        ("svgf.alpha=inf", "not inf"),
        ("svgf.alpha=1e999", "not inf"),
        ("svgf.iterations=3.0", r"must be a whole number in \[0;8\], not 3.0"),
        ("svgf.iterations=false", "must be a whole number"),
        ("svgf.iterations=0x" + "f" * 5000, "not a number of that size"),
        ("svgf.iterations=" + "9" * 5000, "is not a value"),
        ("svgf.temporal=1", "must be true or false, not 1"),
        ("svgf.temporal=True", 'must be true or false, not "True"'),
        ("render.sequence=hasch", """must be "halton" | "hash", not "hasch", did you mean 'hash'?"""),
        ("render.jitter=true", 'must be "auto" | "on" | "off", not true'),
        ("svgf.preset=bost", 'must be "paper" | "reference" | "best", not "bost", did you mean \'best\'?'),
    ],
)
def test_wrong_overrides_say_what_is_wrong(override, message):
    with pytest.raises(UserError, match=message.replace("?", r"\?").replace(" | ", r" \| ")):
        load(None, [override])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[svgf]\nalhpa = 0.1", "some.toml [svgf] alhpa: unknown key, did you mean 'alpha'?"),
        ("[svfg]\nalpha = 0.1", "some.toml [svfg]: unknown section, did you mean 'svgf'?"),
        ("alpha = 0.1", "some.toml alpha: stands outside a section; sections are render, firefly, svgf, asvgf, bmfr, "),
        ("svgf = 3", "some.toml [svgf]: must be a section, written [svgf] on a line of its own"),
        ("[[svgf]]\nalpha = 0.1", "some.toml [svgf]: must be a section"),
        ("[svgf]\nalpha = 2", "some.toml [svgf] alpha: must be in [0;1], not 2 (smallest share of the new frame"),
        ("[svgf]\nalpha = 1979-05-27", "some.toml [svgf] alpha: must be a number in [0;1], not 1979-05-27"),
        ("[svgf]\nalpha = {a = 1}", "some.toml [svgf] alpha: must be a number in [0;1], not {'a': 1}"),
        ("[svgf\nalpha = 2", "some.toml: is not valid TOML: "),
        (
            "[svgf]\nalpha = 1\nalpha = 1",
            "some.toml: is not valid TOML: Cannot overwrite a value (at ",
        ),
        ("[svgf]\nalpha = " + "[" * 5000, "some.toml: is not valid TOML: "),
    ],
)
def test_wrong_files_say_where_and_what(tmp_path, monkeypatch, text, message):
    write(tmp_path, text)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError) as caught:
        load(Path("some.toml"))
    assert str(caught.value).startswith(message)


def test_unreadable_files_are_user_errors(tmp_path):
    with pytest.raises(UserError, match=r"missing\.toml: cannot be read \(No such file or directory\)"):
        load(tmp_path / "missing.toml")
    with pytest.raises(UserError, match=r"cannot be read \(Is a directory\)"):
        load(tmp_path)
    (tmp_path / "latin.toml").write_bytes(b"# \xe9")
    with pytest.raises(UserError, match=r"latin\.toml: is not text in UTF-8 \(byte 2\)"):
        load(tmp_path / "latin.toml")


def test_a_byte_order_mark_is_no_error(tmp_path):
    path = tmp_path / "marked.toml"
    path.write_bytes(b"\xef\xbb\xbf[svgf]\nalpha = 0.5\n")
    assert load(path).svgf.alpha == 0.5


def test_configs_are_immutable_hashable_and_checked_when_replaced():
    loaded = load()
    with pytest.raises(dataclasses.FrozenInstanceError):
        loaded.svgf.alpha = 0.5  # type: ignore[misc]
    changed = dataclasses.replace(loaded, svgf=dataclasses.replace(loaded.svgf, iterations=4))
    assert {loaded: 1, changed: 2}[Config()] == 1
    assert changed.svgf.iterations == 4
    with pytest.raises(UserError, match=r"\[svgf\] iterations: must be in \[0;8\], not 9"):
        dataclasses.replace(loaded.svgf, iterations=9)


@pytest.mark.parametrize(("level", "iterations", "used"), [(0, 5, 0), (3, 5, 3), (7, 5, 4), (0, 0, -1), (-1, 5, -1)])
def test_fewer_iterations_never_cut_the_feedback(level, iterations, used):
    assert Svgf(feedback_level=level, iterations=iterations).feedback == used


@pytest.mark.parametrize(("section", "preset"), [(s, p) for s, presets in PRESETS.items() for p in presets])
def test_presets_hold_valid_values_and_are_choices(section, preset):
    values = PRESETS[section][preset]
    assert preset in parameters(SECTIONS[section])["preset"].choices
    assert SECTIONS[section](preset=preset, **values)  # type: ignore[call-arg]  # raises if a value is none


PAIRS = [(s, a, b) for s, presets in PRESETS.items() for a in presets for b in presets]


@pytest.mark.parametrize(("section", "before", "after"), PAIRS, ids=lambda part: part)
def test_a_change_of_preset_ends_where_a_start_with_it_begins(section, before, after):
    """Nothing of the preset before is left, though some presets give only the keys in which they differ."""
    started = load(None, [f"{section}.preset={before}"])
    assert apply_preset(started, section, after) == load(None, [f"{section}.preset={after}"])


def test_a_preset_owns_what_any_of_its_section_owns(monkeypatch):
    monkeypatch.setitem(PRESETS, "taa", {"one": {"alpha": 0.5}, "two": {"clip": False}})
    assert preset_values("taa", "one") == {"alpha": 0.5, "clip": True}
    assert preset_values("taa", "two") == {"alpha": 0.1, "clip": False}


def test_a_change_of_preset_takes_its_keys_and_leaves_the_others():
    values = ["svgf.alpha=0.7", "svgf.color_clamp=true", "svgf.depth_tolerance=0.5", "display.exposure=2"]
    before = load(None, ["svgf.preset=paper", *values])
    after = apply_preset(before, "svgf", "reference")
    assert (before.svgf.alpha, after.svgf.alpha, after.svgf.preset) == (0.7, 0.05, "reference")
    assert (after.svgf.color_clamp, after.svgf.depth_tolerance) == (True, 0.5)
    assert (after.display, after.taa) == (before.display, before.taa)


def test_presets_that_are_not_there_are_user_errors():
    with pytest.raises(UserError, match=r"\[svgf\] preset: unknown preset 'bost', did you mean 'best'\?"):
        apply_preset(Config(), "svgf", "bost")
    with pytest.raises(UserError, match=r"\[taa\]: has no presets"):
        apply_preset(Config(), "taa", "best")


def test_the_first_preset_of_a_section_equals_the_defaults():
    for section, presets in PRESETS.items():
        specs = parameters(SECTIONS[section])
        first = presets[str(specs["preset"].default)]
        assert first == {key: specs[key].default for key in first}


def test_documentation_opens_with_the_range_of_every_number():
    for row in describe():
        doc = parameters(SECTIONS[row.section])[row.key].doc
        assert doc.startswith(f"{row.range} ") == row.range.startswith("["), row
        assert row.doc, row
        assert not row.doc.startswith("["), row


def test_describe_has_every_parameter_once():
    rows = describe()
    assert [(row.section, row.key) for row in rows] == [
        (section.name, item.name)
        for section in dataclasses.fields(Config)
        if section.name in SECTIONS
        for item in dataclasses.fields(getattr(Config(), section.name))
    ]
    assert ("svgf", "iterations", "int", "3", "[0;8]") in [row[:5] for row in rows]
    assert ("taa", "clip", "bool", "true", "true | false") in [row[:5] for row in rows]
    assert ("render", "sequence", "str", '"halton"', '"halton" | "hash"') in [row[:5] for row in rows]


def test_the_shipped_file_lists_every_key_with_default_range_and_meaning():
    shipped: dict[tuple[str, str], tuple[str, str]] = {}
    section = ""
    for line in (ROOT / "config.toml").read_text().splitlines():
        if head := re.match(r"\[(\w+)\]", line):
            section = head[1]
        elif entry := re.fullmatch(r"(?:# )?(\w+) = (\S+) *# (.*)", line):
            shipped[section, entry[1]] = entry[2], entry[3]
    for row in describe():
        colon = "" if row.range.startswith("[") else ":"
        assert shipped.pop((row.section, row.key)) == (row.default, f"{row.range}{colon} {row.doc}")
    assert not shipped


def test_the_shipped_file_leaves_to_the_preset_what_the_preset_owns():
    text = (ROOT / "config.toml").read_text()
    assert load(ROOT / "config.toml") == Config()
    for section in PRESETS:
        table = text.partition(f"\n[{section}]")[2].partition("\n[")[0]
        for key in preset_values(section, "best"):
            assert f"\n# {key} = " in table
