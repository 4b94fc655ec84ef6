"""tools/setup.py with a machine that is told what it has, and the environment steps in a scratch folder."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from tools import setup
from tools.setup import EGL_DRIVER, GL, WAYLAND, WINDOW_TESTS, X11, Need, SetupError

ROOT = Path(__file__).resolve().parents[2]
EGL_LIBRARY = GL[0]


class FakeMachine(setup.Machine):
    """Lacks ``missing``, cannot run ``failing`` commands, and installs with apt what ``apt_brings``."""

    def __init__(
        self,
        missing: Sequence[str] = (),
        *,
        root: bool = True,
        failing: Sequence[str] = (),
        apt_brings: bool = True,
        apt_needs_update: bool = False,
    ) -> None:
        self.missing = set(missing)
        self.root = root
        self.failing = failing
        self.apt_brings = apt_brings
        self.lists_are_stale = apt_needs_update
        self.commands: list[str] = []
        self.environ = {}
        self.python = (3, 11, 2)

    def has(self, need: Need) -> bool:
        return need.name not in self.missing

    def has_module(self, name: str) -> bool:
        return name not in self.missing

    def egl_initialises(self) -> bool:
        return EGL_DRIVER.name not in self.missing

    def is_root(self) -> bool:
        return self.root

    def run(self, *command: str, quiet: bool = False) -> int:
        line = " ".join(command)
        self.commands.append(line)
        if any(word in line for word in self.failing):
            return 1
        if line.endswith("update"):
            self.lists_are_stale = False
        if " install " in line and "apt-get" in line:
            if self.lists_are_stale:
                return 100
            if self.apt_brings:
                self.missing.clear()
        return 0


def test_nothing_missing_runs_nothing():
    machine = FakeMachine()
    setup.provide(setup.system_needs("test", {}), machine)
    setup.provide_driver(machine)
    assert machine.commands == []


def test_root_installs_without_asking():
    machine = FakeMachine([EGL_LIBRARY.name, "xdotool"])
    setup.provide(setup.system_needs("test", {}), machine)
    assert len(machine.commands) == 1
    assert machine.commands[0].startswith("env DEBIAN_FRONTEND=noninteractive apt-get ")
    assert machine.commands[0].endswith(" install -y --no-install-recommends libegl1 xdotool")


def test_sudo_without_a_password_is_used():
    machine = FakeMachine([EGL_LIBRARY.name], root=False)
    setup.provide(list(GL), machine)
    assert machine.commands[0] == "sudo -n true"
    assert machine.commands[1].startswith("sudo -n env DEBIAN_FRONTEND=noninteractive apt-get ")


def test_stale_package_lists_are_fetched_once_and_the_installation_repeated():
    machine = FakeMachine([EGL_LIBRARY.name], apt_needs_update=True)
    setup.provide(list(GL), machine)
    assert [" install " in line for line in machine.commands] == [True, False, True]
    assert machine.commands[1].endswith(" update")


def test_without_root_or_sudo_the_command_is_printed():
    machine = FakeMachine(["libGL.so.1", "Xvfb"], root=False, failing=["sudo"])
    with pytest.raises(SetupError) as caught:
        setup.provide(setup.system_needs("test", {}), machine)
    assert "missing on this machine: libGL.so.1, Xvfb." in str(caught.value)
    assert "sudo apt-get update && sudo apt-get install -y libgl1 xvfb" in str(caught.value)
    assert machine.commands == ["sudo -n true"]


def test_without_apt_nothing_is_tried():
    machine = FakeMachine([EGL_LIBRARY.name, "apt-get"])
    with pytest.raises(SetupError, match=r"missing on this machine: libEGL\.so\.1\.\n.*apt-get install -y libegl1"):
        setup.provide(list(GL), machine)
    assert machine.commands == []


@pytest.mark.parametrize("machine", [{"failing": ["apt-get"]}, {"apt_brings": False}])
def test_an_installation_that_brings_nothing_is_an_error(machine):
    with pytest.raises(SetupError, match=r"libEGL\.so\.1"):
        setup.provide(list(GL), FakeMachine([EGL_LIBRARY.name], **machine))


def test_a_browser_is_welcome_but_nothing_fails_without_one(capsys):
    machine = FakeMachine(["chromium", "chromedriver"])
    setup.offer(setup.PAGE_TESTS, machine)
    assert machine.commands[0].endswith(" chromium chromium-driver")
    assert "without" not in capsys.readouterr().out
    setup.offer(setup.PAGE_TESTS, machine)
    assert len(machine.commands) == 1
    setup.offer(setup.PAGE_TESTS, FakeMachine(["chromedriver"], failing=["apt-get"]))
    assert "without chromedriver some tests are skipped: apt-get update && " in capsys.readouterr().out


def test_a_missing_driver_is_installed_or_named():
    machine = FakeMachine([EGL_DRIVER.name])
    setup.provide_driver(machine)
    assert machine.commands[0].endswith("libegl-mesa0 libgl1-mesa-dri")
    with pytest.raises(SetupError, match=r"an OpenGL driver for EGL.*\n.*libegl-mesa0 libgl1-mesa-dri"):
        setup.provide_driver(FakeMachine([EGL_DRIVER.name], apt_brings=False))


@pytest.mark.parametrize(
    ("environ", "libraries"),
    [
        ({}, ()),
        ({"XDG_SESSION_TYPE": "wayland"}, ()),
        ({"DISPLAY": ":0"}, X11),
        ({"DISPLAY": ":0", "XDG_SESSION_TYPE": "x11", "WAYLAND_DISPLAY": "wayland-0"}, X11),
        ({"DISPLAY": ":0", "XDG_SESSION_TYPE": "wayland", "WAYLAND_DISPLAY": "wayland-0"}, WAYLAND),
        ({"DISPLAY": ":0", "XDG_SESSION_TYPE": "wayland", "PYGLFW_LIBRARY_VARIANT": "x11"}, X11),
    ],
)
def test_window_libraries_are_those_glfw_will_load(environ, libraries):
    assert setup.window_libraries(environ) == libraries
    assert setup.system_needs("run", environ) == [*GL, *libraries]


def test_tests_need_a_virtual_display_whatever_the_session():
    assert setup.system_needs("test", {}) == [*GL, *X11, *WINDOW_TESTS]
    assert setup.system_needs("test", {"DISPLAY": ":0"}) == [*GL, *X11, *WINDOW_TESTS]


@pytest.mark.parametrize("version", [(2, 7, 18), (3, 10, 13)])
def test_an_old_python_is_named_with_what_to_do(version):
    machine = FakeMachine()
    machine.python = version
    with pytest.raises(SetupError, match=r"python 3\.11 or newer is needed.*\n.*make PYTHON=python3\.11 run"):
        setup.check_python(machine)


@pytest.mark.parametrize("module", ["venv", "ensurepip"])
def test_a_python_without_venv_is_named_with_the_package(module):
    with pytest.raises(SetupError, match=r"apt-get install -y python3\.11-venv"):
        setup.check_python(FakeMachine([module]))
    setup.check_python(FakeMachine())


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A folder with requirement files and an environment that looks whole."""
    (tmp_path / "requirements.txt").write_text("numpy==2.4.6\n")
    (tmp_path / "requirements-dev.txt").write_text("pytest==9.2.0\n")
    (tmp_path / ".venv/bin").mkdir(parents=True)
    (tmp_path / ".venv/bin/python").symlink_to(sys.executable)
    (tmp_path / ".venv/lib/python3.11/site-packages/pip").mkdir(parents=True)
    return tmp_path


