"""What was measured on one sequence, and what follows from it: equal time, and the Pareto fronts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from bench.events import EventsResult
from bench.hardness import HardTable
from bench.machine import Machine
from bench.memory import MemoryResult
from bench.methods import PATH_TRACING
from bench.pareto import front
from bench.path_tracing import PathTracing
from bench.running import MethodResult
from bench.scores import Errors, Pictures
from bench.timing import Summary
from bench.tracing import TracingResult
from config import Config


@dataclass(frozen=True)
class QualityResult:
    """All methods on one sequence. ``noise`` and ``temporal_noise``: the references' own, estimated; no error below
    them means anything; ``floors``: the same for every error. ``trace``: milliseconds of a frame of one path per pixel,
    ``sample_milliseconds`` of one path more. ``truth``: the references to look at."""

    scene: str
    motion: str
    size: tuple[int, int]
    samples: int
    noise: float
    temporal_noise: float
    reference_seconds: float
    methods: tuple[MethodResult, ...]
    floors: Errors | None = None
    trace: Summary | None = None
    sample_milliseconds: float = 0.0
    path_tracing: tuple[PathTracing, ...] = ()
    truth: Pictures | None = None

    @property
    def title(self) -> str:
        """Scene, motion and size, as a heading."""
        return f"{self.scene}, {self.motion}, {self.size[0]}x{self.size[1]}"


@dataclass(frozen=True)
class Contender:
    """One point of the diagram of error against time.

    ``milliseconds``: of tracing and filtering a frame; ``p95``: of the filter's share. ``equal``: path tracing in the
    same time, None for path tracing itself. ``best_rmse``, ``best_flip``: nothing else measured is at least as fast and
    as good in that error; False as well for what does not compete: anti-aliasing follows what the errors are taken of,
    so that a variant with it only takes longer.
    """

    name: str
    group: str
    described: str
    stage: bool
    milliseconds: float
    filter_milliseconds: float
    p95: float
    errors: Errors
    equal: PathTracing | None
    competes: bool
    best_rmse: bool = False
    best_flip: bool = False
    pictures: Pictures | None = None


def contenders(result: QualityResult) -> tuple[Contender, ...]:
    """Every method and every number of paths, with the fronts marked. Empty where tracing was not timed."""
    if result.trace is None:
        return ()
    traced, display = result.trace.median, result.methods[0].milliseconds
    by_samples = {points.samples: points for points in result.path_tracing}
    found = []
    for m in result.methods:
        assert m.errors is not None
        assert m.method is not None
        found.append(
            Contender(
                name=m.name,
                group=m.method.group,
                described=m.method.described,
                stage=m.method.stage,
                milliseconds=traced + m.milliseconds,
                filter_milliseconds=m.milliseconds,
                p95=m.wall.p95,
                errors=m.errors,
                equal=by_samples.get(equal_samples(result, m)),
                competes=not m.method.taa,
                pictures=m.pictures,
            )
        )
    for points in result.path_tracing:
        if points.samples > 1:  # one path per pixel is the noisy frame
            found.append(
                Contender(
                    name=f"{points.samples} paths",
                    group=PATH_TRACING,
                    described=f"mean of {points.samples} paths per pixel",
                    stage=False,
                    milliseconds=points.milliseconds + display,
                    filter_milliseconds=display,
                    p95=0.0,
                    errors=points.errors,
                    equal=None,
                    competes=True,
                    pictures=points.pictures,
                )
            )
    return _marked(found)


def equal_samples(result: QualityResult, method: MethodResult) -> int:
    """Paths per pixel that fit into tracing and filtering by ``method``, both being displayed; 1 if only one does."""
    spare = method.milliseconds - result.methods[0].milliseconds
    return 1 + max(0, int(spare / result.sample_milliseconds)) if result.sample_milliseconds > 0.0 else 1


def _marked(found: list[Contender]) -> tuple[Contender, ...]:
    def best(error: Callable[[Errors], float]) -> list[bool]:
        nan = float("nan")
        return front([(c.milliseconds if c.competes else nan, error(c.errors)) for c in found])

    marks = zip(found, best(lambda e: e.rmse), best(lambda e: e.flip), strict=True)
    return tuple(replace(contender, best_rmse=rmse, best_flip=flip) for contender, rmse, flip in marks)


@dataclass(frozen=True)
class Report:
    """Everything measured in one run. ``seconds``: of the whole run without ``reference_seconds``, which went into
    references that were not on disk yet."""

    machine: Machine
    config: Config
    quick: bool
    quality: tuple[QualityResult, ...]
    tracing: tuple[TracingResult, ...]
    memory: MemoryResult | None
    seconds: float
    reference_seconds: float
    events: EventsResult | None = None
    hard: tuple[HardTable, ...] = ()
