"""Shaders that do not compile, and shaders that change while the program runs."""

from __future__ import annotations

import re
from pathlib import Path

import moderngl
import numpy as np
import pytest

from gl.graph import Graph
from gl.programs import FULLSCREEN
from gl.renderer import Renderer
from gl.shader import ShaderError
from gl.variants import variants
from tests.passes.stage import SHADERS, SIZE, Index, Place, Stage, add_plan, fill_plan, pixels


def test_compile_errors_carry_the_real_file_and_line(stage: Stage) -> None:
    (stage.root / "common/broken.glsl").write_text("float twice(float x) {\n    return 2.0 * y;\n}\n")
    (stage.root / "fill.frag").write_text('#include "common/broken.glsl"\n' + SHADERS["fill.frag"])
    with pytest.raises(ShaderError) as caught:
        stage.run(fill_plan())
    lines = str(caught.value).splitlines()
    assert lines[0] == "fill.frag: GLSL Compiler failed"
    assert lines[1].startswith("common/broken.glsl:2: ")
    assert "y" in lines[1]
    assert lines[2] == "    return 2.0 * y;"

    (stage.root / "fill.frag").write_text(SHADERS["fill.frag"])
    (stage.root / "common/fullscreen.vert").write_text("void main() {\n    gl_Position = vec3(0.0);\n}\n")
    with pytest.raises(
        ShaderError, match=r"common/fullscreen\.vert: GLSL Compiler failed\ncommon/fullscreen\.vert:2: "
    ):
        stage.run(fill_plan())


def test_variants_are_named_in_errors(stage: Stage) -> None:
    (stage.root / "add.frag").write_text(SHADERS["add.frag"].replace("* FACTOR", "* FACTOR * oops"))
    with pytest.raises(
        ShaderError, match=r"^add\.frag \(FACTOR=2, HAS_IN_B=0\): GLSL Compiler failed\nadd\.frag:9: .*oops"
    ):
        stage.run(add_plan())


def test_interface_mistakes_are_found_before_compiling(stage: Stage) -> None:
    (stage.root / "fill.frag").write_text(SHADERS["fill.frag"].replace("u_color", "u_colour"))
    with pytest.raises(ShaderError, match=r"fill\.frag:2: 'u_colour' is no port of Fill, did you mean 'u_color'"):
        stage.run(fill_plan())


def test_reload_replaces_what_changed_and_keeps_the_last_good_program(stage: Stage) -> None:
    executor, plan = stage.executor, add_plan()

    def value() -> float:
        return float(pixels(stage.run(plan).outputs["display"]).max())

    assert (value(), executor.reload_shaders()) == (2, [])
    (stage.root / "add.frag").write_text(SHADERS["add.frag"].replace("* FACTOR", "+ FACTOR"))
    assert value() == 2
    assert (executor.reload_shaders(), value()) == ([], 3)

    text = '#include "common/late.glsl"\n' + SHADERS["add.frag"].replace("* FACTOR", "* late()")
    (stage.root / "add.frag").write_text(text)
    (error,) = executor.reload_shaders()
    assert "there is no shader file 'common/late.glsl'" in str(error)
    assert value() == 3
    (stage.root / "common/late.glsl").write_text("float late() { return 7.0 }\n")
    (error,) = executor.reload_shaders()
    assert "common/late.glsl:1" in str(error)
    assert executor.reload_shaders() == [error]  # still wrong, and not compiled again
    (stage.root / "common/late.glsl").write_text("float late() { return 7.0; }\n")
    assert (executor.reload_shaders(), value()) == ([], 7)


def save(file: Path, text: str) -> None:
    """As editors do: written beside it, then moved over it."""
    beside = file.with_name(f".{file.name}.swp")
    beside.write_text(text)
    beside.replace(file)


