"""The tracer's frames in the filters: what the guides must be for histories and edges to work at all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Config, Svgf, Taa
from raytrace.camera import Camera
from raytrace.frame import FramePacket
from raytrace.integrator import Tracer
from raytrace.scene import Material
from raytrace.shot import jitter_of
from tests.passes.harness import Bench
from tests.tracer.scenes import cornell, placed, placed_camera, rigid, tracer

F32 = NDArray[np.float32]

SIZE = (66, 38)
CONFIG = Config(taa=Taa(enabled=False))
REPROJECTION = "svgf.reproject.out_reprojection"
BOX = cornell()


@pytest.fixture(scope="module")
def box() -> Iterator[Tracer]:
    with tracer(BOX) as opened:
        yield opened


def found(bench: Bench, packet: FramePacket) -> tuple[F32, NDArray[np.bool_]]:
    """What the reprojection of the next frame finds, (H, W, 4), and which pixels show a surface."""
    return bench.denoise(packet, CONFIG, keep=[REPROJECTION])[REPROJECTION], packet.motion[..., 3] >= 0


def looking(position: tuple[float, float, float]) -> Camera:
    return Camera.look_at(position, (0.0, 0.0, 0.0), yfov_degrees=42.0)


def test_jitter_moves_nothing(bench: Bench, box: Tracer) -> None:
    for index in range(9):
        camera = BOX.camera.with_jitter(jitter_of(index))
        reprojection, surface = found(bench, box.frame(index, camera, BOX.camera, SIZE))
    # Projected through jittered cameras, the same point would seem to move by their difference.
    assert np.hypot(*np.subtract(jitter_of(8), jitter_of(7))) > 0.3
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    np.testing.assert_array_equal(reprojection[surface][:, :2], np.stack([x, y], -1)[surface])
    # At silhouettes another object may have been seen in between.
    assert (reprojection[surface][:, 3] == 8).mean() > 0.85


def test_a_camera_that_moves_forwards_keeps_its_histories(bench: Bench, box: Tracer) -> None:
    """6 % nearer in one frame, which is more than the tolerance of the depth test."""
    far, near = looking((0.0, 0.0, 4.0)), looking((0.0, 0.0, 3.7))
    first, second = box.frame(0, far, far, SIZE), box.frame(1, near, far, SIZE)
    found(bench, first)
    reprojection, surface = found(bench, second)
    x, y = (np.clip(np.rint(reprojection[..., k]).astype(int), 0, SIZE[k] - 1) for k in (0, 1))
    then = first.surface[y, x, 3]
    now = second.surface[..., 3]
    slope = np.abs(second.gradient).sum(-1)
    unguarded = np.abs(then - now) <= Svgf().depth_tolerance * now + slope
    back = surface & (slope < 0.01)  # what faces the camera has no slope to hide behind
    assert unguarded[back].mean() < 0.05
    assert (reprojection[back][:, 3] == 1).mean() > 0.95
    assert (reprojection[surface][:, 3] == 1).mean() > 0.9


def test_slopes_at_silhouettes_are_those_of_the_surface(box: Tracer) -> None:
    """A finite difference across a silhouette is a tolerance that lets everything through."""
    packet = box.frame(0, BOX.camera, BOX.camera, SIZE)
    depth, ids = packet.surface[..., 3], packet.motion[..., 3]
    difference = np.abs(np.diff(depth, axis=1))
    edge = (ids[:, 1:] != ids[:, :-1]) & (difference > 0.3)
    assert edge.sum() > 20
    exact = np.abs(packet.gradient[:, :-1, 0])
    assert np.median(difference[edge] / np.maximum(exact[edge], 1e-3)) > 10
    same = (ids[:, 1:] == ids[:, :-1]) & (np.abs(packet.surface[:, 1:, :3] - packet.surface[:, :-1, :3]).max(-1) < 1e-3)
    np.testing.assert_allclose(exact[same], difference[same], rtol=0.2, atol=2e-3)


def test_black_surfaces(bench: Bench) -> None:
    """Illumination is never divided by an albedo, so that there is no 0 / 0 and no floor to give back what came in."""
    black = tuple(
        Material(m.name, (0.0, 1e-9, 0.5), emission=m.emission) if m.name == "white" else m for m in BOX.materials
    )
    dark = replace(BOX, materials=black)
    with tracer(BOX) as t:
        white_packet = t.frame(0, BOX.camera, BOX.camera, SIZE)
    with tracer(dark) as t:
        packets = [t.frame(index, BOX.camera, BOX.camera, SIZE) for index in range(4)]
    packet = packets[0]
    changed = (packet.albedo[..., 3] == 1) & (packet.albedo[..., 0] == 0)
    assert changed.mean() > 0.3
    radiance = packet.direct[..., :3] * packet.albedo[..., :3]
    with np.errstate(divide="ignore", invalid="ignore"):
        divided = radiance / packet.albedo[..., :3]
    assert np.isnan(divided[changed]).any()
    # What reaches the surface first does not depend on what the surface is made of.
    np.testing.assert_array_equal(packet.direct, white_packet.direct)
    for packet in packets:
        out = bench.denoise(packet, CONFIG)["radiance"][..., :3]
        assert np.isfinite(out).all()
        np.testing.assert_array_equal(out[changed][:, 0], 0.0)
        assert out[changed][:, 1].max() < 1e-6
    assert out[changed][:, 2].mean() > 0.01


def test_a_scene_far_from_its_origin(bench: Bench, box: Tracer) -> None:
    """100 km away, where single precision has steps of 8 mm: relative to the scene's centre nothing changes."""
    offset = (1e5, -3e4, 7e4)
    assert np.float32(1e5) + np.float32(1e-3) == np.float32(1e5)  # a ray's constant offset would be lost
    with tracer(placed(BOX, 1.0, offset)) as far:
        for index in range(3):
            step = 0.02 * index
            now, then = (looking((0.1 + step + shift, 0.05, 3.6)) for shift in (0.0, -0.02 * (index > 0)))
            here = box.frame(index, now, then, SIZE)
            there = far.frame(index, placed_camera(now, 1.0, offset), placed_camera(then, 1.0, offset), SIZE)
            reprojection, surface = found(bench, there)
            lit = here.direct[..., :3].sum(-1) > 0
            assert ((there.direct[..., :3].sum(-1) > 0) == lit).mean() > 0.995  # no surface shadows itself
            np.testing.assert_allclose(there.motion[surface], here.motion[surface], atol=1e-4)
    assert (reprojection[surface][:, 3] == 2).mean() > 0.85


