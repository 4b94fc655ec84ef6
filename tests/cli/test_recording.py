"""``app.py record`` and ``app.py replay`` from end to end."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from bench.recording import exr
from bench.recording.layout import HEADER, NOTES
from bench.recording.sequence import open_sequence
from config import load
from gl.pipelines import remembered
from gl.renderer import Renderer, read
from raytrace.frame import FramePacket
from raytrace.shot import Shot
from session import open_shot
from tests.cli.runner import App, command, environment, png
from tests.unit.recordings import foreign

SMALL = ("--size", "48x32")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four frames of the Cornell box in motion, with references."""
    path = tmp_path_factory.mktemp("cli") / "box"
    words = ("record", "--animate", "--frames", "4", *SMALL, "--reference-spp", "16", "--out", str(path))
    subprocess.run(command(*words), env=environment(), check=True, capture_output=True)
    return path


def live(denoiser: str, *settings: str) -> list[np.ndarray]:
    """What the filter makes of the same frames as they are traced."""
    from gl.context import create_headless

    config = load(None, ["render.width=48", "render.height=32", *settings])
    ctx = create_headless()
    renderer = Renderer(ctx)
    shot = open_shot("cornell", config, None, animate=True)
    shot.remember = remembered(config, denoiser)
    with shot.tracer:
        images = [
            read(renderer.run(shot.frame(index), config, denoiser).outputs["radiance"])[..., :3] for index in range(4)
        ]
    renderer.release()
    ctx.release()
    return images


@pytest.mark.parametrize(
    ("denoiser", "tolerance"),
    [
        ("none", 0.0),
        ("svgf", 0.0),
        # BMFR's features are made from the camera's axes, which are in the matrices to single precision only.
        ("bmfr", 1e-3),
    ],
)
def test_a_replay_gives_the_picture_of_the_live_run(
    app: App, tmp_path: Path, folder: Path, denoiser: str, tolerance: float
) -> None:
    assert app("replay", folder, "--denoiser", denoiser, "--out", tmp_path).files()[-1] == str(tmp_path)
    for index, expected in enumerate(live(denoiser)):
        found = exr.read(tmp_path / f"denoised{index}.exr", 3)
        np.testing.assert_allclose(found, expected, rtol=tolerance, atol=tolerance)


def test_what_a_replay_writes(app: App, tmp_path: Path, folder: Path) -> None:
    out = app("replay", folder, "--denoiser", "accumulate", "--out", tmp_path)
    kinds = [f"{name}{index}" for name in ("denoised", "display") for index in range(4)]
    assert sorted(path.stem for path in tmp_path.iterdir()) == [*kinds, "metrics", "timings"]
    assert png(tmp_path / "display3.png").shape == (32, 48, 3)
    timings = json.loads((tmp_path / "timings.json").read_text())
    assert [row["frame"] for row in timings["frames"]] == [0, 1, 2, 3]
    assert {"upload", "accumulate.reproject", "modulate"} <= set(timings["frames"][2]["passes_ms"])
    row = timings["frames"][2]
    assert 0.0 < sum(row["passes_ms"].values()) <= row["frame_ms"] <= row["wall_ms"]
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    errors, noisy, floor = (metrics["summary"][kind] for kind in ("errors", "noisy", "of_reference"))
    for name in ("rmse", "relmse", "flip"):
        assert 0.0 < floor[name] < errors[name] < 0.8 * noisy[name]
    for name in ("psnr", "ssim"):
        assert floor[name] > errors[name] > noisy[name]
    assert 0.0 < floor["temporal"] < errors["temporal"] < noisy["temporal"]
    assert metrics["summary"]["means_something"] == dict.fromkeys(errors, True)
    assert [row["reference_samples"] for row in metrics["frames"]] == [16] * 4
    assert "temporal" not in metrics["frames"][0]["errors"]
    assert "rmse" in out.out


