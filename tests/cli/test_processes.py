"""Whole processes: missing and old OpenGL, signals, closed pipes. Dear, at a second each: what needs no process of its
own is tested elsewhere."""

from __future__ import annotations

import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests.cli.runner import SECONDS, SMALL, command, environment, process

QUICK = ("render", *SMALL, "--frames", "1")
NO_DRIVER = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent"}


def test_a_picture_from_another_folder(tmp_path: Path) -> None:
    done = process(*QUICK, cwd=tmp_path)
    assert (done.code, done.out) == (0, "out/shot.png\n")
    assert (tmp_path / "out" / "shot.png").exists()


def test_without_an_egl_driver(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("an earlier picture")
    error = process(*QUICK, "--out", tmp_path / "a.png", env=environment(**NO_DRIVER)).error()
    assert "no headless OpenGL" in error
    assert "apt install libegl1 libgl1-mesa-dri" in error
    assert (tmp_path / "a.png").read_text() == "an earlier picture"


@pytest.mark.parametrize("version", ["3.3", "4.2"])
def test_with_an_old_opengl(ctx: object, tmp_path: Path, version: str) -> None:
    env = environment(MESA_GL_VERSION_OVERRIDE=version)
    error = process(*QUICK, "--out", tmp_path / "a.png", env=env).error()
    assert f"OpenGL {version} of" in error
    assert "4.3 is needed" in error


def test_with_a_display_that_is_not_there(tmp_path: Path) -> None:
    error = process("--out", tmp_path, env=environment(DISPLAY=":987")).error()
    assert "no window: " in error
    assert "app.py doctor" in error
    assert "app.py render works without a window" in error


def test_the_doctor_finds_a_missing_driver() -> None:
    done = process("doctor", env=environment(**NO_DRIVER))
    assert (done.code, done.err) == (2, "")
    assert "MISSING  opengl" in done.out


def test_help_does_not_wait_for_a_compiler() -> None:
    """What takes long to import is not imported: by the clock this could not be told on a busy machine."""
    script = (
        "import sys, runpy; sys.argv = ['app.py', 'render', '--help']\n"
        "try: runpy.run_path('app.py', run_name='__main__')\n"
        "except SystemExit as left: code = left.code\n"
        "print(code, [name for name in ('numpy', 'numba', 'moderngl', 'glfw', 'embreex') if name in sys.modules])"
    )
    words = [command()[0], "-c", script]
    root = Path(command()[1]).parent
    done = subprocess.run(words, cwd=root, capture_output=True, text=True, timeout=SECONDS, check=True)
    assert done.stdout.splitlines()[-1] == "0 []"


def test_ctrl_c_ends_a_long_reference_quietly_and_soon(tmp_path: Path) -> None:
    out = tmp_path / "new" / "a.png"
    words = ("render", *SMALL, "--denoiser", "reference", "--spp", "10000000", "--out", out)
    with subprocess.Popen(
        command(*words), env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as running:
        deadline = time.monotonic() + SECONDS
        while not out.parent.exists():  # made when everything is imported
            assert time.monotonic() < deadline
            time.sleep(0.05)
        time.sleep(2.0)
        running.send_signal(signal.SIGINT)
        printed, errors = running.communicate(timeout=SECONDS)
    assert (running.returncode, printed) == (130, "")
    assert errors.splitlines()[-1] == "interrupted"
    assert "Traceback" not in errors
    assert list(out.parent.iterdir()) == []


def test_a_reader_that_has_seen_enough() -> None:
    with subprocess.Popen(
        command("graph"), env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        running.stdout.close()
        assert running.stderr.read() == ""
        assert running.wait(SECONDS) == 141
