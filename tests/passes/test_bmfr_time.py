"""BMFR over time: which histories are kept, and how frames are blended."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from raytrace.frame import STILL, CameraStep, FramePacket
from tests.passes.bmfr_frames import F32, SIZE, radiance, run, tilted
from tests.passes.harness import DEPTH, HALF, PIXEL_SIZE, Bench, frame
from tests.passes.room import flight, room, triple

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


# ------------------------------------------------------------------------------------- where what moves is looked for


def in_place(packet: FramePacket, step: CameraStep = STILL) -> FramePacket:
    """``packet`` of a scene in which something moves, with what is known of its camera."""
    normal = np.concatenate([packet.surface[..., :3], np.zeros_like(packet.surface[..., :1])], -1)
    return replace(packet, prev_normal=normal, camera_step=step)


def test_what_moves_loses_its_history_where_it_is_looked_for_in_place(bench: Bench) -> None:
    before, now = in_place(frame(SIZE, depth=3.0)), in_place(frame(SIZE, depth=DEPTH, previous_depth=3.0))
    assert (lengths(bench, [before, now])[1] == 1.0).all()
    bench.restart()
    assert (lengths(bench, [before, now], follow_motion=False)[1] == 0.0).all()


def test_what_slides_in_its_own_plane_finds_what_was_there_before(bench: Bench) -> None:
    """Its own neighbour, half a pattern further: the place is right, the point is not."""
    stripes = np.broadcast_to(np.arange(SIZE[0]) // 4 % 2, SIZE[::-1])
    first = in_place(frame(SIZE, direct=stripes))
    then = in_place(frame(SIZE, direct=np.roll(stripes, -4, 1), shift=(4.0, 0.0)))
    settings = {"alpha": 0.2, "fit": False}
    followed = [radiance(bench, packet, i, **settings) for i, packet in enumerate((first, then))][1]
    np.testing.assert_allclose(followed[:, :-4], then.direct[:, :-4, :3], atol=4 * HALF)
    bench.restart()
    looked = [radiance(bench, packet, i, follow_motion=False, **settings) for i, packet in enumerate((first, then))][1]
    np.testing.assert_allclose(looked[:, :-4], 0.5, atol=4 * HALF)


def test_where_only_the_camera_moves_both_ways_find_the_same(bench: Bench) -> None:
    """A flight through a room: sideways, forwards, turning."""

    def packets() -> list[FramePacket]:
        made = []
        for index in range(5):
            now, then = flight(index), flight(max(index - 1, 0))
            turn = np.array(then.axes()) @ np.array(now.axes()).T
            shift = np.array(then.axes()) @ np.subtract(now.position, then.position)
            made.append(
                in_place(room(index, SIZE), ((triple(turn[0]), triple(turn[1]), triple(turn[2])), triple(shift)))
            )
        return made

    followed = lengths(bench, packets())
    bench.restart()
    looked = lengths(bench, packets(), follow_motion=False)
    for a, b in zip(followed, looked, strict=True):
        assert (a == b).mean() > 0.99
    assert followed[-1].mean() > 2.0


def test_without_knowing_the_camera_motion_is_followed(bench: Bench) -> None:
    """As in recorded frames, which have no camera."""
    before, now = (replace(in_place(frame(SIZE, depth=z, previous_depth=3.0)), camera_step=None) for z in (3.0, DEPTH))
    assert (lengths(bench, [before, now], follow_motion=False)[1] == 1.0).all()
