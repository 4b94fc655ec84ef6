"""Temporal anti-aliasing against its own formulas in double precision: Karis 2014."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from config import Config, Taa
from raytrace.frame import FramePacket
from raytrace.shot import jitter_of
from tests.passes.harness import HALF, SIZES, Bench, Size, anti_aliasing, frame, with_sky

F64 = NDArray[np.float64]

SIZE = (18, 12)
REC_709 = (0.2126, 0.7152, 0.0722)
YCOCG = np.array([[0.25, 0.5, 0.25], [0.5, 0.0, -0.5], [-0.25, 0.5, -0.25]])


def show(
    bench: Bench, color: ArrayLike, packet: FramePacket | None = None, p: Taa | None = None, reset: str = ""
) -> NDArray[np.float32]:
    """(H, W, 3) result for one frame of (H, W, 3) or grey ``color``."""
    packet = packet or frame(SIZE)
    width, height = packet.size
    values = np.asarray(color, np.float32)
    if values.shape in ((), (height, width)):
        values = values[..., None]
    values = np.concatenate([np.broadcast_to(values, (height, width, 3)), np.ones((height, width, 1))], 2)
    extra = {"frame.color": values.astype(np.float32)}
    return bench.run(packet, anti_aliasing(p), extra=extra, reset=reset)["color"][..., :3]


def random_picture(size: Size, seed: int) -> NDArray[np.float32]:
    """(H, W, 3) colours in [0, 1) that half precision holds exactly, as tone-mapped colour comes to this pass."""
    values = np.random.default_rng(seed).random((size[1], size[0], 3)).astype(np.float16)
    return values.astype(np.float32)


# ------------------------------------------------------------------------------------------------------------- oracle


def catmull_rom(history: F64, at: F64) -> F64:
    """``history`` (H, W, 3) at the points (H, W, 2), texel units; Keys 1981 with a = -1/2, edge texels repeated."""
    height, width, _ = history.shape

    def spline(t: F64) -> F64:
        t = np.abs(t)
        near = 1 - 2.5 * t**2 + 1.5 * t**3
        far = 2 - 4 * t + 2.5 * t**2 - 0.5 * t**3
        return np.where(t < 1, near, np.where(t < 2, far, 0.0))

    base = np.floor(at).astype(int)
    total = np.zeros_like(history)
    for dy in range(-1, 3):
        for dx in range(-1, 3):
            x, y = base[..., 0] + dx, base[..., 1] + dy
            weight = spline(at[..., 0] - x) * spline(at[..., 1] - y)
            total += weight[..., None] * history[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)]
    return total


def resolve(color: F64, history: F64, at: F64, p: Taa) -> F64:
    """What the pass does where the history is on the screen."""
    padded = np.pad(color, ((1, 1), (1, 1), (0, 0)), mode="edge") @ YCOCG.T
    around = np.stack([padded[y : y + color.shape[0], x : x + color.shape[1]] for y in range(3) for x in range(3)])
    low, high, mean = around.min(0), around.max(0), around.mean(0)
    fetched = np.maximum(catmull_rom(history, at), 0.0)
    if p.clip:
        way = fetched @ YCOCG.T - mean
        room = np.where(way > 0, high - mean, mean - low)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.nan_to_num(room / np.abs(way), nan=1.0, posinf=1.0)
        inside = mean + way * np.minimum(t.min(-1, keepdims=True), 1.0)
        fetched = np.maximum(inside @ np.linalg.inv(YCOCG).T, 0.0)
    new = p.alpha / (1 + color @ REC_709)[..., None]
    old = (1 - p.alpha) / (1 + fetched @ REC_709)[..., None]
    return np.asarray((new * color + old * fetched) / (new + old))


@pytest.mark.parametrize("clip", [True, False])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.3, -0.45), (-2.5, 1.25)])
@pytest.mark.parametrize("size", [SIZE, (31, 33)])
def test_against_double_precision(bench: Bench, size: Size, shift: tuple[float, float], clip: bool) -> None:
    p = Taa(clip=clip, alpha=0.25)
    width, height = size
    y, x = np.mgrid[:height, :width].astype(np.float64)
    at = np.stack([x + shift[0], y + shift[1]], -1)
    inside = np.all((at >= -0.5) & (at < np.array(size) - 0.5), axis=-1, keepdims=True)
    expected = random_picture(size, 0).astype(np.float64)
    for index in range(4):
        color = random_picture(size, index)
        result = show(bench, color, frame(size, shift=shift), p)
        if index:
            expected = np.where(inside, resolve(color.astype(np.float64), expected, at, p), color)
        np.testing.assert_allclose(result, expected, rtol=0, atol=2 * HALF)
        expected = result.astype(np.float64)


# -------------------------------------------------------------------------------------------------------- properties


@pytest.mark.parametrize("size", SIZES)
def test_the_first_frame_is_the_input(bench: Bench, size: Size) -> None:
    color = random_picture(size, 1)
    np.testing.assert_array_equal(show(bench, color, frame(size, shift=(0.5, 0.5))), color)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("clip", [True, False])
def test_a_constant_stays_constant(bench: Bench, size: Size, clip: bool) -> None:
    color = np.broadcast_to(np.array([0.1, 0.5, 0.9]), (size[1], size[0], 3))
    for _ in range(12):
        result = show(bench, color, frame(size, shift=(0.37, 0.61)), Taa(clip=clip))
    np.testing.assert_allclose(result, color, rtol=2 * HALF)


def test_motion_by_whole_pixels_moves_the_picture_exactly(bench: Bench) -> None:
    p = Taa(clip=False, alpha=0.01)
    picture = random_picture(SIZE, 3)
    show(bench, picture, p=p)
    moved = show(bench, np.roll(picture, (-1, -3), (0, 1)), frame(SIZE, shift=(3, 1)), p)
    np.testing.assert_allclose(moved[:-1, :-3], picture[1:, 3:], atol=HALF)


def test_a_reset_shows_the_input(bench: Bench) -> None:
    show(bench, 1.0)
    np.testing.assert_array_equal(show(bench, 0.25, reset="cut"), 0.25)


def test_what_was_outside_of_the_screen_is_taken_from_the_input(bench: Bench) -> None:
    p = Taa(clip=False)
    show(bench, 1.0, p=p)
    result = show(bench, 0.0, frame(SIZE, shift=(5.0, 0.0)), p)
    np.testing.assert_array_equal(result[:, -5:], 0.0)
    assert (result[:, :-5] > 0.5).all()


def test_a_ghost_is_gone_in_one_frame(bench: Bench) -> None:
    """Something bright has left: the clip leaves nothing that this frame's neighbourhood does not have."""
    ghost = np.zeros((12, 18))
    ghost[4:8, 6:12] = 1.0
    show(bench, ghost)
    np.testing.assert_allclose(show(bench, 0.0), 0.0, atol=1e-6)
    bench.restart()
    show(bench, ghost, p=Taa(clip=False))
    assert show(bench, 0.0, p=Taa(clip=False))[5, 8, 0] > 0.5  # what it is there for


