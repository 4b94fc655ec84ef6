"""``app.py render``: which frame it shows, by which method, and what lands in which file."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import config
import headless
import session
from config import Config
from gl.executor import Result
from gl.pipelines import FrameTraits, build
from gl.renderer import read
from images import read_exr, viewable
from raytrace.camera import Camera
from raytrace.frame import FramePacket
from raytrace.shot import Shot
from tests.cli.runner import SMALL, App, png

F32 = NDArray[np.float32]

MOVING = ("--camera", "flight", "--animate")


def settings(*overrides: str) -> Config:
    return config.load(None, ("render.width=32", "render.height=18", *overrides))


def shot(stack: ExitStack, camera: str = "flight", animate: bool = True, jitter: bool = False, *keys: str) -> Shot:
    opened = session.open_shot("cornell", settings(*keys), camera, animate, jitter)
    stack.enter_context(opened.tracer)
    return opened


def packet(index: int, camera: str = "flight", animate: bool = True, jitter: bool = False) -> FramePacket:
    """One frame of the Cornell box, traced alone."""
    with ExitStack() as stack:
        return shot(stack, camera, animate, jitter).frame(index)


def render(app: App, folder: Path, *words: object) -> F32:
    """Linear radiance that ``app.py render`` writes, row 0 = bottom."""
    out = folder / "shot.png"
    files = app("render", *SMALL, *words, "--exr", "--out", out).files()
    assert files == [str(out), str(folder / "shot.exr")]
    return read_exr(folder / "shot.exr")


# ------------------------------------------------------------------------------------------------------- which frame


def test_none_shows_the_last_frame_as_it_is_traced_alone(app: App, tmp_path: Path) -> None:
    got = render(app, tmp_path, "--denoiser", "none", "--frames", 5, *MOVING)
    np.testing.assert_allclose(got, packet(4).radiance(), rtol=1e-6)
    assert np.abs(got - packet(3).radiance()).max() > 0.1


@pytest.mark.parametrize("denoiser", ["none", "accumulate", "svgf", "reference"])
def test_every_denoiser_shows_the_same_frame(app: App, tmp_path: Path, denoiser: str) -> None:
    """By what is free of noise: the lamp, which no filter touches, is where it is in frame N - 1."""
    got = render(app, tmp_path, "--denoiser", denoiser, "--frames", 5, "--spp", 1, *MOVING)
    lamps = [packet(index).emission[..., 0] > 0.0 for index in (3, 4)]
    np.testing.assert_array_equal(got[..., 0] >= 17.0, lamps[1])
    assert (lamps[0] != lamps[1]).any(), "or this test could not tell"


@pytest.mark.parametrize("name", ["surface", "motion", "albedo"])
def test_guides_are_those_of_the_last_frame(app: App, tmp_path: Path, name: str) -> None:
    got = render(app, tmp_path, "--frames", 5, "--show", f"frame.{name}", *MOVING)
    np.testing.assert_array_equal(got, getattr(packet(4), name)[..., :3])
    assert (got != getattr(packet(3), name)[..., :3]).any()


def by_hand(denoiser: str, frames: int) -> tuple[F32, NDArray[np.uint8]]:
    """Radiance and picture after all frames of the moving shot, one after the other."""
    with ExitStack() as stack:
        moving = shot(stack)
        renderer = headless.open_renderer(moving.size, stack)
        results: list[Result] = [renderer.run(moving.frame(i), settings(), denoiser) for i in range(frames)]
        return read(results[-1].outputs["radiance"])[..., :3], headless.display_of(results[-1])


@pytest.mark.parametrize("denoiser", ["accumulate", "svgf"])
def test_filters_over_time_see_every_frame_up_to_it(app: App, tmp_path: Path, denoiser: str) -> None:
    got = render(app, tmp_path, "--denoiser", denoiser, "--frames", 4, *MOVING)
    radiance, picture = by_hand(denoiser, 4)
    np.testing.assert_array_equal(got, radiance)
    np.testing.assert_array_equal(png(tmp_path / "shot.png"), picture[::-1])
    assert (by_hand(denoiser, 3)[0] != got).any()


def test_still_is_still_and_animation_moves(app: App, tmp_path: Path) -> None:
    def depth(*words: object) -> F32:
        return render(app, tmp_path, "--show", "frame.surface", *words)

    rest = depth("--frames", 1)
    np.testing.assert_array_equal(depth("--frames", 9), rest)
    np.testing.assert_array_equal(depth("--frames", 1, *MOVING), rest)
    assert (depth("--frames", 9, "--animate") != rest).any()
    assert (depth("--frames", 9, "--camera", "flight") != rest).any()


# --------------------------------------------------------------------------------------------------------- reference


def truth(index: int, samples: int, first_sample: int = 0, jitter: bool = False, *keys: str) -> F32:
    """What the tracer itself says, in one go."""
    with ExitStack() as stack:
        moving = shot(stack, "flight", True, jitter, *keys)
        frame = moving.frame(index)
        camera = moving.camera(index).with_jitter(frame.jitter)
        direct, indirect = moving.tracer.reference(camera, moving.size, samples, moving.time(index), first_sample)
        light = (direct + indirect) * frame.albedo[..., :3] + frame.emission[..., :3]
        return light.astype(np.float32)


@pytest.mark.parametrize("jitter", [False, True])
def test_the_reference_is_the_mean_of_many_paths_of_the_last_frame(app: App, tmp_path: Path, jitter: bool) -> None:
    flags = ("--jitter",) if jitter else ()
    got = render(app, tmp_path, "--denoiser", "reference", "--frames", 4, "--spp", 6, *flags, *MOVING)
    np.testing.assert_allclose(got, truth(3, 6, jitter=jitter), rtol=1e-5, atol=1e-6)
    assert np.abs(got - truth(3, 5, jitter=jitter)).max() > 0.01


def test_the_reference_has_as_many_paths_as_there_are_frames_unless_told(app: App, tmp_path: Path) -> None:
    flags = ("--denoiser", "reference", "--frames", 3)
    default = render(app, tmp_path, *flags)
    np.testing.assert_array_equal(default, render(app, tmp_path, *flags, "--spp", 3))
    assert (default != render(app, tmp_path, *flags, "--spp", 4)).any()


def test_the_reference_shares_no_path_with_any_frame(app: App, tmp_path: Path) -> None:
    """Whatever the frames draw from, references draw the same hash numbers, which no frame does."""
    flags = ("--denoiser", "reference", "--frames", 1, "--spp", 1)
    halton = render(app, tmp_path, *flags, "--set", "render.sequence=halton")
    np.testing.assert_array_equal(halton, render(app, tmp_path, *flags, "--set", "render.sequence=hash"))
    lit = halton.max(axis=2) > 0.0
    for sequence in ("halton", "hash"):
        noisy = render(app, tmp_path, "--denoiser", "none", "--frames", 1, "--set", f"render.sequence={sequence}")
        lamp = packet(0, "still", False).emission[..., :3].max(axis=2) > 0.0
        assert (noisy == halton).all(axis=2)[lit & ~lamp].mean() < 0.01


def test_the_reference_converges_like_independent_samples(app: App, tmp_path: Path) -> None:
    """Four times the paths, half the error; and no bias is left that more paths would not remove."""
    converged = truth(0, 2048, first_sample=1_000_000)

    def error(samples: int) -> float:
        got = render(app, tmp_path, "--denoiser", "reference", "--frames", 1, "--spp", samples, *MOVING)
        return float(np.sqrt(np.mean((got - converged).astype(np.float64) ** 2)))

    errors = [error(samples) for samples in (4, 16, 64)]
    ratios = [errors[0] / errors[1], errors[1] / errors[2]]
    assert ratios == pytest.approx([2.0, 2.0], rel=0.25)


def test_portions_of_a_reference_add_up(monkeypatch: pytest.MonkeyPatch) -> None:
    with ExitStack() as stack:
        moving = shot(stack)
        frame = moving.frame(2)
        whole = headless.reference_of(moving, frame, 7, lambda share: None)
        monkeypatch.setattr(headless, "PATHS_AT_ONCE", 3 * 32 * 18)
        shares: list[float] = []
        parts = headless.reference_of(moving, frame, 7, shares.append)
    np.testing.assert_allclose(parts, whole, rtol=1e-6, atol=1e-7)
    assert shares == pytest.approx([3 / 7, 6 / 7, 1.0])


# --------------------------------------------------------------------------------------------------------- what counts


def test_the_exr_is_before_tone_mapping_and_anti_aliasing(app: App, tmp_path: Path) -> None:
    flags = ("--frames", 3, *MOVING)
    radiance = render(app, tmp_path, *flags)
    picture = png(tmp_path / "shot.png")
    assert radiance.max() > 10.0, "the lamp's radiance, not its colour on the screen"
    changes = ("display.exposure=2", "display.tonemap=reinhard", "taa.enabled=false")
    np.testing.assert_array_equal(render(app, tmp_path, *flags, *(f"--set={change}" for change in changes)), radiance)
    assert (png(tmp_path / "shot.png") != picture).any()
    assert (render(app, tmp_path, *flags, "--set", "svgf.iterations=1") != radiance).any()


def test_the_picture_is_anti_aliased_over_time(app: App, tmp_path: Path) -> None:
    render(app, tmp_path, "--frames", 3, *MOVING)
    blended = png(tmp_path / "shot.png")
    render(app, tmp_path, "--frames", 3, "--set", "taa.enabled=false", *MOVING)
    assert (png(tmp_path / "shot.png") != blended).any()


def test_pictures_are_the_same_to_the_bit_for_the_same_seed_whatever_the_threads(app: App, tmp_path: Path) -> None:
    def files(name: str, *words: str) -> tuple[bytes, bytes]:
        render(app, tmp_path / name, "--frames", 3, "--set", "render.tile=256", *words, *MOVING)
        return (tmp_path / name / "shot.png").read_bytes(), (tmp_path / name / "shot.exr").read_bytes()

    first = files("a", "--set", "render.threads=2")
    assert files("b", "--set", "render.threads=2") == first
    assert files("c", "--set", "render.threads=1") == first
    assert files("d", "--seed", "0") == first
    other = files("e", "--seed", "1")
    assert (other[0] != first[0], other[1] != first[1]) == (True, True)
    assert files("f", "--set", "render.seed=1") == other


def test_another_seed_changes_the_noise_and_nothing_else(app: App, tmp_path: Path) -> None:
    flags = ("--denoiser", "none", "--frames", 2, *MOVING)
    assert (render(app, tmp_path, *flags, "--seed", 1) != render(app, tmp_path, *flags, "--seed", 2)).mean() > 0.3
    albedo = ("--show", "frame.albedo")
    np.testing.assert_array_equal(
        render(app, tmp_path, *flags, *albedo, "--seed", 1), render(app, tmp_path, *flags, *albedo, "--seed", 2)
    )


def test_jitter_is_off_unless_asked_for(app: App, tmp_path: Path) -> None:
    flags = ("--frames", 2, "--show", "frame.surface")
    plain = render(app, tmp_path, *flags)
    np.testing.assert_array_equal(plain, packet(1, "still", False).surface[..., :3])
    shifted = render(app, tmp_path, *flags, "--jitter")
    np.testing.assert_array_equal(shifted, packet(1, "still", False, jitter=True).surface[..., :3])
    assert (shifted != plain).any()
    np.testing.assert_array_equal(render(app, tmp_path, *flags, "--set", "render.jitter=on"), shifted)
    np.testing.assert_array_equal(render(app, tmp_path, *flags, "--set", "render.jitter=off"), plain)


# -------------------------------------------------------------------------------------------------------------- cameras


def camera_file(path: Path, cameras: list[Camera]) -> Path:
    frames = []
    for camera in cameras:
        right, up, forward = camera.basis()
        matrix = np.eye(4)
        matrix[:3] = np.column_stack([right, up, -forward, camera.position])
        frames.append({"camera_to_world_gl": matrix.tolist(), "yfov_deg": float(np.degrees(camera.yfov))})
    path.write_text(json.dumps({"frames": frames}))
    return path


def test_a_camera_path_is_followed_and_its_last_camera_stays(app: App, tmp_path: Path) -> None:
    with ExitStack() as stack:
        flight = shot(stack)
        path = camera_file(tmp_path / "path.json", [flight.camera(0), flight.camera(20)])
    flags = ("--denoiser", "none", "--show", "frame.albedo")
    for frames, index in ((1, 0), (2, 20), (5, 20)):
        got = render(app, tmp_path, *flags, "--camera", path, "--frames", frames)
        expected = packet(index, animate=False).albedo[..., :3]
        # Directions from a matrix differ by a rounding error: a pixel on an edge may fall to the other side.
        assert (np.abs(got - expected).max(axis=2) > 1e-3).mean() < 0.01


# ----------------------------------------------------------------------------------------------------- --show and files


def test_show_writes_any_texture_even_one_that_is_written_over_later(app: App, tmp_path: Path) -> None:
    plan = build(settings(), "svgf", FrameTraits()).compile()
    slots = list(plan.slot_of.values())
    covered = next(tex.name for tex, slot in plan.slot_of.items() if slots.count(slot) > 1)
    feeder = next(iter(plan.feeds)).name
    one_channel_or_two = "frame.gradient"
    for name in (covered, feeder, one_channel_or_two):
        values = render(app, tmp_path, "--frames", 2, "--show", name)
        assert values.std() > 0.0
        assert png(tmp_path / "shot.png").std() > 0.0
    assert (values[..., 2] == 0.0).all()


def test_show_of_the_finished_picture_is_the_picture(app: App, tmp_path: Path) -> None:
    plan = build(settings(), "svgf", FrameTraits()).compile()
    render(app, tmp_path, "--frames", 2)
    picture = png(tmp_path / "shot.png")
    render(app, tmp_path, "--frames", 2, "--show", plan.outputs["display"].name)
    np.testing.assert_array_equal(png(tmp_path / "shot.png"), picture)


def test_values_of_any_range_become_visible() -> None:
    def shown(values: list[float]) -> list[float]:
        image = np.array(values, np.float32).reshape(1, -1, 1)
        return [float(value) for value in viewable(image)[0, :, 1]]

    assert shown([0.0, 0.25, 1.0]) == [0.0, 0.25, 1.0], "what fits stays as it is"
    assert shown([-1.0, 0.0, 1.0]) == pytest.approx([0.0, 0.5, 1.0], abs=0.02)
    assert shown([0.0, 10.0]) == pytest.approx([0.0, 1.0], abs=0.02)
    assert shown([float("nan"), float("inf")]) == [0.0, 0.0]
    two = viewable(np.full((1, 1, 2), 0.5, np.float32))
    assert two[0, 0].tolist() == [0.5, 0.5, 0.0]


def test_without_flags_the_picture_goes_to_out(app: App, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert app("render", *SMALL, "--frames", 1).files() == ["out/shot.png"]
    assert png(tmp_path / "out" / "shot.png").shape == (18, 32, 3)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["shot.png"]


def test_the_size_may_come_from_the_parameters(app: App, tmp_path: Path) -> None:
    out = tmp_path / "new" / "folders" / "a.png"
    flags = ("--set", "render.width=20", "--set", "render.height=10", "--frames", 1, "--out", out)
    assert app("render", *flags).files() == [str(out)]
    assert png(out).shape == (10, 20, 3)
    app("render", *flags, "--size", "12x8").files()
    assert png(out).shape == (8, 12, 3), "a flag wins"


def test_one_pixel_is_a_picture_too(app: App, tmp_path: Path) -> None:
    for denoiser in ("none", "accumulate", "svgf", "reference"):
        app("render", "--size", "1x1", "--frames", 2, "--denoiser", denoiser, "--out", tmp_path / "a.png").files()
        assert png(tmp_path / "a.png").shape == (1, 1, 3)
