"""What settings do to plans, as it is told, against plans built with parameters that were loaded as a user's are."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest

from config import SECTIONS, Config, load
from gl.pipelines import DENOISERS, FrameTraits, build
from gl.plan import Plan
from gl.switches import DENOISER, TRAIT, Effect, _with, compare, effects, nearest, reasons, ways
from parameter import parameters
from tests.unit.small_graphs import example

STILL, MOVING = FrameTraits(), FrameTraits(moving=True)
DEFAULT = load(None, ())


def plan_with(effect: Effect, denoiser: str = "svgf", traits: FrameTraits = STILL) -> Plan:
    """The plan with the other value of ``effect``, which goes the way of ``--set``."""
    section, _, key = effect.setting.partition(".")
    if effect.setting == DENOISER:
        return build(DEFAULT, str(effect.other), traits).compile()
    if section == TRAIT:
        changes: dict[str, Any] = {key: effect.other}
        return build(DEFAULT, denoiser, dataclasses.replace(traits, **changes)).compile()
    return build(load(None, (f"{effect.setting}={json.dumps(effect.other)}",)), denoiser, traits).compile()


def names(plan: Plan) -> set[str]:
    return {node.name for node in plan.passes}


@pytest.mark.parametrize("denoiser", DENOISERS)
@pytest.mark.parametrize("traits", [STILL, MOVING], ids=["still", "moving"])
def test_every_effect_is_there_when_the_value_is_really_set(denoiser: str, traits: FrameTraits) -> None:
    now = build(DEFAULT, denoiser, traits).compile()
    found = effects(DEFAULT, denoiser, traits)
    assert found
    for effect in found:
        plan = plan_with(effect, denoiser, traits)
        assert plan.text() == effect.plan.text() != now.text()
        assert names(plan) == (names(now) | set(effect.added)) - set(effect.removed)
        assert not set(effect.changed) - (names(plan) & names(now))


@pytest.mark.parametrize("denoiser", DENOISERS)
def test_no_switch_and_no_choice_is_forgotten(denoiser: str) -> None:
    """Whatever changes the plan's text is an effect, and nothing else is."""
    now = build(DEFAULT, denoiser, STILL).compile().text()
    told = {(effect.setting, effect.other) for effect in effects(DEFAULT, denoiser, STILL)}
    for section, group in SECTIONS.items():
        for key, spec in parameters(group).items():
            if not (spec.choices or isinstance(spec.default, bool)):
                continue
            for value in spec.choices or (False, True):
                setting = f"{section}.{key}"
                text = build(load(None, (f"{setting}={json.dumps(value)}",)), denoiser, STILL).compile().text()
                assert ((setting, value) in told) == (text != now), (setting, value)


@pytest.mark.parametrize("denoiser", DENOISERS)
def test_what_is_switched_off_is_never_added_hence_nothing_is_culled(denoiser: str) -> None:
    assert not any(effect.plan.culled for effect in effects(DEFAULT, denoiser, MOVING))


def test_a_pass_is_there_for_the_settings_that_take_it_away() -> None:
    found = effects(DEFAULT, "svgf", STILL)
    assert {effect.setting: effect.other for effect in reasons("taa", found)} == {
        "taa.enabled": False,
        DENOISER: "none",
    }
    by_setting = {effect.setting: effect.other for effect in reasons("svgf.direct.atrous2", found)}
    assert by_setting["svgf.iterations"] == 2  # the nearest of 2, 1 and 0
    assert by_setting["svgf.separate"] is False
    assert "svgf.temporal" not in by_setting
    assert reasons("encode", found) == []
    for node in found[0].plan.passes:
        for effect in reasons(node.name, found):
            assert node.name not in names(plan_with(effect))


def test_a_pass_that_is_off_comes_with_what_switches_it_on() -> None:
    listed = ways(effects(DEFAULT, "svgf", STILL))
    assert [(way.setting, way.other) for way in listed["svgf.direct.atrous6"]] == [("svgf.iterations", 7)]
    assert ("svgf.separate", False) in [(way.setting, way.other) for way in listed["svgf.both.accumulate"]]
    assert not set(listed) & names(build(DEFAULT, "svgf", STILL).compile())
    for name, found in listed.items():
        for effect in found:
            assert name in names(plan_with(effect))


def test_what_a_feature_of_the_scene_adds() -> None:
    (moving,) = [effect for effect in effects(DEFAULT, "svgf", STILL) if effect.setting == f"{TRAIT}.moving"]
    assert (moving.now, moving.other, moving.added, moving.removed) == (False, True, (), ())
    assert moving.changed == ("svgf.reproject",)
    assert "frame.prev_normal" in {tex.name for tex in moving.plan.imports}


def test_a_preset_counts_with_all_that_it_sets() -> None:
    (paper,) = [e for e in effects(DEFAULT, "svgf", STILL) if (e.setting, e.other) == ("svgf.preset", "paper")]
    assert paper.plan.text() == build(load(None, ("svgf.preset=paper",)), "svgf", STILL).compile().text()


def test_the_nearest_value_on_each_side_stands_for_all() -> None:
    kept = nearest(effects(DEFAULT, "svgf", STILL))
    assert sorted(effect.other for effect in kept if effect.setting == "svgf.iterations") == [2, 4]
    assert {effect.other for effect in kept if effect.setting == "display.tonemap"} == {"none", "reinhard"}
    assert [effect.other for effect in kept if effect.setting == "svgf.separate"] == [False]


def test_what_parameters_exclude_is_not_tried() -> None:
    assert _with(Config(), "svgf", "alpha", 2.0) is None
    changed = _with(Config(), "svgf", "alpha", 0.5)
    assert changed is not None
    assert changed.svgf.alpha == 0.5


def test_what_two_plans_differ_in() -> None:
    with_history, without = example().compile(), example(history_read=False).compile()
    effect = compare("t.history", True, False, with_history, without)
    assert effect.removed == ("svgf.temporal", "svgf.blur2", "svgf.blur3")
    assert effect.added == ()
    assert effect.changed == ("svgf.blur", "show")  # other textures are read
    assert compare("t.history", True, True, with_history, example().compile()).changed == ()
