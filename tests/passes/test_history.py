"""Histories on a real OpenGL context: what they hold, and when that counts."""

from __future__ import annotations

import pytest

from gl.executor import Result
from gl.graph import FragmentPass, Graph, GraphError, Out, Plan, Prev
from tests.passes.stage import Stage, count_plan, fill_plan, pixels


def counted(result: Result) -> tuple[float, float]:
    """The count and what the history held."""
    values = pixels(result.outputs["display"])
    assert (values == values[0, 0]).all()
    return float(values[0, 0, 0]), float(values[0, 0, 3])


def test_history_holds_last_frame_across_rebuilt_graphs(stage: Stage) -> None:
    result = stage.run(count_plan())
    assert result.histories == {"count": "first use"}
    assert counted(result) == (5, 0)  # cleared when made
    for frame in range(1, 4):
        result = stage.run(count_plan())
        assert result.histories == {"count": "valid"}
        assert counted(result) == (5 + frame, 4 + frame)


def test_reset_and_a_frame_without_feeding_invalidate_but_resume(stage: Stage) -> None:
    stage.run(count_plan())
    result = stage.run(count_plan(), reset="camera cut")
    assert (result.histories, counted(result)) == ({"count": "reset: camera cut"}, (5, 5))
    assert counted(stage.run(count_plan())) == (6, 5)
    assert stage.run(fill_plan()).histories == {}
    result = stage.run(count_plan())
    assert (result.histories, counted(result)[0]) == ({"count": "not fed last frame"}, 5)
    assert counted(stage.run(count_plan()))[0] == 6


def test_the_last_frame_again_has_the_histories_that_it_had(stage: Stage) -> None:
    """However often, and whatever it reads then; the frame after it follows the last of them."""
    assert counted(stage.run(count_plan(), again=True)) == (5, 0)  # there is no last frame
    stage.run(count_plan())
    result = stage.run(count_plan())
    assert counted(result) == (7, 6)
    for _ in range(3):
        result = stage.run(count_plan(), again=True)
        assert (result.histories, counted(result)) == ({"count": "valid"}, (7, 6))
    assert counted(stage.run(count_plan(), reset="by key", again=True))[0] == 5
    assert counted(stage.run(count_plan(), again=True)) == (7, 6)
    assert stage.run(fill_plan(), again=True).histories == {}
    assert stage.run(count_plan(), again=True).histories == {"count": "valid"}
    assert counted(stage.run(count_plan())) == (8, 7)


def test_a_history_that_is_new_in_a_frame_made_again_is_void(stage: Stage) -> None:
    stage.run(fill_plan())
    result = stage.run(count_plan(), again=True)
    assert (result.histories, counted(result)[0]) == ({"count": "first use"}, 5)
    result = stage.run(count_plan(), again=True)
    assert (result.histories, counted(result)[0]) == ({"count": "not fed last frame"}, 5)
    assert counted(stage.run(count_plan()))[0] == 6


def test_resizing_and_another_format_start_from_zero(stage: Stage) -> None:
    stage.run(count_plan())
    result = stage.run(count_plan(), size=(5, 3))
    assert (result.histories, counted(result)) == ({"count": "resized"}, (5, 0))
    assert result.outputs["display"].size == (5, 3)
    assert counted(stage.run(count_plan(), size=(5, 3))) == (6, 5)
    result = stage.run(count_plan("rgba32f"), size=(5, 3))
    assert (result.histories, counted(result)) == ({"count": "format changed"}, (5, 0))


def test_another_frame_size_counts_even_where_the_texture_s_stays(stage: Stage) -> None:
    """A third of 13 pixels, rounded up, is that of 15: what the texels stand for has changed all the same."""
    (stage.root / "thirds.frag").write_text("""
        uniform sampler2D prev_color;
        uniform bool u_history_valid;
        layout(location = 0) out vec4 out_color;
        void main() {
            out_color = u_history_valid ? texelFetch(prev_color, ivec2(gl_FragCoord.xy), 0) + 1.0 : vec4(1.0);
        }
    """)

    class Thirds(FragmentPass):
        shader = "thirds.frag"
        prev_color = Prev("count")
        out_color = Out("rgba32f", "count", divisor=3)

    def plan() -> Plan:
        g = Graph()
        history = g.history("thirds", "rgba32f", divisor=3)
        thirds = g.add(Thirds(), prev_color=history)
        g.feed(history, thirds.out_color)
        g.output("display", thirds.out_color)
        return g.compile()

    reasons = []
    for width in (13, 13, 15, 15, 16):
        result = stage.run(plan(), size=(width, 7))
        reasons.append((result.outputs["display"].width, result.histories["thirds"], pixels(result.outputs["display"])))
    assert [(width, why, values.max()) for width, why, values in reasons] == [
        (5, "first use", 1),
        (5, "valid", 2),
        (5, "resized", 1),
        (5, "valid", 2),
        (6, "resized", 1),
    ]


def test_a_frame_that_failed_has_fed_nothing(stage: Stage) -> None:
    stage.run(count_plan())
    with pytest.raises(GraphError):
        stage.run(fill_plan(color=(1, 2)))
    assert stage.run(count_plan()).histories == {"count": "not fed last frame"}


def test_a_pass_s_histories_are_valid_only_together(stage: Stage) -> None:
    (stage.root / "two.frag").write_text("""
        uniform sampler2D prev_a, prev_b;
        uniform bool u_history_valid;
        layout(location = 0) out vec4 out_a;
        layout(location = 1) out vec4 out_b;
        void main() {
            vec4 zero = 0.0 * (texelFetch(prev_a, ivec2(0), 0) + texelFetch(prev_b, ivec2(0), 0));
            out_a = out_b = vec4(u_history_valid) + zero;
        }
    """)

    class Two(FragmentPass):
        shader = "two.frag"
        prev_a, prev_b = Prev("a"), Prev("b")
        out_a, out_b = Out("rgba8", "valid"), Out("rgba8", "valid")

    def plan(second: str) -> Plan:
        g = Graph()
        a, b = g.history("a", "rgba8"), g.history(second, "rgba8")
        two = g.add(Two(), prev_a=a, prev_b=b)
        g.feed(a, two.out_a)
        g.feed(b, two.out_b)
        g.output("display", two.out_a)
        return g.compile()

    flags = [pixels(stage.run(plan(second)).outputs["display"]).max() for second in ("b", "b", "c", "c")]
    assert flags == [0, 255, 0, 255]
    assert stage.run(plan("b")).histories == {"a": "valid", "b": "not fed last frame"}
