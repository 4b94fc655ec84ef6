"""Which uses of a program need machine code of their own, and the small frames that stand in for large ones."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from gl.graph import Graph
from gl.plan import texture_size
from gl.ports import ONE_TEXEL
from gl.variants import stand_in, variants
from tests.passes.stage import Add, Fill, add_plan, count_plan, fill_plan


def powers(size: tuple[int, int], divisors: Iterable[int]) -> list[bool]:
    return [side & (side - 1) == 0 for divisor in divisors for side in texture_size(size, divisor)]


@pytest.mark.parametrize("size", [(640, 360), (512, 288), (1024, 512), (1, 1), (7, 64), (1920, 1080)])
@pytest.mark.parametrize("divisors", [(1,), (1, 2), (1, 3, ONE_TEXEL), (2, 4, 8)])
def test_a_small_frame_stands_in_for_a_large_one(size, divisors):
    small = stand_in(size, divisors)
    assert powers(small, divisors) == powers(size, divisors)
    assert max(small) <= 33


def test_a_frame_without_textures_of_its_size_is_as_small_as_can_be():
    assert stand_in((640, 360), ()) == (1, 1)
    assert stand_in((640, 512), (1,)) == (3, 1)


def test_each_variant_is_there_once_and_in_the_order_of_the_passes():
    names = [node.name for node in variants(add_plan(), (13, 7)).values()]
    assert names == ["fill", "add"]


def test_parameters_make_no_variant_but_formats_and_sides_do():
    def keys(plan, size=(13, 7)):
        return set(variants(plan, size))

    assert keys(fill_plan((1, 2, 3, 4))) == keys(fill_plan((5, 6, 7, 8)))
    assert keys(fill_plan()) == keys(fill_plan(), (640, 360))
    assert keys(fill_plan()).isdisjoint(keys(fill_plan(), (16, 7)))
    assert keys(fill_plan(), (16, 7)).isdisjoint(keys(fill_plan(), (13, 8)))
    half, single = keys(count_plan("rgba16f")), keys(count_plan("rgba32f"))
    assert len(half & single) == 1, "the pass before the history is the same"


def test_formats_of_what_is_read_make_variants():
    def plan(fmt):
        g = Graph()
        filled = g.add(Fill(u_color=(1, 1, 1, 1), formats={"out_color": fmt})).out_color
        g.output("display", g.add(Add(defines={"FACTOR": 2}), in_a=filled).out_color)
        return g.compile()

    (_, half), (_, single) = (list(variants(plan(fmt), (13, 7))) for fmt in ("rgba16f", "rgba32f"))
    assert half[0] == single[0], "one program"
    assert half != single
