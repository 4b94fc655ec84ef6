"""Who may import whom, read from the source: imports inside functions and of relative names count as well."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = {"app", "cli", "demo", "doctor", "explain", "headless", "session"}
HELPERS = {"config", "console", "errors", "images", "parameter", "presets", "storage"}
OURS = COMMANDS | HELPERS | {"assets", "bench", "gl", "raytrace", "tests", "tools", "ui"}
OPENGL = {"moderngl", "glcontext", "OpenGL"}
EMBREE = {"embreex", "trimesh"}
WINDOWS = {"glfw", "imgui_bundle"}


@dataclass(frozen=True)
class Layer:
    """Own packages that the files under ``path`` may import, and others that they must not."""

    path: str
    ours: frozenset[str]
    banned: frozenset[str]
    only: frozenset[str] | None = None
    """If set: the only packages that are not ours and not of the standard library which may be imported."""


def layer(path: str, ours: str, banned: set[str], only: set[str] | None = None) -> Layer:
    return Layer(path, frozenset(ours.split()), frozenset(banned), None if only is None else frozenset(only))


LAYERS = [
    layer("errors.py", "", set(), only=set()),
    layer("parameter.py", "errors", set(), only=set()),
    layer("presets.py", "parameter", set(), only=set()),
    layer("config.py", "errors parameter presets", set(), only=set()),
    # What gl/ loads of raytrace/: neither may bring the tracer along.
    layer("raytrace/__init__.py", "", set(), only=set()),
    layer("raytrace/frame.py", "errors", set(), only={"numpy"}),
    layer("assets", "assets raytrace errors", OPENGL | EMBREE | WINDOWS),
    layer("raytrace", "raytrace config errors", OPENGL | WINDOWS),
    layer("gl", "gl raytrace.frame config parameter presets errors", EMBREE | WINDOWS),
    layer(
        "ui",
        "ui assets bench.judge gl raytrace config parameter presets console errors images session storage",
        EMBREE,
    ),
    layer(
        "bench",
        "assets bench gl raytrace config parameter console errors images session storage",
        OPENGL | WINDOWS | {"embreex"},
    ),
    layer(
        "app.py",
        "assets bench cli config demo doctor errors explain gl headless raytrace ui",
        OPENGL | EMBREE | WINDOWS,
    ),
    layer("bench/judge.py", "bench.metrics bench.metrics_visual raytrace.still", OPENGL | WINDOWS | EMBREE),
    layer("explain.py", "config parameter gl raytrace session ui.state", OPENGL | EMBREE | WINDOWS),
    layer("tools", "tools assets bench cli config parameter presets errors gl images raytrace session ui", WINDOWS),
]


def imported(source: str, package: str) -> Iterator[str]:
    """Dotted names that ``source``, a module of ``package``, imports; ``from a import b`` yields ``a.b``."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".") if package else []
            base = parents[: len(parents) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            yield from (f"{module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("__import__", "importlib.import_module"):
            yield ast.literal_eval(node.args[0])


def violations(source: str, package: str, rules: Layer) -> list[str]:
    """The names ``source`` imports against ``rules``, in order."""
    found = []
    for name in imported(source, package):
        top = name.partition(".")[0]
        if top in OURS:
            allowed = any(name == ours or name.startswith(f"{ours}.") for ours in rules.ours)
        elif rules.only is not None:
            allowed = top in rules.only or top in sys.stdlib_module_names
        else:
            allowed = top not in rules.banned
        if not allowed:
            found.append(name)
    return found


def check(path: str, source: str) -> list[str]:
    """What the file ``path`` with this content imports and must not; every layer it lies in counts."""
    package = ".".join(Path(path).parent.parts)
    found: list[str] = []
    for rules in LAYERS:
        if path == rules.path or path.startswith(f"{rules.path}/"):
            found += violations(source, package, rules)
    return found


def sources() -> list[str]:
    roots = [ROOT / rules.path for rules in LAYERS]
    files = {file for root in roots for file in (root.rglob("*.py") if root.is_dir() else [root]) if file.is_file()}
    return sorted(str(file.relative_to(ROOT)) for file in files)


@pytest.mark.parametrize("path", sources())
def test_layers_hold(path):
    assert check(path, (ROOT / path).read_text()) == []


@pytest.mark.parametrize(
    ("path", "source", "found"),
    [
        ("raytrace/worker.py", "import moderngl", ["moderngl"]),
        ("raytrace/worker.py", "def f():\n    from moderngl import Context", ["moderngl.Context"]),
        ("raytrace/worker.py", "from gl import graph", ["gl.graph"]),
        ("raytrace/worker.py", "from ..gl import graph", ["gl.graph"]),
        ("raytrace/worker.py", "from . import camera; from .frame import FramePacket; import embreex, numba", []),
        ("raytrace/frame.py", "import numba", ["numba"]),
        ("raytrace/frame.py", "from raytrace.camera import Camera", ["raytrace.camera.Camera"]),
        ("raytrace/__init__.py", "from .embree import Tracer", ["raytrace.embree.Tracer"]),
        ("gl/upload.py", "import embreex", ["embreex"]),
        ("gl/passes/svgf.py", "import raytrace", ["raytrace"]),
        ("gl/passes/svgf.py", "from raytrace import integrator", ["raytrace.integrator"]),
        ("gl/passes/svgf.py", "import importlib\nimportlib.import_module('glfw')", ["glfw"]),
        ("gl/passes/svgf.py", "from raytrace.frame import FramePacket; from ..graph import In; import moderngl", []),
        ("gl/passes/svgf.py", "from ...ui import window", ["ui.window"]),
        ("ui/window.py", "import glfw, moderngl, raytrace.worker, embreex", ["embreex"]),
        ("bench/report.py", "import moderngl, gl.executor, ui.window", ["moderngl", "ui.window"]),
        ("app.py", "import glfw, moderngl, doctor, ui.window", ["glfw", "moderngl"]),
        ("config.py", "import errors, tomllib, numpy, gl.graph", ["numpy", "gl.graph"]),
        ("errors.py", "import config", ["config"]),
    ],
)
def test_the_check_finds_what_it_should(path, source, found):
    assert check(path, source) == found
