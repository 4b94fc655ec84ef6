"""The ladder of rendering sizes and the choice of the first one."""

from __future__ import annotations

import pytest

from ui.resolution import FPS_WANTED, Calibration, ladder, step

BASE = (640, 360)


def pixels(size: tuple[int, int]) -> int:
    return size[0] * size[1]


@pytest.mark.parametrize("base", [BASE, (1, 1), (9, 16384), (16384, 16384), (641, 359), (8, 8)])
def test_the_ladder_grows_and_holds_the_size_asked_for(base):
    sizes = ladder(base)
    assert base in sizes
    assert [pixels(size) for size in sizes] == sorted({pixels(size) for size in sizes})
    assert all(1 <= side <= 16384 for size in sizes for side in size)


def test_rungs_keep_the_shape():
    assert (320, 180) in ladder(BASE)
    assert (1280, 720) in ladder(BASE)
    assert all(abs(w / h - 16 / 9) < 0.02 for w, h in ladder(BASE))


def test_steps_end_at_the_ends():
    sizes = ladder(BASE)
    assert step(BASE, BASE, -1) == (480, 270)
    assert step(BASE, BASE, 1) == (853, 480)
    assert step(BASE, sizes[0], -1) == sizes[0]
    assert step(BASE, sizes[-1], 99) == sizes[-1]


def calibrate(seconds_of, base=BASE) -> tuple[list[tuple[int, int]], int]:
    """Sizes gone through and the number of frames it took, on a machine whose frames take ``seconds_of(size)``."""
    calibration = Calibration(base)
    sizes, frames = [calibration.size], 0
    while not calibration.done:
        frames += 1
        assert frames < 100, "it never ends"
        if calibration.count(seconds_of(calibration.size)):
            sizes.append(calibration.size)
    return sizes, frames


LOWEST = (160, 90)


@pytest.mark.parametrize("fixed", [0.0, 0.02, 0.08])
@pytest.mark.parametrize("nanoseconds", [1, 100, 400, 1000, 4000, 10000])
def test_the_size_chosen_is_fluent_and_no_smaller_than_it_must_be(nanoseconds, fixed):
    def seconds(size):
        return fixed + pixels(size) * nanoseconds * 1e-9

    sizes, frames = calibrate(seconds)
    chosen = sizes[-1]
    assert seconds(chosen) <= 1 / FPS_WANTED or chosen == LOWEST
    above = step(BASE, chosen, 1)
    assert seconds(above) > 0.8 / FPS_WANTED or pixels(above) > pixels(BASE)
    assert frames < 40


def test_a_fast_machine_shows_what_was_asked_for_and_not_more():
    assert calibrate(lambda size: 1e-3)[0] == [LOWEST, BASE]


def test_time_that_grows_faster_than_the_pixels_is_noticed():
    def seconds(size):
        return 0.02 * (pixels(size) / pixels(LOWEST)) ** 1.5

    sizes, _ = calibrate(seconds)
    assert seconds(sizes[-1]) <= 1 / FPS_WANTED
    assert len(sizes) >= 3


def test_where_nothing_helps_the_picture_is_not_made_smaller_and_smaller():
    assert calibrate(lambda size: 0.3)[0] == [LOWEST]


def test_one_slow_frame_decides_nothing():
    times = iter([0.5, 0.5, 0.5, 0.001, 3.0, 0.001, 0.001] + [0.001] * 50)
    assert calibrate(lambda size: next(times))[0][-1] == BASE


def test_a_picture_with_one_size_only_needs_no_search():
    assert Calibration((1, 1)).done
    assert not Calibration((1, 1)).count(10.0)
