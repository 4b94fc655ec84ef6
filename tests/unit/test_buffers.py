"""Memory of frames that nobody holds any more."""

from __future__ import annotations

import numpy as np

from raytrace.buffers import Buffers


def address(array: np.ndarray) -> int:
    return int(array.ctypes.data)


def test_what_is_held_is_never_given_again():
    buffers = Buffers()
    held = [buffers.empty(4, 3) for _ in range(40)]
    assert len({address(array) for array in held}) == 40
    assert {(array.shape, array.dtype.name) for array in held} == {((4, 3), "float32")}


def test_a_part_of_an_array_holds_all_of_it():
    buffers = Buffers()
    part = buffers.empty(2, 8, 4)[1].reshape(4, 8)[2:]
    part[:] = 7.0
    for _ in range(3):
        buffers.empty(2, 8, 4)[:] = 0.0
    assert (part == 7.0).all()


def test_what_nobody_holds_is_used_again_where_the_shape_is_the_same():
    buffers = Buffers()
    first = buffers.empty(5, 4)
    place = address(first)
    assert address(buffers.empty(4, 5)) != place
    del first
    assert address(buffers.empty(5, 4)) == place


def test_memory_of_sizes_that_are_no_longer_asked_for_is_given_back():
    buffers = Buffers()
    for count in range(1, 100):
        buffers.empty(count, 4)
    assert len(buffers._blocks) < 20
