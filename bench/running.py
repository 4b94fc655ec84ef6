"""Speed against error: every method on the same frames.

Frames are traced once and kept. Then, frame by frame, each method filters that frame with a renderer of its own, so
that a drift of the machine hits all alike and no method voids another's history; the tracer's own time is taken in the
same loop. On every second frame, shifted by one from repeat to repeat, the passes are timed one by one, which drains
the pipeline around each; on the others only the frame is.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bench import oidn
from bench.cases import FIRST_MEASURED, FRAMES, SCORED
from bench.methods import METHODS, Method, NewRenderer
from bench.scores import Errors, Pictures, Score, Truth
from bench.timing import Summary
from config import Config
from console import Progress
from gl.pipelines import remembered
from gl.profiler import Profiler, is_software
from gl.renderer import Renderer, read
from raytrace.frame import FramePacket
from raytrace.shot import Shot

F32 = NDArray[np.float32]

UPLOAD = "upload"
"""What gl/renderer.py calls its first measurement of a frame."""


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
    where the frame is that sum. ``rmse`` and ``temporal`` are those of the radiance before anti-aliasing, as all errors
    are; the ratios divide by the noisy frames' own. ``errors``: the same and all others. ``method``: None where only
    the numbers are of interest. ``pictures``: None unless they were kept.
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
    errors: Errors | None = None
    method: Method | None = None
    pictures: Pictures | None = None

    def of_pass(self, name: str) -> float:
        """Milliseconds of the pass ``name``; 0 where there is none."""
        return sum(row.milliseconds for row in self.passes if row.name == name)

    @property
    def upload(self) -> float:
        """Median milliseconds of sending the frame's arrays to GL."""
        return self.of_pass(UPLOAD)


class Contestant(Protocol):
    """One method, whatever it runs on."""

    method: Method

    def filter(self, packet: FramePacket, profiler: Profiler | None) -> F32 | None:
        """Filter and display one frame, and wait until that is done. Returns (H, W, 3) linear radiance, row 0 at the
        bottom, where it is there anyway; None where :meth:`radiance` has to fetch it."""

    def radiance(self) -> F32:
        """Of the frame filtered last."""

    def release(self) -> None: ...


class GlContestant:
    """A denoiser of gl/pipelines.py."""

    def __init__(self, method: Method, config: Config, renderer: Renderer) -> None:
        self.method, self._config, self._renderer = method, method.configure(config), renderer
        self._read: Callable[[], F32] | None = None

    def filter(self, packet: FramePacket, profiler: Profiler | None) -> F32 | None:
        result = self._renderer.run(packet, self._config, self.method.denoiser, profiler=profiler)
        self._renderer.ctx.finish()
        self._read = lambda: read(result.outputs["radiance"])[..., :3]
        return None

    def radiance(self) -> F32:
        assert self._read is not None
        return self._read()

    def release(self) -> None:
        self._renderer.release()


class OidnContestant:
    """Open Image Denoise, and then the same display as of all others."""

    def __init__(self, method: Method, config: Config, renderer: Renderer) -> None:
        self.method, self._config, self._renderer = method, method.configure(config), renderer
        self._filter: oidn.Filter | None = None
        self._image: F32 | None = None

    def filter(self, packet: FramePacket, profiler: Profiler | None) -> F32 | None:
        if self._filter is None or self._filter.size != packet.size:
            self._filter = oidn.Filter(packet.size, self.method.quality)
        if profiler is None:
            image = self._filter.run(packet)
            self._show(packet, image, None)
        else:
            with profiler.frame():
                with profiler.measure("oidn"):
                    image = self._filter.run(packet)
                self._show(packet, image, profiler)
        self._image = image[..., :3]
        return self._image

    def _show(self, packet: FramePacket, image: F32, profiler: Profiler | None) -> None:
        self._renderer.run(packet, self._config, "reference", reference=image)
        self._renderer.ctx.finish()

    def radiance(self) -> F32:
        assert self._image is not None
        return self._image

    def release(self) -> None:
        self._renderer.release()


