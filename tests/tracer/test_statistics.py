"""Whole pictures: against an independent tracer, against references, and one generator against the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from raytrace.integrator import Seeds, Tracer
from raytrace.sampling import HALTON, HASH
from raytrace.scene import Scene
from tests.tracer.brute_force import Soup, trace_paths
from tests.tracer.conftest import OpenTracer
from tests.tracer.scenes import cornell, everything, ordered_triangles, repeated, rigid, shade, still, view_of
from tests.tracer.statistics import Estimate, assert_same

F64 = NDArray[np.float64]
SIZE = (24, 24)
MOVING = cornell(motion=rigid((0.2, 1.0, 0.3), 2.0, (0.3, 0.4, -0.5), pivot=(0.45, -0.75, 0.25)))


def blocks(image: NDArray[np.floating], side: int = 6) -> F64:
    """Means over squares of ``side`` pixels, (n, 3), without the squares that miss the scene."""
    height, width = image.shape[:2]
    means: F64 = image[..., :3].astype(np.float64).reshape(height // side, side, width // side, side, 3).mean((1, 3))
    return means.reshape(-1, 3)


def frames_of(t: Tracer, count: int, size: tuple[int, int] = SIZE, time: float = 0.0) -> tuple[F64, F64]:
    """Block means of direct and indirect of ``count`` frames, (count, n, 3) each."""
    direct, indirect = [], []
    for index in range(count):
        frame = still(t, size, index, time)
        direct.append(blocks(frame.direct))
        indirect.append(blocks(frame.indirect))
    return np.stack(direct), np.stack(indirect)


def brute_force_frames(what: Scene, t: Tracer, count: int, time: float) -> tuple[F64, F64]:
    """The same block means from the tests' own tracer, through the same pixel centres."""
    view = view_of(t, what.camera, SIZE)
    x, y = np.meshgrid((np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1, (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2 - 1)
    right, up, forward = (part.astype(np.float64) for part in (view.right, view.up, view.forward))
    directions = (forward + x[..., None] * right + y[..., None] * up).reshape(-1, 3)
    origins = np.broadcast_to(np.array(what.camera.position), directions.shape)
    materials = np.concatenate([m.materials for m in sorted(what.meshes, key=lambda m: m.motion is not None)])
    soup = Soup(
        ordered_triangles(what, time),
        np.array([m.base_color for m in what.materials])[materials],
        np.array([m.emission for m in what.materials])[materials],
    )
    random = np.random.default_rng(20)
    direct, indirect = [], []
    for _ in range(count):
        d, i = trace_paths(soup, origins, directions, random)
        direct.append(blocks(d.reshape(*SIZE[::-1], 3)))
        indirect.append(blocks(i.reshape(*SIZE[::-1], 3)))
    return np.stack(direct), np.stack(indirect)


@pytest.mark.slow
@pytest.mark.parametrize(("what", "time"), [(cornell(), 0.0), (MOVING, 0.3)], ids=["still", "moving"])
def test_the_cornell_box_has_the_light_of_an_independent_tracer(trace: OpenTracer, what: Scene, time: float) -> None:
    t = trace(what)
    ours = frames_of(t, 400, time=time)
    theirs = brute_force_frames(what, t, 120, time)
    for mine, other in zip(ours, theirs, strict=True):
        lit = mine.mean((0, 2)) > 0.02
        assert lit.sum() >= 12
        assert_same(Estimate.of(mine), Estimate.of(other))
        total = Estimate.of(mine[:, lit].mean(1)), Estimate.of(other[:, lit].mean(1))
        assert_same(*total, sharp=0.06)


@pytest.mark.parametrize("what", [cornell(), everything()], ids=["cornell", "everything"])
def test_frames_average_to_the_reference(trace: OpenTracer, what: Scene) -> None:
    """The mean of many frames of one path per pixel is what `reference` says, region by region."""
    t = trace(what)
    frames = frames_of(t, 200)
    parts = [t.reference(what.camera, SIZE, 32, first_sample=32 * i) for i in range(32)]
    for k, ours in enumerate(frames):
        reference = np.stack([blocks(part[k]) for part in parts])
        assert reference.mean() > 0.01
        assert_same(Estimate.of(ours), Estimate.of(reference))
        assert_same(Estimate.of(ours.mean(1)), Estimate.of(reference.mean(1)), sharp=0.08)


@pytest.mark.parametrize("what", [cornell(), everything()], ids=["cornell", "everything"])
def test_the_sixteen_halton_points_average_to_the_same_light(trace: OpenTracer, what: Scene) -> None:
    """One cycle has the noise of 16 well-spread samples at a pixel; over pixels and seeds it has no bias."""
    t = trace(what)
    reference = [t.reference(what.camera, SIZE, 64, first_sample=64 * i) for i in range(16)]
    cycles: list[list[F64]] = [[], []]
    for seed in range(24):
        t.settings = replace(t.settings, generator=HALTON, seed=seed)
        direct, indirect = frames_of(t, 16)
        cycles[0].append(direct.mean(0))
        cycles[1].append(indirect.mean(0))
    for k in range(2):
        exact = Estimate.of(np.stack([blocks(part[k]) for part in reference]))
        assert_same(Estimate.of(np.stack(cycles[k])), exact)


def test_a_halton_cycle_has_less_noise_than_as_many_random_paths(trace: OpenTracer) -> None:
    """Its purpose. Variance of the mean of the first 8 and of all 16 frames over seeds, averaged over the picture."""
    t = trace(cornell())
    variance = {}
    for generator in (HALTON, HASH):
        means = []
        for seed in range(12):
            t.settings = replace(t.settings, generator=generator, seed=seed)
            frames = [still(t, SIZE, index) for index in range(16)]
            light = np.stack([(f.direct[..., :3], f.indirect[..., :3]) for f in frames]).astype(np.float64)
            means.append((light[:8].mean(0), light.mean(0)))
        variance[generator] = np.array(means).var(0, ddof=1).mean((2, 3, 4))  # by number of frames, direct or indirect
    assert (variance[HALTON] < np.array([[0.65, 0.85], [0.65, 0.8]]) * variance[HASH]).all()


def test_paths_of_one_pixel_are_independent(trace: OpenTracer) -> None:
    """The variance of a mean of n paths is that of one path over n: along frames, along pixels, along seeds."""
    t = trace(cornell())
    view = view_of(t, cornell().camera, SIZE)
    hits = t.primary(view, np.array([SIZE[0] * 5 + 11], np.int32))
    count = 64 * 256
    many = repeated(hits, 0, count)
    slow, fast = np.repeat(np.arange(256, dtype=np.uint32), 64), np.tile(np.arange(64, dtype=np.uint32), 256)
    for name, seeds in (("frames", Seeds(slow, fast)), ("pixels", Seeds(fast, slow))):
        for part in shade(t, many, seeds, view.eye):
            values = part[:, 0].astype(np.float64).reshape(256, 64)
            ratio = values.mean(1).var() / (values.var() / 64)
            assert 0.7 < ratio < 1.3, name  # the ratio's own deviation is sqrt(2/255) = 0.09
