"""Temporal gradients: which points are carried from frame to frame, where to, and what comes of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.frame import STRATUM, FramePacket
from raytrace.gradients import CARRIED, REMEMBERED, RULES, Gloss, Points, Reshading, strata
from raytrace.integrator import Tracer
from raytrace.sampling import HALTON
from tests.tracer.conftest import OpenTracer
from tests.tracer.scenes import cornell, everything, glossy, mesh, quad, rigid, scene, view_of
from tests.tracer.statistics import Estimate, assert_same
from tests.tracer.test_determinism import assert_same_bits

SIZE = (61, 47)
MOVING = cornell(motion=rigid((0.2, 1.0, 0.3), 2.0, (0.3, 0.4, -0.5), pivot=(0.45, -0.75, 0.25)))
any_rule = pytest.mark.parametrize("rule", RULES)


def flown(t: Tracer, frames: range, rule: str, moving: bool = True, size: tuple[int, int] = SIZE) -> list[FramePacket]:
    """Frames of a camera that moves and, with ``moving``, of objects that do."""
    camera = t.scene.scene.camera
    x, y, z = camera.position

    def at(index: int) -> Camera:
        return replace(camera, position=(x + 0.02 * index, y, z - 0.01 * index))

    time = [index / 30 if moving else 0.0 for index in range(frames.stop)]
    return [
        t.frame(i, at(i), at(max(i - 1, 0)), size, time[i], time[max(i - 1, 0)], cut=i == 0, remember=rule)
        for i in frames
    ]


def change(packet: FramePacket) -> NDArray[np.float32]:
    assert packet.temporal_gradient is not None
    return packet.temporal_gradient


def marks(packet: FramePacket) -> NDArray[np.float32]:
    return packet.direct[..., 3]


def luminance(color: NDArray[np.float32]) -> NDArray[np.float64]:
    return np.asarray(color[..., :3].astype(np.float64) @ (0.2126, 0.7152, 0.0722))


def test_where_nothing_changed_the_gradient_is_zero_to_the_bit(trace: OpenTracer) -> None:
    """Textures, a sky, a textured lamp, a smooth ball; the camera moves, nothing else does."""
    for generator in (HALTON, 1):
        first, *others = flown(trace(everything(), threads=2, tile=512, generator=generator), range(4), "random", False)
        assert not change(first).any()
        for packet in others:
            values = change(packet)
            np.testing.assert_array_equal(values[..., [0, 2]], 0.0)
            assert (values[..., 1] > 0).mean() > 0.2
            assert (values[..., 3] > 0).sum() > 5


def still(t: Tracer, lamps: tuple[float, ...], rule: str = "random") -> list[FramePacket]:
    """Frames of a camera and of objects that rest, each with its share of the lamps' light."""
    camera = t.scene.scene.camera
    return [t.frame(i, camera, camera, SIZE, cut=i == 0, remember=rule, lamps=share) for i, share in enumerate(lamps)]


def gloss(packet: FramePacket) -> NDArray[np.float32]:
    assert packet.temporal_gradient_specular is not None
    return packet.temporal_gradient_specular


def test_specular_light_that_did_not_change_has_no_gradient_to_the_bit(trace: OpenTracer) -> None:
    """Nor has the sum of all light. There is no image of it where nothing is specular."""
    for generator in (HALTON, 1):
        for packet in still(trace(glossy(), threads=2, tile=512, generator=generator), (1.0,) * 3)[1:]:
            for values in (change(packet), gloss(packet)):
                np.testing.assert_array_equal(values[..., [0, 2]], 0.0)
            assert (gloss(packet)[..., 1] > 0).mean() > 0.2
            assert (gloss(packet)[..., 3] > gloss(packet)[..., 1]).any()
    assert still(trace(cornell()), (1.0,))[0].temporal_gradient_specular is None


