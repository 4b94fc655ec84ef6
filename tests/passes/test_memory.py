"""The bytes that a plan tells, against the textures that OpenGL then has."""

from __future__ import annotations

from collections import Counter
from typing import Any

import moderngl
import pytest

from config import load
from gl.formats import FORMATS
from gl.pipelines import DENOISERS
from gl.renderer import Renderer
from tests.passes.harness import frame

SIZE = (19, 13)  # odd on purpose: what has a divisor is rounded up

EVERYTHING = ("display.auto_exposure=true", "display.mark_bad=on", "svgf.color_clamp=true", "firefly.mode=variance")


def spec(texture: moderngl.Texture) -> tuple[str, tuple[int, int]]:
    layout = (texture.components, texture.dtype)
    (fmt,) = (fmt for fmt in FORMATS.values() if (fmt.components, fmt.dtype) == layout)
    return fmt.name, texture.size


@pytest.mark.parametrize("denoiser", [name for name in DENOISERS if name != "reference"])
@pytest.mark.parametrize("settings", [(), EVERYTHING], ids=["default", "everything"])
def test_there_are_the_textures_that_are_told(
    ctx: moderngl.Context, monkeypatch: pytest.MonkeyPatch, denoiser: str, settings: tuple[str, ...]
) -> None:
    made: list[moderngl.Texture] = []

    def texture(*args: Any, **options: Any) -> moderngl.Texture:
        made.append(create(*args, **options))
        return made[-1]

    create = ctx.texture
    monkeypatch.setattr(ctx, "texture", texture)
    renderer = Renderer(ctx)
    try:
        plan = renderer.run(frame(SIZE), load(None, settings), denoiser).plan  # the first frame: nothing is given back
        memory = plan.memory(SIZE)
        assert Counter((row.fmt, row.size) for row in memory for _ in range(row.copies)) == Counter(map(spec, made))
        assert sum(row.bytes for row in memory) == sum(len(texture.read(alignment=1)) for texture in made)
    finally:
        renderer.release()


def test_what_takes_turns_in_a_slot_is_told_in_that_order(ctx: moderngl.Context) -> None:
    renderer = Renderer(ctx)
    try:
        result = renderer.run(frame(SIZE), load(None, ()), "svgf")
        order = [tex.name for node in result.plan.passes for tex in node.writes.values()]
        slots = [row for row in result.plan.memory(SIZE) if row.kind == "slot"]
        held = [name for row in slots for name in row.names]
        assert sorted(held) == sorted(tex.name for tex in result.plan.slot_of)
        for row in slots:
            assert list(row.names) == sorted(row.names, key=order.index)
            objects = {texture.glo for tex, texture in result.textures.items() if tex.name in row.names}
            assert len(objects) == 1
    finally:
        renderer.release()
