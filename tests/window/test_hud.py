"""The numbers of the panel: what is said, in which colour, and what a click does."""

from __future__ import annotations

from dataclasses import replace

import pytest

from config import load
from gl.executor import Result
from gl.pipelines import DENOISERS, FrameTraits, build
from gl.profiler import Row
from tests.passes.harness import frame
from tests.window.hand import Hand, watching
from ui import help, theme
from ui.hud import Branch, branches, by_reason
from ui.keys import BINDINGS, Action, rows
from ui.state import State
from ui.status import Status
from ui.switches import switches, uses

SIZE = (640, 360)


@pytest.fixture
def hand(ctx, monkeypatch):
    made = Hand(ctx)
    with watching(made, monkeypatch):
        yield made
    made.release()


def rgb(color):
    return color.x, color.y, color.z


def result_of(denoiser: str = "svgf", reason: str = "valid") -> Result:
    """What a run of the denoiser leaves, without textures."""
    plan = build(load(), denoiser, FrameTraits()).compile()
    return Result({}, {history.name: reason for history in plan.feeds.values()}, 3, plan, {})


def status(**known: object) -> Status:
    return replace(Status("cornell", "llvmpipe", SIZE), **known)  # type: ignore[arg-type]


def labels(state: State) -> dict[str, str | bool | None]:
    return {switch.name: switch.value for switch in switches(state, status())}


# --------------------------------------------------------------------------------------------------------- switches


def test_every_key_that_switches_something_is_listed_once():
    listed = [binding for switch in switches(State(load(), "svgf"), status()) for binding in switch.bindings]
    others = {
        Action.SHOW, Action.PREVIOUS, Action.STEP, Action.RESET_CAMERA, Action.RESET_HISTORY, Action.NEXT_SCENE,
        Action.SCREENSHOT, Action.BACK, Action.FLY,
    }  # fmt: skip
    expected = [binding for binding in BINDINGS if binding.action not in others]
    assert sorted(listed, key=BINDINGS.index) == expected
    assert len(expected) > 15


def test_switches_tell_how_things_stand():
    state = State(load(None, ["svgf.iterations=3", "display.exposure=-1.5", "firefly.mode=clamp"]), "svgf")
    found = labels(state)
    assert found["temporal"] is True
    assert found["iterations"] == "3"
    assert found["exposure"] == "-1.5"
    assert found["firefly"] == "clamp"
    assert found["preset"] == "best"
    assert found["taa"] is True
    assert found["jitter"] is True
    assert found["split"] is False
    assert found["animate"] is True
    assert found["resolution"] == "640×360"
    assert found["view"] == "picture"
    state.perform(next(binding for binding in BINDINGS if binding.key == "F1"))
    state.split, state.view = True, "frame.direct"
    assert (labels(state)["temporal"], labels(state)["split"], labels(state)["view"]) == (False, True, "frame.direct")


def test_keys_of_the_same_thing_stand_together():
    found = {switch.name: switch.keys for switch in switches(State(load(), "svgf"), status())}
    assert found["iterations"] == "F3 ← →"
    assert found["exposure"] == "↑ ↓"
    assert found["resolution"] == "+ -"


def test_what_the_method_does_not_have_is_none():
    found = labels(State(load(), "none"))
    assert [name for name in ("preset", "temporal", "iterations", "separate", "taa") if found[name] is not None] == []
    assert found["tonemap"] == "aces"
    assert found["firefly"] == "off"
    assert labels(State(load(), "reference"))["firefly"] is None


@pytest.mark.parametrize("denoiser", DENOISERS)
@pytest.mark.parametrize(
    ("section", "key", "other"),
    [
        ("taa", "enabled", False),
        ("firefly", "mode", "clamp"),
        ("svgf", "color_clamp", True),
        ("bmfr", "round_history", False),
        ("spatial", "temporal", False),
        ("gaussian", "separable", False),
        ("atrous", "iterations", 2),
    ],
)
def test_a_section_is_used_exactly_if_the_plan_depends_on_it(denoiser, section, key, other):
    config = load()
    changed = replace(config, **{section: replace(getattr(config, section), **{key: other})})
    before, after = (build(c, denoiser, FrameTraits()).compile().text() for c in (config, changed))
    assert uses(State(config, denoiser), section) == (before != after)


def test_a_click_is_like_the_first_key(hand):
    hand.click("##switch temporal")
    assert hand.state.config.svgf.temporal is False
    hand.click("##switch iterations")
    assert hand.state.config.svgf.iterations == 0
    hand.click("##switch split")
    assert hand.state.split
    hand.state.show("none")
    hand.draw(2)
    before = hand.state.config
    hand.click("##switch temporal")
    hand.click("##switch taa")
    assert hand.state.config is before, "noisy frames go through no anti-aliasing, so there is nothing to switch"


def test_switches_that_do_not_apply_are_faint(hand):
    assert hand.said("temporal")[0][1] == rgb(theme.TEXT)
    hand.state.show("none")
    hand.draw()
    assert hand.said("temporal")[0][1] == rgb(theme.FAINT)


