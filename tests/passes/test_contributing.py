"""The worked example of CONTRIBUTING.md, block by block: it is a pass that runs."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import moderngl
import numpy as np
import pytest

from gl import pipelines
from tests.passes.harness import Bench, frame
from tests.unit.documents import blocks

EXAMPLE = {block.title: block.text for block in blocks("CONTRIBUTING.md") if block.language in ("python", "glsl")}
PASS, SHADER, TEST = "gl/passes/despeckle.py", "gl/shaders/despeckle/bound.frag", "tests/passes/test_despeckle.py"
BUILDER = "gl/pipelines.py"


def run(title: str, names: dict[str, Any]) -> dict[str, Any]:
    """The names that a block defines, executed with ``names`` around it."""
    exec(compile(EXAMPLE[title], f"CONTRIBUTING.md ({title})", "exec", dont_inherit=True), names)
    return names


@pytest.fixture
def despeckle(ctx: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """A bench with the example among its denoisers and its shaders."""
    module = ModuleType("gl.passes.despeckle")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    run(PASS, module.__dict__)
    builders = run(BUILDER, dict(vars(pipelines)))
    monkeypatch.setitem(pipelines._BUILDERS, "despeckle", builders["_despeckle"])
    bench = Bench(ctx, tmp_path)
    shader = tmp_path / SHADER.removeprefix("gl/shaders/")
    shader.parent.mkdir()
    shader.write_text(EXAMPLE[SHADER])
    return bench


def test_the_example_passes_its_own_test(despeckle: Bench) -> None:
    names = run(TEST, {})
    tests = [value for name, value in names.items() if name.startswith("test_")]
    assert len(tests) == 1
    tests[0](despeckle)
    despeckle.release()


def test_the_example_bounds_and_leaves_the_rest(despeckle: Bench) -> None:
    """A spike goes down to its brightest neighbour, in a corner too; NaN is not spread; what is dark stays dark."""
    rng = np.random.default_rng(1)
    light = rng.uniform(0.5, 1.0, (12, 18, 1)) * (1.0, 0.5, 0.25)
    light[0, 0] = light[6, 9] = 50.0
    light[3, 3] = np.nan
    light[9:, 14:] = 0.0
    radiance = despeckle.denoise(frame((18, 12), direct=light), denoiser="despeckle")["radiance"][..., :3]
    despeckle.release()
    luminance = radiance @ np.array([0.2126, 0.7152, 0.0722])
    before = light @ np.array([0.2126, 0.7152, 0.0722])
    assert np.isfinite(radiance).all()
    assert luminance[0, 0] == pytest.approx(max(before[0, 1], before[1, 0], before[1, 1]), rel=1e-3)
    neighbours = np.delete(before[5:8, 8:11].ravel(), 4)
    assert luminance[6, 9] == pytest.approx(neighbours.max(), rel=1e-3)
    assert (radiance[9:, 14:] == 0.0).all()
    assert (luminance <= np.nan_to_num(before) * 1.001 + 1e-6).all()
