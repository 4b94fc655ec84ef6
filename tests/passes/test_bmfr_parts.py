"""BMFR's parts of blocks: invariants, and parts that are hard to fit. Against double precision: test_bmfr_oracle.py."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Bmfr, load
from gl.passes import bmfr
from tests.passes.bmfr_frames import F32, MODES, SIZE, polynomial, radiance, tilted, with_alpha
from tests.passes.harness import HALF, SIZES, Bench, frame, noise, with_sky

PARTS = (16, 8)


def wave(packet_size: tuple[int, int] = SIZE) -> NDArray[np.float64]:
    """(H, W) light that no square of a position follows over a block of 32 pixels, but does over one of 8."""
    x = np.arange(packet_size[0]) + np.zeros((packet_size[1], 1))
    return np.asarray(1.0 + 0.5 * np.sin(x / 5.0))


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("size", SIZES)
def test_a_constant_image_stays_constant(bench: Bench, size: tuple[int, int], mode: str, part: int) -> None:
    color = (0.75, 0.5, 0.25)
    for index in (0, 1, 7):
        result = radiance(bench, frame(size, direct=color), index, regularization=mode, part=part)
        np.testing.assert_allclose(result, np.broadcast_to(color, result.shape), rtol=HALF)


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize(("mode", "bound"), [("rank", 1e-4 + HALF), ("noise", 1e-2), ("both", 1e-2)])
def test_what_the_features_can_express_is_reproduced(bench: Bench, mode: str, bound: float, part: int) -> None:
    packet = tilted()
    colors = polynomial(packet, 4.0)
    result = radiance(bench, replace(packet, direct=with_alpha(colors)), regularization=mode, part=part)
    assert np.abs(result - colors).max() / colors.max() < bound


@pytest.mark.parametrize("mode", MODES)
def test_light_that_a_block_cannot_express_comes_back(bench: Bench, mode: str) -> None:
    packet = frame(SIZE, direct=wave())
    errors = []
    for part in (0, 16, 8):
        bench.restart()
        clean = radiance(bench, packet, regularization=mode, part=part)[..., 0]
        errors.append(float(np.sqrt(np.mean((clean - wave()) ** 2))))
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.05 * errors[0]


def deviation(bench: Bench, **changes: object) -> float:
    """Of fits of pure noise from its mean, over several grids."""
    total = 0.0
    for index in range(6):
        bench.restart()
        clean = radiance(bench, replace(tilted(), direct=with_alpha(noise(SIZE, index))), index, **changes)
        total += float(((clean - 1.0) ** 2).mean())
    return float(np.sqrt(total / 6))


@pytest.mark.parametrize("mode", MODES)
def test_doubt_takes_noise_out_of_the_parts(bench: Bench, mode: str) -> None:
    """What is left is nearly the block's own fit; without doubt it is the parts', with 16 times fewer samples each."""
    block = deviation(bench, part=0, regularization=mode)
    believed, doubted, refused = (
        deviation(bench, part=8, caution=caution, regularization=mode) for caution in (0.0, 2.0, 100.0)
    )
    assert believed > 2.0 * block
    assert doubted < 0.5 * (block + believed)
    assert refused == pytest.approx(block, rel=1e-3)


def test_full_doubt_is_the_block_s_fit(bench: Bench) -> None:
    packet = replace(tilted(), direct=with_alpha(noise(SIZE, 7)))
    whole = radiance(bench, packet, 1, part=0)
    bench.restart()
    np.testing.assert_allclose(radiance(bench, packet, 1, part=16, caution=100.0), whole, rtol=4 * HALF, atol=HALF)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [1.0, 6e4, 1e-6])
def test_the_share_knows_no_scale(bench: Bench, scale: float, mode: str) -> None:
    """Squares of colours are summed up, of bright and of dark ones."""
    colors = np.minimum(wave() * (0.5 + 0.25 * noise(SIZE, 5)[..., 0]), 1.0)
    expected = radiance(bench, frame(SIZE, direct=colors), 1, part=8, regularization=mode)
    bench.restart()
    clean = radiance(bench, frame(SIZE, direct=colors * scale), 1, part=8, regularization=mode)
    floor = 2.0**-24 / scale if scale < 1.0 else 0.0  # half precision has no smaller numbers
    np.testing.assert_allclose(clean / scale, expected, rtol=8 * HALF, atol=2 * floor + HALF / 8)


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("mode", MODES)
def test_parts_of_sky_take_no_part(bench: Bench, mode: str, part: int) -> None:
    """A whole part of it, parts with few samples, and a single one left."""
    sky = np.zeros((SIZE[1], SIZE[0]), bool)
    sky[:, 13:] = True
    sky[20, 30] = sky[40, 50] = False
    clean = radiance(bench, with_sky(frame(SIZE, direct=0.75), sky), regularization=mode, part=part)
    np.testing.assert_allclose(clean[~sky], 0.75, rtol=HALF)
    assert (clean[sky] == 0.0).all()


def test_a_part_of_few_samples_gets_the_block_s_fit(bench: Bench) -> None:
    """Noise on as many samples as there are features would be reproduced."""
    packet = replace(tilted(), direct=with_alpha(noise(SIZE, 7)))
    sky = np.zeros((SIZE[1], SIZE[0]), bool)
    sky[18:26, 20:28] = True  # in frame 1 a part begins there
    few = sky.copy()
    few[18:20, 20:28] = False
    fits = []
    for part in (0, 8):
        bench.restart()
        fits.append(radiance(bench, with_sky(packet, few), 1, part=part, caution=0.0))
    spot = sky & ~few
    begins = (np.array(bmfr.OFFSETS[1]) + 16) % 8  # of parts, in x and y
    assert tuple(begins) == (20 % 8, 18 % 8)
    np.testing.assert_allclose(fits[1][spot], fits[0][spot], rtol=2 * HALF)
    assert np.abs(fits[1] - fits[0])[~few].max() > 0.1


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("image", ["direct", "surface"])
@pytest.mark.parametrize("part", PARTS)
def test_a_spoilt_pixel_harms_no_other(bench: Bench, part: int, image: str, value: float) -> None:
    packet = frame(SIZE, direct=0.5)
    values = getattr(packet, image).copy()
    values[7, 5] = value
    result = radiance(bench, replace(packet, **{image: values}), 1, part=part)
    assert np.isfinite(result).all()
    result[7, 5] = 0.5
    np.testing.assert_allclose(result, 0.5, rtol=2 * HALF)


@pytest.mark.parametrize("mode", MODES)
def test_equal_features_do_no_harm(bench: Bench, mode: str) -> None:
    """On a plane across the view: normals and depths are constant, albedo is one number three times."""
    pattern = 0.2 + 0.6 * noise(SIZE, 9)[..., :1].clip(0.0, 1.0)
    packet = frame(SIZE, direct=np.broadcast_to(wave()[..., None], (*wave().shape, 3)), albedo=pattern)
    clean = radiance(bench, packet, 1, features="1,n,w,w2,albedo,depth", regularization=mode, part=8)
    expected = wave()[..., None] * packet.albedo[..., :3]
    assert np.abs(clean - expected).max() < 0.05


def threads_of(count: int, monkeypatch: pytest.MonkeyPatch, bench: Bench, **changes: object) -> F32:
    bench.restart()
    monkeypatch.setattr(bmfr, "SOFTWARE_THREADS", count)
    packet = replace(tilted(), direct=with_alpha(noise(SIZE, 7) * wave()[..., None]))
    return radiance(bench, packet, 1, **changes)


@pytest.mark.parametrize(("part", "threads"), [(16, 4), (16, 64), (8, 1), (8, 4), (8, 16), (8, 64)])
@pytest.mark.parametrize("mode", ["both", "rank"])
def test_the_number_of_threads_changes_nothing_but_roundings(
    bench: Bench, part: int, threads: int, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fewer than there are parts, as many, and several for each."""
    changes = {"part": part, "regularization": mode}
    expected = threads_of(8, monkeypatch, bench, **changes)
    found = threads_of(threads, monkeypatch, bench, **changes)
    np.testing.assert_allclose(found, expected, rtol=8 * HALF, atol=HALF)


