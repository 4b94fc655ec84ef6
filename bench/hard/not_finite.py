"""NaN and infinity: in colour, in every guide, in every history."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from bench.hard.stage import EXACT, FILTERS, SIZE, Row, Stage, deviation, number, recovery, wall, worst
from gl.executor import Result

SPOILT: Final = {(5, 7): np.nan, (5, 8): np.inf, (20, 0): -np.inf, (32, 30): np.nan}
"""(y, x) -> value: two side by side, one at an edge, a corner."""

LIGHT: Final = 0.75


def _blended() -> str:
    """What a recursive filter makes of a NaN that is multiplied by a weight instead of being left out."""
    history, frames = np.float32(np.nan), 0
    while np.isnan(history) and frames < 100:
        history, frames = np.float32(0.2) * np.float32(LIGHT) + np.float32(0.8) * history, frames + 1
    return f"{number(float(history))}, still after {frames} frames"


def _weighed() -> str:
    """What a window of 5x5 taps makes of one guide that is NaN: a weight is, and with it the sum."""
    depth = np.ones((9, 9), np.float32)
    depth[4, 4] = np.nan
    views = np.lib.stride_tricks.sliding_window_view(np.pad(depth, 2, mode="edge"), (5, 5))
    with np.errstate(invalid="ignore"):
        sums = np.exp(-np.abs(views - depth[..., None, None])).sum((2, 3))
    return f"NaN in {np.isnan(sums).sum()} pixels"


def _placed() -> str:
    """Which texel a motion vector that is NaN leads to."""
    with np.errstate(invalid="ignore"):
        return f"texel {np.array(np.nan, np.float32).astype(np.int32)} of the last frame"


def _shown() -> str:
    with np.errstate(invalid="ignore"):
        return f"{number(float(np.float32(np.inf) * np.float32(0.0)))} in the picture and all histories after it"


IMAGES: Final = {
    "colour": ("direct", slice(0, 3), _blended),
    "one channel": ("indirect", slice(1, 2), _blended),
    "albedo": ("albedo", slice(0, 3), _shown),
    "emission": ("emission", slice(0, 3), _shown),
    "normal": ("surface", slice(0, 3), _weighed),
    "depth": ("surface", slice(3, 4), _weighed),
    "depth gradient": ("gradient", slice(0, 2), _weighed),
    "motion vector": ("motion", slice(0, 2), _placed),
    "previous depth": ("motion", slice(2, 3), _placed),
    "object id": ("motion", slice(3, 4), _placed),
    "previous normal": ("prev_normal", slice(0, 3), _weighed),
}
"""What is spoilt: image and channels of a frame packet, and what comes of it without any care."""


def measure(stage: Stage) -> list[Row]:
    """NaN and infinity in colour, in each guide, and in every history."""
    rows = [worst([_spoilt(stage, what, method) for method in FILTERS]) for what in IMAGES]
    alone = ("svgf.temporal=false", "bmfr.temporal=false", "spatial.temporal=false")
    for name, settings in (
        ("without time", alone),
        ("without time or variance", (*alone, "svgf.variance_guided=false")),
    ):
        found = [_spoilt(stage, "colour", method, settings) for method in FILTERS if method != "accumulate"]
        rows.append(replace(worst(found), case=f"NaN, ±infinity: colour, {name}"))
    return [*rows, worst([_spoilt_history(stage, method) for method in FILTERS])]


def _spoilt(stage: Stage, what: str, method: str, settings: Sequence[str] = ()) -> Row:
    """Three clean frames, one with bad pixels, three clean ones."""
    image, channels, unguarded = IMAGES[what]
    normal = np.broadcast_to(np.array([0.0, 0.0, 1.0, 0.0], np.float32), (*SIZE[::-1], 4)).copy()
    clean = wall(LIGHT, prev_normal=normal)
    own = np.zeros(SIZE[::-1], bool)
    values = getattr(clean, image).copy()
    for (y, x), bad in SPOILT.items():
        own[y, x], values[y, x, channels] = True, bad
    during = replace(clean, **{image: values})
    shown = stage.sequence([clean, clean, clean, during, clean, clean, clean], method, settings)
    # What it does to its neighbours at once, and to everybody later.
    errors = [deviation(shown[3][~own], LIGHT), *(deviation(later, LIGHT) for later in shown[4:])]
    return Row(
        case=f"NaN, ±infinity: {what}",
        method=method,
        exact=number(LIGHT),
        error=max(errors[0], errors[-1]),
        bound=EXACT,
        unguarded=unguarded(),
        finite=bool(np.isfinite(errors).all()),
        recovery=recovery(errors[1:], EXACT),
    )


def _spoilt_history(stage: Stage, method: str) -> Row:
    """Every history overwritten with NaN between two frames."""
    clean = wall(LIGHT)
    stage.restart()
    for _ in range(3):
        result = stage.frame(clean, method)
    overwrite_histories(result, np.nan)
    errors = [deviation(stage.radiance(clean, method), LIGHT) for _ in range(3)]
    return Row(
        case="NaN: all histories",
        method=method,
        exact=number(LIGHT),
        error=errors[-1],
        bound=EXACT,
        unguarded=_blended(),
        finite=bool(np.isfinite(errors).all()),
        recovery=recovery(errors, EXACT),
    )


def overwrite_histories(result: Result, value: float) -> None:
    """Fill every texture that the last frame has left for the next one with ``value``."""
    for texture in {tex: result.textures[tex] for tex in result.plan.feeds}.values():
        kind: Any = {"f4": np.float32, "f2": np.float16}[texture.dtype]
        texture.write(np.full((texture.height, texture.width, texture.components), value, kind).tobytes())
