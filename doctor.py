"""``app.py doctor``: what the program needs, what is there of it, and what to do about the rest.

Each library is tried in a process of its own (this file, run with the probe's name): a driver that crashes or hangs
must not take the report down with it.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools import setup

ROOT = Path(__file__).resolve().parent
OLDEST_GL = 430
PROBE_SECONDS = 60.0
REINSTALL = "run `make run` again: it installs the pinned packages"

Facts = dict[str, str]


@dataclass(frozen=True)
class Finding:
    """One line of the report. ``ok`` None: missing, but only some of the program needs it."""

    ok: bool | None
    subject: str
    found: str
    advice: str = ""

    def __str__(self) -> str:
        mark = {True: "ok", False: "MISSING", None: "note"}[self.ok]
        text = f"{mark:<8} {self.subject:<9} {self.found}"
        return f"{text}\n{'':<19}-> {self.advice}" if self.advice else text


def report() -> tuple[str, bool]:
    """The report for people, one line per subject, and whether everything is there that every run needs."""
    machine = setup.Machine()
    with ThreadPoolExecutor() as pool:
        probed = dict(zip(PROBES, pool.map(probe, PROBES), strict=True))
    findings = [
        _python(machine),
        _packages(),
        *_libraries(machine),
        _opengl(probed["gl"], machine),
        _embree(probed["embree"]),
        _numba(probed["numba"]),
        _processor(),
        _display(probed["window"], machine),
        _cache(machine.environ),
    ]
    ok = all(finding.ok is not False for finding in findings)
    summary = "Everything that is needed is there." if ok else "Something is missing: see the lines marked MISSING."
    return "\n".join([*map(str, findings), "", summary]), ok


def probe(name: str) -> Facts:
    """What a probe found, or ``{"error": why}``, whatever the library does to the process that loads it."""
    command = [sys.executable, str(ROOT / "doctor.py"), name]
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PROBE_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return {"error": f"no answer within {PROBE_SECONDS:.0f} s"}
    if done.returncode < 0:
        return {"error": f"crashed (signal {-done.returncode})"}
    if done.returncode > 0:
        lines = done.stderr.strip().splitlines()
        return {"error": lines[-1] if lines else f"exit status {done.returncode}"}
    facts: Facts = json.loads(done.stdout.splitlines()[-1])
    return facts


def _python(machine: setup.Machine) -> Finding:
    found = ".".join(map(str, machine.python)) + f" ({sys.executable})"
    if machine.python >= setup.OLDEST_PYTHON:
        return Finding(True, "python", found)
    oldest = "{}.{}".format(*setup.OLDEST_PYTHON)
    return Finding(False, "python", found, f"python {oldest} or newer is needed: make PYTHON=python{oldest} run")


def _packages() -> Finding:
    """Installed versions against the pinned ones."""
    pins = [line.split("==") for line in (ROOT / "requirements.txt").read_text().splitlines() if "==" in line]
    wrong = [f"{name} {_version(name)} (pinned: {pin})" for name, pin in pins if _version(name) != pin]
    if wrong:
        return Finding(False, "packages", ", ".join(wrong), REINSTALL)
    return Finding(True, "packages", ", ".join(f"{name} {pin}" for name, pin in pins))


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _libraries(machine: setup.Machine) -> list[Finding]:
    """EGL and GL, which every run needs, and glfw's, which only a window does."""
    findings = []
    for subject, needs in (("libraries", setup.GL), ("window", setup.window_libraries(machine.environ))):
        missing = [need for need in needs if not machine.has(need)]
        names = ", ".join(need.name for need in missing or needs)
        if missing:
            findings.append(Finding(False, subject, f"{names} not found", setup.apt_command(missing, machine)))
        elif needs:
            findings.append(Finding(True, subject, names))
    return findings


def _opengl(facts: Facts, machine: setup.Machine) -> Finding:
    install = setup.apt_command([*setup.GL, setup.EGL_DRIVER], machine)
    if "error" in facts:
        return Finding(False, "opengl", f"no context through EGL: {facts['error']}", install)
    version = int(facts["version"])
    kib = int(facts["shared_memory"]) // 1024
    found = f"{version // 100}.{version // 10 % 10} on {facts['renderer']}, {kib} KiB shared memory in compute"
    if version < OLDEST_GL:
        return Finding(False, "opengl", found, f"OpenGL 4.3 is needed: a newer driver, or Mesa's own: {install}")
    return Finding(True, "opengl", found)


def _embree(facts: Facts) -> Finding:
    if "error" in facts:
        return Finding(False, "embree", facts["error"], REINSTALL)
    return Finding(True, "embree", f"a ray hits a triangle at {facts['distance']}; rays go through {facts['backend']}")