@pytest.mark.parametrize("features", ["1", "1,n,w,w2", "1,n,w,w2,w3,albedo,depth"])
def test_parts_fit_into_shared_memory(features: str) -> None:
    count = bmfr.layout(features)["FEATURES"]
    for parts, software in product((0, 4, 16), (True, False)):
        threads = bmfr.thread_count(features, software, parts)
        assert bmfr.shared_bytes(count, threads, parts) <= bmfr.SHARED_MEMORY
        most = bmfr.SOFTWARE_THREADS if software else bmfr.HARDWARE_THREADS
        assert threads == most or bmfr.shared_bytes(count, 2 * threads, parts) > bmfr.SHARED_MEMORY


def test_shared_memory_holds_every_part() -> None:
    """Ten features: triangles of 85 numbers, what is left, its age, 4 to be merged and 16 to stay; bounds; weights."""
    assert bmfr.shared_bytes(10, 8, 16) == 4 * 87 * (4 + 16) + 2 * 16 * 8 + 16 * 10 * (1 + 16)


@pytest.mark.parametrize(
    ("block", "part", "side"),
    [(32, 16, 16), (32, 8, 8), (32, 5, 8), (32, 32, 16), (24, 16, 12), (24, 8, 6), (30, 1, 15), (9, 16, 0), (32, 0, 0)],
)
def test_parts_are_cut_as_the_block_allows(block: int, part: int, side: int) -> None:
    p = Bmfr(block=block, part=part)
    assert p.part_side == side
    assert bmfr.part_count(p) == ((block // side) ** 2 if side else 0)


def test_the_paper_has_no_parts() -> None:
    assert bmfr.part_count(load(None, ("bmfr.preset=paper",)).bmfr) == 0
    assert bmfr.part_count(load(None, ("bmfr.preset=reference",)).bmfr) == 0
    assert [bmfr.part_count(Bmfr(part=part)) for part in (0, 16, 8)] == [0, 4, 16]


def test_parts_are_judged_by_another_doubt_where_the_history_is_short(bench: Bench) -> None:
    """In the first frame it is short, in the fourth no longer; threads that share a part, or the parts, agree."""
    packets = [replace(tilted(), direct=with_alpha(noise(SIZE, i) * wave()[..., None])) for i in range(5)]

    def sequence(**changes: object) -> list[F32]:
        bench.restart()
        return [radiance(bench, packet, i, part=8, alpha_fit=1.0, **changes) for i, packet in enumerate(packets)]

    believed = sequence(caution=0.0)
    doubted = sequence(caution=100.0)
    fresh = sequence(caution=100.0, short_history=4, fresh_caution=0.0)
    for i in range(3):
        np.testing.assert_array_equal(fresh[i], believed[i])
    for i in (3, 4):
        np.testing.assert_array_equal(fresh[i], doubted[i])
    assert np.abs(believed[1] - doubted[1]).max() > 0.1


@pytest.mark.parametrize(("part", "threads"), [(16, 64), (8, 1), (8, 64)])
def test_the_age_of_a_part_does_not_depend_on_threads(
    bench: Bench, part: int, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    changes = {"part": part, "caution": 100.0, "short_history": 2, "fresh_caution": 0.0}
    expected = threads_of(8, monkeypatch, bench, **changes)
    found = threads_of(threads, monkeypatch, bench, **changes)
    np.testing.assert_allclose(found, expected, rtol=8 * HALF, atol=HALF)