def test_environment_is_made_once_and_again_when_something_it_depends_on_changes(checkout):
    machine = FakeMachine()
    assert not setup.environment_is_current("run", machine, checkout)
    setup.make_environment("run", machine, checkout)
    assert [line.partition(" install ")[2] for line in machine.commands] == [
        f"--disable-pip-version-check --no-input --only-binary=:all: -r {checkout}/requirements.txt"
    ]
    assert setup.environment_is_current("run", machine, checkout)
    assert not setup.environment_is_current("test", machine, checkout)

    setup.make_environment("test", machine, checkout)
    assert machine.commands[-1].endswith(f"-r {checkout}/requirements.txt -r {checkout}/requirements-dev.txt")
    assert setup.environment_is_current("test", machine, checkout)
    assert setup.environment_is_current("run", machine, checkout)

    (checkout / "requirements-dev.txt").write_text("pytest==9.2.1\n")
    assert setup.environment_is_current("run", machine, checkout)
    assert not setup.environment_is_current("test", machine, checkout)

    machine.python = (3, 12, 0)
    assert not setup.environment_is_current("run", machine, checkout)


def test_a_dangling_interpreter_is_not_current_and_is_replaced(checkout):
    machine = FakeMachine()
    setup.make_environment("run", machine, checkout)
    (checkout / ".venv/bin/python").unlink()
    (checkout / ".venv/bin/python").symlink_to("/nowhere/python3")
    assert not setup.environment_is_current("run", machine, checkout)
    setup.make_environment("run", machine, checkout)
    assert f"{sys.executable} -m venv --clear {checkout}/.venv" in machine.commands


