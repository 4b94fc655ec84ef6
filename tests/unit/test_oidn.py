"""bench/oidn.py, where Intel Open Image Denoise is installed."""

from __future__ import annotations

import numpy as np
import pytest

from bench import oidn, running
from bench.methods import METHODS
from raytrace.frame import FramePacket

needs_oidn = pytest.mark.skipif(not oidn.installed(), reason="the optional requirements-compare.txt is not installed")


def packet(noise: float) -> FramePacket:
    rng = np.random.default_rng(1)
    ones = np.ones((48, 64, 4), np.float32)
    light = (0.5 * ones * (1.0 + noise * rng.uniform(-1.0, 1.0, ones.shape))).astype(np.float32)
    surface, emission = np.zeros_like(ones), np.zeros_like(ones)
    surface[..., 2], surface[..., 3] = 1.0, 5.0
    emission[:8, :8] = 20.0
    return FramePacket(0, 0.0, light, 0.5 * light, 0.8 * ones, emission, surface, ones[..., :2] * 0.0, emission * 0.0)


@needs_oidn
@pytest.mark.parametrize("quality", ["fast", "balanced", "high"])
def test_a_noisy_wall_becomes_smooth_and_the_lamp_is_kept_out(quality):
    filtered = oidn.Filter((64, 48), quality).run(packet(0.8))
    assert filtered.shape == (48, 64, 4)
    wall = filtered[12:, 12:, :3]
    noisy = packet(0.8).radiance()[12:, 12:]
    assert wall.std() < 0.2 * noisy.std()
    assert wall.mean() == pytest.approx(noisy.mean(), rel=0.05)
    # The lamp's light was added after the filter: its pixels are the wall's and 20.
    assert filtered[:8, :8, :3].mean() == pytest.approx(20.0 + wall.mean(), abs=0.03)


@needs_oidn
def test_a_filter_may_be_used_again():
    once = oidn.Filter((64, 48), "fast")
    first = once.run(packet(0.5))
    once.run(packet(0.1))
    np.testing.assert_array_equal(once.run(packet(0.5)), first)


def test_without_it_its_rows_are_left_out(monkeypatch):
    monkeypatch.setattr(oidn, "installed", lambda: False)
    rest = running.available(METHODS)
    assert not any(method.quality for method in rest)
    assert len(rest) == len(METHODS) - 3
