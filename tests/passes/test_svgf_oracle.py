"""The whole filter on a flight through a small room, against an independent one in double precision."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Config, Svgf, Taa, load
from raytrace.frame import FramePacket
from tests.passes.harness import HALF, PAPER, Bench
from tests.passes.room import room
from tests.passes.svgf_oracle import Oracle, exact, to_half

SIZE = (54, 38)
FRAMES = 6


def difference(image: NDArray[np.float32], expected: NDArray[np.float64], packet: FramePacket) -> NDArray[np.float64]:
    """Relative to what is expected, on surfaces; sky has no noise and must be exact."""
    surface = packet.motion[..., 3] >= 0
    np.testing.assert_array_equal(image[~surface], packet.emission[~surface][..., :3])
    return np.abs(image - expected)[surface] / (expected[surface] + 0.02)


@pytest.mark.parametrize(
    "p",
    [
        Svgf(),
        replace(PAPER, separate=False),
        Svgf(separate=False, feedback_level=-1, sigma_n=100, alpha=0.0, alpha_moments=0.0),
        Svgf(
            separate=False, feedback_level=2, iterations=3, sigma_l=1.0, sigma_z=0.5, alpha=0.5, normal_tolerance=0.99
        ),
        Svgf(separate=False, demodulate=False, variance_guided=False, depth_tolerance=0.001),
        load(None, ("svgf.preset=reference",)).svgf,
        Svgf(separate=False, prefilter=True, feedback_level=-1),
        Svgf(separate=False, color_clamp=True),
        Svgf(separate=False, color_clamp=True, color_clamp_sigma=0.25, iterations=1),
        Svgf(separate=False, normal_history=4),
    ],
    ids=[
        "default",
        "paper",
        "running mean",
        "short",
        "unguided",
        "reference",
        "prefilter",
        "clamped",
        "clamped hard",
        "growing",
    ],
)
def test_every_frame_agrees_with_double_precision(bench: Bench, p: Svgf) -> None:
    """With the same roundings to half precision only those values differ that fall on the other side of a rounding."""
    oracle = Oracle(p, to_half)
    config = Config(svgf=p, taa=Taa(enabled=False))
    for index in range(FRAMES):
        packet = room(index, SIZE)
        error = difference(bench.denoise(packet, config)["radiance"][..., :3], oracle.step(packet), packet)
        assert error.mean() < HALF / 20
        assert np.quantile(error, 0.99) < HALF
        assert error.max() < 8 * HALF


def test_half_precision_costs_no_more_than_its_roundings(bench: Bench) -> None:
    """Five iterations and the accumulation round: without bias, and sqrt(6) of one rounding in all."""
    p = Svgf(separate=False)
    oracle = Oracle(p, exact)
    config = Config(svgf=p, taa=Taa(enabled=False))
    for index in range(FRAMES):
        packet = room(index, SIZE)
        radiance = bench.denoise(packet, config)["radiance"][..., :3]
        expected = oracle.step(packet)
        error = difference(radiance, expected, packet)
        assert error.mean() < HALF
        assert np.quantile(error, 0.999) < 3 * HALF
        surface = packet.motion[..., 3] >= 0
        assert radiance[surface].mean() == pytest.approx(expected[surface].mean(), rel=HALF / 8)


def test_the_flight_keeps_its_histories_and_loses_some(bench: Bench) -> None:
    """Otherwise the comparison above would say little: taps dropped, searched around, rejected, shortened."""
    keep = ["svgf.reproject.out_reprojection"]
    masks, lengths = [], []
    for index in range(FRAMES):
        packet = room(index, SIZE)
        values = bench.denoise(packet, replace(Config(), taa=Taa(enabled=False)), keep=keep)[keep[0]]
        surface = packet.motion[..., 3] >= 0
        masks.append(np.maximum(values[surface][:, 2], 0.0).astype(int))  # below 0 is a reason, not a mask
        lengths.append(values[surface][:, 3])
    assert not masks[0].any()
    mask = np.concatenate(masks[1:])
    full, partial = mask == 15, (mask > 0) & (mask < 15)
    assert full.mean() > 0.6
    assert partial.mean() > 0.02
    assert (mask > 15).sum() > 10
    assert (mask == 0).mean() > 0.02
    assert (lengths[-1] == FRAMES - 1).mean() > 0.5
    assert len(np.unique(lengths[-1])) == FRAMES