def test_methods_are_chosen_by_buttons(hand):
    hand.click("0  none##method")
    assert hand.state.denoiser == "none"
    hand.click("Tab  svgf##method")
    assert hand.state.denoiser == "svgf"


# ------------------------------------------------------------------------------------------------------------ times


def test_passes_are_summed_up_by_scope_and_by_number():
    names = "upload a.one a.b.x a.b.y0 a.b.y1 a.b.z encode"
    found = branches([Row(name, 2.0**i, 0.0) for i, name in enumerate(names.split())])
    assert found == [
        Branch("upload", 1.0),
        Branch("a.one", 2.0),
        Branch("a.b", 60.0, (
            Branch("x", 4.0),
            Branch("y", 24.0, (Branch("y0", 8.0), Branch("y1", 16.0))),
            Branch("z", 32.0),
        )),
        Branch("encode", 64.0),
    ]  # fmt: skip


def test_every_pass_of_a_real_plan_is_counted_once():
    passes = result_of().plan.passes
    pending, found = branches([Row(node.name, 1.0, 0.0) for node in passes]), []
    assert sum(branch.milliseconds for branch in pending) == len(passes)
    while pending:
        branch = pending.pop()
        pending += branch.parts
        found += [] if branch.parts else [branch.name]
    assert len(found) == len(passes)


def test_times_are_shown_and_opened(hand):
    hand.status.passes = [Row("s.a", 1.0, 0.25), Row("s.level0", 2.0, 0.5), Row("s.level1", 1.0, 0.25)]
    hand.status.trace_ms, hand.status.fps = 12.34, 8.0
    hand.draw(2)
    assert {"12.3", "4.0", "3.0", "8.0 fps", "125 ms"} <= {text for text, _ in hand.words}
    assert "level0" not in hand.boxes
    hand.click("level", 0.02)
    assert "level0" in hand.boxes
    hand.click("filters", 0.02)
    assert "level0" not in hand.boxes


# ------------------------------------------------------------------------------------ history, health, progress, errors


def test_history_is_valid_or_says_why_not(hand):
    hand.status.result = result_of()
    count = len(hand.status.result.histories)
    hand.draw()
    assert hand.said("valid") == [(f"valid ({count})", rgb(theme.GOOD))]
    hand.status.result = result_of(reason="reset: camera cut")
    hand.draw()
    assert hand.said("valid") == []
    assert hand.said("camera cut") == [(f"reset: camera cut ({count})", rgb(theme.WARNING))]
    hand.status.result = result_of("none")
    hand.draw()
    assert hand.said("the method has none")


def test_reasons_are_grouped_with_trouble_first():
    histories = {"a": "valid", "b": "resized", "c": "valid", "d": "first use", "e": "resized"}
    assert list(by_reason(histories).items()) == [
        ("resized", ["b", "e"]),
        ("first use", ["d"]),
        ("valid", ["a", "c"]),
    ]


def test_why_history_was_void_is_remembered(hand):
    packet = frame((8, 4))
    hand.status.show(packet, result_of(reason="reset: by key"))
    hand.status.show(packet, result_of())
    hand.status.show(packet, result_of())
    hand.draw()
    assert hand.said("2 frames since: reset: by key")
    assert (hand.status.size, hand.status.packet) == ((8, 4), packet)


@pytest.mark.parametrize(("bad", "color"), [((0, 0), theme.DIM), ((1, 0), theme.BAD), ((0, 1), theme.BAD)])
def test_nan_and_infinity_are_counted_in_red(hand, bad, color):
    hand.status.result = result_of()
    hand.draw()
    assert hand.said("NaN") == [], "nobody counted"
    hand.status.bad = bad
    hand.draw()
    assert hand.said("NaN") == [(f"NaN, Inf: {bad[0]} samples, {bad[1]} pixels", rgb(color))]


def test_what_the_frame_takes(hand):
    result = hand.status.result = result_of()
    hand.draw()
    megabytes = f"{result.plan.bytes(SIZE) / 1e6:.1f} MB"
    assert hand.said(f"passes {len(result.plan.passes)}, barriers 3, {megabytes}")


def test_scene_progress_and_renderer(hand):
    hand.status.triangles, hand.status.progress = 161_336, "compiling 3 programs"
    hand.draw()
    assert hand.said("cornell · 640×360 · 161,336 triangles")
    assert hand.said("compiling 3 programs")[0][1] == rgb(theme.WARNING)
    assert hand.said("llvmpipe") == [("llvmpipe", rgb(theme.FAINT))]


def test_errors_are_red_and_as_written(hand):
    assert not any(color == rgb(theme.BAD) for _, color in hand.words)
    hand.status.errors = ["svgf/atrous.frag:41: 100% %s wrong ##x", "second"]
    hand.draw(2)
    assert hand.said("atrous.frag") == [("svgf/atrous.frag:41: 100% %s wrong ##x", rgb(theme.BAD))]
    assert hand.said("second")


def test_the_help_lists_the_whole_table(hand):
    hand.body = help.draw
    hand.draw(2)
    assert sorted(text for text, _ in hand.words if text) == sorted(word for row in rows() for word in row)
    assert hand.picture()[600:900, 400:800].max() > 0.5, "it is in the middle of the screen"