def test_a_turning_block_keeps_its_history(bench: Bench) -> None:
    """By 40 degrees in one frame: the normal of now is none of those seen before."""
    turn = np.radians(40.0) * 30
    what = cornell(motion=rigid((0, 1, 0), turn, (0, 0, 0), pivot=(0.45, 0.0, 0.25)))
    above = Camera.look_at((0.45, 2.5, 2.5), (0.45, -0.7, 0.25), yfov_degrees=25.0)
    with tracer(what) as t:
        found(bench, t.frame(0, above, above, SIZE, 0.0, 0.0))
        packet = t.frame(1, above, above, SIZE, 1 / 30, 0.0)
    reprojection, _ = found(bench, packet)
    assert packet.prev_normal is not None
    moving = np.abs(packet.motion[..., :2]).max(-1) > 0
    sides = moving & (np.abs(packet.surface[..., 1]) < 0.5)
    seen_before = sides & (packet.prev_normal[..., 2] > 0.3)  # turned away from the camera otherwise
    assert seen_before.sum() > 40
    unguarded = (packet.surface[..., :3] * packet.prev_normal[..., :3]).sum(-1) >= Svgf().normal_tolerance
    assert not unguarded[seen_before].any()
    assert (reprojection[seen_before][:, 3] == 1).mean() > 0.8
