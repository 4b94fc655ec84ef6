"""Reprojection and accumulation: Schied et al. 2017, sec. 4.1, with what gl/passes/temporal.py says it adds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Config, Svgf
from gl.graph import Graph
from raytrace.frame import FramePacket
from tests.passes.harness import HALF, PIXEL_SIZE, SIZES, Bench, Images, Size, accumulation, frame, noise

SIZE = (18, 12)
STILL = frame(SIZE)
RUNNING_MEAN = Svgf(alpha=0.0, alpha_moments=0.0)


def run(bench: Bench, *packets: FramePacket, graph: Graph | None = None) -> Images:
    """The last of ``packets``, all run in turn."""
    graph = graph or accumulation(RUNNING_MEAN)
    for packet in packets:
        images = bench.run(packet, graph)
    return images


def lengths(images: Images) -> NDArray[np.float32]:
    """(H, W) N: frames in the history that was fetched."""
    return images["reprojection"][..., 3]


def ramp(size: Size = SIZE) -> NDArray[np.float64]:
    """(H, W, 3) that is different in each pixel, and linear in x and in y."""
    y, x = np.mgrid[: size[1], : size[0]]
    return np.stack([1.0 + x, 1.0 + y, 1.0 + x + 2 * y], -1)


# -------------------------------------------------------------------------------------------------------- accumulation


@pytest.mark.parametrize("size", SIZES)
def test_the_first_frame_is_the_input(bench: Bench, size: Size) -> None:
    sample = noise(size, 1)
    images = run(bench, frame(size, direct=sample))
    np.testing.assert_array_equal(images["color"][..., :3], sample)
    luminance = sample.astype(np.float64) @ (0.2126, 0.7152, 0.0722)
    np.testing.assert_allclose(images["moments"], np.stack([luminance, luminance**2], -1), rtol=1e-6)
    assert (images["color"][..., 3] <= 1e-3 * luminance).all()  # the variance of one sample
    assert not lengths(images).any()
    assert (images["reprojection"][..., 2] == -1).all()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("fmt", ["rgba16f", "rgba32f"])
def test_a_constant_stays_constant(bench: Bench, size: Size, fmt: str) -> None:
    value = np.array([0.3, 1.7, 12.9])
    packet = frame(size, direct=value, shift=(0.3, -0.4))
    graph = accumulation(Svgf(), fmt=fmt)
    color = run(bench, *[packet] * 8, graph=graph)["color"][..., :3]
    tolerance = HALF if fmt == "rgba16f" else 1e-6
    np.testing.assert_allclose(color, np.broadcast_to(value, color.shape), rtol=tolerance)


@pytest.mark.parametrize(("fmt", "tolerance"), [("rgba32f", 1e-5), ("rgba16f", 10 * HALF)])
def test_a_still_camera_converges_to_the_mean(bench: Bench, fmt: str, tolerance: float) -> None:
    """In half precision the errors of 40 roundings add up, each weighted by what is left of it: sqrt(40 / 3) of one,
    and the largest of 192 pixels is some four times that."""
    samples = [noise(SIZE, seed) for seed in range(40)]
    images = run(bench, *(replace(STILL, direct=frame(SIZE, direct=s).direct) for s in samples),
                 graph=accumulation(RUNNING_MEAN, fmt=fmt))  # fmt: skip
    assert (lengths(images) == 39).all()
    mean = np.mean(samples, axis=0, dtype=np.float64)
    np.testing.assert_allclose(images["color"][..., :3], mean, rtol=tolerance)
    luminance = np.asarray(samples, np.float64) @ (0.2126, 0.7152, 0.0722)
    moments = images["moments"]
    np.testing.assert_allclose(moments, np.stack([luminance.mean(0), (luminance**2).mean(0)], -1), rtol=1e-5)
    np.testing.assert_allclose(images["color"][..., 3], luminance.std(0), rtol=max(1e-4, tolerance))


def test_the_weights_are_a_running_mean_first_and_then_exponential(bench: Bench) -> None:
    samples = [noise(SIZE, seed) for seed in range(9)]
    images = run(bench, *(frame(SIZE, direct=s) for s in samples), graph=accumulation(Svgf(alpha=0.2)))
    expected = samples[0].astype(np.float64)
    for count, sample in enumerate(samples[1:], 1):
        weight = max(1 / (count + 1), 0.2)
        expected = (1 - weight) * expected + weight * sample
    np.testing.assert_allclose(images["color"][..., :3], expected, rtol=1e-5)


@pytest.mark.slow
def test_what_an_exponential_mean_leaves_of_the_variance(bench: Bench) -> None:
    """At a = 0.2: of the colour's variance a / (2 - a) = 1/9, and the moments see the other 8/9 of it."""
    size = (256, 128)
    last = run(bench, *(frame(size, direct=noise(size, s)) for s in range(28)), graph=accumulation(Svgf(alpha=0.2)))
    color = last["color"][..., 0].astype(np.float64)
    # 32768 independent pixels: the mean is good to 0.2 %, the variance of these skewed values to 2 %.
    assert color.mean() == pytest.approx(1.0, abs=0.01)
    assert color.var() == pytest.approx(1 / 9, rel=0.06)
    assert (last["color"][..., 3].astype(np.float64) ** 2).mean() == pytest.approx(8 / 9, rel=0.06)


