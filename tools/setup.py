"""Set-up behind ``make run`` and ``make test``: system libraries, then ``.venv`` with the pinned packages.

Standard library only, because it runs under the system's python3 before the environment exists. Once everything is
there it costs a few milliseconds: libraries are looked up by loading them, packages by a stamp inside ``.venv``.
"""

from __future__ import annotations

import argparse
import ctypes
import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OLDEST_PYTHON = (3, 11)
REQUIREMENTS = {"run": ("requirements.txt",), "test": ("requirements.txt", "requirements-dev.txt")}


class SetupError(Exception):
    """What is missing and what to do about it, for people."""


@dataclass(frozen=True)
class Need:
    """A shared library, or a command where ``command`` is set, and the Debian/Ubuntu packages that bring it."""

    name: str
    packages: tuple[str, ...]
    command: bool = False


GL = (Need("libEGL.so.1", ("libegl1",)), Need("libGL.so.1", ("libgl1",)))
EGL_DRIVER = Need("an OpenGL driver for EGL", ("libegl-mesa0", "libgl1-mesa-dri"))
# What imgui_bundle is linked with, whatever the session.
PANEL = (Need("libX11.so.6", ("libx11-6",)), Need("libXext.so.6", ("libxext6",)))
# What the glfw wheel loads by name at run time: the cursor and input libraries are needed to hide and follow the mouse.
X11 = (
    *PANEL,
    Need("libXcursor.so.1", ("libxcursor1",)),
    Need("libXi.so.6", ("libxi6",)),
    Need("libXinerama.so.1", ("libxinerama1",)),
    Need("libXrandr.so.2", ("libxrandr2",)),
)
WAYLAND = (
    *PANEL,
    Need("libwayland-client.so.0", ("libwayland-client0",)),
    Need("libwayland-cursor.so.0", ("libwayland-cursor0",)),
    Need("libwayland-egl.so.1", ("libwayland-egl1",)),
    Need("libxkbcommon.so.0", ("libxkbcommon0",)),
)
WINDOW_TESTS = (Need("Xvfb", ("xvfb",), command=True), Need("xdotool", ("xdotool",), command=True))
# What tries the report's page: welcome, but not every system has it as a package, and only those tests need it.
PAGE_TESTS = (Need("chromium", ("chromium",), command=True), Need("chromedriver", ("chromium-driver",), command=True))


class Machine:
    """The questions and commands that reach outside this file, in one place so that a test can answer them."""

    environ: Mapping[str, str] = os.environ
    python: tuple[int, ...] = sys.version_info[:3]

    def has(self, need: Need) -> bool:
        if need.command:
            return shutil.which(need.name, path=self.environ.get("PATH")) is not None
        try:
            ctypes.CDLL(need.name)
        except OSError:
            return False
        return True

    def has_module(self, name: str) -> bool:
        return importlib.util.find_spec(name) is not None

    def egl_initialises(self) -> bool:
        """In a process of its own: it loads the driver, and a broken driver may crash."""
        return subprocess.run([sys.executable, __file__, "probe-egl"], check=False).returncode == 0

    def is_root(self) -> bool:
        return os.geteuid() == 0

    def run(self, *command: str, quiet: bool = False) -> int:
        """Exit status of ``command``, run in the repository's root; 127 if there is no such command."""
        output = subprocess.DEVNULL if quiet else None
        try:
            return subprocess.run(command, cwd=ROOT, stdout=output, stderr=output, check=False).returncode
        except FileNotFoundError:
            return 127


def window_libraries(environ: Mapping[str, str]) -> tuple[Need, ...]:
    """What glfw and the panel need for a window in this session: nothing without a display.

    The choice between X11 and Wayland is the glfw wheel's own (``_get_package_path_variant`` in its library.py).
    """
    if not environ.get("DISPLAY") and not environ.get("WAYLAND_DISPLAY"):
        return ()
    variant = environ.get("PYGLFW_LIBRARY_VARIANT", "").lower() or environ.get("XDG_SESSION_TYPE")
    return WAYLAND if variant == "wayland" else X11


