"""Plans on a real OpenGL context: pixels, bindings, compute, reuse of objects."""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

import moderngl
import numpy as np
import pytest

from gl.executor import COMPUTE_BARRIER
from gl.formats import FORMATS, lookup
from gl.graph import FragmentPass, Graph, GraphError, Out, Uniform
from gl.resources import KEEP_RUNS
from tests.passes.stage import SIZE, Add, Fill, Index, Place, Stage, Third, count_plan, fill_plan, pixels


class Uniforms(FragmentPass):
    shader = "uniforms.frag"
    out_a, out_b = Out("rgba32f", "a"), Out("rgba32f", "b")
    u_int, u_uint, u_bool = Uniform("int", "i"), Uniform("uint", "u"), Uniform("bool", "b")
    u_vec, u_ivec, u_mat = Uniform("vec2", "v"), Uniform("ivec3", "i"), Uniform("mat3", "m")
    u_unused = Uniform("float", "declared, then optimised away")


UNIFORMS: dict[str, Any] = {
    "u_int": -3,
    "u_uint": 4,
    "u_bool": True,
    "u_vec": (1.0, 2.5),
    "u_ivec": (1, 2, 3),
    "u_mat": np.arange(9.0).reshape(3, 3),
    "u_unused": 1.0,
}


# --------------------------------------------------------------------------------------------------- fragment passes


def test_the_triangle_covers_every_pixel_once_and_targets_are_in_order(stage: Stage) -> None:
    g = Graph()
    place = g.add(Place())
    g.output("pixel", place.out_pixel)
    g.output("index", place.out_index)
    result = stage.run(g.compile())
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    np.testing.assert_array_equal(pixels(result.outputs["pixel"]), np.stack([x, y], -1) + 0.5)
    np.testing.assert_array_equal(pixels(result.outputs["index"])[..., :2], np.stack([x, y], -1))
    assert (pixels(result.outputs["index"])[..., 2:] == (7, 8)).all()
    assert result.barriers == 0


def test_blending_depth_and_culling_of_the_caller_do_not_matter(stage: Stage) -> None:
    stage.ctx.enable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
    stage.ctx.blend_func = (moderngl.ONE, moderngl.ONE)
    plan = fill_plan()
    for _ in range(2):
        result = stage.run(plan)
    assert (pixels(result.outputs["display"]) == (1, 2, 3, 4)).all()
    stage.ctx.blend_func = (moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA)


def test_a_run_leaves_none_of_its_framebuffers_bound(stage: Stage) -> None:
    for size in (SIZE, (4, 4)):  # the second run releases the first one's framebuffers
        stage.run(fill_plan(), size)
        assert stage.ctx.fbo.glo == 0
    with pytest.raises(GraphError):
        stage.run(fill_plan(color=(1, 2)))
    assert stage.ctx.fbo.glo == 0


def test_inputs_defines_and_optional_ports(stage: Stage) -> None:
    values = np.random.default_rng(1).random((SIZE[1], SIZE[0], 4), np.float32)
    g = Graph()
    noisy = g.import_("noisy", "rgba32f")
    alone = g.add(Add(defines={"FACTOR": 2.0}), in_a=noisy).out_color
    g.output("alone", alone)
    g.output("both", g.add(Add(defines={"FACTOR": 4.0}), in_a=alone, in_b=noisy).out_color)
    result = stage.run(g.compile(), noisy=stage.upload(values))
    np.testing.assert_array_equal(pixels(result.outputs["alone"]), values * 2)
    np.testing.assert_array_equal(pixels(result.outputs["both"]), values * 8 + values)


def test_aliasing_does_not_change_pixels(stage: Stage) -> None:
    g = Graph()
    x = g.add(Fill(u_color=(1, 0, 0, 1))).out_color
    first = x
    for _ in range(4):
        x = g.add(Add(defines={"FACTOR": 2.0}), in_a=x).out_color
    g.output("display", x)
    for alias, count in ((True, 2), (False, 5)):
        plan = g.compile(alias=alias)
        assert len(plan.slots) == count
        assert (pixels(stage.run(plan).outputs["display"]) == (16, 0, 0, 16)).all()

    result = stage.run(g.compile())
    with pytest.raises(GraphError, match=r"'fill\.out_color' was written over later .* keep=\('fill\.out_color',\)"):
        result.texture("fill.out_color")
    with pytest.raises(GraphError, match=r"no texture 'fil\.out_color' in this frame, did you mean 'fill\.out_color'"):
        result.texture("fil.out_color")
    kept = stage.run(g.compile(keep=(first.name,)))
    assert (pixels(kept.texture("fill.out_color")) == (1, 0, 0, 1)).all()
    assert kept.texture("add4.out_color") is kept.outputs["display"]


def test_divided_sizes_round_up(stage: Stage) -> None:
    g = Graph()
    g.output("third", g.add(Third()).out_color)
    third = stage.run(g.compile()).outputs["third"]
    assert third.size == (5, 3)
    assert tuple(pixels(third)[2, 4]) == (4.5, 2.5, 0, 1)


