"""Filtered frames must be nearer to converged ones than the noisy frames are, by stated margins.

That catches what a comparison with stored pictures blesses: a filter that does the same wrong thing as yesterday. The
references are 1024 paths per pixel of two frames of a flight through the Cornell box, radiance in half precision;
``make references`` traces them anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

import assets
from bench.metrics import rmse, temporal_difference
from config import Bmfr, Config, Firefly, Svgf, Taa, load
from gl.renderer import Renderer, read
from raytrace.compiled import compile_scene
from raytrace.frame import FramePacket
from raytrace.integrator import Tracer
from raytrace.shot import Shot, modulate

F32 = NDArray[np.float32]

REFERENCES = Path(__file__).parent / "cornell_flight.npz"
SIZE = (160, 90)
LAST = 23
"""The frame that is scored, counted from 0; the one before it is there for differences in time."""
PATHS = 1024


class Case(NamedTuple):
    """All frames of the flight, radiance of the last two converged, and which pixels count: lamps do not."""

    shot: Shot
    packets: list[FramePacket]
    references: tuple[F32, F32]
    mask: NDArray[np.bool_]


@pytest.fixture(scope="module")
def case(regenerate: bool) -> Iterator[Case]:
    scene = compile_scene(assets.build("cornell"))
    with Tracer(scene) as tracer:
        shot = Shot(scene, tracer, SIZE, "flight")
        packets = [shot.frame(index) for index in range(LAST + 1)]
        if regenerate:
            traced = {
                f"frame{i}": modulate(packets[i], *shot.reference(i, PATHS))[..., :3].astype(np.float16)
                for i in (LAST - 1, LAST)
            }
            np.savez_compressed(REFERENCES, allow_pickle=False, **traced)
        with np.load(REFERENCES) as stored:
            before, last = (stored[f"frame{i}"].astype(np.float32) for i in (LAST - 1, LAST))
        lamps = sum(packets[i].emission[..., :3].max(axis=2) for i in (LAST - 1, LAST))
        yield Case(shot, packets, (before, last), lamps == 0.0)


class Score(NamedTuple):
    """Both as fractions of the noisy frames': error of the last frame, and of its difference to the one before;
    ``energy``: mean radiance as a fraction of the reference's."""

    error: float
    flicker: float
    energy: float


def score(
    ctx: moderngl.Context, case: Case, denoiser: str, parameters: Svgf | Bmfr, firefly: Firefly | None = None
) -> Score:
    renderer = Renderer(ctx)
    config = Config(taa=Taa(enabled=False), firefly=firefly or Firefly())
    own = {"bmfr": parameters} if isinstance(parameters, Bmfr) else {"svgf": parameters}
    config = replace(config, **own)
    images: list[F32] = []
    for packet in case.packets:
        result = renderer.run(packet, config, denoiser)
        if packet.index >= LAST - 1:
            images.append(read(result.outputs["radiance"])[..., :3])
    renderer.release()
    before, last = case.references

    def both(sequence: list[F32]) -> tuple[float, float]:
        flicker = temporal_difference(sequence[1], sequence[0], last, before, case.mask)
        return rmse(sequence[1], last, case.mask), flicker

    error, flicker = both(images)
    noisy_error, noisy_flicker = both([packet.radiance() for packet in case.packets[-2:]])
    energy = float(images[1][case.mask].mean() / last[case.mask].mean())
    return Score(error / noisy_error, flicker / noisy_flicker, energy)


@pytest.fixture(scope="module")
def whole(_session_context: moderngl.Context, case: Case) -> Score:
    """Of the filter as it is set up by default."""
    with _session_context:
        return score(_session_context, case, "svgf", Svgf())


def test_the_references_are_of_this_scene(case: Case) -> None:
    """64 other paths differ from them by what 64 and 1024 paths must differ: 8.2 times less than one path does."""
    fresh = modulate(case.packets[LAST], *case.shot.reference(LAST, 64))[..., :3]
    stored = case.references[1]
    noise = np.sqrt(1 / 64 + 1 / PATHS)
    one_path = rmse(case.packets[LAST].radiance(), stored, case.mask)
    assert rmse(fresh, stored, case.mask) == pytest.approx(one_path * noise, rel=0.2)
    assert fresh[case.mask].mean() == pytest.approx(stored[case.mask].mean(), rel=0.01)


def test_svgf_beats_the_noisy_frame(whole: Score) -> None:
    assert whole.error < 0.17
    assert whole.flicker < 0.06
    assert whole.energy == pytest.approx(1.0, abs=0.03)


def test_the_paper_s_parameters_do_nearly_as_well(ctx: moderngl.Context, case: Case, whole: Score) -> None:
    paper = score(ctx, case, "svgf", load(None, ("svgf.preset=paper",)).svgf)
    assert whole.error < paper.error < 0.21
    assert paper.flicker < 0.06
    assert paper.energy == pytest.approx(1.0, abs=0.03)


