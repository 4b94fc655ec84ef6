"""One frame, one set of bits: whatever the number of threads, the tiling, and what was traced before."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from raytrace.frame import FramePacket
from raytrace.integrator import REFERENCE_SEED, Seeds, Settings, Tracer
from raytrace.sampling import HALTON, HASH
from raytrace.scene import Scene
from raytrace.shot import Shot
from tests.tracer.conftest import OpenTracer
from tests.tracer.scenes import cornell, everything, repeated, rigid, shade, still, view_of

SIZE = (61, 47)
MOVING = cornell(motion=rigid((0.2, 1.0, 0.3), 2.0, (0.3, 0.4, -0.5), pivot=(0.45, -0.75, 0.25)))
SCENES = {
    "still": cornell(),
    "sky": cornell(sky=(0.3, 0.5, 0.8)),
    "moving": MOVING,
    "textured, sky and moving": everything(),
}
any_scene = pytest.mark.parametrize("what", SCENES.values(), ids=SCENES.keys())


def assert_same_bits(a: FramePacket, b: FramePacket) -> None:
    """Every array and every other field but the timings and what tells tracers apart."""
    for field in fields(FramePacket):
        one, other = getattr(a, field.name), getattr(b, field.name)
        if isinstance(one, np.ndarray):
            bits = [np.ascontiguousarray(values).view(np.uint32) for values in (one, other)]
            np.testing.assert_array_equal(bits[0], bits[1], err_msg=field.name)
        elif field.name not in ("timings", "scene_id"):
            assert one == other, field.name


def moving_frame(t: Tracer, index: int) -> FramePacket:
    """Frame ``index`` of a shot in which both the camera and the objects move."""
    camera = t.scene.scene.camera
    x, y, z = camera.position
    cameras = [replace(camera, position=(x + 0.02 * i, y, z - 0.01 * i)) for i in (index - 1, index)]
    return t.frame(index, cameras[1], cameras[0], SIZE, index / 30, (index - 1) / 30)


@pytest.mark.parametrize("generator", [HALTON, HASH], ids=["halton", "hash"])
@any_scene
def test_a_frame_is_the_same_for_every_tiling_and_any_number_of_threads(
    trace: OpenTracer, what: Scene, generator: int
) -> None:
    expected = moving_frame(trace(what, generator=generator, tile=16384), 5)
    assert np.isfinite(expected.radiance()).all()
    assert (expected.radiance() > 0).any(axis=-1).mean() > 0.3
    for tile, threads in ((1, 1), (256, 2), (1000, 3), (16384, 3), (256, 1)):
        t = trace(what, generator=generator, tile=tile, threads=threads)
        assert_same_bits(expected, moving_frame(t, 5))


@any_scene
def test_a_frame_traced_alone_is_that_of_the_sequence(trace: OpenTracer, what: Scene) -> None:
    t = trace(what, threads=2, tile=512)
    sequence = [moving_frame(t, index) for index in range(4)]
    assert_same_bits(sequence[3], moving_frame(trace(what), 3))
    assert_same_bits(sequence[1], moving_frame(t, 1))
    assert (sequence[3].direct != sequence[1].direct).any()


@any_scene
def test_a_reference_is_the_same_for_every_tiling_and_its_parts_add_up(trace: OpenTracer, what: Scene) -> None:
    t = trace(what, tile=256, threads=3)
    camera = what.camera
    whole = t.reference(camera, SIZE, 6, 0.1)
    first, second = t.reference(camera, SIZE, 2, 0.1), t.reference(camera, SIZE, 4, 0.1, first_sample=2)
    other = trace(what).reference(camera, SIZE, 6, 0.1)
    for k in range(2):
        np.testing.assert_array_equal(whole[k], other[k])
        np.testing.assert_allclose(whole[k], (2 * first[k] + 4 * second[k]) / 6, rtol=1e-12)
        assert whole[k].dtype == np.float64
        assert whole[k].shape == (SIZE[1], SIZE[0], 3)


def test_a_reference_leaves_the_frames_alone(trace: OpenTracer) -> None:
    t = trace(everything(), generator=HALTON, threads=2)
    before = moving_frame(t, 2)
    t.reference(everything().camera, SIZE, 2, 0.3)
    assert_same_bits(before, moving_frame(t, 2))


def test_a_reference_reports_its_progress(trace: OpenTracer) -> None:
    shares: list[float] = []
    trace(cornell(), tile=SIZE[0] * 4).reference(cornell().camera, SIZE, 1, progress=shares.append)
    assert len(shares) == 12
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_failure_inside_a_reference_gives_the_settings_back(trace: OpenTracer) -> None:
    t = trace(cornell(), generator=HALTON, seed=5)

    def stop(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        t.reference(cornell().camera, SIZE, 1, progress=stop)
    assert t.settings == Settings(seed=5, generator=HALTON, threads=1, positions=True)


@pytest.mark.parametrize("generator", [HALTON, HASH], ids=["halton", "hash"])
def test_seeds_make_other_noise_and_the_same_guides(trace: OpenTracer, generator: int) -> None:
    frames = [moving_frame(trace(everything(), generator=generator, seed=seed), 2) for seed in (0, 0, 1, 2**32 - 1)]
    assert_same_bits(frames[0], frames[1])
    lit = frames[0].albedo[..., 3] == 1.0
    for other in frames[2:]:
        changed = (frames[0].direct != other.direct).any(axis=-1)
        assert changed[lit].mean() > 0.5
        np.testing.assert_array_equal(frames[0].surface, other.surface)
        np.testing.assert_array_equal(frames[0].motion, other.motion)


def test_pixels_and_frames_have_noise_of_their_own(trace: OpenTracer) -> None:
    """One surface point with the seeds of many pixels and frames: no two paths are the same."""
    t = trace(cornell())
    view = view_of(t, cornell().camera, SIZE)
    hits = t.primary(view, np.array([SIZE[0] * 6 + 30], np.int32))
    grid = np.stack(np.meshgrid(np.arange(80), np.arange(40)), axis=-1).reshape(-1, 2).astype(np.uint32)
    direct, _ = shade(t, repeated(hits, 0, len(grid)), Seeds(grid[:, 0].copy(), grid[:, 1].copy()), view.eye)
    lit = direct[direct.any(axis=1)]
    assert len(lit) > 1000
    assert len(np.unique(lit, axis=0)) > 0.99 * len(lit)


def test_halton_repeats_after_sixteen_frames_and_references_never_do(trace: OpenTracer) -> None:
    t = trace(cornell(), generator=HALTON)
    np.testing.assert_array_equal(still(t, SIZE, 3).direct, still(t, SIZE, 19).direct)
    assert (still(t, SIZE, 3).direct != still(t, SIZE, 4).direct).any()
    t.settings = replace(t.settings, generator=HASH)
    assert (still(t, SIZE, 3).direct != still(t, SIZE, 19).direct).any()
    camera = cornell().camera
    one, later = t.reference(camera, SIZE, 1), t.reference(camera, SIZE, 1, first_sample=16)
    assert (one[0] != later[0]).any()


def test_no_path_of_a_reference_is_one_of_a_frame(trace: OpenTracer) -> None:
    """Also where the run has the seed of the reference, or frames are numbered from 2^31 on."""
    t = trace(cornell())
    camera = cornell().camera
    samples = [t.reference(camera, SIZE, 1, first_sample=i)[0].astype(np.float32) for i in range(3)]
    for settings, first in ((t.settings, 0), (t.settings, 2**31), (replace(t.settings, seed=REFERENCE_SEED), 0)):
        t.settings = settings
        for index in range(3):
            frame = still(t, SIZE, first + index).direct[..., :3]
            for sample in samples:
                both = (sample != 0).any(-1) & (frame != 0).any(-1)
                assert both.mean() > 0.1
                assert (sample == frame).all(-1)[both].mean() < 0.05


def test_a_shot_frame_by_frame(trace: OpenTracer) -> None:
    t = trace(MOVING, generator=HALTON)
    shot = Shot(t.scene, t, SIZE, "still", animate=True, jitter=True)
    frames = [shot.frame(index) for index in (0, 1, 2)]
    assert_same_bits(frames[2], Shot(t.scene, t, SIZE, "still", animate=True, jitter=True).frame(2))
    assert len({frame.jitter for frame in frames}) == 3
