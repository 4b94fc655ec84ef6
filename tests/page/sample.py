"""A report of made-up numbers and pictures, so that the page can be tried without measuring anything."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.cases import FRAMES, SCORED
from bench.events import EventResult, EventsResult
from bench.hardness import HardTable
from bench.machine import describe
from bench.memory import MemoryResult
from bench.methods import APART, BMFR, BMFR_TAA, METHODS, NOISY, Method
from bench.path_tracing import PathTracing
from bench.results import QualityResult, Report
from bench.running import MethodResult, PassTime
from bench.scores import Errors, FrameErrors, Pictures
from bench.timing import Summary
from bench.tracing import TracingResult
from config import Config

SIZE = (96, 54)
STAGE = next(method for method in METHODS if method.stage)


def errors(rmse: float) -> Errors:
    frames = tuple(FrameErrors(index, rmse, rmse**2, 30.0, 0.9, 2 * rmse) for index in SCORED)
    return Errors(rmse, rmse**2, -20 * np.log10(rmse), 1.0 - rmse, 2 * rmse, rmse / 2, frames)


def pictures(level: int) -> Pictures:
    """A picture of one grey, but for a white square in its upper right quarter."""
    picture = np.full((SIZE[1], SIZE[0], 3), level, np.uint8)
    picture[40:44, 70:74] = 255
    return Pictures(picture, np.full(SIZE[::-1], level, np.uint8), np.full((FRAMES, SIZE[0], 3), level, np.uint8))


def result(method: Method, milliseconds: float, rmse: float, level: int) -> MethodResult:
    passes = (PassTime("upload", 0.1 * milliseconds), PassTime("svgf.atrous0", 0.9 * milliseconds))
    return MethodResult(
        name=method.name,
        milliseconds=milliseconds,
        wall=Summary(milliseconds, 1.2 * milliseconds, 20),
        passes=passes,
        deviation=0.0,
        rmse=rmse,
        rmse_ratio=rmse / 0.1,
        temporal=rmse / 2,
        temporal_ratio=rmse / 0.1,
        errors=errors(rmse),
        method=method,
        pictures=pictures(level),
    )


def quality(scene: str = "cornell") -> QualityResult:
    methods = (
        result(NOISY, 2.0, 0.1, 40),
        result(APART, 60.0, 0.02, 80),
        result(BMFR, 20.0, 0.01, 120),
        result(BMFR_TAA, 25.0, 0.01, 120),
        result(STAGE, 50.0, 0.04, 160),
    )
    traced = tuple(
        PathTracing(n, 30.0 + (n - 1) * 10.0, errors(0.1 / np.sqrt(n)), pictures(180)) for n in (1, 2, 3, 5, 6)
    )
    return QualityResult(
        scene=scene,
        motion="moving camera",
        size=SIZE,
        samples=1024,
        noise=0.005,
        temporal_noise=0.002,
        reference_seconds=1.0,
        methods=methods,
        floors=replace(errors(0.005), frames=()),
        trace=Summary(30.0, 35.0, 20),
        sample_milliseconds=10.0,
        path_tracing=traced,
        truth=pictures(200),
    )


def report(*scenes: str) -> Report:
    once = Summary(30.0, 35.0, 20)
    names = ("cut", "light switched")
    seen = tuple(
        EventResult(
            method.name,
            method.group,
            method.stage,
            0.01,
            {name: tuple(0.1 / (1 + frame) for frame in range(12)) for name in names},
            dict.fromkeys(names, 0.01),
            dict.fromkeys(names, 8),
        )
        for method in (NOISY, APART, BMFR, STAGE)
    )
    return Report(
        machine=describe({"GL_RENDERER": "some <renderer>", "GL_VERSION": "4.5"}, 2),
        config=Config(),
        quick=True,
        quality=tuple(quality(scene) for scene in scenes),
        tracing=(
            TracingResult("cornell", "moving camera", False, SIZE, 32, 900, once, once, once, once, 5.0, 6.0, "x"),
        ),
        memory=MemoryResult("cornell", SIZE, 200, 1000, 250.0, 256.5),
        seconds=12.0,
        reference_seconds=34.0,
        hard=(HardTable("light", ("case", "found", ""), (("all black", "0", ""), ("firefly", "1e5", "FAILS"))),),
        events=EventsResult("cornell", SIZE, (4, 12), 128, dict.fromkeys(names, 0.001), seen, 1.0),
    )
