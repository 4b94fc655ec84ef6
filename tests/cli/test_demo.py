"""What there is to see without a display."""

from __future__ import annotations

import re
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import config
import demo
import headless
import session
from images import to_srgb8
from tests.cli.runner import App, Outcome, png

SIZE = ("--size", "64x36")


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo, "ANIMATED", 6)


def panels(path: Path) -> list[np.ndarray]:
    """The pictures between the dark gaps of 4 pixels."""
    picture = png(path)
    return [picture[:, x : x + 64] for x in range(0, picture.shape[1], 68)]


def roughness(picture: np.ndarray) -> float:
    """Mean difference of neighbours."""
    return float(np.abs(np.diff(picture.astype(float), axis=1)).mean())


@pytest.mark.usefixtures("short")
def test_the_demo_writes_a_comparison_and_an_animation_and_prints_numbers(app: App, tmp_path: Path) -> None:
    outcome = app(*SIZE, "--out", tmp_path / "new")
    lines = outcome.files()
    picture, animation = tmp_path / "new" / "demo.png", tmp_path / "new" / "demo_flight.png"
    assert lines[1] == f"{picture}  noisy | SVGF"
    assert lines[2] == f"{animation}  animation"
    assert lines[3] == f"{picture}  noisy | SVGF | reference"

    noisy, filtered, reference = panels(picture)
    assert noisy.shape == filtered.shape == reference.shape == (36, 64, 3)
    assert roughness(filtered) < 0.6 * roughness(noisy)
    errors = [np.abs(panel.astype(float) - reference).mean() for panel in (noisy, filtered)]
    assert errors[1] < 0.7 * errors[0]

    rows = {row.split("  ")[0]: re.split(r"  +", row) for row in lines}
    assert float(rows["SVGF"][3]) < 0.5 * float(rows["noisy"][3])
    assert float(rows["SVGF"][2]) > 0.0
    assert lines[-2].startswith("64x36, ")


@pytest.mark.usefixtures("short")
def test_the_animation_goes_there_and_back_at_the_flight_s_own_speed(app: App, tmp_path: Path) -> None:
    app(*SIZE, "--out", tmp_path).files()
    with Image.open(tmp_path / "demo_flight.png") as image:
        assert (image.size, image.n_frames, image.info["loop"]) == ((32, 18), 10, 0)  # type: ignore[attr-defined]
        frames = []
        for index in range(10):
            image.seek(index)
            frames.append(np.asarray(image.convert("RGB")).astype(int))
            assert image.info["duration"] == 33
    for index in range(1, 5):
        np.testing.assert_array_equal(frames[5 + index], frames[5 - index])
    assert all((frames[index] != frames[index + 1]).any() for index in range(5))


@pytest.mark.usefixtures("short")
def test_noise_and_reference_are_of_the_same_frame(app: App, tmp_path: Path) -> None:
    app(*SIZE, "--out", tmp_path, "--set", "display.tonemap=none").files()
    settings = config.load(None, ("render.width=64", "render.height=36", "display.tonemap=none"))
    with ExitStack() as stack:
        shot = session.open_shot("cornell", settings, "flight", animate=False)
        stack.enter_context(shot.tracer)
        packet = shot.frame(demo.FIRST + demo.FRAMES - 1)
        truth = headless.reference_of(shot, packet, demo.SAMPLES, lambda share: None)
    noisy, _, reference = panels(tmp_path / "demo.png")
    for shown, expected in ((noisy, packet.radiance()), (reference, truth)):
        assert np.abs(shown.astype(int) - to_srgb8(expected)[::-1]).max() <= 1


def demo_of_a_file(app: App, folder: Path, *flags: object) -> Outcome:
    path = folder / "tile.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    return app(*SIZE, "--scene", path, *flags, "--out", folder / "out")


@pytest.mark.usefixtures("short")
def test_a_scene_without_a_flight_is_shown_standing_still(app: App, tmp_path: Path) -> None:
    lines = demo_of_a_file(app, tmp_path).files()
    assert "animation" not in "".join(lines)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["demo.png"]
    assert len(panels(tmp_path / "out" / "demo.png")) == 3


@pytest.mark.usefixtures("short")
def test_a_camera_that_is_asked_for_counts(app: App, tmp_path: Path) -> None:
    outcome = demo_of_a_file(app, tmp_path, "--camera", "flight")
    assert outcome.code == 2
    assert "tile has no flight" in outcome.err
    app(*SIZE, "--camera", "still", "--out", tmp_path / "still").files()
    assert [path.name for path in (tmp_path / "still").iterdir()] == ["demo.png"]


@pytest.mark.usefixtures("short")
def test_a_picture_of_nothing_but_light_has_no_error_to_print(app: App, tmp_path: Path) -> None:
    """One pixel that looks past the triangle at the sky."""
    path = tmp_path / "far.obj"
    path.write_text("v 9 9 9\nv 9.1 9 9\nv 9 9.1 9\nf 1 2 3\nv 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 4 5 6\n")
    lines = app("--size", "1x1", "--scene", path, "--out", tmp_path).files()
    assert [line.split()[-1] for line in lines if line.startswith(("noisy", "SVGF"))] == ["-", "-"]
