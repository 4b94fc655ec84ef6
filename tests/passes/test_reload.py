"""Shaders that do not compile, and shaders that change while the program runs."""

from __future__ import annotations

import pytest

from gl.shader import ShaderError
from tests.passes.stage import SHADERS, Stage, add_plan, fill_plan, pixels


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
