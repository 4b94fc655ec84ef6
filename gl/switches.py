"""Why a pass runs: every setting in turn is given its other values, and the plans are compared. Pure Python, no OpenGL.

Nothing is listed by hand. A new parameter, denoiser or trait of a frame is found by itself, and a setting that is said
to switch something off does so, or it is not named.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from config import SECTIONS, Config, apply_preset
from errors import UserError
from gl.pipelines import DENOISERS, FrameTraits, build
from gl.plan import Node, Plan
from parameter import Param, Value, parameters
from presets import PRESETS

FEW: Final = 16
"""Whole numbers with at most so many values are tried one by one, others at both ends of their range only."""

TRAIT, DENOISER = "frame", "--denoiser"
"""``Effect.setting`` of a frame's traits, before a dot; and of the method itself."""


@dataclass(frozen=True)
class Effect:
    """What one other value of one setting makes of a plan.

    Attributes:
        setting: ``"svgf.separate"``; ``"frame.moving"`` for a trait of the frame; ``"--denoiser"``.
        now: its value.
        other: the value that was tried.
        plan: the plan with that value.
        added: names of passes that run then, and do not now.
        removed: names of passes that run now, and do not then.
        changed: names of passes that run in both, but with other inputs, outputs, formats or ``#define``s.
    """

    setting: str
    now: Value
    other: Value
    plan: Plan
    added: tuple[str, ...]
    removed: tuple[str, ...]
    changed: tuple[str, ...]

    @property
    def distance(self) -> float:
        """How far the value tried is from the present one: of numbers their difference, otherwise 1."""
        if isinstance(self.now, int | float) and isinstance(self.other, int | float):
            return abs(self.other - self.now)
        return 1.0


def effects(config: Config, denoiser: str, traits: FrameTraits) -> list[Effect]:
    """What every other value of every setting does to the plan of one frame; those that do nothing are left out."""
    plan = build(config, denoiser, traits).compile()
    found = [
        compare(setting, now, other, plan, build(changed, denoiser, traits).compile())
        for setting, now, other, changed in _other_configs(config)
    ]
    for field in dataclasses.fields(traits):
        now = getattr(traits, field.name)
        if isinstance(now, bool):
            flip: dict[str, Any] = {field.name: not now}
            other = build(config, denoiser, dataclasses.replace(traits, **flip)).compile()
            found.append(compare(f"{TRAIT}.{field.name}", now, not now, plan, other))
    found += [
        compare(DENOISER, denoiser, name, plan, build(config, name, traits).compile())
        for name in DENOISERS
        if name != denoiser
    ]
    return [effect for effect in found if effect.added or effect.removed or effect.changed]


def compare(setting: str, now: Value, other: Value, before: Plan, after: Plan) -> Effect:
    """The difference between the plan ``before``, of the present value, and the one ``after``."""
    old = {node.name: _wiring(node) for node in before.passes}
    new = {node.name: _wiring(node) for node in after.passes}
    return Effect(
        setting,
        now,
        other,
        after,
        added=tuple(name for name in new if name not in old),
        removed=tuple(name for name in old if name not in new),
        changed=tuple(name for name in old if name in new and old[name] != new[name]),
    )


def nearest(found: Iterable[Effect]) -> list[Effect]:
    """Of numbers the nearest effective value on each side only; of all others every effect."""
    best: dict[tuple[str, object], Effect] = {}
    for effect in found:
        number = not isinstance(effect.now, bool | str) and not isinstance(effect.other, bool | str)
        side = float(effect.other) > float(effect.now) if number else effect.other
        key = (effect.setting, side)
        if key not in best or effect.distance < best[key].distance:
            best[key] = effect
    return list(best.values())


def reasons(name: str, found: Iterable[Effect]) -> list[Effect]:
    """Why the pass ``name`` runs: of each setting that can take it away, the effect of the nearest value that does."""
    return _nearest_by_setting(effect for effect in found if name in effect.removed)


def ways(found: Iterable[Effect]) -> dict[str, list[Effect]]:
    """Passes that do not run, by name, with the nearest value of each setting that would add them."""
    listed = list(found)
    names = dict.fromkeys(name for effect in listed for name in effect.added)
    return {name: _nearest_by_setting(effect for effect in listed if name in effect.added) for name in names}


def _nearest_by_setting(found: Iterable[Effect]) -> list[Effect]:
    best: dict[str, Effect] = {}
    for effect in found:
        if effect.setting not in best or effect.distance < best[effect.setting].distance:
            best[effect.setting] = effect
    return list(best.values())


def _wiring(node: Node) -> tuple[object, ...]:
    """What of a pass is no mere number: equal for two plans in which it is compiled and connected alike."""
    return (
        node.program,
        tuple((port, tex.name, tex.fmt) for port, tex in node.reads.items()),
        tuple((port, history.name, history.fmt) for port, history in node.prevs.items()),
        tuple((port, tex.fmt, tex.divisor) for port, tex in node.writes.items()),
    )


def _other_configs(config: Config) -> Iterator[tuple[str, Value, Value, Config]]:
    """Setting, present value, other value, and ``config`` with that one."""
    for section, group in SECTIONS.items():
        present = getattr(config, section)
        for key, spec in parameters(group).items():
            now = getattr(present, key)
            for other in _others(spec, now):
                changed = _with(config, section, key, other)
                if changed is not None:
                    yield f"{section}.{key}", now, other, changed


def _others(spec: Param, now: Value) -> list[Value]:
    values: list[Value]
    if spec.choices:
        values = list(spec.choices)
    elif isinstance(spec.default, bool):
        values = [False, True]
    elif spec.words:
        values = [spec.words[0], str(spec.default), ",".join(spec.words)]
    else:
        low, high = spec.lo, spec.hi
        assert low is not None  # what is neither a switch nor a choice is a number, and has a range
        assert high is not None
        if isinstance(spec.default, int):
            few = high - low < FEW
            values = list(range(int(low), int(high) + 1)) if few else [int(low), int(high)]
        else:
            values = [float(low), float(high)]
    return [value for value in values if value != now]


def _with(config: Config, section: str, key: str, value: Value) -> Config | None:
    """``config`` with one parameter changed, a preset with all that it sets; None where others exclude the value."""
    changes: Mapping[str, Any] = {key: value}
    try:
        if key == "preset" and section in PRESETS:
            return apply_preset(config, section, str(value))
        group: dict[str, Any] = {section: dataclasses.replace(getattr(config, section), **changes)}
    except UserError:
        return None
    return dataclasses.replace(config, **group)
