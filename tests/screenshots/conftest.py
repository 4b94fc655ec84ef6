"""The renderer whose pictures are kept."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import pytest

from gl.renderer import Renderer


@pytest.fixture
def renderer(ctx: moderngl.Context) -> Iterator[Renderer]:
    name = ctx.info["GL_RENDERER"]
    if not name.startswith("llvmpipe"):
        pytest.skip(f"the pictures are those of llvmpipe, this is {name}")
    renderer = Renderer(ctx)
    yield renderer
    renderer.release()
