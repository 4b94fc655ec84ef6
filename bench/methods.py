"""Speed against error: every method on the same frames.

Frames are traced once and kept. Then, frame by frame, each method filters that frame with a renderer of its own, so
that a drift of the machine hits all alike and no method voids another's history. On every second frame, shifted by one
from repeat to repeat, the passes are timed one by one, which drains the pipeline around each; on the others only the
frame is.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench.cases import FIRST_MEASURED, FRAMES, SCORED, SCORED_PAIRS
from bench.metrics import Mask, pooled, rmse, temporal_difference
from bench.references import Reference, temporal_noise
from bench.timing import Summary
from config import Config, apply_preset
from console import Progress
from errors import UserError
from gl.profiler import Profiler, is_software
from gl.renderer import Renderer, read
from raytrace.frame import FramePacket
from raytrace.shot import Shot

NewRenderer = Callable[[], Renderer]

UPLOAD = "upload"
"""What gl/renderer.py calls its first measurement of a frame."""


@dataclass(frozen=True)
class Method:
    """A denoiser of gl/pipelines.py with what differs from the user's parameters. ``separate`` None: it has none.

    ``preset``: of the denoiser's section, its values win over the user's; empty: the user's stand.
    """

    name: str
    denoiser: str
    taa: bool = False
    separate: bool | None = None
    preset: str = ""

    def configure(self, config: Config) -> Config:
        """``config`` as this method needs it."""
        if self.preset:
            config = apply_preset(config, self.denoiser, self.preset)
        svgf = config.svgf
        if self.separate is not None:
            svgf = replace(svgf, separate=self.separate)
        return replace(config, svgf=svgf, taa=replace(config.taa, enabled=self.taa))


NOISY = Method("noisy", "none")
ONE_SIGNAL = Method("SVGF, one signal", "svgf", separate=False)
APART = Method("SVGF, direct and indirect", "svgf", separate=True)
ONE_SIGNAL_TAA = replace(ONE_SIGNAL, name=f"{ONE_SIGNAL.name} + TAA", taa=True)
APART_TAA = replace(APART, name=f"{APART.name} + TAA", taa=True)
BMFR = Method("BMFR", "bmfr")
BMFR_TAA = replace(BMFR, name=f"{BMFR.name} + TAA", taa=True)
BMFR_PAPER = Method("BMFR as published", "bmfr", preset="paper")
METHODS = (
    NOISY,
    Method("accumulation", "accumulate"),
    ONE_SIGNAL,
    ONE_SIGNAL_TAA,
    APART,
    APART_TAA,
    Method("SVGF as published", "svgf", separate=True, preset="paper"),
    Method("SVGF, reference constants", "svgf", separate=False, preset="reference"),
    BMFR,
    BMFR_TAA,
    BMFR_PAPER,
    Method("BMFR, reference constants", "bmfr", preset="reference"),
)


@dataclass(frozen=True)
class PassTime:
    """Median milliseconds of one pass."""

    name: str
    milliseconds: float


@dataclass(frozen=True)
class MethodResult:
    """One method on one sequence.

    ``milliseconds``: median of a whole frame, upload and all passes; ``wall``: the same by the clock, which on hardware
    includes what the CPU does meanwhile. ``deviation``: sum of ``passes`` over the frame minus 1; None on hardware,
    where the frame is that sum. ``rmse`` and ``temporal`` are those of the radiance before anti-aliasing; the ratios
    divide by the noisy frames' own.
    """

    name: str
    milliseconds: float
    wall: Summary
    passes: tuple[PassTime, ...]
    deviation: float | None
    rmse: float
    rmse_ratio: float
    temporal: float
    temporal_ratio: float

    def of_pass(self, name: str) -> float:
        """Milliseconds of the pass ``name``; 0 where there is none."""
        return sum(row.milliseconds for row in self.passes if row.name == name)

    @property
    def upload(self) -> float:
        """Median milliseconds of sending the frame's arrays to GL."""
        return sum(row.milliseconds for row in self.passes if row.name == UPLOAD)


@dataclass(frozen=True)
class QualityResult:
    """All methods on one sequence. ``noise`` and ``temporal_noise``: the references' own, estimated; no error below
    them means anything."""

    scene: str
    motion: str
    size: tuple[int, int]
    samples: int
    noise: float
    temporal_noise: float
    reference_seconds: float
    methods: tuple[MethodResult, ...]


