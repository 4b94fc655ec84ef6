"""The first frame, cuts, other sizes, and very many frames."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from typing import Final

import numpy as np

from bench.hard.stage import EXACT, FILTERS, Row, Stage, deviation, number, wall, worst
from config import load
from gl.graph import Graph
from gl.passes.temporal import Guides, accumulate, reproject
from gl.renderer import read
from gl.upload import Uploader
from raytrace.frame import FramePacket

MANY: Final = 100_000
TINY: Final = (8, 8)


def measure(stage: Stage) -> list[Row]:
    """All cases of time."""
    return [
        worst([_first(stage, method) for method in FILTERS]),
        worst([_changed(stage, "camera cut", _cut, method) for method in FILTERS]),
        worst([_changed(stage, "another size and back", _resized, method) for method in FILTERS]),
        accumulation(stage, MANY),
    ]


def _first(stage: Stage, method: str) -> Row:
    """Histories that hold NaN and are not valid: the first frame of a sequence does not look at them."""
    stage.sequence([wall(np.nan)] * 2, method)
    error = deviation(stage.sequence([wall(0.75)], method)[0], 0.75)
    return Row("first frame after one of NaN", method, "0.75", error, EXACT, "NaN: what a new texture holds, blended")


def _cut() -> list[FramePacket]:
    return [wall(1.0), wall(1.0), replace(wall(0.2), cut=True)]


def _resized() -> list[FramePacket]:
    """Back at the old size, nothing of the old frames may be there."""
    return [wall(1.0), wall(1.0), wall(0.5, (23, 14)), wall(0.2)]


def _changed(stage: Stage, case: str, packets: Callable[[], list[FramePacket]], method: str) -> Row:
    shown = stage.sequence(packets(), method)[-1]
    blended = 0.2 / 3 + 1.0 * 2 / 3
    return Row(case, method, "0.2", deviation(shown, 0.2), EXACT, f"{number(blended)}: blended with what was before")


def accumulation(stage: Stage, frames: int) -> Row:
    """The temporal passes alone, 8x8 pixels: the mean of two values in turn, neither drifting nor overflowing."""
    p = load(None, ("svgf.alpha=0",)).svgf
    g = Graph()
    found = reproject(g, Guides(g, False), "hard", p, 0.02)
    history = g.history("hard.color", "rgba32f")
    mean, _ = accumulate(g, g.import_("frame.direct", "rgba32f"), found, history, p, fmt="rgba32f")
    g.feed(history, mean)
    g.output("color", mean)
    plan = g.compile()
    with ExitStack() as stack:
        pair = [Uploader(stage.renderer.ctx) for _ in range(2)]
        for light, uploader in enumerate(pair):
            stack.callback(uploader.release)
            uploader.upload(wall(float(light), TINY), (tex.name for tex in plan.imports))
        executor = stage.renderer.executor
        for index in range(frames):
            result = executor.run(plan, TINY, pair[index % 2].textures, "" if index else "hard case")
        image = read(result.outputs["color"])[..., :3]
    stage.restart()
    # The length is capped at 255: the last sample's share stays 1/255.
    share = 1.0 / 255.0
    exact = share / (1.0 - (1.0 - share) ** 2)
    half = np.float16(0.0)
    for index in range(4096):
        half = np.float16(half + np.float16((index % 2 - half) / min(index + 1, 255)))
    return Row(
        case=f"{frames:,} frames of accumulation",
        method="temporal pass",
        exact=number(exact),
        error=deviation(image, exact),
        bound=1e-4,
        unguarded=f"{number(float(half) / exact - 1.0)} off in half precision",
        finite=bool(np.isfinite(image).all()),
    )