class _Runner:
    """A contestant with its times and its score."""

    def __init__(self, contestant: Contestant, renderer: Renderer, truth: Truth, frames: Sequence[FramePacket]) -> None:
        self.contestant, self._ctx, self._frames = contestant, renderer.ctx, frames
        self.score = Score(truth)
        self._software = is_software(renderer.ctx)
        self._profiler = Profiler(renderer.ctx)
        self._wall: list[float] = []

    def run(self, index: int, profiled: bool, watched: bool) -> None:
        """Filter one frame. ``profiled``: time its passes instead of the whole; ``watched``: look at the result."""
        packet = self._frames[index]
        measured = packet.index >= FIRST_MEASURED
        profiler = self._profiler if profiled and measured else None
        self._ctx.finish()
        start = time.perf_counter()
        self.contestant.filter(packet, profiler)
        milliseconds = (time.perf_counter() - start) * 1e3
        if measured and not profiled:
            self._wall.append(milliseconds)
        if watched:
            image = self.contestant.radiance()
            self.score.watch(packet.index, image)
            if packet.index in SCORED:
                self.score.add(packet.index, image)

    def result(self, noisy: Score) -> MethodResult:
        self._profiler.flush()
        passes = tuple(PassTime(row.name, row.milliseconds) for row in self._profiler.rows())
        wall = Summary.of(self._wall)
        total = sum(row.milliseconds for row in passes)
        on_cpu = self._software or bool(self.contestant.method.quality)
        errors = self.score.errors()
        return MethodResult(
            name=self.contestant.method.name,
            milliseconds=wall.median if on_cpu else total,
            wall=wall,
            passes=passes,
            deviation=total / wall.median - 1.0 if on_cpu else None,
            rmse=errors.rmse,
            rmse_ratio=_ratio(errors.rmse, noisy.rmse()),
            temporal=errors.temporal,
            temporal_ratio=_ratio(errors.temporal, noisy.temporal()),
            errors=errors,
            method=self.contestant.method,
            pictures=self.score.pictures(),
        )


def _ratio(value: float, unit: float) -> float:
    """NaN where there is no noise to compare with, as in a scene in darkness."""
    return value / unit if unit > 0.0 else math.nan


def available(methods: Sequence[Method]) -> tuple[Method, ...]:
    """Those of ``methods`` that this installation has."""
    return tuple(method for method in methods if not method.quality or oidn.installed())


def remembers(method: Method, config: Config) -> str:
    """By which rule the tracer is to remember points for ``method``; "" for none."""
    return "" if method.quality else remembered(method.configure(config), method.denoiser)


def contestant(method: Method, config: Config, renderer: Renderer) -> Contestant:
    """``renderer`` becomes the contestant's own."""
    return (OidnContestant if method.quality else GlContestant)(method, config, renderer)


def trace(shot: Shot) -> list[FramePacket]:
    """All frames of the motion."""
    with Progress(f"{shot.scene.scene.name}: {FRAMES} frames") as progress:
        packets = []
        for index in range(FRAMES):
            packets.append(shot.frame(index))
            progress.update((index + 1) / FRAMES)
    return packets


class Footage:
    """The frames of a shot, traced once, and once more for each rule of :data:`raytrace.gradients.RULES` by which a
    method wants points remembered: every method gets what it would get in use."""

    def __init__(self, shot: Shot) -> None:
        self._shot = shot
        self._frames: dict[str, list[FramePacket]] = {}

    def __call__(self, rule: str = "") -> list[FramePacket]:
        if rule not in self._frames:
            before, self._shot.remember = self._shot.remember, rule
            try:
                self._frames[rule] = trace(self._shot)
            finally:
                self._shot.remember = before
        return self._frames[rule]


def measure(
    packets: Sequence[FramePacket],
    truth: Truth,
    config: Config,
    new_renderer: NewRenderer,
    repeats: int,
    methods: Sequence[Method] = METHODS,
    beside: Callable[[int], None] | None = None,
    footage: Callable[[str], Sequence[FramePacket]] | None = None,
) -> tuple[MethodResult, ...]:
    """Run ``methods``, of which the first must be the noisy frame itself, in lockstep over ``packets``.

    ``packets`` are the frames 0, 1, ... of a sequence; errors are taken in the first repeat, being the same in all.
    ``beside``: called with the index of each frame, to measure in the same loop what is no method. ``footage``: the
    same frames with points remembered by a rule, for the methods that want that.
    """
    runners = []
    try:
        for method in available(methods):
            renderer = new_renderer()
            rule = remembers(method, config)
            frames = footage(rule) if footage is not None and rule else packets
            runners.append(_Runner(contestant(method, config, renderer), renderer, truth, frames))
        with Progress(f"{len(runners)} methods") as progress:
            for repeat in range(repeats):
                for index in range(len(packets)):
                    if beside is not None:
                        beside(index)
                    for runner in runners:
                        runner.run(index, (index + repeat) % 2 == 1, watched=repeat == 0)
                    progress.update((repeat * len(packets) + index + 1) / (repeats * len(packets)))
        return tuple(runner.result(runners[0].score) for runner in runners)
    finally:
        for runner in runners:
            runner.contestant.release()