def test_an_error_below_the_reference_s_noise_is_only_a_bound(app: App, tmp_path: Path, folder: Path) -> None:
    """As if the picture were better than the reference."""
    for path in folder.iterdir():
        if path.is_file():
            (tmp_path / path.name).write_bytes(path.read_bytes())
    notes = json.loads((tmp_path / NOTES).read_text())
    for note in notes["references"].values():
        note["floors"] |= {"rmse": 10.0, "psnr": 3.0}
    (tmp_path / NOTES).write_text(json.dumps(notes))
    out = app("replay", tmp_path, "--out", tmp_path / "out")
    lines = {line.split()[0]: line.split()[1:3] for line in out.out.splitlines()}
    assert (lines["rmse"], lines["psnr"]) == (["<", "10"], [">", "3"])
    summary = json.loads((tmp_path / "out" / "metrics.json").read_text())["summary"]
    assert [name for name, known in summary["means_something"].items() if known is False] == ["rmse", "psnr"]


def test_gradients_are_recorded_for_the_method_that_reads_them(app: App, tmp_path: Path, folder: Path) -> None:
    told = app("replay", folder, "--denoiser", "asvgf", "--out", tmp_path / "out").error()
    assert f"--denoiser asvgf: {folder} has no gradient0.exr" in told
    assert "--denoiser svgf --set svgf.fast_clamp=true" in told
    words = ("record", "--animate", *SMALL, "--gradients", "--out", tmp_path / "box")
    app(*words, "--frames", "3")
    app(*words, "--frames", "4")  # goes on as if it had not stopped
    app("replay", tmp_path / "box", "--denoiser", "asvgf", "--out", tmp_path / "out")
    for index, expected in enumerate(live("asvgf")):
        np.testing.assert_array_equal(exr.read(tmp_path / "out" / f"denoised{index}.exr", 3), expected)
    assert "gradients is True there, not False" in app("record", "--animate", *SMALL, "--out", tmp_path / "box").error()


def test_a_part_of_the_frames(app: App, tmp_path: Path, folder: Path) -> None:
    app("replay", folder, "--frames", "1:3", "--denoiser", "none", "--out", tmp_path)
    assert sorted(path.name for path in tmp_path.glob("*.exr")) == ["denoised1.exr", "denoised2.exr"]


def test_frames_of_another_program(app: App, tmp_path: Path) -> None:
    foreign(tmp_path / "theirs")
    told = app("replay", tmp_path / "theirs", "--out", tmp_path / "out")
    assert told.code == 0
    assert "theirs: direct and indirect light are not told apart: SVGF filters their sum" in told.err
    assert not (tmp_path / "out" / "metrics.json").exists()
    passes = json.loads((tmp_path / "out" / "timings.json").read_text())["frames"][0]["passes_ms"]
    assert any(name.startswith("svgf.both") for name in passes)
    sequence = open_sequence(tmp_path / "theirs")
    noisy, clean = sequence.packet(2).radiance(), exr.read(tmp_path / "out" / "denoised2.exr", 3)
    floor = sequence.packet(2).motion[..., 3] >= 0.0
    assert clean[floor].std() < 0.3 * noisy[floor].std()
    assert clean[floor].mean() == pytest.approx(noisy[floor].mean(), rel=0.3)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("record --out {} --frames 0", "--frames 0: must be a whole number in [1;1000000]"),
        ("record --out {} --reference-spp 0", "--reference-spp 0: must be a whole number"),
        ("record --out {} --scene cornel", "did you mean 'cornell'?"),
        ("record --out {} --camera nowhere.json", "nowhere.json: cannot be read"),
        ("record --out /proc/nowhere", "/proc/nowhere/.probe: cannot be written"),
        ("record --out {} --frames 1000000 --size 4096x4096", "{}: 1000000 frames of 4096x4096 need"),
        ("replay", "the following arguments are required: DIR"),
        ("replay {}", "there is no camera_matrices.h in it"),
        ("replay {}/nowhere", "nowhere: there is no such folder"),
        ("replay {} --frames 3", "--frames 3: must be A:B"),
        ("replay {} --frames b:a", "--frames b:a: must be A:B"),
        ("replay {} --denoiser reference", "there are: none, accumulate, svgf"),
        ("replay {} --window", "--window: there is no display"),
    ],
)
def test_mistakes(app: App, tmp_path: Path, words: str, message: str) -> None:
    told = app(*words.format(tmp_path).split()).error()
    assert message.format(tmp_path) in told