def test_the_history_is_counted_and_capped(bench: Bench) -> None:
    graph = accumulation(Svgf(max_history=10, alpha=0.0))
    for expected in (*range(10), 9, 9):
        assert (lengths(run(bench, STILL, graph=graph)) == expected).all()
    # So the share of a new sample never falls below 1 / max_history.
    before = run(bench, frame(SIZE, direct=0.0), graph=graph)["color"][..., 0]
    after = run(bench, frame(SIZE, direct=10.0), graph=graph)["color"][..., 0]
    np.testing.assert_allclose(after, before + 1.0)


def test_the_moments_have_a_weight_of_their_own(bench: Bench) -> None:
    graph = accumulation(Svgf(alpha=1.0, alpha_moments=0.0))
    images = run(bench, *(frame(SIZE, direct=v) for v in (1.0, 2.0, 6.0)), graph=graph)
    np.testing.assert_allclose(images["color"][..., :3], 6.0)
    np.testing.assert_allclose(images["moments"][..., 0], 3.0, rtol=1e-6)
    np.testing.assert_allclose(images["moments"][..., 1], 41 / 3, rtol=1e-6)


# -------------------------------------------------------------------------------------------------------- reprojection


@pytest.mark.parametrize("shift", [(3, 0), (-2, 0), (0, 4), (0, -1), (2, -3)])
@pytest.mark.parametrize("size", [(18, 12), (31, 33), (641, 3)])
def test_motion_by_whole_pixels_moves_the_history_exactly(bench: Bench, size: Size, shift: tuple[int, int]) -> None:
    # alpha = 0 and a second frame of zeros: the result is half of what was fetched.
    sample = noise(size, 2)
    images = run(bench, frame(size, direct=sample), frame(size, shift=shift))
    width, height = size
    y, x = np.mgrid[:height, :width]
    there_x, there_y = x + shift[0], y + shift[1]
    inside = (there_x >= 0) & (there_x < width) & (there_y >= 0) & (there_y < height)
    expected = np.where(inside[..., None], sample[there_y % height, there_x % width] / 2, 0.0)
    far = (there_x < -1) | (there_x > width) | (there_y < -1) | (there_y > height)
    color = images["color"][..., :3]
    np.testing.assert_allclose(color[inside], expected[inside], rtol=1e-6)
    np.testing.assert_array_equal(color[far], 0.0)
    assert (lengths(images)[inside] == 1).all()
    assert (lengths(images)[far] == 0).all()


@pytest.mark.parametrize("shift", [(0.5, 0.5), (0.25, -0.125), (-1.75, 0.5)])
def test_between_pixels_the_history_is_interpolated(bench: Bench, shift: tuple[float, float]) -> None:
    images = run(bench, frame(SIZE, direct=ramp()), frame(SIZE, shift=shift))
    inner = (slice(3, -3), slice(3, -3))
    expected = ramp() + np.array([shift[0], shift[1], shift[0] + 2 * shift[1]])
    np.testing.assert_allclose(images["color"][inner][..., :3], expected[inner] / 2, rtol=1e-5)


