"""Where light changes, what knows of it is nearer to converged frames by stated margins; elsewhere it is no farther."""

from __future__ import annotations

from pathlib import Path

import moderngl

from bench.dynamic import FILMS, Outcome, compare, shoot
from bench.methods import NOISY, Method
from bench.references import ReferenceCache
from config import Config, load
from gl.renderer import Renderer

SIZE = (96, 54)
PATHS = 256


def outcomes(ctx: moderngl.Context, folder: Path, film: str, *settings: tuple[str, str]) -> list[Outcome]:
    """Of a method with settings each, on the first 26 frames of ``film``."""
    footage = shoot(FILMS[film].first(26), Config(), SIZE, PATHS, ReferenceCache(folder))
    try:
        methods = [(Method(f"{name} {sets}", name), load(None, sets.split())) for name, sets in settings]
        return list(compare(footage, [(NOISY, Config()), *methods], lambda: Renderer(ctx))[1:])
    finally:
        footage.shot.tracer.close()


def test_the_lamp_flickers(ctx: moderngl.Context, tmp_path: Path) -> None:
    svgf, asvgf, bmfr, adaptive = outcomes(
        ctx, tmp_path, "switching", ("svgf", ""), ("asvgf", ""), ("bmfr", ""), ("bmfr", "bmfr.adaptive=true")
    )
    assert asvgf.rmse_ratio < 0.5 * svgf.rmse_ratio
    assert asvgf.temporal_ratio < 1.1 * svgf.temporal_ratio  # light that lingers does not flicker
    assert adaptive.rmse_ratio < 0.5 * bmfr.rmse_ratio


def test_nothing_moves(ctx: moderngl.Context, tmp_path: Path) -> None:
    svgf, asvgf = outcomes(ctx, tmp_path, "still", ("svgf", ""), ("asvgf", ""))
    assert asvgf.rmse_ratio < 1.04 * svgf.rmse_ratio
    assert asvgf.temporal_ratio < 1.1 * svgf.temporal_ratio
