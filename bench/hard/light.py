"""Light at the ends of what half precision holds, and no light at all."""

from __future__ import annotations

import numpy as np

from bench.hard.stage import (
    EXACT,
    FILTERS,
    SIZE,
    Row,
    Stage,
    constant,
    deviation,
    number,
    recovery,
    wall,
    with_sky,
    worst,
)
from raytrace.frame import FramePacket

HALF_LIMIT = 65000.0
"""``gl/shaders/common/finite.glsl``: what radiance is clamped to."""

SPIKE = 1e5


def measure(stage: Stage) -> list[Row]:
    """Fireflies, light at the end of half precision, hardly any, none, nothing but sky."""
    with np.errstate(over="ignore", invalid="ignore"):
        square = np.float16(6e4) * np.float16(6e4)
        deviation_of_6e4 = number(float(square - square))
    tiny = float(np.float16(1e-6)) / 1e-6 - 1.0
    return [
        worst([_firefly(stage, method) for method in FILTERS]),
        worst([_rejected(stage, method) for method in FILTERS]),
        constant(stage, "radiance 6e4 everywhere", wall(6e4), 6e4, f"σ = {deviation_of_6e4} in half precision"),
        constant(stage, "radiance 1e-6 everywhere", wall(1e-6), 1e-6, f"{tiny:+.0%} in half precision", bound=0.05),
        constant(stage, "all black", wall(0.0), 0.0, f"{_nothing_over_nothing()}: 0 / 0 of normalised light"),
        worst([_sky_only(stage, method) for method in FILTERS]),
    ]


def _spiked() -> list[FramePacket]:
    """Frame 3 of seven has one pixel of 1e5 in a wall of 1."""
    plain, spike = np.ones(SIZE[::-1]), np.ones(SIZE[::-1])
    spike[16, 15] = SPIKE
    return [wall(spike if index == 3 else plain) for index in range(7)]


def _firefly(stage: Stage, method: str) -> Row:
    """A filter may spread of the spike what half precision holds; it must not add to it."""
    shown = stage.sequence(_spiked(), method)
    allowed = SIZE[0] * SIZE[1] - 1 + HALF_LIMIT
    brightest = max(float(image[..., 0].astype(np.float64).sum()) for image in shown)
    with np.errstate(over="ignore"):
        unguarded = float(np.float32(SPIKE).astype(np.float16))
    return Row(
        case="radiance 1e5 on one pixel",
        method=method,
        exact=f"≤ {number(allowed)}",
        error=max(0.0, brightest / allowed - 1.0),
        bound=0.1,
        unguarded=f"{number(unguarded)} in half precision",
        measure="of all light",
        finite=bool(np.isfinite(shown).all()),
    )


def _rejected(stage: Stage, method: str) -> Row:
    """With rejection of outliers: what the spike leaves behind, and for how long."""
    shown = stage.sequence(_spiked(), method, ("firefly.mode=variance",))
    errors = [deviation(image, 1.0) for image in shown[4:]]
    return Row(
        case="the same, outliers rejected",
        method=method,
        exact="1",
        error=errors[-1],
        bound=0.1,
        unguarded=f"{number((3.0 + HALF_LIMIT) / 4.0)}, mean of four frames",
        finite=bool(np.isfinite(shown).all()),
        recovery=recovery(errors, 0.1),
    )


def _nothing_over_nothing() -> str:
    with np.errstate(invalid="ignore"):
        return number(float(np.float32(0.0) / np.float32(0.0)))


def _sky_only(stage: Stage, method: str) -> Row:
    """The sky's radiance comes out as it went in."""
    sky = with_sky(wall(0.5), np.ones(SIZE[::-1], bool), radiance=3.0)
    shown = stage.sequence([sky] * 3, method)
    error = max(deviation(image, 3.0) for image in shown)
    return Row("sky only", method, "3", error, EXACT, f"{_nothing_over_nothing()}: no weight in any window")