def test_the_rim_of_a_moving_object_moves_with_it(bench: Bench) -> None:
    """The background beside something nearer takes over its motion; further away it keeps its own."""
    p = Taa(clip=False, alpha=0.01)
    show(bench, random_picture(SIZE, 5), p=p)
    before = show(bench, random_picture(SIZE, 5), p=p)
    near = np.zeros((12, 18), bool)
    near[4:8, 6:12] = True
    shift = np.where(near[..., None], (-4.0, 0.0), (0.0, 0.0))
    after = show(bench, before, frame(SIZE, shift=shift, depth=np.where(near, 2.0, 4.0)), p)
    ring = np.zeros_like(near)
    ring[3:9, 5:13] = True
    moved = np.roll(before, 4, axis=1)
    np.testing.assert_allclose(after[ring], moved[ring], atol=0.03)
    np.testing.assert_allclose(after[~ring], before[~ring], atol=2 * HALF)


def test_the_sky_is_behind_everything(bench: Bench) -> None:
    """Its depth is 0, which must not make it the nearest: what borders on it keeps its own motion."""
    p = Taa(clip=False, alpha=0.01)
    sky = np.broadcast_to(np.arange(18) >= 9, (12, 18))
    before = show(bench, random_picture(SIZE, 6), p=p)
    shift = np.where(sky[..., None], (-4.0, 0.0), (0.0, 0.0))
    after = show(bench, before, with_sky(frame(SIZE, shift=shift), sky), p)
    np.testing.assert_allclose(after[~sky], before[~sky], atol=2 * HALF)


def test_jittered_frames_of_an_edge_become_its_coverage(bench: Bench) -> None:
    """A vertical edge through column 9, seen through jittered pixel centres: 8 of 16 lie beyond it."""
    columns = np.arange(18)
    shown = []
    for index in range(64):
        covered = columns + 0.5 + jitter_of(index)[0] > 9.49
        shown.append(show(bench, np.broadcast_to(covered.astype(float), (12, 18)))[5, :, 0])
    mean = np.mean(shown[-16:], axis=0)
    assert set(np.unique(mean[:9])) == {0.0}
    assert set(np.unique(mean[10:])) == {1.0}
    # Weighted by 1 / (1 + l), as the pass does against flicker: half white, half black is 1/3.
    assert mean[9] == pytest.approx(1 / 3, abs=0.05)
    assert np.std(shown[-16:], axis=0)[9] < 0.12  # alone, without history, it is 0.5


def test_it_is_part_of_the_filters_and_not_of_the_noisy_frame(bench: Bench) -> None:
    packets = [frame(SIZE, emission=value) for value in (0.8, 0.1)]
    for denoiser, blended in (("none", False), ("accumulate", True), ("svgf", True)):
        grown = {}
        for enabled in (True, False):
            bench.restart()
            config = Config(taa=Taa(enabled=enabled, clip=False, alpha=0.05))
            for packet in packets:
                images = bench.denoise(packet, config, denoiser)
            grown[enabled] = float(images["display"][5, 5, 0])
            np.testing.assert_allclose(images["radiance"][..., :3], 0.1, rtol=1e-6)  # which is before it
        assert (grown[True] > grown[False] + 0.2) == blended