def system_needs(mode: str, environ: Mapping[str, str]) -> list[Need]:
    """Libraries and commands that ``make run`` or ``make test`` cannot do without; each once."""
    needs = GL + window_libraries(environ)
    if mode == "test":
        needs += X11 + WINDOW_TESTS
    return list(dict.fromkeys(needs))


def apt_command(needs: list[Need], machine: Machine) -> str:
    """The command for a person to type that installs ``needs``."""
    packages = " ".join(dict.fromkeys(package for need in needs for package in need.packages))
    sudo = "" if machine.is_root() else "sudo "
    return f"{sudo}apt-get update && {sudo}apt-get install -y {packages}"


def check_python(machine: Machine) -> None:
    """Raises SetupError unless this Python is new enough and can make an environment with pip in it."""
    have = ".".join(map(str, machine.python))
    oldest = ".".join(map(str, OLDEST_PYTHON))
    if machine.python < OLDEST_PYTHON:
        raise SetupError(
            f"python {oldest} or newer is needed, but {sys.executable} is {have}.\n"
            f"  Install a newer one and name it: make PYTHON=python{oldest} run"
        )
    if not (machine.has_module("venv") and machine.has_module("ensurepip")):
        minor = "{}.{}".format(*machine.python)
        raise SetupError(
            f"{sys.executable} cannot make virtual environments: its venv or ensurepip module is missing.\n"
            f"  Install it: {apt_command([Need('venv', (f'python{minor}-venv',))], machine)}"
        )


def apt_install(needs: list[Need], machine: Machine) -> bool:
    """Install with apt if that is possible without asking anybody; false if it is not, or if apt failed."""
    if not machine.has(Need("apt-get", (), command=True)):
        return False
    sudo: tuple[str, ...] = ()
    if not machine.is_root():
        if machine.run("sudo", "-n", "true", quiet=True) != 0:
            return False
        sudo = ("sudo", "-n")
    apt = (*sudo, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "-q", "-o", "DPkg::Lock::Timeout=120")
    packages = dict.fromkeys(package for need in needs for package in need.packages)
    install = (*apt, "install", "-y", "--no-install-recommends", *packages)
    print("set-up: installing with apt: " + " ".join(packages), flush=True)
    # Package lists are absent in a fresh image and stale on an old one: fetch them only when it turns out so.
    return machine.run(*install) == 0 or (machine.run(*apt, "update") == 0 and machine.run(*install) == 0)


def provide(needs: list[Need], machine: Machine) -> None:
    """Install what is missing. Raises SetupError, naming the command to type, if something still is afterwards."""
    missing = [need for need in needs if not machine.has(need)]
    if not missing:
        return
    apt_install(missing, machine)
    missing = [need for need in missing if not machine.has(need)]
    if missing:
        raise SetupError(_missing_message(missing, machine))


def offer(needs: tuple[Need, ...], machine: Machine) -> None:
    """Install what is missing if that is possible, or say what will be left out without it."""
    missing = [need for need in needs if not machine.has(need)]
    if missing and not apt_install(missing, machine):
        names = ", ".join(need.name for need in missing)
        print(f"set-up: without {names} some tests are skipped: {apt_command(missing, machine)}", flush=True)


def provide_driver(machine: Machine) -> None:
    """Libraries alone draw nothing: some EGL device must initialise (Mesa's software renderer will do)."""
    if machine.egl_initialises():
        return
    apt_install([EGL_DRIVER], machine)
    if not machine.egl_initialises():
        raise SetupError(_missing_message([EGL_DRIVER], machine))


def _missing_message(missing: list[Need], machine: Machine) -> str:
    return (
        f"missing on this machine: {', '.join(need.name for need in missing)}.\n"
        f"  Install it, then start again: {apt_command(missing, machine)}\n"
        "  (On a system without apt: the packages that bring the same files.)"
    )


def stamp_text(mode: str, machine: Machine, root: Path = ROOT) -> str:
    """Changes whenever ``.venv`` has to be set up again: other pins, another Python, another kind of processor."""
    digest = hashlib.sha256(f"{machine.python[:2]} {os.uname().machine}".encode())
    for name in REQUIREMENTS[mode]:
        digest.update((root / name).read_bytes())
    return digest.hexdigest()