def test_failures_of_venv_and_pip_say_what_to_do_and_leave_no_stamp(checkout):
    setup.make_environment("test", FakeMachine(), checkout)
    with pytest.raises(SetupError, match=r"HTTPS_PROXY(.|\n)*no build for python 3\.11(.|\n)*make PYTHON=\S+ run"):
        setup.make_environment("run", FakeMachine(failing=["pip install"]), checkout)
    assert not setup.environment_is_current("run", FakeMachine(), checkout)
    assert not setup.environment_is_current("test", FakeMachine(), checkout)
    (checkout / ".venv/bin/python").unlink()
    with pytest.raises(SetupError, match=r"could not make the virtual environment(.|\n)*python3\.11-venv"):
        setup.make_environment("run", FakeMachine(failing=["-m venv"]), checkout)


def test_the_real_machine_answers():
    machine = setup.Machine()
    assert machine.has(EGL_LIBRARY)
    assert not machine.has(Need("libNoSuchThing.so.1", ()))
    assert machine.has(Need("sh", (), command=True))
    assert not machine.has(Need("no-such-command", (), command=True))
    assert machine.has_module("venv")
    assert not machine.has_module("no_such_module")
    assert machine.egl_initialises()
    assert machine.run("no-such-command") == 127
    assert machine.run("sh", "-c", "exit 3") == 3


def test_without_any_driver_egl_does_not_initialise(monkeypatch):
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere.json")
    assert not setup.Machine().egl_initialises()


def test_errors_leave_as_a_message_and_a_status(monkeypatch, capsys):
    def fail(mode, machine):
        raise SetupError("missing: something.\n  Do this.")

    monkeypatch.setattr(setup, "set_up", fail)
    monkeypatch.setattr(sys, "argv", ["setup.py", "run"])
    assert setup.main() == 2
    assert capsys.readouterr().err == "error: missing: something.\n  Do this.\n"


@pytest.mark.skipif(
    not setup.environment_is_current("test", setup.Machine()), reason="this environment was not made by make test"
)
def test_a_second_start_adds_no_noticeable_time():
    empty = min(_seconds("-c", "pass") for _ in range(3))
    again = min(_seconds(str(ROOT / "tools" / "setup.py"), "test") for _ in range(3))
    assert again - empty < 0.2


def _seconds(*arguments: str) -> float:
    start = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, env=dict(os.environ), stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def test_every_requirement_is_pinned_and_no_index_is_named():
    for name in (*setup.REQUIREMENTS["test"], "requirements-compare.txt"):
        for line in (ROOT / name).read_text().splitlines():
            assert re.fullmatch(r"#.*|[A-Za-z0-9_]+==[0-9a-z.]+", line), f"{name}: {line}"
