"""What the hard cases run on: frames made of plain arrays, and a renderer that they go through."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from config import Config, load
from gl.executor import Result
from gl.renderer import Renderer, read
from raytrace.frame import MISS, FramePacket

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Size = tuple[int, int]

SIZE: Final = (31, 33)
DEPTH: Final = 4.0
PIXEL_SIZE: Final = 0.02
HALF: Final = 2.0**-11
"""Largest relative error of one rounding to half precision."""

EXACT: Final = 4 * HALF
"""Bound where nothing but rounding to half precision is allowed."""

FILTERS: Final = (
    *("accumulate", "svgf", "bmfr"),
    *("gaussian", "bilateral", "joint", "joint-separable", "atrous", "atrous-jitter", "guided"),
)
"""Every method with a history."""

ON_SURFACES: Final = ("svgf", "bmfr", "joint", "joint-separable", "atrous", "atrous-jitter", "guided")
"""Those that know edges of surfaces."""


@dataclass(frozen=True)
class Row:
    """One hard case, measured.

    Attributes:
        case: what is hard.
        method: which method it was measured with; the worst of several.
        exact: the answer in double precision.
        error: the largest deviation from it, in the sense of ``measure``.
        bound: the error that is allowed.
        measure: what the error is, such as "relative" or "noise left".
        unguarded: what the formula gives that takes no care.
        finite: nothing was NaN or infinite, but what was so in the frame's own input.
        recovery: frames after the one that was spoilt until the error was within ``bound``; None where nothing was.
    """

    case: str
    method: str
    exact: str
    error: float
    bound: float
    unguarded: str
    measure: str = "relative"
    finite: bool = True
    recovery: int | None = None

    @property
    def passed(self) -> bool:
        """Whether all of it is as it should be: recovery takes two frames at most."""
        return self.finite and self.error <= self.bound and (self.recovery is None or self.recovery <= 2)


def wall(
    light: ArrayLike = 1.0,
    size: Size = SIZE,
    *,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    depth: ArrayLike = DEPTH,
    gradient: ArrayLike = (0.0, 0.0),
    albedo: ArrayLike = 1.0,
    pixel_size: float = PIXEL_SIZE,
    **others: Any,
) -> FramePacket:
    """A still surface, by default a wall that faces the camera, whose direct light is ``light``.

    All are broadcast to (H, W) with 3 channels, or 2 of the gradient, 1 of the depth; an (H, W) light is grey.
    """
    width, height = size

    def image(values: ArrayLike, channels: int) -> F32:
        array = np.asarray(values, np.float32)
        if channels > 2 and array.ndim in (0, 2):
            array = array[..., None]
        return np.broadcast_to(array, (height, width, channels)).astype(np.float32)

    distance = np.broadcast_to(np.asarray(depth, np.float32), (height, width))[..., None]
    one = np.ones((height, width, 1), np.float32)
    zero = np.zeros((height, width, 3), np.float32)
    return FramePacket(
        index=0,
        time=0.0,
        direct=np.concatenate([image(light, 3), one], 2),
        indirect=np.concatenate([zero, one], 2),
        albedo=np.concatenate([image(albedo, 3), one], 2),
        emission=np.concatenate([zero, one], 2),
        surface=np.concatenate([image(normal, 3), distance], 2),
        gradient=image(gradient, 2),
        motion=np.concatenate([zero[..., :2], distance, zero[..., :1]], 2),
        scene="hard case",
        pixel_size=pixel_size,
        **others,
    )


def with_sky(packet: FramePacket, sky: NDArray[np.bool_], radiance: float = 0.0) -> FramePacket:
    """``packet`` with misses where ``sky`` (H, W) is set, as the tracer writes them, which see ``radiance``."""

    def cleared(values: F32) -> F32:
        return np.where(sky[..., None], np.float32(0.0), values)

    motion, emission = packet.motion.copy(), packet.emission.copy()
    motion[sky, 2:] = 0.0, MISS
    emission[sky, :3] = radiance
    images: dict[str, Any] = {
        name: cleared(getattr(packet, name)) for name in ("direct", "indirect", "albedo", "surface", "gradient")
    }
    return replace(packet, motion=motion, emission=emission, **images)


def noise(seed: int, size: Size = SIZE, mean: float = 1.0) -> F64:
    """(H, W) noise of one path per pixel: a few bright samples among dark ones."""
    return np.random.default_rng(seed).exponential(mean, size[::-1])


@cache
def _configured(settings: tuple[str, ...]) -> Config:
    return load(None, ("taa.enabled=false", *settings))


class Stage:
    """Runs sequences of frames through one renderer, so that programs are compiled once."""

    def __init__(self, renderer: Renderer) -> None:
        self.renderer = renderer
        self._restart = True

    def restart(self) -> None:
        """The next frame begins a sequence."""
        self._restart = True

    def frame(
        self, packet: FramePacket, denoiser: str, settings: Sequence[str] = (), keep: Sequence[str] = ()
    ) -> Result:
        """One frame, without anti-aliasing."""
        reset, self._restart = "hard case" if self._restart else "", False
        return self.renderer.run(packet, _configured(tuple(settings)), denoiser, keep=keep, reset=reset)

    def radiance(self, packet: FramePacket, denoiser: str, settings: Sequence[str] = ()) -> F32:
        """(H, W, 3) of one frame."""
        return read(self.frame(packet, denoiser, settings).outputs["radiance"])[..., :3]

    def sequence(self, packets: Iterable[FramePacket], denoiser: str, settings: Sequence[str] = ()) -> list[F32]:
        """(H, W, 3) radiance of every frame of a sequence of its own."""
        self.restart()
        return [self.radiance(packet, denoiser, settings) for packet in packets]


def deviation(image: NDArray[np.floating], exact: ArrayLike) -> float:
    """Largest |x - e| / |e|, infinity where x is not finite; absolute where e is 0."""
    expected = np.asarray(exact, np.float64)
    if not np.isfinite(image).all():
        return float("inf")
    scale = np.where(expected == 0.0, 1.0, np.abs(expected))
    return float((np.abs(image.astype(np.float64) - expected) / scale).max())


def worst(rows: Sequence[Row]) -> Row:
    """Of the same case with several methods that which is farthest from what it should be; "all" where none is."""
    row = max(
        rows, key=lambda row: (not row.finite, row.recovery or 0, not row.error <= row.bound, row.error / row.bound)
    )
    return replace(row, method=f"all {len(rows)}") if row.passed and row.error == 0.0 and len(rows) > 1 else row


def number(value: float) -> str:
    """Short, for the table."""
    return f"{value:.3g}" if np.isfinite(value) else ("NaN" if np.isnan(value) else "infinite")


def recovery(errors: Sequence[float], bound: float) -> int:
    """After how many frames the error stays within ``bound``: 1 if already the first of ``errors`` is."""
    beyond = [n for n, error in enumerate(errors, 1) if not error <= bound]
    return max(beyond, default=0) + 1


def constant(stage: Stage, case: str, packet: FramePacket, exact: float, unguarded: str, bound: float = EXACT) -> Row:
    """What is constant stays so: of all methods the worst, over three frames of ``packet``."""
    return worst([of_constant(stage, case, packet, method, exact, unguarded, bound) for method in FILTERS])


def of_constant(
    stage: Stage, case: str, packet: FramePacket, method: str, exact: float, unguarded: str, bound: float = EXACT
) -> Row:
    """The same of one ``method``, measured where there are surfaces; elsewhere only what is not finite counts."""
    shown = stage.sequence([packet] * 3, method)
    surface = np.isfinite(packet.surface).all(-1) & (packet.surface[..., 3] > 0.0)
    error = max((deviation(image[surface], exact) for image in shown if surface.any()), default=0.0)
    finite = bool(np.isfinite(shown).all())
    return Row(case, method, number(exact), error, bound, unguarded, finite=finite)