class Truth:
    """References of the scored frames beside what the error is measured on.

    Raises UserError where a frame shows no surface that does not emit.
    """

    def __init__(self, packets: Sequence[FramePacket], references: dict[int, Reference]) -> None:
        self._packets, self._references = packets, references
        self.radiance = {index: references[index].radiance(packets[index]) for index in SCORED}
        self.masks: dict[int, Mask] = {index: packets[index].emission[..., :3].max(axis=2) == 0.0 for index in SCORED}
        if blind := [index for index, mask in self.masks.items() if not mask.any()]:
            raise UserError(
                f"{packets[0].scene}: frame {blind[0]} shows nothing but sky and light sources",
                "errors are measured on surfaces: choose a scene whose camera sees some",
            )

    @property
    def samples(self) -> int:
        """Paths per pixel of the least converged reference."""
        return min(self._references[index].samples for index in SCORED)

    def noise(self) -> float:
        """RMSE that the references themselves have, pooled."""
        return pooled([self._references[i].noise(self._packets[i], self.masks[i]) for i in SCORED])

    def temporal_noise(self) -> float:
        """Mean temporal difference error of the references themselves."""
        values = []
        for before, now in SCORED_PAIRS:
            pair = [(self._references[i], self._packets[i]) for i in (now, before)]
            values.append(temporal_noise(pair[0], pair[1], self.masks[now] & self.masks[before]))
        return float(np.mean(values))


class Score:
    """Errors of one method, frame by frame."""

    def __init__(self, truth: Truth) -> None:
        self._truth = truth
        self._errors: list[float] = []
        self._temporal: list[float] = []
        self._last: tuple[int, NDArray[np.float32]] | None = None

    def add(self, index: int, image: NDArray[np.float32]) -> None:
        """``image`` (H, W, 3) is the method's radiance in the scored frame ``index``; in ascending order."""
        truth = self._truth
        self._errors.append(rmse(image, truth.radiance[index], truth.masks[index]))
        if self._last is not None and (self._last[0], index) in SCORED_PAIRS:
            before, previous = self._last
            mask = truth.masks[index] & truth.masks[before]
            self._temporal.append(
                temporal_difference(image, previous, truth.radiance[index], truth.radiance[before], mask)
            )
        self._last = (index, image)

    def rmse(self) -> float:
        """Pooled over the frames so far."""
        return pooled(self._errors)

    def temporal(self) -> float:
        """Mean over the pairs so far."""
        return float(np.mean(self._temporal))


class _Runner:
    """One method with its renderer, its times and its score."""

    def __init__(self, method: Method, config: Config, renderer: Renderer, truth: Truth) -> None:
        self.method, self._config, self.renderer = method, method.configure(config), renderer
        self.score = Score(truth)
        self._software = is_software(renderer.ctx)
        self._profiler = Profiler(renderer.ctx)
        self._wall: list[float] = []

    def run(self, packet: FramePacket, profiled: bool, scored: bool) -> None:
        """Filter one frame. ``profiled``: time its passes instead of the whole."""
        measured = packet.index >= FIRST_MEASURED
        profiler = self._profiler if profiled and measured else None
        self.renderer.ctx.finish()
        start = time.perf_counter()
        result = self.renderer.run(packet, self._config, self.method.denoiser, profiler=profiler)
        self.renderer.ctx.finish()
        milliseconds = (time.perf_counter() - start) * 1e3
        if measured and not profiled:
            self._wall.append(milliseconds)
        if scored:
            self.score.add(packet.index, read(result.outputs["radiance"])[..., :3])

    def result(self, noisy: Score) -> MethodResult:
        self._profiler.flush()
        passes = tuple(PassTime(row.name, row.milliseconds) for row in self._profiler.rows())
        wall = Summary.of(self._wall)
        total = sum(row.milliseconds for row in passes)
        return MethodResult(
            name=self.method.name,
            milliseconds=wall.median if self._software else total,
            wall=wall,
            passes=passes,
            deviation=total / wall.median - 1.0 if self._software else None,
            rmse=self.score.rmse(),
            rmse_ratio=_ratio(self.score.rmse(), noisy.rmse()),
            temporal=self.score.temporal(),
            temporal_ratio=_ratio(self.score.temporal(), noisy.temporal()),
        )


def _ratio(value: float, unit: float) -> float:
    """NaN where there is no noise to compare with, as in a scene in darkness."""
    return value / unit if unit > 0.0 else math.nan


def trace(shot: Shot) -> list[FramePacket]:
    """All frames of the motion."""
    with Progress(f"{shot.scene.scene.name}: {FRAMES} frames") as progress:
        packets = []
        for index in range(FRAMES):
            packets.append(shot.frame(index))
            progress.update((index + 1) / FRAMES)
    return packets


def measure(
    packets: Sequence[FramePacket],
    truth: Truth,
    config: Config,
    new_renderer: NewRenderer,
    repeats: int,
    methods: Sequence[Method] = METHODS,
) -> tuple[MethodResult, ...]:
    """Run ``methods``, of which the first must be the noisy frame itself, in lockstep over ``packets``.

    ``packets`` are the frames 0, 1, ... of a sequence; errors are taken in the first repeat, being the same in all.
    """
    runners = [_Runner(method, config, new_renderer(), truth) for method in methods]
    try:
        with Progress(f"{len(methods)} methods") as progress:
            for repeat in range(repeats):
                for index, packet in enumerate(packets):
                    for runner in runners:
                        runner.run(packet, (index + repeat) % 2 == 1, repeat == 0 and index in SCORED)
                    progress.update((repeat * len(packets) + index + 1) / (repeats * len(packets)))
        return tuple(runner.result(runners[0].score) for runner in runners)
    finally:
        for runner in runners:
            runner.renderer.release()