def environment_is_current(mode: str, machine: Machine, root: Path = ROOT) -> bool:
    stamp = root / ".venv" / f"setup-{mode}"
    python = root / ".venv" / "bin" / "python"  # a link, dangling once the system's Python was replaced
    return python.exists() and stamp.exists() and stamp.read_text() == stamp_text(mode, machine, root)


def make_environment(mode: str, machine: Machine, root: Path = ROOT) -> None:
    """Create ``.venv`` if there is no usable one, install the pinned packages, leave the stamp."""
    venv = root / ".venv"
    python = venv / "bin" / "python"
    version = "{}.{}".format(*machine.python)
    site_packages = venv / "lib" / f"python{version}" / "site-packages"
    if not (python.exists() and (site_packages / "pip").is_dir()):
        print(f"set-up: making .venv with python {version}", flush=True)
        if machine.run(sys.executable, "-m", "venv", "--clear", str(venv)) != 0:
            raise SetupError(
                f"could not make the virtual environment {venv} (see above).\n"
                f"  Is the folder writable, and is there room on the disk? If venv itself is at fault: "
                f"{apt_command([Need('venv', (f'python{version}-venv',))], machine)}"
            )
    for name in REQUIREMENTS:  # from here until pip is done the environment is neither the old one nor the new
        (venv / f"setup-{name}").unlink(missing_ok=True)
    print("set-up: installing the pinned packages (once; about a minute)", flush=True)
    files = [argument for file in REQUIREMENTS[mode] for argument in ("-r", str(root / file))]
    pip = (str(python), "-m", "pip", "install", "--disable-pip-version-check", "--no-input", "--only-binary=:all:")
    if machine.run(*pip, *files) != 0:
        raise SetupError(
            "pip could not install the packages (see above).\n"
            "  Is the network up? Behind a proxy, set HTTPS_PROXY. Then start again.\n"
            f"  If it is, the pinned packages have no build for python {version} on {os.uname().machine}: "
            f"name another Python, as in make PYTHON=python3.12 {mode}"
        )
    for name in REQUIREMENTS if mode == "test" else (mode,):
        (venv / f"setup-{name}").write_text(stamp_text(name, machine, root))


def set_up(mode: str, machine: Machine) -> None:
    """Everything that ``make run`` or ``make test`` needs before it starts. Raises SetupError."""
    current = environment_is_current(mode, machine)
    if not current:
        check_python(machine)
    provide(system_needs(mode, machine.environ), machine)
    if not current:
        if mode == "test":
            offer(PAGE_TESTS, machine)
        provide_driver(machine)
        make_environment(mode, machine)


def probe_egl() -> bool:
    """Does any EGL device initialise? Devices are what a context without a display is made on."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    addresses = [egl.eglGetProcAddress(name) for name in (b"eglQueryDevicesEXT", b"eglGetPlatformDisplayEXT")]
    if not all(addresses):
        return False
    pointer, integer = ctypes.c_void_p, ctypes.c_int
    query = ctypes.CFUNCTYPE(ctypes.c_uint, integer, pointer, pointer)(addresses[0])
    platform_display = ctypes.CFUNCTYPE(pointer, ctypes.c_uint, pointer, pointer)(addresses[1])
    egl.eglInitialize.argtypes = [pointer, pointer, pointer]
    devices, count = (pointer * 16)(), integer()
    if not query(len(devices), devices, ctypes.byref(count)):
        return False
    egl_platform_device = 0x313F
    displays = [platform_display(egl_platform_device, devices[i], None) for i in range(count.value)]
    return any(display and egl.eglInitialize(display, None, None) for display in displays)


def main() -> int:
    parser = argparse.ArgumentParser(description="Set up what `make run` or `make test` needs. Safe to repeat.")
    parser.add_argument("mode", choices=[*REQUIREMENTS, "probe-egl"])
    mode = parser.parse_args().mode
    if mode == "probe-egl":
        return 0 if probe_egl() else 1
    try:
        set_up(mode, Machine())
    except SetupError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nset-up: interrupted; start again to go on", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
