"""BMFR's regression: invariants, and blocks that are hard to fit. Its solver: test_bmfr_solver.py."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config import Bmfr
from errors import UserError
from gl.passes import bmfr
from tests.passes.bmfr_frames import MODES, SIZE, polynomial, radiance, tilted, with_alpha
from tests.passes.harness import DEPTH, HALF, SIZES, Bench, frame, noise, with_sky


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("size", SIZES)
def test_a_constant_image_stays_constant(bench: Bench, size: tuple[int, int], mode: str) -> None:
    """On every grid, and so on every pixel of every block. The noise weakens the fit of nothing but the features."""
    color = (0.75, 0.5, 0.25)
    for index in range(18):
        result = radiance(bench, frame(size, direct=color), index, regularization=mode)
        np.testing.assert_allclose(result, np.broadcast_to(color, result.shape), rtol=HALF)


@pytest.mark.parametrize(("pixel_size", "depth"), [(0.02, 4.0), (0.02, 1e-5), (0.02, 1e6), (1e-4, 1e3)])
@pytest.mark.parametrize(("mode", "bound"), [("rank", 1e-4 + HALF), ("noise", 1e-2), ("both", 1e-2)])
def test_what_the_features_can_express_is_reproduced(
    bench: Bench, pixel_size: float, depth: float, mode: str, bound: float
) -> None:
    """Near and far, large and small: the fit knows no scale. With noise it shrinks a little."""
    packet = tilted(pixel_size=pixel_size, depth=depth)
    colors = polynomial(packet, depth)
    error = np.abs(radiance(bench, replace(packet, direct=with_alpha(colors)), regularization=mode) - colors)
    assert error.max() / colors.max() < bound


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("extent", [1e-3, 1e3])
def test_a_million_units_away(bench: Bench, extent: float, mode: str) -> None:
    """A block of a thousand units is fitted as if it were near. One of a thousandth is flat to single precision, and
    gets the best constant."""
    packet = tilted((32, 32), pixel_size=extent / 32 / 1e6)
    relief = packet.surface[..., 3:] / DEPTH - 1.0
    facing = np.zeros((32, 32, 3))
    facing[..., 2] = 1.0
    surface = np.concatenate([facing, 1e6 + extent * relief], -1)
    packet = replace(packet, surface=surface.astype(np.float32), direct=with_alpha(noise((32, 32), 3)))
    clean = radiance(bench, packet, 5, regularization=mode, features="1,w", noise=1e-4)
    assert np.isfinite(clean).all()
    if extent < 1.0 and mode != "noise":
        grid = np.array(bmfr.OFFSETS[5]) + 16
        block = clean[max(grid[1], 0) :, max(grid[0], 0) :]
        assert np.ptp(block) <= HALF * block.max()
    else:
        assert np.ptp(clean) > 0.05


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [1.0, 6e4, 1e-6])
def test_noise_becomes_its_mean(bench: Bench, scale: float, mode: str) -> None:
    """On a wall that faces the camera, where all but two positions and their squares are constant."""
    noisy = np.minimum(noise(SIZE, 1), 1.0)
    clean = radiance(bench, frame(SIZE, direct=noisy * scale), 3, regularization=mode)
    deviation = np.sqrt(np.mean((clean / scale - noisy.mean()) ** 2))
    assert deviation < 0.25 * noisy.std()
    assert clean.mean() / scale == pytest.approx(noisy.mean(), rel=0.01)


def test_the_fit_is_never_negative(bench: Bench) -> None:
    """A bright corner in the dark: the parabola through it goes below 0."""
    colors = np.zeros((SIZE[1], SIZE[0]))
    colors[:6, :6] = 50.0
    clean = radiance(bench, frame(SIZE, direct=colors))
    assert clean.min() == 0.0
    assert clean.max() > 1.0


@pytest.mark.parametrize("mode", MODES)
def test_only_sky_gives_sky(bench: Bench, mode: str) -> None:
    packet = with_sky(frame(SIZE, emission=(0.1, 0.2, 0.3)), np.ones((SIZE[1], SIZE[0]), bool))
    for index in range(3):
        sky = radiance(bench, packet, index, regularization=mode)
        np.testing.assert_array_equal(sky, np.broadcast_to(np.array([0.1, 0.2, 0.3], np.float32), sky.shape))


@pytest.mark.parametrize("mode", MODES)
def test_sky_takes_no_part_in_the_fit(bench: Bench, mode: str) -> None:
    sky = np.zeros((SIZE[1], SIZE[0]), bool)
    sky[:, 13:] = True
    clean = radiance(bench, with_sky(frame(SIZE, direct=0.75), sky), regularization=mode)
    np.testing.assert_allclose(clean[:, :13], 0.75, rtol=HALF)
    assert (clean[:, 13:] == 0.0).all()


def test_the_picture_goes_on_as_its_mirror_image(bench: Bench) -> None:
    """The block in the corner begins 30 pixels outside on both axes: all but 2x2 of its pixels are mirror images."""
    colors = np.ones((SIZE[1], SIZE[0]))
    colors[0, 0] = 9.0
    clean = radiance(bench, frame(SIZE, direct=colors), 0, features="1")
    mirrored = np.pad(colors, 30, mode="symmetric")[:32, :32]
    np.testing.assert_allclose(clean[:2, :2], mirrored.mean(), rtol=HALF)


def test_sixteen_grids_take_turns(bench: Bench) -> None:
    packet = frame(SIZE, direct=noise(SIZE, 7))
    fits = []
    for index in (0, 1, 15, 16):
        bench.restart()
        fits.append(radiance(bench, packet, index, regularization="rank"))
    first, second, last, again = fits
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - second).max() > 0.05
    assert np.abs(first - last).max() > 0.05


def test_the_noise_changes_from_frame_to_frame(bench: Bench) -> None:
    packet = tilted()
    packet = replace(packet, direct=with_alpha(noise(SIZE, 7)))
    fits = []
    for index in (0, 16):  # the same grid
        bench.restart()
        fits.append(radiance(bench, packet, index, regularization="noise", noise=0.1))
    assert np.abs(fits[0] - fits[1]).max() > 0.01


def test_albedo_is_a_feature_if_it_is_listed(bench: Bench) -> None:
    """Light that follows a pattern of the albedo; nothing else can express it."""
    pattern = 0.2 + 0.6 * (np.add.outer(np.arange(SIZE[1]), np.arange(SIZE[0])) % 2)
    packet = frame(SIZE, direct=pattern, albedo=pattern)
    found = radiance(bench, packet, features="1,albedo", regularization="rank")
    np.testing.assert_allclose(found, packet.albedo[..., :3] ** 2, rtol=2 * HALF)
    bench.restart()
    assert np.abs(radiance(bench, packet) - found).max() > 0.1


def test_a_row_has_a_place_for_every_feature() -> None:
    places = bmfr.layout("1,w2,depth,n")
    assert places == {"FEATURES": 8, "W2_AT": 1, "DEPTH_AT": 4, "N_AT": 5, "W_AT": -1, "W3_AT": -1, "ALBEDO_AT": -1}


def test_as_many_threads_as_there_is_shared_memory_for() -> None:
    assert bmfr.thread_count("1,n,w,w2", software=True) == bmfr.SOFTWARE_THREADS
    for features in ("1", "1,n,w,w2", "1,n,w,w2,w3,albedo,depth"):
        threads = bmfr.thread_count(features, software=False)
        count = bmfr.layout(features)["FEATURES"]
        assert bmfr.shared_bytes(count, threads) <= bmfr.SHARED_MEMORY
        assert threads == bmfr.HARDWARE_THREADS or bmfr.shared_bytes(count, 2 * threads) > bmfr.SHARED_MEMORY
    assert bmfr.thread_count("1,n,w,w2", software=False) >= 32


@pytest.mark.parametrize("threads", [2, 64])
def test_the_number_of_threads_changes_nothing_but_roundings(
    bench: Bench, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    packet = replace(tilted(), direct=with_alpha(noise(SIZE, 7)))
    expected = radiance(bench, packet)
    bench.restart()
    monkeypatch.setattr(bmfr, "SOFTWARE_THREADS", threads)
    np.testing.assert_allclose(radiance(bench, packet), expected, rtol=4 * HALF)


@pytest.mark.parametrize(
    ("features", "message"),
    [
        ("n,w", 'must begin with the constant, "1"'),
        ("1,n,n", "'n' is there twice"),
        ("1,albdeo", "unknown name 'albdeo', did you mean 'albedo'"),
        ("", "unknown name ''"),
    ],
)
def test_lists_of_features_that_make_no_sense_are_refused(features: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        Bmfr(features=features)