@pytest.mark.parametrize("frames", ["4:6", "3:3", "3:1", ":0", "7:"])
def test_frames_that_are_not_there(app: App, tmp_path: Path, folder: Path, frames: str) -> None:
    told = app("replay", folder, "--frames", frames, "--out", tmp_path / "out").error()
    assert f"--frames {frames}: {folder} has the frames 0 to 3\n  A:B is from frame A up to frame B - 1" in told


def test_a_replay_does_not_write_over_the_recording(app: App, folder: Path) -> None:
    assert "is the recording itself" in app("replay", folder, "--out", folder).error()


def test_a_broken_file_ends_a_replay_with_one_message(app: App, tmp_path: Path) -> None:
    foreign(tmp_path)
    path = tmp_path / "color1.exr"
    path.write_bytes(path.read_bytes()[:-20])
    assert "color1.exr: is only half written" in app("replay", tmp_path, "--out", tmp_path / "out").error()


def test_more_frames_later(app: App, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ("record", "--scene", "cornell", *SMALL, "--out", tmp_path)
    app(*words, "--frames", 1)
    traced: list[int] = []
    frame = Shot.frame

    def noting(shot: Shot, index: int) -> FramePacket:
        traced.append(index)
        return frame(shot, index)

    monkeypatch.setattr(Shot, "frame", noting)
    told = app(*words, "--frames", 3)
    assert (told.code, traced) == (0, [1, 2])
    assert f"{tmp_path}: 1 frame is there already" in told.err
    assert open_sequence(tmp_path).frames == 3
    told = app(*words, "--frames", 3, "--seed", 1)
    assert "holds another recording: seed is 0 there, not 1" in told.error()


@pytest.mark.parametrize("references", [False, True])
def test_an_interrupted_recording_is_kept_and_goes_on(tmp_path: Path, references: bool) -> None:
    """By Ctrl-C in the middle of the frames, or of the references."""
    words = ["record", *SMALL, "--out", str(tmp_path / "box"), "--frames", "2" if references else "5000"]
    words += ["--reference-spp", "1000000"] if references else []
    running = subprocess.Popen(command(*words), env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    wanted = tmp_path / "box" / ("reference0.exr" if references else "world_position5.exr")
    end = time.monotonic() + 120
    while not wanted.exists():
        assert running.poll() is None, running.communicate()
        assert time.monotonic() < end
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=60)
    assert running.returncode == 130, err
    assert "the same command goes on\ninterrupted\n" in err.decode()
    sequence = open_sequence(tmp_path / "box")
    assert sequence.frames >= 2
    sequence.packet(sequence.frames - 1)
    assert not list((tmp_path / "box").glob(".*.exr"))
    if references:
        assert sequence.notes["references"]["0"]["samples"] > 0
    assert (tmp_path / "box" / HEADER).exists()


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="this system cannot limit the size of files")
def test_a_disk_that_is_full(tmp_path: Path) -> None:
    """Files may not become longer than 4 kB: what was recorded before is kept, and one message told."""
    words = ["record", "--frames", "3", "--size", "64x48", "--out", str(tmp_path / "box")]
    limited = ["bash", "-c", 'ulimit -f 4; trap "" XFSZ; exec "$@"', "bash", *command(*words)]
    done = subprocess.run(limited, env=environment(), capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert "cannot be written" in done.stderr
    assert "Traceback" not in done.stderr
    assert [path.name for path in (tmp_path / "box").glob("*.exr")] == []
