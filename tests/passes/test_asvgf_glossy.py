"""A-SVGF of specular light: its gradients cut and correct the history of that signal, or of all light as one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.recording.sequence import open_sequence
from bench.recording.writer import Recording, Stage
from config import Asvgf, Bmfr, Config, Svgf, Taa
from raytrace.frame import FramePacket
from raytrace.scene import Scene
from tests.passes.asvgf_oracle import Strata, changing_room, spread, void_and_factor, with_gradients
from tests.passes.harness import F32, HALF, Bench, frame, noise
from tests.passes.test_asvgf import wall
from tests.passes.test_glossy import glossy
from tests.tracer.scenes import glossy as glossy_scene
from tests.tracer.scenes import tracer
from tests.tracer.test_gradients import flown

SIZE = (55, 38)
SMALL = (30, 20)
PLAIN = Taa(enabled=False)


def shining(packet: FramePacket, seed: int) -> FramePacket:
    """``packet`` with noisy specular light, on the right half only, and made-up gradients of it."""
    width, height = packet.size
    lobe = np.where(np.arange(width) < width // 2, 0.0, 0.4) * np.ones((height, 1))
    lit = glossy(packet, noise(packet.size, seed) * (lobe > 0)[..., None], lobe)
    assert lit.specular is not None
    specular = lit.specular.copy()
    specular[..., 3] = packet.direct[..., 3]
    made_up = with_gradients(packet, seed).temporal_gradient
    return replace(lit, specular=specular, temporal_gradient_specular=made_up)


def whole(packet: FramePacket) -> NDArray[np.float64]:
    """(H, W, 3) all light over the sum of both albedos."""
    assert packet.specular is not None
    assert packet.specular_albedo is not None
    direct, indirect, specular, albedo, lobe = (
        image[..., :3].astype(np.float64)
        for image in (packet.direct, packet.indirect, packet.specular, packet.albedo, packet.specular_albedo)
    )
    radiance = (direct + indirect) * albedo + specular * lobe
    return np.where(lobe > 0, radiance / np.maximum(albedo + lobe, 1e-30), direct + indirect)


@pytest.mark.parametrize("separate", [True, False])
def test_every_step_agrees_with_double_precision(bench: Bench, separate: bool) -> None:
    """From the first pair of the second image for specular light, from its second pair for all light."""
    p = Asvgf(separate=separate)
    scope = "asvgf.specular" if separate else "asvgf"
    for index in range(2):
        packet = shining(changing_room(index, SIZE), index)
        assert packet.temporal_gradient_specular is not None
        assert packet.specular is not None
        names = {f"gradient{i}": f"{scope}.gradient{i}.out_change" for i in range(p.gradient_iterations)}
        names |= {"lambda": f"{scope}.lambda.out_lambda", "light": f"{scope}.strata.out_light"}
        images = bench.denoise(packet, Config(asvgf=p, taa=PLAIN), "asvgf", keep=names.values())
        light = packet.specular[..., :3].astype(np.float64) if separate else whole(packet)
        strata = Strata.of(packet, joint=False, only=light)
        pair = packet.temporal_gradient_specular[..., :2] if separate else packet.temporal_gradient_specular[..., 2:]
        change = np.concatenate([pair, np.zeros_like(pair)], -1).astype(np.float64)
        expected = {"light": strata.light}
        for i in range(p.gradient_iterations):
            change = expected[f"gradient{i}"] = spread(change, strata, 1 << i, p, packet.pixel_size)
        expected["lambda"] = void_and_factor(change, strata, packet, p)
        for step, name in names.items():
            tolerance = HALF if step == "lambda" else 2e-4
            np.testing.assert_allclose(images[name], expected[step], tolerance, tolerance, err_msg=step)
        assert 0.01 < images[names["lambda"]][..., 0].mean() < 0.9


@pytest.mark.parametrize("separate", [True, False])
def test_where_nothing_changed_it_is_svgf_to_the_bit(bench: Bench, separate: bool) -> None:
    pictures: dict[str, list[F32]] = {"svgf": [], "asvgf": []}
    config = Config(asvgf=Asvgf(separate=separate), svgf=Svgf(separate=separate), taa=PLAIN)
    for denoiser, radiance in pictures.items():
        bench.restart()
        for index in range(4):
            packet = shining(wall(SIZE, noise(SIZE, index), (0, 1, 0, 1)), index)
            assert packet.temporal_gradient_specular is not None
            still = packet.temporal_gradient_specular * np.array([0, 1, 0, 1], np.float32)
            packet = replace(packet, temporal_gradient_specular=still)
            radiance.append(bench.denoise(packet, config, denoiser)["radiance"])
    np.testing.assert_array_equal(pictures["svgf"], pictures["asvgf"])


def lit(diffuse: object, specular: object, change: tuple[float, float, float, float]) -> FramePacket:
    """A wall that is diffuse and glossy in equal parts, whose diffuse light does not change."""
    packet = wall(SMALL, diffuse, (0, 1, 0, 1))
    packet = replace(packet, albedo=frame(SMALL, albedo=0.5).albedo)
    assert packet.temporal_gradient is not None
    values = np.broadcast_to(np.array(change, np.float32), packet.temporal_gradient.shape)
    return replace(glossy(packet, specular, 0.5), temporal_gradient_specular=values)  # type: ignore[arg-type]


@pytest.mark.parametrize("follow", [True, False])
def test_specular_light_that_is_gone_is_gone_in_the_same_frame(bench: Bench, follow: bool) -> None:
    """And diffuse light keeps its history. Without an image of its gradients it would fade."""
    config = Config(asvgf=Asvgf(follow=follow), taa=PLAIN)
    names = [
        f"asvgf.{signal}.accumulate.out_{what}" for signal in ("specular", "direct") for what in ("color", "moments")
    ]
    for known in (True, False):
        bench.restart()
        for seed in range(6):
            bench.denoise(lit(1.0, noise(SMALL, seed), (0, 1, 0, 1)), config, "asvgf")
        packet = lit(1.0, 0.0, (-1, 1, -0.25, 1))
        packet = packet if known else replace(packet, temporal_gradient_specular=None)
        images = bench.denoise(packet, config, "asvgf", keep=names)
        color, moments, _, direct = (images[name] for name in names)
        assert (direct[..., 3] == 6.0).all()
        if known:
            assert not color[..., :3].any()
            assert not moments[..., 3].any()
        else:
            assert color[..., :3].min() > 0.1
            assert (moments[..., 3] == 6.0).all()


def test_the_history_of_specular_light_follows_it(bench: Bench) -> None:
    """Halved, with gain 0 so that nothing is cut: a history of 1s is one of halves before the sample is added."""
    config = Config(asvgf=Asvgf(gain=0.0), taa=PLAIN)
    names = [f"asvgf.{signal}.accumulate.out_color" for signal in ("specular", "direct")]
    for _ in range(6):
        bench.denoise(lit(1.0, 1.0, (0, 1, 0, 1)), config, "asvgf")
    specular, direct = bench.denoise(lit(1.0, 0.5, (-0.5, 1, -0.25, 1)), config, "asvgf", keep=names), 1.0
    np.testing.assert_allclose(specular[names[0]][..., :3], 0.5, rtol=4 * HALF)
    np.testing.assert_allclose(specular[names[1]][..., :3], direct, rtol=4 * HALF)


@pytest.mark.parametrize("denoiser", ["asvgf", "bmfr"])
def test_all_light_as_one_follows_the_sum(bench: Bench, denoiser: str) -> None:
    """Of 3 / 2 of light, 1 diffuse and 1/2 specular, the latter goes: two thirds are left, in the same frame."""
    config = Config(asvgf=Asvgf(gain=0.0, separate=False), bmfr=Bmfr(adaptive=True, gain=0.0, part=0), taa=PLAIN)
    for _ in range(6):
        bench.denoise(lit(1.0, 1.0, (0, 1, 0, 1.5)), config, denoiser)
    radiance = bench.denoise(lit(1.0, 0.0, (-1, 1, -0.5, 1.5)), config, denoiser)["radiance"]
    np.testing.assert_allclose(radiance[..., :3], 1.0, rtol=8 * HALF)


def test_both_kinds_of_light_apart_follow_their_own_in_bmfr(bench: Bench) -> None:
    config = Config(bmfr=Bmfr(adaptive=True, separate=True, part=0), taa=PLAIN)
    for _ in range(6):
        bench.denoise(lit(1.0, 1.0, (0, 1, 0, 1.5)), config, "bmfr")
    names = ["bmfr.accumulate.out_color", "bmfr.specular.accumulate.out_color"]
    images = bench.denoise(lit(1.0, 0.0, (-1, 1, -0.5, 1.5)), config, "bmfr", keep=names)
    np.testing.assert_allclose(images[names[0]][..., :3], 2.0, rtol=8 * HALF)
    assert not images[names[1]][..., :3].any()


def in_the_dark() -> Scene:
    """The glossy scene, in which next to nothing shines but the lamp. No sky at all is another kind of scene."""
    return replace(glossy_scene(), sky=(1e-5, 1e-5, 1e-5))


def specular_means(bench: Bench, packets: list[FramePacket], denoiser: str) -> list[float]:
    """Mean of the specular light that has been accumulated, frame by frame."""
    name = f"{denoiser}.specular.accumulate.out_color"
    bench.restart()
    return [
        float(bench.denoise(packet, Config(taa=PLAIN), denoiser, keep=[name])[name][..., :3].mean())
        for packet in packets
    ]


def test_specular_light_of_a_lamp_that_is_switched_off_is_gone_within_two_frames(bench: Bench) -> None:
    what = in_the_dark()
    with tracer(what) as t:
        packets = [
            t.frame(i, what.camera, what.camera, (66, 44), cut=i == 0, remember="random", lamps=float(i < 8))
            for i in range(10)
        ]
        adaptive = specular_means(bench, packets, "asvgf")
        plain = specular_means(bench, packets, "svgf")
    assert adaptive[9] < 0.01 * adaptive[7]
    assert plain[9] > 0.3 * plain[7]


def test_factors_of_a_view_that_changes_do_not_add_up(bench: Bench) -> None:
    """A camera in flight, light that rests, and the worst of noise: few strata see the lamp's highlights.

    Gradients have either sign, and the history stays near where it was: 4 % off. Of factors above 1 alone it would be
    8 %.
    """
    with tracer(in_the_dark()) as t:
        packets = flown(t, range(30), "random", moving=False, size=(66, 44))
        adaptive = specular_means(bench, packets, "asvgf")
    change = packets[-1].temporal_gradient_specular
    assert change is not None
    assert (change[..., 0] > 0).sum() > 10
    assert (change[..., 0] < 0).sum() > 10
    noisy = [float(packet.specular[..., :3].mean()) for packet in packets if packet.specular is not None]
    assert np.mean(adaptive[6:]) == pytest.approx(np.mean(noisy[6:]), rel=0.06)


def test_a_replay_of_a_glossy_recording_with_gradients_gives_the_live_picture(bench: Bench, tmp_path: Path) -> None:
    """The lamp is dimmed meanwhile. Without the second image of gradients the replay still works, and lags."""
    what = in_the_dark()
    with tracer(what) as t:
        stage = Stage(t.scene.origin, t.scene.extent, {})
        packets = [
            t.frame(i, what.camera, what.camera, SIZE, cut=i == 0, remember="random", lamps=1.0 - 0.4 * i)
            for i in range(3)
        ]
    recording = Recording(tmp_path, stage)
    for packet in packets:
        recording.add(packet, what.camera)
    recording.flush()

    def replayed() -> list[F32]:
        sequence = open_sequence(tmp_path)
        found = [sequence.packet(i, cut=i == 0) for i in range(3)]
        for before, after in zip(packets, found, strict=True):
            for field in ("direct", "indirect", "specular", "temporal_gradient"):
                np.testing.assert_array_equal(getattr(before, field), getattr(after, field), err_msg=field)
        return filtered(found)

    def filtered(frames: list[FramePacket]) -> list[F32]:
        bench.restart()
        return [bench.denoise(packet, Config(taa=PLAIN), "asvgf")["radiance"] for packet in frames]

    assert packets[2].temporal_gradient_specular is not None
    assert packets[2].temporal_gradient_specular[..., 0].any()
    live = filtered(packets)
    hit = packets[0].motion[..., 3] >= 0
    for one, other in zip(live, replayed(), strict=True):
        np.testing.assert_array_equal(one[hit], other[hit])
    for path in tmp_path.glob("gradient_specular*.exr"):
        path.unlink()
    assert packets[2].specular_albedo is not None
    metal = (packets[2].albedo[..., :3].max(-1) == 0) & (packets[2].specular_albedo[..., :3].max(-1) > 0)
    assert replayed()[2][metal][:, :3].mean() > 1.2 * live[2][metal][:, :3].mean()