def test_dropped_taps_leave_the_others_their_proportions(bench: Bench) -> None:
    """At (5.25, 4.25) between four texels of which (6, 4) belongs to another object: 9, 3 and 1 parts of the others."""
    ids = np.zeros(SIZE[::-1])
    ids[4, 6] = 1.0
    images = run(bench, frame(SIZE, direct=ramp(), object_id=ids), frame(SIZE, shift=(0.25, 0.25)))
    taps = {(5, 4): 0.5625, (5, 5): 0.1875, (6, 5): 0.0625}
    expected = sum(w * ramp()[y, x] for (x, y), w in taps.items()) / sum(taps.values())
    np.testing.assert_allclose(images["color"][4, 5, :3], expected / 2, rtol=1e-6)
    assert images["reprojection"][4, 5, 2] == 1 + 4 + 8


def test_without_any_of_the_four_the_mean_of_those_around_counts(bench: Bench) -> None:
    """The point lands at (5.25, 4.25), whose four texels are another object's; around texel (5, 4) five are left."""
    ids = np.zeros(SIZE[::-1])
    ids[4:6, 5:7] = 1.0
    images = run(bench, frame(SIZE, direct=ramp(), object_id=ids), frame(SIZE, shift=(0.25, 0.25)))
    around = [ramp()[y, x] for y in (3, 4, 5) for x in (4, 5, 6) if ids[y, x] == 0.0]
    assert len(around) == 5
    np.testing.assert_allclose(images["color"][4, 5, :3], np.mean(around, axis=0) / 2, rtol=1e-6)
    # Bits 4 to 12 are the 3x3 texels row by row: all of the lowest row, the left one of the two others.
    assert images["reprojection"][4, 5, 2] == sum(16 << i for i in (0, 1, 2, 3, 6))
    assert lengths(images)[4, 5] == 1


def test_with_nothing_left_around_the_history_is_rejected(bench: Bench) -> None:
    ids = np.zeros(SIZE[::-1])
    ids[3:6, 4:7] = 1.0
    images = run(bench, frame(SIZE, direct=9.0, object_id=ids), frame(SIZE, direct=1.0, shift=(0.0, 0.0)))
    assert lengths(images)[4, 5] == 0
    np.testing.assert_array_equal(images["color"][4, 5, :3], 1.0)
    # All others find some of theirs, at the latest in the 3x3.
    outside = ids == 0.0
    np.testing.assert_allclose(images["color"][outside][:, :3], 5.0)
    inner_ring = (ids == 1.0) & (np.arange(SIZE[0]) != 5)
    assert (lengths(images)[inner_ring] == 1).all()


def test_the_length_is_interpolated_and_rounded(bench: Bench) -> None:
    """Left of x = 8 h is 4, from there on 1; a point between the two finds the nearest integer to the mean."""
    outside = np.where(np.arange(SIZE[0]) < 8, 0.0, 100.0)[None, :, None] * (1.0, 0.0)
    for quarters in (1, 2, 3):
        bench.restart()
        run(bench, STILL, STILL, STILL, frame(SIZE, shift=outside))
        images = run(bench, frame(SIZE, shift=(quarters / 4, 0.0)))
        assert lengths(images)[5, 7] == np.floor(4 - 3 * quarters / 4 + 0.5)
        assert lengths(images)[5, 6] == 4
        assert lengths(images)[5, 8] == 1


def test_a_footprint_that_is_valid_in_part_shortens_the_history(bench: Bench) -> None:
    """16 frames, then a quarter of the bilinear weight is left: sqrt(1/4) of 16."""
    for _ in range(16):
        bench.run(STILL, accumulation(RUNNING_MEAN))
    ids = np.zeros(SIZE[::-1])
    ids[5, 8] = 1.0
    images = bench.run(frame(SIZE, object_id=ids), accumulation(RUNNING_MEAN))
    assert lengths(images)[5, 8] == 0
    images = bench.run(frame(SIZE, shift=(0.5, 0.5), object_id=ids), accumulation(RUNNING_MEAN))
    assert images["reprojection"][5, 8, 2] == 1.0  # the only tap of its own object is itself
    assert lengths(images)[5, 8] == 1  # sqrt(1/4) of 1 rounds up
    assert lengths(images)[4, 7] == round(17 * np.sqrt(0.75))
    assert lengths(images)[8, 3] == 17