def _numba(facts: Facts) -> Finding:
    if "error" in facts:
        return Finding(False, "numba", facts["error"], REINSTALL)
    return Finding(True, "numba", f"compiles for {facts['cpu']}")


def _processor() -> Finding:
    usable = len(os.sched_getaffinity(0))
    return Finding(True, "cores", f"{usable} of {os.cpu_count()} usable; render.threads = 0 traces on {usable}")


def _display(facts: Facts, machine: setup.Machine) -> Finding:
    session = [f"{name}={value}" for name in ("DISPLAY", "WAYLAND_DISPLAY") if (value := machine.environ.get(name))]
    if not session:
        advice = "without a display `make run` opens no window but renders a demo to out/"
        return Finding(None, "display", "DISPLAY and WAYLAND_DISPLAY are not set", advice)
    if "error" in facts:
        advice = "is the display server running, and may this user use it? Without DISPLAY everything runs headless"
        return Finding(False, "display", f"{', '.join(session)}, but glfw: {facts['error']}", advice)
    return Finding(
        True, "display", f"{', '.join(session)}: glfw {facts['version']} opens a window on {facts['platform']}"
    )


def _cache_folders(environ: Mapping[str, str]) -> list[Path]:
    """Where Numba keeps compiled kernels: the first of these that can be written to."""
    if chosen := environ.get("NUMBA_CACHE_DIR"):
        return [Path(chosen)]
    users = Path(environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return [ROOT / "raytrace" / "__pycache__", users / "numba"]


def _cache(environ: Mapping[str, str]) -> Finding:
    problems = []
    for folder in _cache_folders(environ):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError as error:
            problems.append(f"{folder}: {error.strerror}")
        else:
            return Finding(True, "cache", f"{folder} is writable")
    advice = "Numba needs one for its compiled kernels: set NUMBA_CACHE_DIR to a folder you may write to"
    return Finding(False, "cache", "; ".join(problems), advice)


def _probe_gl() -> Facts:
    import moderngl

    ctx = moderngl.create_context(standalone=True, backend="egl")  # type: ignore[arg-type]  # the newest there is
    shared_memory = ctypes.c_int()
    gl_max_compute_shared_memory_size = 0x8262
    ctypes.CDLL("libGL.so.1").glGetIntegerv(gl_max_compute_shared_memory_size, ctypes.byref(shared_memory))
    renderer = ctx.info["GL_RENDERER"]
    return {"version": str(ctx.version_code), "renderer": renderer, "shared_memory": str(shared_memory.value)}


def _probe_embree() -> Facts:
    import numpy as np
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    scene = rtcore_scene.EmbreeScene()
    triangle = np.array([[[-1, -1, 2], [1, -1, 2], [0, 1, 2]]], np.float32)
    mesh = TriangleMesh(scene, triangle)
    origin, direction = np.zeros((1, 3), np.float32), np.array([[0, 0, 1]], np.float32)
    hit = scene.run(origin, direction, output=True)
    if hit["primID"][0] != 0:
        raise RuntimeError("the ray misses the triangle")
    del mesh
    from raytrace.embree import describe_backend

    return {"distance": f"{hit['tfar'][0]:.6g}", "backend": describe_backend()}


def _probe_numba() -> Facts:
    import llvmlite.binding
    from numba import njit

    double = njit(lambda x: 2 * x)
    if double(21) != 42:
        raise RuntimeError("a compiled function returns a wrong result")
    return {"cpu": llvmlite.binding.get_host_cpu_name()}


def _probe_window() -> Facts:
    import glfw

    def reason() -> str:
        text: Any = glfw.get_error()[1]
        return bytes(text).decode(errors="replace") if text else "no reason given"  # bytes, whatever its stub says

    glfw.ERROR_REPORTING = "ignore"  # as exceptions the messages would be bytes
    if not glfw.init():
        raise RuntimeError(reason())
    glfw.window_hint(glfw.VISIBLE, False)
    glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, OLDEST_GL // 100)
    glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, OLDEST_GL // 10 % 10)
    glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
    window = glfw.create_window(64, 64, "doctor", None, None)
    if not window:
        raise RuntimeError(reason())
    glfw.destroy_window(window)
    version = ".".join(map(str, glfw.get_version()))
    platform = {glfw.PLATFORM_X11: "X11", glfw.PLATFORM_WAYLAND: "Wayland"}.get(glfw.get_platform(), "other platform")
    glfw.terminate()
    return {"version": version, "platform": platform}


PROBES: dict[str, Callable[[], Facts]] = {
    "gl": _probe_gl,
    "embree": _probe_embree,
    "numba": _probe_numba,
    "window": _probe_window,
}


if __name__ == "__main__":
    print(json.dumps(PROBES[sys.argv[1]]()))
