"""The mean of many frames against Mitsuba 3: another program, the same picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from raytrace.scene import Material, Scene, Texture
from tests.tracer.conftest import OpenTracer
from tests.tracer.peer import peer_images
from tests.tracer.scenes import cornell, with_every_material
from tests.tracer.statistics import Estimate, assert_same

pytestmark = pytest.mark.slow

F64 = NDArray[np.float64]

SIZE, BLOCK = (24, 16), 4
FRAMES, BATCHES = 800, 40
SAMPLES, RUNS = 48, 16


def textured() -> Scene:
    """The box with stripes, wide enough that no footprint is wider, on floor, ceiling and back wall."""
    what = cornell()
    stripes = np.zeros((4, 4, 3), np.uint8)
    stripes[:, :2] = (230, 120, 60)
    stripes[:, 2:] = (90, 160, 220)
    room = what.meshes[0]
    uvs = (room.vertices[:, :2] / 2).astype(np.float32)
    materials = (Material("stripes", (1.0, 1.0, 1.0), base_texture=0), *what.materials[1:])
    meshes = (replace(room, uvs=uvs), *what.meshes[1:])
    return replace(what, materials=materials, meshes=meshes, textures=(Texture("stripes", stripes),))


def metallic() -> Scene:
    """The box with both blocks of rough metal."""
    what = cornell()
    metal = Material("metal", (1.0, 1.0, 1.0), specular=True, metallic=1.0, roughness=0.6)
    meshes = [
        replace(m, materials=np.full_like(m.materials, len(what.materials))) if m.name in ("tall", "short") else m
        for m in what.meshes
    ]
    faint = (1e-6, 1e-6, 1e-6)  # what the tracer's scene gets to need no kernels of its own
    return replace(what, materials=(*what.materials, metal), meshes=tuple(meshes), sky=faint)


def blocks(images: F64) -> F64:
    """Means over squares of BLOCK pixels, (n, rows, columns, 3)."""
    n, height, width, _ = images.shape
    return np.asarray(images.reshape(n, height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3).mean(axis=(2, 4)))


@pytest.mark.parametrize("make", [cornell, textured, metallic])
def test_the_mean_of_many_frames_is_mitsubas(trace: OpenTracer, tmp_path: Path, make: Callable[[], Scene]) -> None:
    """One path per pixel, camera rays anywhere in their pixels; masking in the separable form that Mitsuba has."""
    what = make()
    ours_too = with_every_material(what) if make is metallic else what
    t = trace(ours_too, regularize=False, separable=True, threads=0)
    random = np.random.default_rng(11)
    sums = np.zeros((BATCHES, SIZE[1], SIZE[0], 3))
    for index in range(FRAMES):
        dx, dy = random.uniform(-0.5, 0.5, 2)
        camera = what.camera.with_jitter((float(dx), float(dy)))
        sums[index % BATCHES] += t.frame(index, camera, camera, SIZE).radiance()
    images = blocks(sums * (BATCHES / FRAMES)), blocks(peer_images(what, SIZE, SAMPLES, RUNS, tmp_path))
    ours, theirs = (Estimate.of(one) for one in images)
    relative = np.hypot(ours.error, theirs.error) / np.maximum(theirs.mean, 0.02)
    print(f"relMSE {float((((ours.mean - theirs.mean) / np.maximum(theirs.mean, 0.02)) ** 2).mean()):.2e}", end=" ")
    print(f"bias {float(ours.mean.mean() / theirs.mean.mean() - 1):+.2%}, standard error {float(relative.mean()):.2%}")
    assert relative.mean() < 0.04, "too noisy to tell anything"
    assert_same(ours, theirs, slack=2e-4)
    whole, peers_whole = (Estimate.of(one.mean(axis=(1, 2))) for one in images)
    assert_same(whole, peers_whole, sharp=0.04)
