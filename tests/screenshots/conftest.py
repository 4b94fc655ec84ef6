"""The renderer whose pictures are kept."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import pytest

from gl.renderer import Renderer
from raytrace import integrator
from raytrace.compiled import CompiledScene
from raytrace.tables import Variant, variant_of


@pytest.fixture
def renderer(ctx: moderngl.Context) -> Iterator[Renderer]:
    name = ctx.info["GL_RENDERER"]
    if not name.startswith("llvmpipe"):
        pytest.skip(f"the pictures are those of llvmpipe, this is {name}")
    renderer = Renderer(ctx)
    yield renderer
    renderer.release()


@pytest.fixture
def shared_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes with gloss run the same loops, of whatever any of them needs: each kind takes half a minute to compile.

    The pictures are those of the loops that a scene would get by itself, to the bit.
    """

    def widened(scene: CompiledScene) -> Variant:
        own = variant_of(scene)
        if not own.specular:
            return own
        return own._replace(textured=True, moving=True, lamps=True, environment=True, glossmap=True, bumps=True)

    monkeypatch.setattr(integrator, "variant_of", widened)