def test_what_includes_a_file_is_reloaded_with_it_and_nothing_else(stage: Stage) -> None:
    save(stage.root / "common/level.glsl", "float level() { return 1.0; }\n")
    save(
        stage.root / "add.frag", '#include "common/level.glsl"\n' + SHADERS["add.frag"].replace("* FACTOR", "* level()")
    )
    plan = add_plan()
    assert pixels(stage.run(plan).outputs["display"]).max() == 1
    assert stage.executor.shaders_changed(), "a file has come since the executor was made"
    assert stage.executor.reload_shaders() == []
    assert not stage.executor.shaders_changed()
    first = {node.name: stage.executor._programs.get(node) for node in plan.passes}
    save(stage.root / "common/level.glsl", "float level() { return 6.0; }\n")
    assert stage.executor.shaders_changed()
    assert stage.executor.reload_shaders() == []
    assert not stage.executor.shaders_changed()
    assert pixels(stage.run(plan).outputs["display"]).max() == 6
    second = {node.name: stage.executor._programs.get(node) for node in plan.passes}
    assert (second["fill"] is first["fill"], second["add"] is first["add"]) == (True, False)


def test_a_compute_shader_is_reloaded(stage: Stage) -> None:
    g = Graph()
    g.output("id", g.add(Index(), in_index=g.add(Place()).out_index).out_id)
    plan, file = g.compile(), stage.root / "index.comp"

    def corner() -> int:
        return int(np.asarray(pixels(stage.run(plan).outputs["id"]))[-1, -1, 0])

    right, top = SIZE[0] - 1, SIZE[1] - 1
    assert corner() == 1000 * top + right
    save(file, SHADERS["index.comp"].replace("1000 *", "500 *"))
    assert (stage.executor.reload_shaders(), corner()) == ([], 500 * top + right)
    save(file, SHADERS["index.comp"].replace("1000 *", "1000 ** 2 *"))
    (error,) = stage.executor.reload_shaders()
    assert re.search(r"^index\.comp:10: ", str(error), re.MULTILINE)
    assert corner() == 500 * top + right
    save(file, SHADERS["index.comp"].replace("r32ui,", "rg32ui,"))
    (error,) = stage.executor.reload_shaders()
    assert str(error).startswith("index.comp:5: 'out_id' does not match Index")
    assert corner() == 500 * top + right
    save(file, SHADERS["index.comp"])
    assert (stage.executor.reload_shaders(), corner()) == ([], 1000 * top + right)


def test_the_vertex_shader_is_reloaded_with_every_fragment_pass(stage: Stage) -> None:
    file = stage.root / FULLSCREEN
    whole = file.read_text()

    def color(value: float) -> float:
        return float(pixels(stage.run(fill_plan((value,) * 4)).outputs["display"]).max())

    assert color(1.0) == 1.0
    save(file, "void main() { gl_Position = vec4(2.0); }\n")  # nothing is drawn: what was there stays
    assert (stage.executor.reload_shaders(), color(2.0)) == ([], 1.0)
    save(file, "void main() { gl_Position = vec4(2.0) }\n")
    (error,) = stage.executor.reload_shaders()
    assert f"{FULLSCREEN}:1: " in str(error)
    save(file, whole)
    assert (stage.executor.reload_shaders(), color(3.0)) == ([], 3.0)


def test_what_was_prepared_with_the_former_program_is_so_no_longer(stage: Stage) -> None:
    wanted = variants(add_plan(), SIZE)
    for node in wanted.values():
        stage.executor.prepare(node, SIZE)
    assert stage.executor.unprepared(wanted) == {}
    save(stage.root / "add.frag", SHADERS["add.frag"].replace("* FACTOR", "* oops"))
    assert len(stage.executor.reload_shaders()) == 1
    assert stage.executor.unprepared(wanted) == {}, "the last good program stays"
    save(stage.root / "add.frag", SHADERS["add.frag"])
    assert stage.executor.reload_shaders() == []
    assert [node.name for node in stage.executor.unprepared(wanted).values()] == ["add"]


def test_the_renderer_reloads_its_shaders(ctx: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    error = ShaderError("display/encode.frag:3: oops")
    renderer = Renderer(ctx)
    assert renderer.reload_shaders() == []
    monkeypatch.setattr(renderer.executor, "reload_shaders", lambda: [error])
    assert renderer.reload_shaders() == [error]
    renderer.release()