def test_specular_gradients_are_the_differences_of_the_samples(trace: OpenTracer) -> None:
    """A still camera whose lamp is dimmed: what is remembered lands in its own pixel. The sky goes on shining."""
    for rule in RULES:
        before, after = still(trace(glossy()), (1.0, 0.4), rule)
        y, x = np.nonzero(marks(after) == CARRIED)
        assert before.specular is not None
        assert after.specular is not None
        assert after.specular_albedo is not None
        np.testing.assert_array_equal(after.specular[..., 3], marks(after))
        np.testing.assert_array_equal(before.specular[y, x, 3], REMEMBERED)
        now, then = (luminance(packet.specular)[y, x] for packet in (after, before) if packet.specular is not None)
        values = gloss(after)[y // STRATUM, x // STRATUM]
        np.testing.assert_allclose(values[:, 0], now - then, rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(values[:, 1], np.maximum(now, then), rtol=1e-5, atol=1e-7)
        assert (values[:, 0] < 0).sum() > 10
        diffuse, lobe = luminance(after.albedo)[y, x], luminance(after.specular_albedo)[y, x]
        part = lobe / np.maximum(diffuse + lobe, 1e-30)
        assert ((part > 0) & (part < 1)).any()
        whole = [
            (1 - part) * (luminance(packet.direct) + luminance(packet.indirect))[y, x] + part * of
            for packet, of in ((after, now), (before, then))
        ]
        np.testing.assert_allclose(values[:, 2], whole[0] - whole[1], rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(values[:, 3], np.maximum(*whole), rtol=1e-5, atol=1e-7)


def test_the_brightest_is_chosen_by_specular_light_as_well(trace: OpenTracer) -> None:
    """A metal has no other: its points would never be remembered."""
    packet = still(trace(glossy()), (1.0,), "brightest")[0]
    assert packet.specular is not None
    metal = (packet.albedo[..., :3].max(-1) == 0) & (packet.motion[..., 3] >= 0)
    assert (marks(packet)[metal] == REMEMBERED).sum() > 10


def test_specular_light_that_is_not_a_number_makes_no_gradient(trace: OpenTracer) -> None:
    for bad in (np.nan, np.inf):
        t = trace(glossy())
        camera, size = t.scene.scene.camera, (12, 12)
        everywhere = np.arange(144, dtype=np.int32)
        hits = t.primary(view_of(t, camera, size), everywhere)
        count = strata(size)[0] * strata(size)[1]
        points = Points.none(count, 3)
        seen = np.flatnonzero(hits.triangle >= 0)[::9][:5].astype(np.int32)
        points.triangle[:5], points.u[:5], points.v[:5] = hits.triangle[seen], hits.u[seen], hits.v[seen]
        points.front[:5], points.light[:5] = 1, 2.0
        work = reshading(t, points, camera, size, glossy=True)
        triangle, u, v = hits.triangle.copy(), hits.u.copy(), hits.v.copy()
        work.replace(0, triangle, u, v, everywhere.astype(np.uint32), np.zeros(144, np.uint32))
        direct, indirect, specular, albedo, lobe = np.full((5, 144, 4), 0.5, np.float32)
        specular[:, 0] = bad
        work.note(0, triangle, u, v, direct, indirect, Gloss(specular, albedo, lobe))
        assert (specular[:, 3] == CARRIED).sum() > 0
        assert work.specular is not None
        assert not work.specular.any()
        assert (work.gradient[..., 0] < 0).any()


def test_where_something_moves_there_are_gradients_of_either_sign(trace: OpenTracer) -> None:
    what = cornell()
    slide = rigid((0.0, 1.0, 0.0), 0.0, (4.0, 0.0, 0.0))
    meshes = tuple(replace(m, motion=slide) if m.name == "lamp" else m for m in what.meshes)
    values = change(flown(trace(replace(what, meshes=meshes)), range(3), "random")[-1])
    for signal in (0, 2):
        assert (values[..., signal] > 0).any()
        assert (values[..., signal] < 0).any()
        assert (values[..., signal] == 0).mean() > 0.3
        assert (np.abs(values[..., signal]) <= values[..., signal + 1]).all()


@any_rule
def test_frames_are_the_same_for_every_tiling_and_any_number_of_threads(trace: OpenTracer, rule: str) -> None:
    for what in (MOVING, everything(), glossy()):
        expected = flown(trace(what, tile=16384), range(3), rule)
        assert (marks(expected[-1]) == CARRIED).sum() > 30
        for tile, threads in ((1, 3), (800, 2)):
            for one, other in zip(
                expected, flown(trace(what, tile=tile, threads=threads), range(3), rule), strict=True
            ):
                assert_same_bits(one, other)


@any_rule
def test_only_carried_samples_differ_from_those_of_a_frame_without(trace: OpenTracer, rule: str) -> None:
    plain, packets = flown(trace(MOVING), range(3), ""), flown(trace(MOVING), range(3), rule)
    for one, other in zip(plain, packets, strict=True):
        assert one.temporal_gradient is None
        assert (marks(one) == 1.0).all()
        carried = marks(other) == CARRIED
        other = replace(other, temporal_gradient=None)
        for name in ("direct", "indirect"):
            np.testing.assert_array_equal(
                getattr(one, name)[~carried][:, :3], getattr(other, name)[~carried][:, :3], err_msg=name
            )
        unmarked = replace(other, direct=one.direct, indirect=one.indirect)
        assert_same_bits(one, unmarked)
        assert carried.any() == (one.index > 0)
        changed = (one.direct != other.direct).any(axis=-1)
        assert changed[carried].sum() >= 0.3 * carried.sum()


@any_rule
def test_one_pixel_of_each_stratum_at_most_and_none_twice(trace: OpenTracer, rule: str) -> None:
    """Nobody's numbers are followed for longer than one frame: what was carried is not remembered again."""
    for packet in flown(trace(MOVING), range(5), rule):
        mark = marks(packet)
        across, down = strata(SIZE)
        padded = np.ones((down * STRATUM, across * STRATUM))
        padded[: SIZE[1], : SIZE[0]] = mark
        squares = padded.reshape(down, STRATUM, across, STRATUM).transpose(0, 2, 1, 3).reshape(down, across, -1)
        for kind in (CARRIED, REMEMBERED):
            assert (squares == kind).sum(axis=-1).max() == int(kind == REMEMBERED or packet.index > 0)
        seen = packet.motion[..., 3] >= 0
        assert (mark[~seen] == 1.0).all()
        if rule == "random":
            surface = np.zeros(padded.shape, bool)
            surface[: SIZE[1], : SIZE[0]] = seen & (mark != CARRIED)
            some = surface.reshape(down, STRATUM, across, STRATUM).any(axis=(1, 3))
            np.testing.assert_array_equal((squares == REMEMBERED).any(axis=-1), some)


def test_the_gradient_is_the_difference_of_the_two_samples(trace: OpenTracer) -> None:
    """A still camera: what is remembered lands in its own pixel, so that both frames can be compared there."""
    what = cornell()
    dimmed = replace(what, materials=tuple(replace(m, dimmer=lambda t: 1.0 - t) for m in what.materials))
    t = trace(dimmed)
    camera = what.camera
    before = t.frame(0, camera, camera, SIZE, cut=True, remember="random")
    after = t.frame(1, camera, camera, SIZE, 0.25, 0.0, remember="random")
    carried = marks(after) == CARRIED
    np.testing.assert_array_equal(carried, marks(before) == REMEMBERED)
    y, x = np.nonzero(carried)
    for signal, name in enumerate(("direct", "indirect")):
        now, then = (luminance(getattr(packet, name))[y, x] for packet in (after, before))
        np.testing.assert_allclose(now, 0.75 * then, rtol=1e-5, atol=1e-7)
        values = change(after)[y // STRATUM, x // STRATUM]
        np.testing.assert_allclose(values[:, 2 * signal], now - then, rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(values[:, 2 * signal + 1], then, rtol=1e-5, atol=1e-7)
        assert (now > 0).sum() > 50


def test_a_point_goes_with_its_triangle(trace: OpenTracer) -> None:
    """A board flies and turns under an even sky: every point of it has the light it had, wherever it is now."""
    motion = rigid((0.0, 0.0, 1.0), 3.0, (3.0, 1.5, 0.0))
    board = mesh("board", quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)), motion=motion)
    camera = Camera.look_at((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
    t = trace(scene([board], [replace(cornell().materials[0])], camera, (0.7, 0.8, 0.9)))
    for index in range(3):
        packet = t.frame(
            index, camera, camera, SIZE, index / 30, max(index - 1, 0) / 30, cut=index == 0, remember="random"
        )
    carried, seen = marks(packet) == CARRIED, packet.motion[..., 3] >= 0
    assert seen.sum() > 300
    assert carried.sum() > 0.7 * seen.sum() / STRATUM**2
    assert not carried[~seen].any()
    np.testing.assert_array_equal(change(packet)[..., [0, 2]], 0.0)


def reshading(
    t: Tracer, points: Points, camera: Camera, size: tuple[int, int] = SIZE, glossy: bool = False
) -> Reshading:
    view = view_of(t, camera, size)
    return Reshading(
        t.scene.triangles, t.scene.triangle_info, points, 7, size, view.eye, view.matrix, view.jitter,
        camera.pixel_size(size[1]), 0, brightest=False, glossy=glossy,
    )  # fmt: skip


def points_at(t: Tracer, pixels: list[int], camera: Camera, places: list[int] | None = None) -> Points:
    """The surface points seen in ``pixels``, as those of the strata number ``places``."""
    across, down = strata(SIZE)
    points = Points.none(across * down)
    hits = t.primary(view_of(t, camera, SIZE), np.array(pixels, np.int32))
    for i, (pixel, k) in enumerate(zip(pixels, places or range(len(pixels)), strict=True)):
        points.triangle[k], points.u[k], points.v[k] = hits.triangle[i], hits.u[i], hits.v[i]
        points.pixel[k], points.front[k] = pixel, 1
    return points


def landed(t: Tracer, points: Points, camera: Camera) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """(H, W) pixel and frame of the random numbers that each path of a frame would have."""
    everywhere = np.arange(SIZE[0] * SIZE[1], dtype=np.int32)
    hits = t.primary(view_of(t, camera, SIZE), everywhere)
    pixels, frames = everywhere.astype(np.uint32), np.full(len(everywhere), 7, np.uint32)
    reshading(t, points, camera).replace(0, hits.triangle, hits.u, hits.v, pixels, frames)
    return pixels.reshape(SIZE[1], SIZE[0]), frames.reshape(SIZE[1], SIZE[0])


CORNER = Camera.look_at((0.0, 0.0, 4.0), (0.0, 0.0, 0.0))
WALLS = scene(
    [
        mesh("far", quad((-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0))),
        mesh("near", quad((-0.4, -3, 1), (0, -3, 1), (0, 3, 1), (-0.4, 3, 1))),
    ],
    [cornell().materials[0]],
    CORNER,
    (1.0, 1.0, 1.0),
)


def test_of_several_points_in_one_stratum_the_nearest_counts_then_the_first(trace: OpenTracer) -> None:
    """All of them are seen. The order in which they were remembered does not matter, but among equals."""
    t = trace(WALLS)
    row = 24 * SIZE[0]  # a row of strata begins here
    near = int(
        np.flatnonzero(t.primary(view_of(t, CORNER, SIZE), row + np.arange(SIZE[0], dtype=np.int32)).object == 1)[0]
    )
    column = near - near % STRATUM
    far_pixels = [row + column + d for d in range(near % STRATUM)]
    assert far_pixels, "the near wall's edge must lie within a stratum"
    crowd = [*far_pixels, row + near]
    for places in (list(range(len(crowd))), list(range(len(crowd)))[::-1]):
        pixels, frames = landed(t, points_at(t, crowd, CORNER, places), CORNER)
        assert np.argwhere(frames == 6).tolist() == [[24, near]]
        assert pixels[24, near] == row + near
    twins = [row + 3, row + 4, row + 5]  # the same surface, one depth
    for places in ([0, 1, 2], [2, 1, 0]):
        points = points_at(t, twins, CORNER, places)
        pixels, frames = landed(t, points, CORNER)
        assert np.argwhere(frames == 6).tolist() == [[24, int(points.pixel[0]) - row]]


def test_a_point_that_is_hidden_now_is_not_carried(trace: OpenTracer) -> None:
    """Behind another object, on the other side of a thin board, out of view, behind the camera."""
    t = trace(WALLS)
    middle = 24 * SIZE[0] + 34  # of the wall behind, beside the one in front
    points = points_at(t, [middle], CORNER)
    aside = Camera.look_at((0.3, 0.0, 4.0), (0.3, 0.0, 0.0))
    assert (landed(t, points, CORNER)[1] == 6).sum() == 1
    assert (landed(t, points, aside)[1] == 6).sum() == 1
    hidden = Camera.look_at((-0.3, 0.0, 1.6), (-0.2, 0.0, 0.0), yfov_degrees=60.0)
    behind = Camera.look_at((0.0, 0.0, 4.0), (0.0, 0.0, 9.0))
    away = Camera.look_at((0.0, 0.0, 4.0), (40.0, 0.0, 0.0))
    other_side = Camera.look_at((0.0, 0.0, -4.0), (0.0, 0.0, 0.0))
    for camera in (hidden, behind, away, other_side):
        assert (landed(t, points, camera)[1] == 7).all()


def test_what_does_not_follow_is_not_carried_over(trace: OpenTracer) -> None:
    """A cut, another size, a skipped frame, another time before, other random numbers, a frame without gradients."""
    camera = cornell().camera

    def carried(t: Tracer, index: int, size: tuple[int, int] = SIZE, **how: object) -> int:
        packet = t.frame(index, camera, camera, size, remember="random", **how)  # type: ignore[arg-type]
        return int((marks(packet) == CARRIED).sum())

    t = trace(cornell())
    assert carried(t, 0) == 0
    assert carried(t, 1) > 50
    assert carried(t, 2, cut=True) == 0
    assert carried(t, 3) > 50
    assert carried(t, 5) == 0
    assert carried(t, 6, (40, 30)) == 0
    assert carried(t, 7, (40, 30)) > 50
    assert carried(t, 8, (40, 30), previous=0.5) == 0
    t.settings = replace(t.settings, seed=9)
    assert carried(t, 9, (40, 30)) == 0
    t.frame(10, camera, camera, (40, 30))
    assert carried(t, 11, (40, 30)) == 0


def test_every_pixel_of_a_stratum_has_the_same_chance(trace: OpenTracer) -> None:
    what = scene(
        [mesh("wall", quad((-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)))], list(cornell().materials[:1]), CORNER
    )
    t = trace(what)
    size = (60, 45)
    counts = np.zeros((STRATUM, STRATUM))
    for index in range(0, 24, 2):  # none is carried into the next
        packet = t.frame(index, CORNER, CORNER, size, remember="random")
        chosen = marks(packet) == REMEMBERED
        assert chosen.sum() == size[0] * size[1] // STRATUM**2
        counts += chosen.reshape(15, STRATUM, 20, STRATUM).sum(axis=(0, 2))
    expected = counts.mean()
    assert ((counts - expected) ** 2 / expected).sum() < 26.1  # chi-squared of 8 degrees, 0.1 %


def test_the_brightest_is_chosen_and_none_of_the_dark(trace: OpenTracer) -> None:
    packet = flown(trace(cornell()), range(1), "brightest")[0]
    light = luminance(packet.direct) + luminance(packet.indirect)
    for y, x in np.argwhere(marks(packet) == REMEMBERED):
        top, left = y - y % STRATUM, x - x % STRATUM
        assert light[y, x] == pytest.approx(light[top : top + STRATUM, left : left + STRATUM].max(), rel=1e-5)
        assert light[y, x] > 0


def test_carried_samples_are_as_good_as_others_if_chosen_at_random(trace: OpenTracer) -> None:
    """Means over frames and pixels, against the frames without. The brightest are too bright, as documented."""
    t = trace(cornell())

    def mean(rule: str) -> Estimate:
        packets = flown(t, range(24), rule, moving=False)
        return Estimate.of(np.array([luminance(p.direct).mean() for p in packets[1:]]))

    plain, random, brightest = mean(""), mean("random"), mean("brightest")
    assert_same(random, plain, sharp=0.05)
    assert brightest.mean > 1.04 * plain.mean


def test_light_that_is_not_a_number_makes_no_gradient(trace: OpenTracer) -> None:
    t = trace(cornell())
    size = (12, 12)
    everywhere = np.arange(144, dtype=np.int32)
    hits = t.primary(view_of(t, cornell().camera, size), everywhere)
    lit = hits.triangle >= 0
    for bad in (np.nan, np.inf):
        count = strata(size)[0] * strata(size)[1]
        points = Points.none(count)
        pixels = np.flatnonzero(lit)[::9][:5].astype(np.int32)
        points.triangle[:5], points.u[:5], points.v[:5] = hits.triangle[pixels], hits.u[pixels], hits.v[pixels]
        points.front[:5], points.light[:5] = 1, 2.0
        work = reshading(t, points, cornell().camera, size)
        triangle, u, v = hits.triangle.copy(), hits.u.copy(), hits.v.copy()
        work.replace(0, triangle, u, v, everywhere.astype(np.uint32), np.zeros(144, np.uint32))
        direct, indirect = np.full((2, 144, 4), 1.0, np.float32)
        direct[:, 0] = bad
        work.note(0, triangle, u, v, direct, indirect)
        assert (direct[:, 3] == CARRIED).sum() > 0
        assert not work.gradient[..., :2].any()
        assert (work.gradient[..., 2] < 0).any()


def test_lamps_follow_their_dimmers_and_the_switch(trace: OpenTracer) -> None:
    what = cornell()
    dimmed = replace(what, materials=tuple(replace(m, dimmer=lambda t: 0.5 + t) for m in what.materials))
    t, full = trace(dimmed), trace(what)
    camera = what.camera
    plain = full.frame(0, camera, camera, SIZE)
    for now, lamps, share in ((0.0, 1.0, 0.5), (0.5, 1.0, 1.0), (0.5, 0.0, 0.0), (0.5, 0.25, 0.25), (0.5, 1.0, 1.0)):
        packet = t.frame(0, camera, camera, SIZE, now, now, lamps=lamps)
        for name in ("direct", "indirect", "emission"):
            ours, theirs = getattr(packet, name)[..., :3], getattr(plain, name)[..., :3]
            np.testing.assert_allclose(ours, share * theirs, rtol=1e-5, atol=1e-7)
    assert_same_bits(packet, replace(plain, time=0.5))
    reference = t.reference(camera, SIZE, 2, now=0.0)[0]
    np.testing.assert_allclose(reference, 0.5 * full.reference(camera, SIZE, 2)[0], rtol=1e-5, atol=1e-7)
