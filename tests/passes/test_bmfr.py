"""BMFR pass by pass: invariants, and the inputs on which an unguarded regression breaks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from config import Bmfr, Config, Taa
from errors import UserError
from gl.graph import Graph
from gl.passes import bmfr
from raytrace.frame import STANDARD_BASIS, FramePacket
from tests.passes.harness import DEPTH, HALF, PIXEL_SIZE, SIZES, Bench, Images, Poison, frame, noise, with_sky

F32 = NDArray[np.float32]

SIZE = (60, 44)
MODES = ("noise", "rank", "both")
BAD = {"nan": np.nan, "inf": np.inf, "-inf": -np.inf}
LENGTH = "bmfr.accumulate.out_reprojection"


def config(**changes: object) -> Config:
    return Config(bmfr=replace(Bmfr(), **changes), taa=Taa(enabled=False))  # type: ignore[arg-type]


def run(bench: Bench, packet: FramePacket, index: int = 0, keep: tuple[str, ...] = (), **changes: object) -> Images:
    return bench.denoise(replace(packet, index=index), config(**changes), "bmfr", keep=keep)


def radiance(bench: Bench, packet: FramePacket, index: int = 0, **changes: object) -> F32:
    return run(bench, packet, index, **changes)["radiance"][..., :3]


def tilted(size: tuple[int, int] = SIZE, pixel_size: float = PIXEL_SIZE, depth: float = DEPTH) -> FramePacket:
    """A bumpy, slanting surface, whose features are all different."""
    y, x = np.mgrid[: size[1], : size[0]] / 20.0
    relief = 1 + 0.1 * x - 0.05 * y + 0.05 * np.sin(3 * x) * np.cos(2 * y)
    normal = np.stack([np.sin(2 * x), np.cos(3 * y), 2 + 0.3 * np.sin(x * y)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return frame(size, normal=normal, depth=depth * relief, pixel_size=pixel_size)


def positions(packet: FramePacket) -> NDArray[np.float64]:
    """(H, W, 3) relative to the camera, which looks along -z."""
    width, height = packet.size
    y, x = np.mgrid[:height, :width] + 0.5
    ray = np.stack([(x - width / 2) * packet.pixel_size, (y - height / 2) * packet.pixel_size, -np.ones_like(x)], -1)
    return np.asarray(ray * packet.surface[..., 3:].astype(np.float64))


def polynomial(packet: FramePacket, reach: float = 1.0) -> NDArray[np.float64]:
    """(H, W, 3) colours above 0 that are combinations of "1,n,w,w2"; positions in ``reach``."""
    w = positions(packet) / reach
    w -= w.mean(axis=(0, 1))
    features = np.concatenate([np.ones_like(w[..., :1]), packet.surface[..., :3], w, w * w], -1)
    weights = np.random.default_rng(3).uniform(-1, 1, (10, 3))
    colors = features @ weights
    return np.asarray(colors - colors.min() + 0.1)


# ----------------------------------------------------------------------------------------------------------- the fit


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


def with_alpha(colors: ArrayLike) -> F32:
    values = np.asarray(colors, np.float32)
    return np.concatenate([values, np.ones_like(values[..., :1])], -1)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("extent", [1e-3, 1e3])
def test_a_million_units_away(bench: Bench, extent: float, mode: str) -> None:
    """A block of a thousand units is fitted as if it were near. One of a thousandth is flat to single precision, and gets
    the best constant."""
    packet = tilted((32, 32), pixel_size=extent / 32 / 1e6)
    relief = packet.surface[..., 3:] / DEPTH - 1.0
    surface = np.concatenate([np.broadcast_to((0.0, 0.0, 1.0), (32, 32, 3)), 1e6 + extent * relief], -1)
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
        np.testing.assert_array_equal(sky, np.broadcast_to(np.float32([0.1, 0.2, 0.3]), sky.shape))


@pytest.mark.parametrize("mode", MODES)
def test_sky_takes_no_part_in_the_fit(bench: Bench, mode: str) -> None:
    sky = np.zeros((SIZE[1], SIZE[0]), bool)
    sky[:, 13:] = True
    clean = radiance(bench, with_sky(frame(SIZE, direct=0.75), sky), regularization=mode)
    np.testing.assert_allclose(clean[:, :13], 0.75, rtol=HALF)
    assert (clean[:, 13:] == 0.0).all()


def test_the_picture_goes_on_as_its_mirror_image(bench: Bench) -> None:
    """Of the block in the corner, which begins 30 pixels outside on both axes, 2x2 pixels are in the picture, mirrored
    into four times as many; an outlier among them gets the mean of the four, not of itself."""
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


# ------------------------------------------------------------------------------------------------------ not finite


@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize("image", ["direct", "indirect"])
def test_a_spoilt_sample_is_gone_at_once_and_harms_nothing(bench: Bench, image: str, value: str) -> None:
    packet = frame(SIZE, direct=0.5, indirect=0.25)
    values = getattr(packet, image).copy()
    values[7, 5] = values[43, 59] = BAD[value]
    spoilt = {image: values}
    for index, bad in enumerate((False, True, False, True, True)):
        images = run(bench, replace(packet, **spoilt) if bad else packet, index)
        np.testing.assert_allclose(images["radiance"][..., :3], 0.75, rtol=2 * HALF)


@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize("image", ["surface", "motion"])
def test_a_spoilt_guide_harms_only_its_pixel(bench: Bench, image: str, value: str) -> None:
    packet = frame(SIZE, direct=0.5)
    values = getattr(packet, image).copy()
    values[7, 5] = BAD[value]
    spoilt = {image: values}
    for index, bad in enumerate((False, True, False, False)):
        result = run(bench, replace(packet, **spoilt) if bad else packet, index)["radiance"][..., :3]
        assert np.isfinite(result).all()
        result[7, 5] = 0.5
        np.testing.assert_allclose(result, 0.5, rtol=2 * HALF)


@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize("history", ["noisy", "fitted"])
def test_a_spoilt_history_is_gone_in_the_next_frame(bench: Bench, history: str, value: str) -> None:
    """What is put into a history once, in spite of all guards, does not come back."""
    poison = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
    poison[20:23, 30:35] = BAD[value]
    poison[20:23, 30:35, 3] = 1.0
    packet = frame(SIZE, direct=0.5)
    for index in range(3):
        extra = {"frame.poison": poison if index == 0 else np.zeros_like(poison)}
        images = bench.run(replace(packet, index=index), poisoned(history, packet, index), extra=extra)
        if index > 0:
            np.testing.assert_allclose(images["color"][..., :3], 0.5, rtol=2 * HALF)


def poisoned(spoilt: str, packet: FramePacket, index: int) -> Graph:
    """The filter with the history ``spoilt`` fed by what frame.poison makes of it; output ``color``."""
    g = Graph()
    p = Bmfr()
    view = bmfr.View(STANDARD_BASIS, (0.0, 0.0), packet.pixel_size, index, 8)
    feed = g.feed

    def feeding(history, source):  # type: ignore[no-untyped-def]
        if history.name == f"bmfr.{spoilt}":
            poison = Poison(formats={"out_color": history.fmt})
            source = g.add(poison, in_color=source, in_poison=g.import_("frame.poison", "rgba32f")).out_color
        feed(history, source)

    g.feed = feeding  # type: ignore[method-assign]
    images = [g.import_(f"frame.{name}", "rgba32f") for name in ("direct", "indirect", "albedo")]
    g.output("color", bmfr.bmfr(g, *images, bmfr.Guides(g, False), p, view))
    return g


@pytest.mark.parametrize("depth", [1e-30, 1e-12, 1e30, 3e38])
@pytest.mark.parametrize("mode", MODES)
def test_any_finite_input_gives_a_finite_picture(bench: Bench, mode: str, depth: float) -> None:
    random = np.random.default_rng(5)
    packet = tilted(pixel_size=0.5)
    surface = packet.surface.copy()
    surface[..., 3] = depth * random.uniform(0.5, 1.0, surface.shape[:2])
    surface[..., :3] *= random.choice([1e-30, 1.0, 1e30], surface.shape[:2])[..., None]
    colors = 10.0 ** random.uniform(-38, 38, (SIZE[1], SIZE[0], 3))
    for index in range(3):
        images = run(bench, replace(packet, surface=surface, direct=with_alpha(colors)), index, regularization=mode)
        assert np.isfinite(images["radiance"]).all()


# ------------------------------------------------------------------------------------------------------ in time


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


def test_a_slanting_surface_keeps_its_history_while_it_slides(bench: Bench) -> None:
    """Neighbouring texels are far apart there, in depth as well."""
    width, height = SIZE
    slope = 3.0
    across = (np.arange(width) + 0.5 - width / 2) * PIXEL_SIZE
    depth = np.broadcast_to(DEPTH / (1 - slope * across / 4), (height, width))
    normal = np.array([slope / 4, 0.0, 1.0]) / np.hypot(slope / 4, 1.0)
    shift = 0.5
    there = DEPTH / (1 - slope * (across + shift * PIXEL_SIZE) / 4)
    packet = frame(SIZE, depth=depth, normal=normal, shift=(shift, 0.0), previous_depth=np.broadcast_to(there, depth.shape))
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


# ------------------------------------------------------------------------------------------------- without OpenGL


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
        ("1,n,roughness", "frames have no roughness yet"),
        ("1,n,n", "'n' is there twice"),
        ("1,albdeo", "unknown name 'albdeo', did you mean 'albedo'"),
        ("", "unknown name ''"),
    ],
)
def test_lists_of_features_that_make_no_sense_are_refused(features: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        Bmfr(features=features)
