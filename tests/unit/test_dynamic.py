"""Scenes in which something changes, and how methods are measured on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest

from assets import dynamics
from bench.dynamic import FILMS, Film, compare, play, shoot
from bench.methods import NOISY, Method
from bench.references import ReferenceCache
from config import Config, load
from gl.renderer import Renderer
from raytrace.scene import Scene

SIZE = (48, 27)


@pytest.mark.parametrize("build", [film.build for film in FILMS.values()], ids=list(FILMS))
def test_what_moves_is_back_after_sixty_frames(build: Callable[[], Scene]) -> None:
    scene = build()
    moving = [mesh for mesh in scene.meshes if mesh.motion is not None]
    for mesh in moving:
        assert mesh.motion is not None
        np.testing.assert_array_equal(mesh.motion(0.0), mesh.motion(2.0))
        assert not np.allclose(mesh.motion(0.0), mesh.motion(0.25))
    names = {mesh.name for mesh in moving}
    expected = {"crossing": {"crossing block"}, "rotating": {"tall block"}, "moving": {"lamp", "tall block"}}
    assert names == expected.get(scene.name, set())
    assert len({mesh.name for mesh in scene.meshes}) == len(scene.meshes)


def test_the_lamp_flickers_goes_off_and_on() -> None:
    power = [dynamics.lamp_power(frame / dynamics.FPS) for frame in range(60)]
    assert power[: dynamics.FLICKER[0]] == [1.0] * dynamics.FLICKER[0]
    flickering = power[slice(*dynamics.FLICKER)]
    assert len(set(flickering)) > 5
    assert min(flickering) > 0.0
    assert set(power[slice(*dynamics.OFF)]) == {0.0}
    assert set(power[dynamics.ON :]) == {1.0}
    lamps = [m for m in dynamics.switching().materials if m.emits]
    assert [m.dimmer for m in lamps] == [dynamics.lamp_power]


def test_every_film_is_scored_in_pairs_that_it_has() -> None:
    for film in FILMS.values():
        assert film.scored == tuple(sorted(set(film.scored)))
        assert film.scored[-1] < film.frames
        assert any(frame + 1 in film.scored for frame in film.scored)
        short = film.first(40)
        assert (short.frames, short.scored) == (40, tuple(i for i in film.scored if i < 40))
        assert film.first(1000) == film


def test_a_switch_is_followed_by_the_method_that_knows_of_it(ctx: moderngl.Context, tmp_path: Path) -> None:
    """Small and short: each method gets its own frames, errors are those against the references."""
    lit = dynamics.still()
    materials = tuple(replace(m, dimmer=lambda time: float(time < 6.5 / dynamics.FPS)) for m in lit.materials)
    film = Film("off", lambda: replace(lit, materials=materials), 10, (5, 6, 7, 8, 9))
    footage = shoot(film, Config(), SIZE, 8, ReferenceCache(tmp_path))
    try:
        methods = [(NOISY, Config()), (Method("svgf", "svgf"), Config()), (Method("asvgf", "asvgf"), Config())]
        noisy, svgf, asvgf = compare(footage, methods, lambda: Renderer(ctx))
        assert noisy.rmse_ratio == noisy.temporal_ratio == 1.0
        before = footage.mean(6)
        assert before > 0.0
        assert footage.mean(7) == 0.0
        assert svgf.means[8] > 0.3 * before
        assert asvgf.means[8] < 0.05 * before
        assert asvgf.temporal < svgf.temporal
        assert asvgf.rmse < svgf.rmse
        assert all(packet.temporal_gradient is None for packet in footage.frames(""))
        assert all(packet.temporal_gradient is not None for packet in footage.frames("random"))
        seen: list[int] = []
        short = load(None, ("svgf.iterations=0",))
        play(footage, Method("svgf", "svgf"), short, lambda: Renderer(ctx), lambda index, image: seen.append(index))
        assert seen == list(range(film.frames))
    finally:
        footage.shot.tracer.close()