def test_the_depth_tolerance_is_relative_and_has_a_pixel_of_slope(bench: Bench) -> None:
    def kept(previous: float, expected: float, gradient: tuple[float, float] = (0.0, 0.0)) -> bool:
        bench.restart()
        packets = (
            frame(SIZE, depth=d, previous_depth=e, gradient=gradient) for d, e in ((previous, 1.0), (9.0, expected))
        )
        return bool(lengths(run(bench, *packets))[5, 5] == 1)

    for scale in (1e-3, 1.0, 1e4):
        assert kept(4.0 * scale, 4.0 * scale * 1.009)
        assert kept(4.0 * scale, 4.0 * scale / 1.009)
        assert not kept(4.0 * scale, 4.0 * scale * 1.011)
        assert not kept(4.0 * scale, 4.0 * scale / 1.011)
    assert kept(4.0, 4.08, gradient=(0.05, 0.0))
    assert kept(4.0, 4.08, gradient=(-0.03, 0.02))
    assert not kept(4.0, 4.2, gradient=(0.05, 0.0))  # not even from the next pixel


def test_depth_on_a_slope_is_expected_where_the_tap_is(bench: Bench) -> None:
    """A steep plane seen again half a pixel aside: each tap has the depth of its own place."""
    x = np.arange(SIZE[0], dtype=np.float64)[None, :]
    slope = 0.5
    depth = 10.0 + slope * x
    still = frame(SIZE, direct=ramp(), depth=depth, gradient=(slope, 0.0))
    moved = frame(SIZE, depth=depth, previous_depth=depth + 0.5 * slope, gradient=(slope, 0.0), shift=(0.5, 0.0))
    images = run(bench, still, moved)
    assert (images["reprojection"][:, :-1, 2] == 1 + 2).all()
    np.testing.assert_allclose(images["color"][:, :-1, 0], (ramp()[:, :-1, 0] + 0.5) / 2, rtol=1e-6)


def test_a_normal_that_turned_is_rejected(bench: Bench) -> None:
    def kept(degrees: float) -> bool:
        bench.restart()
        turned = (np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees)))
        return bool(lengths(run(bench, STILL, frame(SIZE, normal=turned)))[5, 5] == 1)

    limit = np.degrees(np.arccos(Svgf().normal_tolerance))
    assert kept(0.0)
    assert kept(limit - 0.5)
    assert not kept(limit + 0.5)
    assert not kept(90.0)
    assert not kept(180.0)


def test_a_turning_object_is_compared_with_its_normal_of_the_last_frame(bench: Bench) -> None:
    was, now = (0.0, 0.0, 1.0), (0.8, 0.0, 0.6)
    first = frame(SIZE, normal=was, previous_normal=was)
    graph = accumulation(RUNNING_MEAN, moving=True)
    kept = run(bench, first, frame(SIZE, normal=now, previous_normal=was), graph=graph)
    assert (lengths(kept) == 1).all()
    bench.restart()
    lost = run(bench, first, frame(SIZE, normal=now, previous_normal=now), graph=graph)
    assert not lengths(lost).any()
    # What is stored is the new normal.
    bench.restart()
    third = frame(SIZE, normal=now, previous_normal=now)
    assert (lengths(run(bench, first, frame(SIZE, normal=now, previous_normal=was), third, graph=graph)) == 2).all()


def test_another_object_is_rejected(bench: Bench) -> None:
    for before, now in ((0, 1), (1, 0), (70_000, 70_001), (2**24 - 1, 2**24 - 2)):
        bench.restart()
        assert not lengths(run(bench, frame(SIZE, object_id=before), frame(SIZE, object_id=now))).any()
        assert (lengths(run(bench, frame(SIZE, object_id=now))) == 1).all()


def test_what_was_behind_the_camera_has_no_history(bench: Bench) -> None:
    for depth in (0.0, -4.0):
        bench.restart()
        assert not lengths(run(bench, frame(SIZE, depth=-depth), frame(SIZE, previous_depth=depth))).any()