def test_the_constants_of_the_known_implementation_trade_error_for_calm(
    ctx: moderngl.Context, case: Case, whole: Score
) -> None:
    """What the second iteration has blurred is fed back, and hardly anything new with it: shadows wash out."""
    reference = score(ctx, case, "svgf", load(None, ("svgf.preset=reference",)).svgf)
    assert 1.5 * whole.error < reference.error < 0.45
    assert reference.flicker < 0.05
    assert reference.energy == pytest.approx(1.0, abs=0.03)


def test_a_clamped_history_costs_little_where_no_light_changes(ctx: moderngl.Context, case: Case, whole: Score) -> None:
    clamped = score(ctx, case, "svgf", Svgf(color_clamp=True))
    assert clamped.error < 1.1 * whole.error
    assert clamped.flicker < 1.1 * whole.flicker
    assert clamped.energy == pytest.approx(whole.energy, abs=0.02)


@pytest.mark.parametrize("firefly", [Firefly("clamp", max_radiance=1.0), Firefly("variance")], ids=lambda p: p.mode)
def test_rejecting_fireflies_takes_little_of_the_light(ctx: moderngl.Context, case: Case, firefly: Firefly) -> None:
    """In the noisy frame itself."""
    plain = score(ctx, case, "none", Svgf())
    cut = score(ctx, case, "none", Svgf(), firefly)
    assert 0.985 * plain.energy < cut.energy < plain.energy
    assert cut.error < plain.error


def test_both_signals_together_do_nearly_as_well(ctx: moderngl.Context, case: Case) -> None:
    joint = score(ctx, case, "svgf", Svgf(separate=False))
    assert joint.error < 0.19
    assert joint.flicker < 0.07
    assert joint.energy == pytest.approx(1.0, abs=0.03)


BAD = {
    "iterations": (Svgf(iterations=0), 1.05, 2.0),
    "history": (Svgf(temporal=False), 1.2, 1.0),
    "variance": (Svgf(variance_guided=False), 1.2, 1.0),
    "blending": (Svgf(alpha=1.0), 1.2, 1.0),
}
"""What is missing, and at least so many times the error and the flicker for it. In so small a picture the wavelet's
taps reach across shadows, and most of what it is worth is calm."""


@pytest.mark.parametrize("part", BAD)
def test_every_part_of_it_is_needed(ctx: moderngl.Context, case: Case, whole: Score, part: str) -> None:
    parameters, error, flicker = BAD[part]
    without = score(ctx, case, "svgf", parameters)
    assert without.error > error * whole.error
    assert without.flicker > flicker * whole.flicker


def test_accumulation_alone_lies_between(ctx: moderngl.Context, case: Case, whole: Score) -> None:
    """With a share of 0.2 of each new frame a ninth of the variance stays: a third of the error."""
    alone = score(ctx, case, "accumulate", Svgf(alpha=0.2))
    assert 1.2 * whole.error < alone.error < 0.4
    assert 3.0 * whole.flicker < alone.flicker < 0.4
    assert alone.energy == pytest.approx(1.0, abs=0.01)


@pytest.fixture(scope="module")
def regressed(_session_context: moderngl.Context, case: Case) -> Score:
    """Of blockwise regression as it is set up by default."""
    with _session_context:
        return score(_session_context, case, "bmfr", Bmfr())


def test_bmfr_beats_the_noisy_frame(regressed: Score) -> None:
    assert regressed.error < 0.14
    assert regressed.flicker < 0.036
    assert regressed.energy == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("preset", ["paper", "reference"])
def test_without_parts_narrow_shadows_go(ctx: moderngl.Context, case: Case, regressed: Score, preset: str) -> None:
    """In so small a picture a block of 32 pixels holds much of the room."""
    published = score(ctx, case, "bmfr", load(None, (f"bmfr.preset={preset}",)).bmfr)
    assert 1.4 * regressed.error < published.error < 0.22
    assert published.flicker < 0.05
    assert published.energy == pytest.approx(1.0, abs=0.03)


WORSE = {
    "second accumulation": (Bmfr(alpha_fit=1.0), 1.05, 3.5),
    "parts": (Bmfr(part=0), 1.3, 1.2),
    "squares": (Bmfr(features="1,n,w"), 1.2, 1.1),
    "positions": (Bmfr(features="1,n"), 2.0, 1.3),
    "features": (Bmfr(features="1"), 3.0, 1.5),
    "little noise": (Bmfr(regularization="noise", noise=1.0), 2.0, 1.2),
}
"""What is missing, and at least so many times the error and the flicker for it."""


@pytest.mark.parametrize("part", WORSE)
def test_every_part_of_the_regression_is_needed(ctx: moderngl.Context, case: Case, regressed: Score, part: str) -> None:
    parameters, error, flicker = WORSE[part]
    without = score(ctx, case, "bmfr", parameters)
    assert without.error > error * regressed.error
    assert without.flicker > flicker * regressed.flicker