def test_uniforms_of_every_shape_and_one_optimised_away(stage: Stage) -> None:
    g = Graph()
    made = g.add(Uniforms(**UNIFORMS))
    g.output("a", made.out_a)
    g.output("b", made.out_b)
    result = stage.run(g.compile())
    assert tuple(pixels(result.outputs["a"])[0, 0]) == (-3, 4, 1, 2.5)
    assert tuple(pixels(result.outputs["b"])[0, 0]) == (0, 3, 6, 3)  # the matrix's first column, given as rows


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("u_int", 1.5, r"uniforms\.u_int = 1\.5 is not a int"),
        ("u_vec", (1.0, 2.0, 3.0), r"u_vec = \(1\.0, 2\.0, 3\.0\) is not a vec2"),
        ("u_uint", -1, "u_uint = -1 is not a uint"),
        ("u_mat", np.eye(4), r"is not a mat3 \(its shape is \(4, 4\)\)"),
    ],
)
def test_values_that_do_not_fit_are_named(stage: Stage, name: str, value: object, message: str) -> None:
    g = Graph()
    g.output("a", g.add(Uniforms(**{**UNIFORMS, name: value})).out_a)
    with pytest.raises(GraphError, match=message):
        stage.run(g.compile())


def test_uploads_are_checked(stage: Stage) -> None:
    g = Graph()
    g.output("a", g.add(Add(defines={"FACTOR": 1}), in_a=g.import_("noisy", "rgba32f")).out_color)
    half = stage.ctx.texture(SIZE, 4, dtype="f2")
    with pytest.raises(GraphError, match="import 'noisy' was not uploaded, did you mean 'nosy'"):
        stage.run(g.compile(), nosy=half)
    with pytest.raises(GraphError, match=r"import 'noisy' is rgba32f \(4 x f4\), but 4 x f2 was uploaded"):
        stage.run(g.compile(), noisy=half)
    with pytest.raises(GraphError, match="size is 0 x 7"):
        stage.run(fill_plan(), size=(0, 7))


@pytest.mark.parametrize("fmt", FORMATS)
def test_every_format_can_be_created_empty_and_rendered_to(stage: Stage, fmt: str) -> None:
    texture = stage.executor._textures.create(fmt, SIZE)
    assert len(texture.read()) == lookup(fmt).bytes_per_pixel * SIZE[0] * SIZE[1]
    assert not any(texture.read())
    assert texture.filter == (moderngl.NEAREST, moderngl.NEAREST)
    assert (texture.repeat_x, texture.repeat_y) == (False, False)
    assert stage.executor._textures.framebuffer([texture]).size == SIZE
    stage.executor._textures.release(texture)


# ----------------------------------------------------------------------------------------------------------- compute


def test_compute_covers_all_pixels_and_is_followed_by_a_barrier(stage: Stage) -> None:
    g = Graph()
    index = g.add(Place()).out_index
    made = g.add(Index(), in_index=index)
    again = g.add(Index(group=(4, 2)), in_index=index)
    g.output("pixel", made.out_pixel)
    g.output("id", made.out_id)
    g.output("again", again.out_id)
    barrier = moderngl.Context.memory_barrier
    with patch.object(moderngl.Context, "memory_barrier", autospec=True, side_effect=barrier) as issued:
        result = stage.run(g.compile())
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    np.testing.assert_array_equal(pixels(result.outputs["pixel"]), np.stack([x, y], -1))
    for name in ("id", "again"):
        np.testing.assert_array_equal(pixels(result.outputs[name])[..., 0], 1000 * y + x)
    assert [call.args[1] for call in issued.call_args_list] == [COMPUTE_BARRIER] * 2
    assert result.barriers == 2
    for bit in ("TEXTURE_FETCH", "SHADER_IMAGE_ACCESS", "FRAMEBUFFER", "TEXTURE_UPDATE"):
        assert COMPUTE_BARRIER & getattr(moderngl, f"{bit}_BARRIER_BIT")


# ------------------------------------------------------------------------------------------------- objects and reuse


def test_objects_are_reused_and_then_released(stage: Stage) -> None:
    executor = stage.executor

    def owned() -> tuple[int, int, int, int]:
        framebuffers = executor._textures._framebuffers
        return len(executor._programs), len(executor._slots), len(executor._histories), len(framebuffers)

    for _ in range(4):
        stage.run(count_plan())
    assert owned() == (2, 1, 1, 3)  # the history's two halves are written in turn
    for _ in range(KEEP_RUNS - 1):
        stage.run(fill_plan())
    assert owned() == (2, 1, 1, 3)
    stage.run(fill_plan())
    assert owned() == (2, 1, 0, 1)
    stage.run(fill_plan(), size=(3, 3))
    assert owned() == (2, 1, 0, 1)
    executor.release()
    assert owned() == (0, 0, 0, 0)


def test_one_program_serves_all_values_and_each_variant_has_its_own(stage: Stage) -> None:
    g = Graph()
    x = g.add(Fill(u_color=(1, 1, 1, 1))).out_color
    y = g.add(Fill(u_color=(2, 2, 2, 2))).out_color
    for factor in (1, 1, 3):
        x = g.add(Add(defines={"FACTOR": factor}), in_a=x).out_color
    g.output("display", g.add(Add(defines={"FACTOR": 1}), in_a=x, in_b=y).out_color)
    assert (pixels(stage.run(g.compile()).outputs["display"]) == 5).all()
    assert len(stage.executor._programs) == 4