def test_a_view_much_less_grazing_than_before_shortens_the_history(bench: Bench) -> None:
    """Cosine of the view angle from the slope, 1 / sqrt(1 + s²); below 0.4 of now it is worth nothing."""

    def kept(before: float, now: float) -> float:
        bench.restart()
        for slope in (before, before, before, before, now):
            images = bench.run(
                frame(SIZE, gradient=(slope * PIXEL_SIZE * 4.0, 0.0)),
                accumulation(Svgf(depth_tolerance=1.0, alpha=0.0)),
            )
        return float(lengths(images)[5, 5])

    def slope(cosine: float) -> float:
        return float(np.sqrt(1 / cosine**2 - 1))

    assert kept(0.0, 0.0) == 4
    assert kept(slope(0.3), slope(0.9)) == 0
    t = (0.5 / 0.9 - 0.4) / 0.4
    assert kept(slope(0.5), slope(0.9)) == round(4 * t * t * (3 - 2 * t))
    assert kept(slope(0.9), slope(0.3)) == 4  # the other way round there was more to see


# -------------------------------------------------------------------------------------------- when histories are valid


def pipeline(bench: Bench, *configs: Config, denoiser: str = "svgf") -> Images:
    """The filter of each configuration in turn on still frames of noise; the last one's images."""
    for index, config in enumerate(configs):
        name = "svgf" if denoiser == "svgf" else denoiser
        keep = [f"{name}.reproject.out_reprojection"] if config.svgf.temporal else []
        images = bench.denoise(frame(SIZE, direct=noise(SIZE, index), indirect=1.0), config, denoiser, keep)
    return images


def history(images: Images, name: str = "svgf") -> float:
    values = images[f"{name}.reproject.out_reprojection"][..., 3]
    assert (values == values[0, 0]).all()
    return float(values[0, 0])


def changed(**svgf: object) -> Config:
    return Config(svgf=replace(Svgf(), **svgf))  # type: ignore[arg-type]


DEFAULT = Config()


def test_a_reset_starts_anew(bench: Bench) -> None:
    images = run(bench, *[frame(SIZE, direct=5.0)] * 3)
    assert (lengths(images) == 2).all()
    images = bench.run(frame(SIZE, direct=1.0), accumulation(RUNNING_MEAN), reset="key")
    assert not lengths(images).any()
    np.testing.assert_array_equal(images["color"][..., :3], 1.0)
    assert set(images.histories.values()) == {"reset: key"}


def test_another_size_starts_anew(bench: Bench) -> None:
    run(bench, *[frame(SIZE)] * 3)
    assert not lengths(run(bench, frame((31, 33)))).any()
    assert (lengths(run(bench, frame((31, 33)))) == 1).all()


@pytest.mark.parametrize(
    "change",
    [
        {"alpha": 0.5},
        {"sigma_l": 9.0},
        {"sigma_n": 100},
        {"iterations": 2},
        {"iterations": 0},
        {"feedback_level": -1},
        {"feedback_level": 2},
        {"variance_guided": False},
        {"max_history": 100},
    ],
)
def test_changing_a_parameter_keeps_the_history(bench: Bench, change: dict[str, object]) -> None:
    images = pipeline(bench, DEFAULT, DEFAULT, changed(**change))
    assert history(images) == 2
    assert set(images.histories.values()) == {"valid"}


def test_from_apart_to_joint_and_back_starts_anew(bench: Bench) -> None:
    joint = changed(separate=False)
    assert history(pipeline(bench, DEFAULT, DEFAULT, joint)) == 0
    assert history(pipeline(bench, joint)) == 1
    assert history(pipeline(bench, DEFAULT)) == 0


def test_from_irradiance_to_radiance_and_back_starts_anew(bench: Bench) -> None:
    """One is the other times the albedo: a history of one is wrong for the other."""
    with_albedo = changed(demodulate=False)
    assert history(pipeline(bench, DEFAULT, DEFAULT, with_albedo)) == 0
    assert history(pipeline(bench, with_albedo)) == 1
    assert history(pipeline(bench, DEFAULT)) == 0


def test_another_denoiser_starts_anew(bench: Bench) -> None:
    assert history(pipeline(bench, DEFAULT, DEFAULT)) == 1
    assert history(pipeline(bench, DEFAULT, denoiser="accumulate"), "accumulate") == 0
    assert history(pipeline(bench, DEFAULT)) == 0
    bench.denoise(frame(SIZE), DEFAULT, "none")
    assert history(pipeline(bench, DEFAULT)) == 0


def test_without_time_and_with_it_again_starts_anew(bench: Bench) -> None:
    pipeline(bench, DEFAULT, DEFAULT, changed(temporal=False))
    assert history(pipeline(bench, DEFAULT)) == 0
