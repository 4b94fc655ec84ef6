"""Faults put in where they would do most harm: two frames later nothing of them is left, in no texture of the frame.

A fault comes with a frame, as a sample or a guide that is no number, or it is written into the executor's own memory of
a history, as a pass without guards would have. What the guards are for is in test_not_finite.py; here every method and
every texture is looked at, whichever they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config import Config, Display, load
from gl.formats import lookup
from gl.graph import Graph, Plan
from gl.pipelines import DENOISERS, FrameTraits, build
from gl.renderer import read
from presets import PRESETS
from raytrace.frame import FramePacket
from tests.passes.harness import PIXEL_SIZE, Bench, frame

SIZE = (31, 33)
SPOILED = (((5, 7), 0), ((5, 8), 1), ((20, 0), 2), ((12, 17), 3), ((32, 30), slice(None)))
"""(y, x) and which channels, those that there are: two side by side, one at an edge; all channels in a corner."""

VALUES = {"nan": np.nan, "inf": np.inf, "-inf": -np.inf}

DISPLAY = Display(auto_exposure=True, mark_bad="on")

METHODS: dict[str, tuple[str, Config]] = {
    f"svgf, {preset}": ("svgf", replace(load(None, (f"svgf.preset={preset}",)), display=DISPLAY))
    for preset in PRESETS["svgf"]
}
METHODS |= {name: (name, Config(display=DISPLAY)) for name in DENOISERS if name not in ("none", "reference", "svgf")}

IMAGES = {
    "samples": ("direct", "indirect"),
    "albedo": ("albedo",),
    "emission": ("emission",),
    "surface": ("surface",),
    "gradient": ("gradient",),
    "motion": ("motion",),
    "every guide": ("albedo", "emission", "surface", "gradient", "motion", "prev_normal"),
}


def still() -> FramePacket:
    """Light without noise on a patterned wall, so that a picture that has recovered is the one from before."""
    width, height = SIZE
    pattern = np.random.default_rng(3).uniform(0.2, 0.9, (height, width, 3))
    return frame(SIZE, direct=(1.0, 0.75, 0.5), indirect=0.25, albedo=pattern, emission=0.125,
                 previous_normal=(0.0, 0.0, 1.0))  # fmt: skip


def spoiled(image: NDArray[np.float32], value: float) -> NDArray[np.float32]:
    image = image.copy()
    height, width, channels = image.shape
    for (y, x), channel in SPOILED:
        if isinstance(channel, slice) or channel < channels:
            image[y % height, x % width, channel] = value
    return image


def spoil(packet: FramePacket, images: tuple[str, ...], value: float) -> FramePacket:
    changed = {image: spoiled(getattr(packet, image), value) for image in images}
    return replace(packet, **changed)  # type: ignore[arg-type]


def spoil_history(bench: Bench, name: str, value: float) -> None:
    """Write ``value`` into what the next frame reads as its history ``name``."""
    pair = bench.executor._histories._pairs[name]
    pair.read.write(spoiled(read(pair.read), value).astype(lookup(pair.fmt).numpy).tobytes())


def graph(method: str) -> Graph:
    denoiser, config = METHODS[method]
    return build(config, denoiser, FrameTraits(moving=True, pixel_size=PIXEL_SIZE), split=True)


def textures(plan: Plan) -> list[str]:
    return [tex.name for node in plan.passes for tex in node.writes.values()]


def recover(bench: Bench, method: str, fault: Callable[[FramePacket], FramePacket]) -> None:
    """Four frames, then one with ``fault`` and one without: all its textures are finite, its picture is as before."""
    packet, g = still(), graph(method)
    keep = textures(g.compile())
    bench.restart()
    for _ in range(4):
        before = bench.run(packet, graph(method))
    radiance, display = before["radiance"], before["display"]
    bench.run(fault(packet), graph(method))
    after = bench.run(packet, g, keep)
    for name in (*keep, *(tex.name for tex in after.result.plan.imports)):
        assert np.isfinite(after[name]).all(), name
    np.testing.assert_allclose(after["radiance"], radiance, rtol=2e-3)
    np.testing.assert_allclose(after["display"], display, atol=8.0 / 255)  # it blends with what the fault looked like
    assert set(after.histories.values()) == {"valid"}


@pytest.mark.parametrize("value", VALUES.values(), ids=VALUES)
@pytest.mark.parametrize("images", IMAGES.values(), ids=IMAGES)
@pytest.mark.parametrize("method", METHODS)
def test_from_a_frame(bench: Bench, method: str, images: tuple[str, ...], value: float) -> None:
    recover(bench, method, lambda packet: spoil(packet, images, value))


@pytest.mark.parametrize("value", VALUES.values(), ids=VALUES)
@pytest.mark.parametrize("method", METHODS)
def test_from_every_history(bench: Bench, method: str, value: float) -> None:
    names = [history.name for history in graph(method).compile().feeds.values()]
    assert {"exposure", f"taa.{METHODS[method][0]}"} < set(names)

    def into(name: str) -> Callable[[FramePacket], FramePacket]:
        def fault(packet: FramePacket) -> FramePacket:
            spoil_history(bench, name, value)
            return packet

        return fault

    for name in names:
        recover(bench, method, into(name))
