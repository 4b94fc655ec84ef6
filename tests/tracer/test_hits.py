"""The two cores of the tracer: surface points of camera rays, and shading of remembered points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.embree import open_caster
from raytrace.integrator import Hits, Seeds, Tracer
from raytrace.sampling import HALTON, HASH
from raytrace.scene import Material, Scene
from tests.tracer.brute_force import nearest_hits
from tests.tracer.conftest import OpenTracer
from tests.tracer.scenes import (
    GREY,
    box,
    cornell,
    everything,
    mesh,
    ordered_triangles,
    quad,
    rigid,
    scene,
    seeds_of,
    selected,
    shade,
    sphere,
    still,
    view_of,
)

F64 = NDArray[np.float64]
SIZE = (32, 24)
PIXELS = np.arange(SIZE[0] * SIZE[1], dtype=np.int32)
MOVING = cornell(motion=rigid((0.2, 1.0, 0.3), 2.0, (0.3, 0.4, -0.5), pivot=(0.45, -0.75, 0.25)))

both_backends = pytest.mark.parametrize("backend", ["native", "run"])


def rays(count: int, seed: int = 0) -> tuple[F64, F64]:
    """Origins in and around the Cornell box, directions of lengths from 0.01 to 100."""
    random = np.random.default_rng(seed)
    origins = random.uniform(-1.5, 1.5, (count, 3))
    directions = random.normal(size=(count, 3)) * 10.0 ** random.uniform(-2, 2, (count, 1))
    return origins.astype(np.float32).astype(np.float64), directions.astype(np.float32).astype(np.float64)


def clear_of_edges(u: F64, v: F64) -> NDArray[np.bool_]:
    return np.minimum(np.minimum(u, v), 1 - u - v) > 1e-4


@both_backends
@pytest.mark.parametrize("what", [cornell(), MOVING, everything()], ids=["still", "moving", "everything"])
def test_nearest_hits_are_those_of_every_triangle_tried_in_turn(what: Scene, backend: str) -> None:
    """Static and moving triangles in either order, against intersections in double precision."""
    time = 0.3
    triangles = ordered_triangles(what, time)
    static = sum(len(m.faces) for m in what.meshes if m.motion is None)
    records = triangles.reshape(-1, 9).astype(np.float32)
    caster = open_caster(records, static, backend)
    if static < len(records):
        moving = triangles[static:].reshape(-1, 3)
        caster.move(records, np.stack([moving.min(0), moving.max(0)]).astype(np.float32))
    origins, directions = rays(1500)
    index, u, v, _ = nearest_hits(triangles, origins, directions)
    clear = (index < 0) | clear_of_edges(u, v)
    assert clear.mean() > 0.99
    o, d = origins.astype(np.float32), directions.astype(np.float32)
    got, gu, gv = caster.intersect(o, d)
    np.testing.assert_array_equal(got[clear], index[clear])
    hit = clear & (index >= 0)
    assert 0.3 < hit.mean() < 1.0
    np.testing.assert_allclose(gu[hit], u[hit], atol=2e-4)
    np.testing.assert_allclose(gv[hit], v[hit], atol=2e-4)
    by_rows, _, _ = caster.intersect_rows(o, d, 50)
    np.testing.assert_array_equal(by_rows[clear], index[clear])
    caster.close()


@both_backends
@pytest.mark.parametrize("what", [cornell(), MOVING], ids=["still", "moving"])
def test_occlusion_respects_the_end_of_the_ray(what: Scene, backend: str) -> None:
    """Just short of the nearest hit the way is free, just beyond it is blocked."""
    triangles = ordered_triangles(what, 0.3)
    static = sum(len(m.faces) for m in what.meshes if m.motion is None)
    records = triangles.reshape(-1, 9).astype(np.float32)
    caster = open_caster(records, static, backend)
    if static < len(records):
        moving = triangles[static:].reshape(-1, 3)
        caster.move(records, np.stack([moving.min(0), moving.max(0)]).astype(np.float32))
    origins, directions = rays(1500, 1)
    index, u, v, distance = nearest_hits(triangles, origins, directions)
    o, d = origins.astype(np.float32), directions.astype(np.float32)
    hit = (index >= 0) & clear_of_edges(u, v) & (distance > 1e-3)
    near = np.where(hit, distance, 1e6)
    short, beyond = (caster.occluded(o, d, (near * f).astype(np.float32)) for f in (0.999, 1.001))
    assert (short[hit] == -1).all()
    assert (beyond[hit] == 0).all()
    missed = index < 0
    assert missed.any()
    assert (beyond[missed] == -1).all()
    caster.close()


@both_backends
def test_primary_gives_object_triangle_and_barycentrics(trace: OpenTracer, backend: str) -> None:
    t = trace(MOVING, backend=backend)
    t.set_time(0.3, 0.3)
    view = view_of(t, MOVING.camera, SIZE)
    hits = t.primary(view, PIXELS)
    frame = still(t, SIZE, time=0.3)
    np.testing.assert_array_equal(hits.object, frame.motion[..., 3].ravel())
    assert {-1, 0, 5} <= set(hits.object.tolist())
    missed = hits.triangle < 0
    np.testing.assert_array_equal(missed, hits.object < 0)
    assert (hits.triangle[hits.object == 5] >= t.scene.static_count).all()
    u, v = hits.u[~missed], hits.v[~missed]
    assert (u >= 0).all()
    assert (v >= 0).all()
    assert (u + v <= 1 + 1e-6).all()
    some = np.array([700, 3, 3, 200], np.int32)
    chosen = t.primary(view, some)
    for all_of, few in zip(vars(hits).values(), vars(chosen).values(), strict=True):
        np.testing.assert_array_equal(few, all_of[some])


def prepared(t: Tracer) -> tuple[Hits, np.ndarray]:
    view = view_of(t, t.scene.scene.camera, SIZE)
    return t.primary(view, PIXELS), view.eye


@pytest.mark.parametrize("generator", [HALTON, HASH])
def test_shading_again_repeats_every_bit(trace: OpenTracer, generator: int) -> None:
    t = trace(everything(), generator=generator)
    t.set_time(0.2, 0.2)
    hits, eye = prepared(t)
    direct, indirect = shade(t, hits, seeds_of(len(PIXELS), 5), eye)
    assert direct.any()
    assert indirect.any()
    still(t, (16, 16), 9, 0.7)  # another frame in between
    t.set_time(0.2, 0.1)  # the time before does not matter
    again = shade(t, hits, seeds_of(len(PIXELS), 5), eye)
    np.testing.assert_array_equal(direct, again[0])
    np.testing.assert_array_equal(indirect, again[1])
    other = shade(t, hits, seeds_of(len(PIXELS), 6), eye)
    assert (other[0] != direct).any(axis=1)[hits.triangle >= 0].mean() > 0.5


def test_shading_does_not_depend_on_the_company(trace: OpenTracer) -> None:
    """Any choice of hits, in any order, with any seeds: each path is that of its own hit and seeds."""
    t = trace(everything())
    t.set_time(0.2, 0.2)
    hits, eye = prepared(t)
    seeds = seeds_of(len(PIXELS), 3)
    direct, indirect = shade(t, hits, seeds, eye)
    order = np.random.default_rng(1).permutation(len(PIXELS))[:333]
    some = shade(t, selected(hits, order), Seeds(seeds.pixel[order], seeds.frame[order]), eye)
    np.testing.assert_array_equal(some[0], direct[order])
    np.testing.assert_array_equal(some[1], indirect[order])


def test_shading_a_miss_brings_nothing_and_reads_nothing(trace: OpenTracer) -> None:
    t = trace(everything())
    t.set_time(0.0, 0.0)
    nothing = Hits(np.full(7, -1, np.int32), np.zeros(7, np.float32), np.zeros(7, np.float32), np.full(7, -1, np.int32))
    direct, indirect = shade(t, nothing, seeds_of(7), np.zeros(3, np.float32))
    assert not direct.any()
    assert not indirect.any()
    none = selected(nothing, np.zeros(0, np.int32))
    assert shade(t, none, seeds_of(0), np.zeros(3, np.float32))[0].shape == (0, 3)


@pytest.mark.parametrize("what", [cornell(), everything()], ids=["cornell", "everything"])
def test_remembered_points_shade_alike_from_any_camera_on_their_side(trace: OpenTracer, what: Scene) -> None:
    """Adaptive temporal filtering needs it (Schied et al. 2018, sec. 4.1): a gradient is 0 unless the light changed."""
    t = trace(what)
    t.set_time(0.0, 0.0)
    hits, eye = prepared(t)
    seeds = seeds_of(len(PIXELS), 4)
    first = shade(t, hits, seeds, eye)
    moved = eye + np.array([0.2, 0.1, 0.4], np.float32)
    corners = (ordered_triangles(what) - t.scene.origin)[hits.triangle]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    side = [((e - corners[:, 0]) * normal).sum(1) for e in (eye, moved)]
    same = (side[0] * side[1] > 0) & (hits.triangle >= 0)
    assert same.mean() > 0.4
    second = shade(t, hits, seeds, moved)
    for a, b in zip(first, second, strict=True):
        assert a.any()
        np.testing.assert_array_equal(a[same], b[same])


def test_a_frame_is_its_hits_shaded_with_its_own_seeds(trace: OpenTracer) -> None:
    t = trace(everything(), backend="run", seed=77)
    frame = still(t, SIZE, 11, 0.2)
    hits, eye = prepared(t)
    direct, indirect = shade(t, hits, seeds_of(len(PIXELS), 11), eye)
    np.testing.assert_array_equal(frame.direct[..., :3].reshape(-1, 3), direct)
    np.testing.assert_array_equal(frame.indirect[..., :3].reshape(-1, 3), indirect)
    np.testing.assert_array_equal(frame.direct[..., 3], 1.0)
    np.testing.assert_array_equal(frame.indirect[..., 3], 1.0)


def test_only_what_can_see_the_change_changes(trace: OpenTracer) -> None:
    """Two closed rooms with a lamp each; something moves in one of them. In the other not a bit changes."""
    lamp = Material("lamp", (0.5, 0.5, 0.5), emission=(4.0, 4.0, 4.0))

    def room(x: float) -> F64:
        return box((x - 1, -1, -1), (x + 1, 1, 1), inward=True)

    def lamp_in(x: float) -> F64:
        return quad((x - 0.4, 0.9, -0.4), (x + 0.4, 0.9, -0.4), (x + 0.4, 0.9, 0.4), (x - 0.4, 0.9, 0.4))

    ball = sphere(0.3, (1.5, -0.3, 0.0), 1)
    meshes = [
        mesh("rooms", np.concatenate([room(-1.5), room(1.5)])),
        mesh("lamps", np.concatenate([lamp_in(-1.5), lamp_in(1.5)]), 1),
        mesh("ball", ball, motion=rigid((0, 1, 0), 0.0, (0.5, 0.3, 0.2))),
    ]
    quiet = Camera.look_at((-1.4, 0.1, 0.95), (-1.6, -0.5, -1.0), yfov_degrees=80.0)
    busy = replace(quiet, position=(1.6, 0.1, 0.95))
    t = trace(scene(meshes, [GREY, lamp], quiet))
    changed = []
    for camera in (quiet, busy):
        t.set_time(0.0, 0.0)
        view = view_of(t, camera, SIZE)
        hits = t.primary(view, PIXELS)
        seeds = seeds_of(len(PIXELS), 2)
        before = np.concatenate(shade(t, hits, seeds, view.eye), axis=1)
        t.set_time(0.4, 0.0)
        after = np.concatenate(shade(t, hits, seeds, view.eye), axis=1)
        changed.append((before != after).any(axis=1).mean())
    assert changed[0] == 0.0
    assert 0.02 < changed[1] < 0.7
