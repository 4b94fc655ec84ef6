"""raytrace/still.py: the mean of a view at rest, its noise, and what its pixels stand for."""

from __future__ import annotations

import math

import numpy as np
import pytest

import assets
from raytrace.camera import Camera
from raytrace.compiled import compile_scene
from raytrace.frame import FramePacket
from raytrace.integrator import Settings, Tracer
from raytrace.still import StillReference, StillView

SIZE = (24, 16)
CAMERA = Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0))


class Noise:
    """Samples of mean 0.5 and standard deviation ``sigma``; ``lit`` rows emit from sample 1 on."""

    def __init__(self, sigma: float, lit: int = 0) -> None:
        self._rng = np.random.default_rng(7)
        self._sigma, self._lit = sigma, lit
        self.cameras: list[Camera] = []

    def reference_frame(
        self, sample: int, camera: Camera, size: tuple[int, int], now: float, lamps: float
    ) -> FramePacket:
        self.cameras.append(camera)
        shape = (size[1], size[0], 4)
        light = (0.5 + self._sigma * self._rng.standard_normal(shape)).astype(np.float32)
        zero, emission = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        emission[: self._lit if sample else 0] = 100.0
        return FramePacket(sample, now, light, zero, np.ones_like(light), emission, zero, zero[..., :2], zero)


def refined(noise: Noise, samples: int, filtered: bool = False):
    reference = StillReference(StillView(CAMERA, SIZE, 0.0, filtered))
    for _ in range(samples):
        snapshot = reference.refine(noise)
    return snapshot


@pytest.mark.parametrize("samples", [2, 5, 16])
def test_the_noise_is_that_of_the_mean(samples):
    snapshot = refined(Noise(0.3), samples)
    assert snapshot.samples == samples
    actual = float(np.sqrt(np.mean((snapshot.radiance - 0.5) ** 2)))
    assert actual == pytest.approx(0.3 / math.sqrt(samples), rel=0.1)
    assert snapshot.noise == pytest.approx(0.3 / math.sqrt(samples), rel=0.1)


def test_one_sample_cannot_tell_its_noise():
    assert math.isnan(refined(Noise(0.3), 1).noise)


def test_light_sources_are_no_part_of_the_noise():
    snapshot = refined(Noise(0.3, lit=3), 8)
    assert not snapshot.mask[:3].any()
    assert snapshot.mask[3:].all()
    assert snapshot.noise == pytest.approx(0.3 / math.sqrt(8), rel=0.1)
    assert math.isnan(refined(Noise(0.3, lit=SIZE[1]), 4).noise)


def test_samples_go_through_centres_or_all_over_the_pixel():
    noise = Noise(0.0)
    refined(noise, 5)
    assert {camera.jitter for camera in noise.cameras} == {(0.0, 0.0)}
    noise = Noise(0.0)
    refined(noise, 256, filtered=True)
    places = np.array([camera.jitter for camera in noise.cameras])
    assert abs(places).max() < 0.5
    np.testing.assert_allclose(places.mean(axis=0), 0.0, atol=0.01)
    squares = np.floor(4.0 * (places + 0.5)).astype(int) @ (4, 1)
    assert np.bincount(squares, minlength=16).min() >= 12  # of 16 in each of 16 squares


def test_a_sample_is_one_of_the_tracer_s_own_references():
    scene = compile_scene(assets.build("cornell"))
    camera = scene.scene.camera
    with Tracer(scene, Settings(threads=1)) as tracer:
        before = tracer.settings
        packet = tracer.reference_frame(3, camera, SIZE, 0.0)
        assert tracer.settings is before
        direct, indirect = tracer.reference(camera, SIZE, 1, 0.0, first_sample=3)
        np.testing.assert_array_equal(packet.direct[..., :3], direct.astype(np.float32))
        np.testing.assert_array_equal(packet.indirect[..., :3], indirect.astype(np.float32))
        assert not np.array_equal(packet.direct, tracer.frame(3, camera, camera, SIZE).direct)
