"""The whole filter on a flight through a small room, against an independent one in double precision."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from config import Bmfr, Config, Taa, load
from raytrace.frame import FramePacket
from tests.passes.bmfr_oracle import Oracle
from tests.passes.harness import HALF, Bench
from tests.passes.room import room
from tests.passes.svgf_oracle import to_half
from tests.passes.test_svgf_oracle import difference

SIZE = (54, 38)
FRAMES = 6


@pytest.mark.parametrize(
    "p",
    [
        load(None, ("bmfr.preset=paper",)).bmfr,
        load(None, ("bmfr.preset=reference",)).bmfr,
        Bmfr(),
        Bmfr(part=8),
        Bmfr(part=8, caution=0.0),
        Bmfr(part=12, block=24, features="1,w", regularization="rank"),
        Bmfr(part=0, regularization="both", block=16, alpha=0.0, alpha_fit=0.0),
        Bmfr(part=0, features="1,depth,w,albedo,n,w3", regularization="noise", noise=0.1, position_tolerance=1.5),
        Bmfr(part=0, features="1", regularization="rank", block=8, normal_tolerance=0.001, max_history=10),
    ],
    ids=[
        *("paper", "reference", "best", "quarters", "without doubt", "rank test of halves"),
        *("small blocks", "other features", "mean of a block"),
    ],
)
def test_every_frame_agrees_with_double_precision(bench: Bench, p: Bmfr) -> None:
    """With the same roundings to half precision only those values differ that fall on the other side of a rounding."""
    oracle = Oracle(p, to_half)
    config = Config(bmfr=p, taa=Taa(enabled=False))
    for index in range(FRAMES):
        packet = room(index, SIZE)
        error = difference(bench.denoise(packet, config, "bmfr")["radiance"][..., :3], oracle.step(packet), packet)
        assert error.mean() < HALF / 4
        assert np.quantile(error, 0.99) < 2 * HALF
        assert error.max() < 32 * HALF


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (20, 3), (31, 33)])
def test_pictures_smaller_than_a_block_agree(bench: Bench, size: tuple[int, int]) -> None:
    """They go on as their mirror image once, and as their last pixels from there on."""
    p = Bmfr(block=32, part=0, features="1")
    packet = room(0, size)
    radiance = bench.denoise(packet, Config(bmfr=p, taa=Taa(enabled=False)), "bmfr")["radiance"][..., :3]
    assert difference(radiance, Oracle(p, to_half).step(packet), packet).max(initial=0.0) < 2 * HALF


def test_camera_rays_may_pass_anywhere_in_their_pixel(bench: Bench) -> None:
    """Positions follow the jitter, of which the fit of a slanted wall takes notice."""
    p = Bmfr(part=0, regularization="rank", features="1,w3")
    packet = replace(room(3, SIZE), jitter=(0.45, -0.4))
    config = Config(bmfr=p, taa=Taa(enabled=False))
    radiance = bench.denoise(packet, config, "bmfr")["radiance"][..., :3]
    with_jitter, without = (Oracle(p, to_half).step(q) for q in (packet, replace(packet, jitter=(0.0, 0.0))))
    assert difference(radiance, with_jitter, packet).max() < 4 * HALF
    assert difference(radiance, without, packet).max() > 8 * HALF


def test_the_flight_keeps_its_histories_and_loses_some(bench: Bench) -> None:
    """Otherwise the comparison above would say little: taps dropped, histories rejected."""
    keep = ["bmfr.accumulate.out_reprojection"]
    masks, lengths = [], []
    for index in range(FRAMES):
        packet: FramePacket = room(index, SIZE)
        values = bench.denoise(packet, Config(taa=Taa(enabled=False)), "bmfr", keep=keep)[keep[0]]
        surface = packet.motion[..., 3] >= 0
        masks.append(values[surface][:, 2].astype(int))
        lengths.append(values[surface][:, 3])
    assert not masks[0].any()
    mask = np.concatenate(masks[1:])
    assert (mask == 15).mean() > 0.6
    assert ((mask > 0) & (mask < 15)).mean() > 0.02
    assert (mask == 0).mean() > 0.02
    assert (lengths[-1] == FRAMES - 1).mean() > 0.5
