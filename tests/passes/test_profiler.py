"""Timings of passes, by queries and by draining the pipeline."""

from __future__ import annotations

from unittest.mock import patch

import moderngl
import pytest

from gl.profiler import Profiler, is_software
from tests.passes.stage import SIZE, Stage, add_plan, fill_plan


def test_without_a_profiler_nothing_waits(stage: Stage) -> None:
    with patch.object(moderngl.Context, "finish", autospec=True) as finish:
        stage.run(add_plan())
    finish.assert_not_called()


@pytest.mark.parametrize("queries", [False, True])
def test_profiler_names_passes_in_order_and_adds_up(stage: Stage, queries: bool) -> None:
    profiler = Profiler(stage.ctx, queries)
    plan = add_plan()
    texture = stage.ctx.texture(SIZE, 4, dtype="f4")
    stage.executor.run(plan, (64, 64), {})  # compile outside of what is measured
    assert (profiler.rows(), profiler.total) == ([], 0.0)
    for _ in range(6):
        with profiler.frame():
            with profiler.measure("before"):
                texture.write(bytes(16 * SIZE[0] * SIZE[1]))
            stage.executor.run(plan, (64, 64), {}, profiler=profiler)
    profiler.flush()
    rows = profiler.rows()
    assert [row.name for row in rows] == ["before", "fill", "add"]
    assert sum(row.share for row in rows) == pytest.approx(1)
    assert all(row.milliseconds >= 0 for row in rows)
    assert profiler.total > 0
    assert profiler.report().splitlines()[-1].startswith("frame")
    with pytest.raises(RuntimeError, match="outside of"), profiler.measure("x"):
        pass


def test_profiler_chooses_by_renderer(stage: Stage) -> None:
    assert Profiler(stage.ctx)._queries is not is_software(stage.ctx)


def test_profiler_drains_the_pipeline_around_passes(stage: Stage) -> None:
    profiler = Profiler(stage.ctx, queries=False)
    with patch.object(moderngl.Context, "finish", autospec=True, side_effect=moderngl.Context.finish) as finish:
        stage.executor.run(add_plan(), SIZE, {}, profiler=profiler)
    assert finish.call_count == 2 + 2 * 2  # the frame, and two passes
    assert 0 < sum(row.milliseconds for row in profiler.rows()) <= profiler.total


def test_profiler_forgets_passes_that_are_gone(stage: Stage) -> None:
    profiler = Profiler(stage.ctx, queries=False)
    stage.executor.run(add_plan(), SIZE, {}, profiler=profiler)
    stage.executor.run(fill_plan(), SIZE, {}, profiler=profiler)
    assert [row.name for row in profiler.rows()] == ["fill"]
