"""What the filters are meant to be worth, beside what was measured: said whether it holds or not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from bench.methods import APART, BMFR, ONE_SIGNAL
from bench.results import Contender, QualityResult, contenders
from bench.scores import Errors

FACTORS = {"cornell": {"rmse": 2.0, "flip": 2.0}, "interior": {"flip": 1.25, "relmse": 1.5}}
"""By how much filters should beat accumulation alone, and path tracing in the same time."""

_LABELS = {"rmse": "RMSE", "flip": "FLIP", "relmse": "relMSE"}
_JUDGED = (ONE_SIGNAL.name, APART.name, BMFR.name)
_RIVAL = "OIDN, fast"


@dataclass(frozen=True)
class Claim:
    """``value``: what was measured, a factor where there is a ``limit``; ``holds``: whether it is as claimed."""

    scene: str
    method: str
    what: str
    value: str
    limit: str
    holds: bool


def claims(result: QualityResult) -> tuple[Claim, ...]:
    """All that can be judged by what was measured on one sequence."""
    by_name = {contender.name: contender for contender in contenders(result)}
    judged = [by_name[name] for name in _JUDGED if name in by_name]
    return tuple(claim for one in judged for claim in _of(result.scene, one, by_name))


def _of(scene: str, one: Contender, by_name: dict[str, Contender]) -> Iterator[Claim]:
    fronts = [name for name, best in (("RMSE", one.best_rmse), ("FLIP", one.best_flip)) if best]
    yield Claim(scene, one.name, "on the Pareto front", ", ".join(fronts) or "neither", "RMSE or FLIP", bool(fronts))
    others = {
        "accumulation alone": by_name.get("accumulation"),
        "accumulation with the papers' share": by_name.get("accumulation, the papers' share"),
    }
    for error, factor in FACTORS.get(scene, {}).items():
        for name, other in others.items():
            if other is not None:
                yield _factor(scene, one, f"{_LABELS[error]} of {name} / its own", error, other.errors, factor)
        if one.equal is not None:
            paths = f"{one.equal.samples} path{'s' if one.equal.samples > 1 else ''} in the same time"
            yield _factor(scene, one, f"{_LABELS[error]} of {paths} / its own", error, one.equal.errors, factor)
    rival = by_name.get(_RIVAL)
    if rival is not None:
        ratio = rival.errors.temporal / one.errors.temporal
        yield Claim(scene, one.name, f"temporal error of {_RIVAL} / its own", f"{ratio:.2f}", "1", ratio > 1.0)
        if one.name != APART.name:
            ratio = rival.filter_milliseconds / one.filter_milliseconds
            yield Claim(scene, one.name, f"time of {_RIVAL} / its own", f"{ratio:.2f}", "1", ratio > 1.0)


def _factor(scene: str, one: Contender, what: str, error: str, other: Errors, factor: float) -> Claim:
    own = getattr(one.errors, error)
    ratio = getattr(other, error) / own if own > 0.0 else float("inf")
    return Claim(scene, one.name, what, f"{ratio:.2f}", f"{factor:g}", ratio >= factor)
