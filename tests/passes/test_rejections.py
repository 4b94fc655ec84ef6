"""Why a pixel has no history: z of ``out_reprojection`` is the reason, and nothing takes it for a mask of taps."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from config import Svgf
from gl.executor import SHADER_ROOT
from gl.passes.temporal import REJECTIONS, Reproject
from raytrace.frame import FramePacket
from tests.passes.harness import DEPTH, PIXEL_SIZE, Bench, Images, accumulation, columns, frame, noise, with_sky

SIZE = (18, 12)
STILL = frame(SIZE, direct=9.0)
AWAY = (0.8, 0.0, 0.6)  # further than the tolerance from the normal of STILL


def run(bench: Bench, *packets: FramePacket, p: Svgf | None = None) -> Images:
    """The last of ``packets``, all run in turn."""
    graph = accumulation(p or Svgf())
    for packet in packets:
        images = bench.run(packet, graph)
    return images


def not_finite(values: np.ndarray) -> np.ndarray:
    spoilt = values.copy()
    spoilt[..., 0] = np.nan
    return spoilt


def grazing(cosine: float) -> FramePacket:
    """A plane at an angle of this cosine to the view."""
    return frame(SIZE, direct=9.0, gradient=(np.sqrt(1 / cosine**2 - 1) * PIXEL_SIZE * DEPTH, 0.0))


CASES: dict[str, tuple[int, list[FramePacket], Svgf | None]] = {
    "the first frame": (-1, [STILL], None),
    "sky": (-2, [STILL, with_sky(STILL, np.ones(SIZE[::-1], bool))], None),
    "a normal that is NaN": (-2, [STILL, replace(STILL, surface=not_finite(STILL.surface))], None),
    "a motion that is NaN": (-2, [STILL, replace(STILL, motion=not_finite(STILL.motion))], None),
    "beyond the edge": (-3, [STILL, frame(SIZE, direct=9.0, shift=(40.0, 0.0))], None),
    "behind the camera": (-3, [STILL, frame(SIZE, direct=9.0, previous_depth=-DEPTH)], None),
    "another object": (-4, [STILL, frame(SIZE, direct=9.0, object_id=1.0)], None),
    "where sky was": (-4, [with_sky(STILL, np.ones(SIZE[::-1], bool)), STILL], None),
    "another object, at another depth": (-4, [STILL, frame(SIZE, direct=9.0, object_id=1.0, depth=9.0)], None),
    "another depth": (-5, [STILL, frame(SIZE, direct=9.0, previous_depth=1.5 * DEPTH)], None),
    "another depth and normal": (-5, [STILL, frame(SIZE, direct=9.0, previous_depth=9.0, normal=AWAY)], None),
    "another normal": (-6, [STILL, frame(SIZE, direct=9.0, normal=AWAY)], None),
    "too grazing": (-7, [grazing(0.3), grazing(0.9)], Svgf(depth_tolerance=1.0)),
}


@pytest.mark.parametrize("case", CASES)
def test_the_reason_is_told(bench: Bench, case: str) -> None:
    reason, packets, p = CASES[case]
    *before, last = packets
    direct = last.direct / 9.0
    direct[5, 5] = np.nan
    last = replace(last, direct=direct)
    images = run(bench, *before, last, p=p)
    assert (images["reprojection"][..., 2] == reason).all()
    assert not images["reprojection"][..., 3].any()
    # A reason is no mask: as one, -1 would be all taps at once, and they would stand in for the sample that is NaN.
    np.testing.assert_array_equal(images["color"][..., :3], np.nan_to_num(direct[..., :3]))


def test_every_reason_has_a_case_and_a_constant_in_the_shader() -> None:
    assert {reason for reason, _, _ in CASES.values()} == set(REJECTIONS)
    source = (SHADER_ROOT / Reproject.shader).read_text()
    constants = [int(value) for value in re.findall(r"^const float [A-Z_]+ = (-\d+)\.0;$", source, re.MULTILINE)]
    assert constants == list(REJECTIONS)


def test_a_reset_leaves_nothing_to_look_in(bench: Bench) -> None:
    run(bench, STILL, STILL)
    images = bench.run(STILL, accumulation(), reset="key")
    assert (images["reprojection"][..., 2] == -1).all()


def test_of_several_texels_the_one_that_came_farthest_counts(bench: Bench) -> None:
    """Around (5, 5) all belong to another object but one, which is too deep, or turned away."""
    ids = np.ones(SIZE[::-1])
    ids[4, 6] = 0.0
    depth = np.full(SIZE[::-1], DEPTH)
    depth[4, 6] = 2 * DEPTH
    for before, reason in (
        (frame(SIZE, object_id=ids, depth=depth), -5),
        (frame(SIZE, object_id=ids, normal=AWAY), -6),
    ):
        bench.restart()
        z = run(bench, before, STILL)["reprojection"][..., 2]
        assert z[5, 5] == reason
        assert z[4, 6] == reason
        assert z[5, 8] == -4, "out of its reach"


def test_where_there_is_a_history_z_is_the_mask_of_its_taps(bench: Bench) -> None:
    """A wall of two objects that moves: kept, lost and out of view side by side."""
    ids = columns(SIZE, np.arange(SIZE[0]) // 9)
    before, now = (frame(SIZE, direct=noise(SIZE, 1), object_id=ids, shift=(dx, 0.0)) for dx in (0.0, 4.25))
    images = run(bench, before, now)
    z, length = images["reprojection"][..., 2], images["reprojection"][..., 3]
    assert ((z > 0) == (length > 0)).all()
    assert set(np.unique(z[z < 0])) == {-3.0, -4.0}
    assert (z[:, 0] == 1 + 2).all(), "it lies between two texels of its row"
