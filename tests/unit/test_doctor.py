"""doctor.py: the report here, and what it says when something is missing, broken or too old."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import doctor
from doctor import Facts
from tools import setup
from tools.setup import Need

SOUND: dict[str, Facts] = {
    "gl": {"version": "450", "renderer": "some card", "shared_memory": "32768"},
    "embree": {"distance": "2", "backend": "Embree's library"},
    "numba": {"cpu": "some processor"},
    "window": {"version": "3.4.0", "platform": "X11"},
}


@pytest.fixture
def probes(monkeypatch) -> dict[str, Facts]:
    """Answers of the probes, to be changed by the test; no display, every library and package present."""
    answers = {name: dict(facts) for name, facts in SOUND.items()}
    monkeypatch.setattr(doctor, "probe", answers.__getitem__)
    monkeypatch.setattr(setup.Machine, "environ", {})
    monkeypatch.setattr(setup.Machine, "has", lambda self, need: True)
    monkeypatch.setattr(setup.Machine, "is_root", lambda self: False)
    return answers


def line(text: str, subject: str) -> str:
    """The report's line about ``subject`` and the advice below it."""
    lines = text.splitlines()
    at = next(i for i, found in enumerate(lines) if found[9:].startswith(subject))
    return "\n".join(lines[at : at + 2])


def test_real_report_names_everything_and_is_ok():
    text, ok = doctor.report()
    assert ok, text
    for subject in ("python", "packages", "libraries", "opengl", "embree", "numba", "cores", "display", "cache"):
        assert line(text, subject)
    assert "KiB shared memory" in line(text, "opengl")
    assert line(text, "embree").startswith("ok       embree    a ray hits a triangle at 2; rays go through ")


def test_headless_is_a_note_and_no_failure(probes):
    probes["window"] = {"error": "no display"}
    text, ok = doctor.report()
    assert ok
    assert line(text, "display").startswith("note")
    assert "make run" in line(text, "display")


def test_a_window_that_opens_is_told_and_one_that_does_not_is_a_failure(probes, monkeypatch):
    monkeypatch.setattr(setup.Machine, "environ", {"DISPLAY": ":9"})
    text, ok = doctor.report()
    assert ok
    assert "DISPLAY=:9: glfw 3.4.0 opens a window on X11" in text
    probes["window"] = {"error": "cannot open :9"}
    text, ok = doctor.report()
    assert not ok
    assert line(text, "display").startswith("MISSING")
    assert "cannot open :9" in text


def test_opengl_without_context_and_too_old(probes):
    probes["gl"] = {"error": "eglInitialize failed"}
    text, ok = doctor.report()
    assert not ok
    assert "no context through EGL: eglInitialize failed" in line(text, "opengl")
    assert "sudo apt-get install -y libegl1 libgl1 libegl-mesa0 libgl1-mesa-dri" in line(text, "opengl")
    probes["gl"] = {"version": "330", "renderer": "old card", "shared_memory": "0"}
    text, ok = doctor.report()
    assert not ok
    assert line(text, "opengl").startswith("MISSING  opengl    3.3 on old card")
    assert "OpenGL 4.3 is needed" in line(text, "opengl")


@pytest.mark.parametrize("subject", ["embree", "numba"])
def test_broken_libraries(probes, subject):
    probes[subject] = {"error": "crashed (signal 4)"}
    text, ok = doctor.report()
    assert not ok
    assert line(text, subject).startswith(f"MISSING  {subject:<9} crashed (signal 4)\n")
    assert "make run" in line(text, subject)


def test_missing_system_libraries_with_the_command_that_brings_them(probes, monkeypatch):
    def has(self: setup.Machine, need: Need) -> bool:
        return need.name not in ("libEGL.so.1", "libXi.so.6")

    monkeypatch.setattr(setup.Machine, "has", has)
    monkeypatch.setattr(setup.Machine, "environ", {"DISPLAY": ":9"})
    text, ok = doctor.report()
    assert not ok
    assert "libEGL.so.1 not found" in line(text, "libraries")
    assert line(text, "libraries").endswith("sudo apt-get update && sudo apt-get install -y libegl1")
    assert line(text, "window").endswith("sudo apt-get install -y libxi6")


def test_packages_are_compared_with_the_pins(probes, monkeypatch):
    real = doctor._version
    monkeypatch.setattr(doctor, "_version", lambda name: "1.0" if name == "numpy" else real(name))
    text, ok = doctor.report()
    assert not ok
    assert "numpy 1.0 (pinned: 2." in line(text, "packages")
    assert doctor._version("numpy") == "1.0"
    assert real("no-such-package") == "not installed"


def test_an_old_python(probes, monkeypatch):
    monkeypatch.setattr(setup.Machine, "python", (3, 10, 1))
    text, ok = doctor.report()
    assert not ok
    assert "make PYTHON=python3.11 run" in line(text, "python")


def test_cache_folder_must_be_writable(probes, monkeypatch, tmp_path):
    monkeypatch.setattr(setup.Machine, "environ", {"NUMBA_CACHE_DIR": str(tmp_path / "new")})
    assert f"{tmp_path}/new is writable" in doctor.report()[0]
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(setup.Machine, "environ", {"NUMBA_CACHE_DIR": str(tmp_path / "file")})
    text, ok = doctor.report()
    assert not ok
    assert "set NUMBA_CACHE_DIR" in line(text, "cache")


def test_without_a_writable_checkout_the_users_cache_is_taken(probes, monkeypatch, tmp_path):
    (tmp_path / "raytrace").write_text("a file where the folder should be")
    monkeypatch.setattr(doctor, "ROOT", tmp_path)
    (tmp_path / "requirements.txt").write_text("")
    monkeypatch.setattr(setup.Machine, "environ", {"XDG_CACHE_HOME": str(tmp_path / "home")})
    text, ok = doctor.report()
    assert ok, text
    assert f"{tmp_path}/home/numba is writable" in line(text, "cache")


@pytest.mark.parametrize(
    ("body", "error"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "crashed (signal 11)"),
        ("raise RuntimeError('no such device')", "RuntimeError: no such device"),
        ("raise SystemExit(7)", "exit status 7"),
        ("import time; time.sleep(30)", "no answer within 1 s"),
    ],
)
def test_a_probe_survives_what_it_tries(monkeypatch, tmp_path, body, error):
    (tmp_path / "doctor.py").write_text(body)
    monkeypatch.setattr(doctor, "ROOT", tmp_path)
    monkeypatch.setattr(doctor, "PROBE_SECONDS", 1.0)
    assert doctor.probe("gl") == {"error": error}


def test_a_probe_returns_its_last_line(monkeypatch, tmp_path):
    (tmp_path / "doctor.py").write_text("import sys; print('noise'); print('{\"name\": \"' + sys.argv[1] + '\"}')")
    monkeypatch.setattr(doctor, "ROOT", tmp_path)
    assert doctor.probe("gl") == {"name": "gl"}


def test_without_the_packages_the_doctor_still_speaks(tmp_path):
    """The report imports nothing but the standard library, so a bare Python can print it."""
    code = "import sys; sys.path.insert(0, sys.argv[1]); import doctor; print(doctor._packages())"
    root = str(Path(doctor.__file__).parent)
    command = [sys.executable, "-S", "-B", "-c", code, root]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    assert "numpy not installed" in done.stdout
    assert done.stdout.startswith("MISSING")
