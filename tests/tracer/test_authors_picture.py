"""A scene that nobody here made against the picture that its author made of it with a renderer of his own.

His paths go on until they are lost, the program's end after the second surface. What they leave out is added here by
:mod:`tests.tracer.brute_force`, so that the rest must be what the program makes of the file: shapes, camera, colours of
surfaces and lamp.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Config
from images import read_exr
from raytrace.camera import Camera
from raytrace.scene import Scene
from session import open_shot
from tests.tracer.brute_force import Points, Soup, lit, points_on

F64 = NDArray[np.float64]

FILES = Path(__file__).parents[1] / "scene_files"
SIDE = 32
STRATA = 16
SAMPLES = STRATA**2
"""Positions within a pixel, one in each cell of a square: the lamp, which has half of the light, is a pixel high."""
LONG = 28
"""Of them those whose paths go on: what these add is a seventh of the light."""


def soup_of(scene: Scene) -> Soup:
    materials = scene.materials
    used = np.concatenate([mesh.materials for mesh in scene.meshes])
    return Soup(
        np.concatenate([mesh.vertices[mesh.faces] for mesh in scene.meshes]),
        np.array([materials[k].base_color for k in used]),
        np.array([materials[k].emission for k in used]),
    )


def camera_rays(camera: Camera, jitter: F64) -> tuple[F64, F64]:
    """Origins and directions of one ray through each pixel, row 0 at the bottom, shifted by ``jitter`` of a pixel."""
    right, up, forward = camera.basis()
    rows, columns = np.mgrid[0:SIDE, 0:SIDE]
    x, y = ((k + 0.5 + j) * 2 / SIDE - 1 for k, j in zip((columns, rows), jitter, strict=True))
    directions = forward + np.tan(camera.yfov / 2) * (x[..., None] * right + y[..., None] * up)
    return np.tile(camera.position, (SIDE * SIDE, 1)), directions.reshape(-1, 3)


def further_light(soup: Soup, origins: F64, directions: F64, random: np.random.Generator) -> F64:
    """What arrives over two bounces and more, (n, 3) radiance; bounces go by the cosine, and end by roulette."""
    light, throughput = np.zeros((len(origins), 3)), np.ones((len(origins), 3))
    alive, bounces = np.arange(len(origins)), 0
    while len(alive):
        at = points_on(soup, origins, directions)
        hit = at.index >= 0
        alive, at = alive[hit], Points(at.index[hit], at.point[hit], at.normal[hit])
        throughput[alive] *= soup.albedo[at.index]
        if bounces >= 2:
            light[alive] += throughput[alive] * lit(soup, at, random)
        chance = np.minimum(throughput[alive].max(axis=1), 1.0)
        stays = random.random(len(alive)) < chance
        alive, at = alive[stays], Points(at.index[stays], at.point[stays], at.normal[stays])
        throughput[alive] /= chance[stays, None]
        sphere = random.normal(size=at.point.shape)
        origins, directions = at.point, at.normal + sphere / np.linalg.norm(sphere, axis=1, keepdims=True)
        bounces += 1
    return light


@pytest.fixture(scope="module")
def pictures() -> tuple[F64, F64]:
    """The program's converged picture, what longer paths add: (SIDE, SIDE, 3) linear radiance each, by a box filter."""
    config = Config()
    config = replace(config, render=replace(config.render, width=SIDE, height=SIDE))
    shot = open_shot(str(FILES / "cornell_bitterli.glb"), config, None, animate=False)
    camera, soup = shot.camera(0), soup_of(shot.scene.scene)
    random = np.random.default_rng(1)
    order = random.permutation(SAMPLES)
    own, more = np.zeros((2, SIDE, SIDE, 3))
    with shot.tracer as tracer:
        for sample in range(SAMPLES):
            jitter = (np.array(divmod(order[sample], STRATA)) + random.random(2)) / STRATA - 0.5
            view = camera.with_jitter((float(jitter[0]), float(jitter[1])))
            own += tracer.reference_frame(sample, view, shot.size, 0.0).radiance() / SAMPLES
            if sample < LONG:
                rays = camera_rays(camera, jitter)
                more += further_light(soup, *rays, random).reshape(more.shape) / LONG
    return own, more


def test_mean_is_the_authors(pictures: tuple[F64, F64]) -> None:
    own, more = pictures
    authors = read_exr(FILES / "cornell_bitterli.exr").mean((0, 1))
    np.testing.assert_allclose(authors, (0.1963, 0.1275, 0.0361), atol=6e-5)  # the file is what it is said to be
    np.testing.assert_allclose((own + more).mean((0, 1)), authors, rtol=0.01)
    assert ((own.mean((0, 1)) / authors) < 0.97).all()  # or the paths that were added would tell nothing


def test_layout_is_the_authors(pictures: tuple[F64, F64]) -> None:
    """Pixel by pixel: neither mirrored nor turned, and every surface as bright as it was."""
    picture = pictures[0] + pictures[1]
    authors = read_exr(FILES / "cornell_bitterli.exr").astype(np.float64)
    lamp = authors.max(axis=2) > 1.0
    assert 5 < lamp.sum() < 20
    np.testing.assert_allclose(picture[lamp].mean(0), authors[lamp].mean(0), rtol=0.02)
    error = np.sqrt(np.mean((picture - authors)[~lamp] ** 2))
    mirrored = np.sqrt(np.mean((picture - authors[:, ::-1])[~(lamp | lamp[:, ::-1])] ** 2))
    assert error < 0.02  # most of it noise of the paths that were added
    assert mirrored > 3 * error
