"""BMFR over time: which histories are kept, and how frames are blended."""

from __future__ import annotations

import numpy as np
import pytest

from raytrace.frame import FramePacket
from tests.passes.bmfr_frames import F32, SIZE, radiance, run, tilted
from tests.passes.harness import DEPTH, HALF, PIXEL_SIZE, Bench, frame

LENGTH = "bmfr.accumulate.out_reprojection"


def lengths(bench: Bench, packets: list[FramePacket], **changes: object) -> list[F32]:
    keep = (LENGTH,)
    return [run(bench, packet, i, keep, **changes)[LENGTH][..., 3] for i, packet in enumerate(packets)]


def test_a_still_wall_keeps_its_history(bench: Bench) -> None:
    for index, length in enumerate(lengths(bench, [tilted()] * 14, max_history=10)):
        assert (length == min(index, 9)).all()


@pytest.mark.parametrize("previous", [3.0, 5.0])
def test_what_moves_along_the_line_of_sight_keeps_its_history(bench: Bench, previous: float) -> None:
    """Its point was there before, though nothing was where it is now."""
    before = frame(SIZE, depth=previous)
    now = frame(SIZE, depth=DEPTH, previous_depth=previous)
    assert (lengths(bench, [before, now])[1] == 1.0).all()


def test_what_turns_keeps_its_history(bench: Bench) -> None:
    normal = (0.6, 0.0, 0.8)
    before = frame(SIZE, previous_normal=(0.0, 0.0, 1.0))
    now = frame(SIZE, normal=normal, previous_normal=(0.0, 0.0, 1.0))
    assert (lengths(bench, [before, now])[1] == 1.0).all()
    bench.restart()
    sudden = frame(SIZE, normal=normal, previous_normal=normal)
    assert (lengths(bench, [before, sudden])[1] == 0.0).all()


@pytest.mark.parametrize(("factor", "kept"), [(0.9, True), (1.1, False)])
def test_the_limit_is_in_widths_of_a_pixel(bench: Bench, factor: float, kept: bool) -> None:
    away = factor * 4.0 * PIXEL_SIZE * DEPTH
    before, now = frame(SIZE, depth=DEPTH + away), frame(SIZE)
    # In the middle of the picture rays and normals are parallel, and a wider footprint does not stretch the limit.
    assert (lengths(bench, [before, now], position_tolerance=4.0)[1][22, 30] == 1.0) == kept


@pytest.mark.parametrize("previous", [np.inf, 0.0, -1.0])
def test_what_was_nowhere_has_no_history(bench: Bench, previous: float) -> None:
    """At infinity, where every distance is infinite and every limit is, too; or behind the camera."""
    now = frame(SIZE, previous_depth=previous)
    assert (lengths(bench, [now, now])[1] == 0.0).all()


def test_a_slanting_surface_keeps_its_history_while_it_slides(bench: Bench) -> None:
    """Neighbouring texels are far apart there, in depth as well."""
    width, height = SIZE
    slope = 3.0
    across = (np.arange(width) + 0.5 - width / 2) * PIXEL_SIZE
    depth = np.broadcast_to(DEPTH / (1 - slope * across / 4), (height, width))
    normal = np.array([slope / 4, 0.0, 1.0]) / np.hypot(slope / 4, 1.0)
    shift = 0.5
    there = np.broadcast_to(DEPTH / (1 - slope * (across + shift * PIXEL_SIZE) / 4), (height, width))
    packet = frame(SIZE, depth=depth, normal=normal, shift=(shift, 0.0), previous_depth=there)
    assert (lengths(bench, [packet, packet])[1][:, :-1] == 1.0).all()


@pytest.mark.parametrize(("alpha", "name"), [(0.2, "alpha"), (0.1, "alpha_fit")])
def test_the_mean_is_a_plain_one_until_alpha(bench: Bench, alpha: float, name: str) -> None:
    """Frames of constant light, each of another brightness: the fits are exact, only the blending counts."""
    values = np.random.default_rng(2).uniform(0.5, 1.5, 16)
    changes = {"alpha": 1.0, "alpha_fit": 1.0, name: alpha}
    mean = 0.0
    for index, value in enumerate(values):
        mean += (value - mean) * max(1 / (index + 1), alpha)
        clean = radiance(bench, frame(SIZE, direct=value), index, **changes)
        np.testing.assert_allclose(clean, mean, rtol=4 * HALF)


def test_lengths_between_two_numbers_are_rounded_in_the_paper_only(bench: Bench) -> None:
    """Half of the texels have seen two frames, the other half one; a shift by 0.3 pixels lies between."""
    width, height = SIZE
    gone = np.arange(width) % 2 == 0
    other = np.where(gone, 2 * DEPTH, DEPTH) + np.zeros((height, 1))
    start, middle = frame(SIZE, depth=other), frame(SIZE)
    last = frame(SIZE, shift=(0.3, 0.0))
    rounded = lengths(bench, [start, middle, last], position_tolerance=10.0)[2]
    assert set(np.unique(rounded)) == {1.0, 2.0}
    bench.restart()
    exact = lengths(bench, [start, middle, last], position_tolerance=10.0, round_history=False)[2]
    np.testing.assert_allclose(exact[:, 2:-2:2], 1.3, atol=1e-3)
