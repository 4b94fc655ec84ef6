"""Makes the README's picture of the window with its panel. Needs no display: the same is drawn into a texture.

python -m tools.panel_picture
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Final

import numpy as np

import config
from gl.context import create_headless
from gl.profiler import Profiler
from gl.renderer import Renderer, count_bad, read
from images import write_png
from session import open_shot
from ui.overlay import Overlay
from ui.present import Presenter
from ui.state import State
from ui.status import Status

ROOT: Final = Path(__file__).resolve().parent.parent
PICTURE: Final = ROOT / "docs" / "images" / "panel.png"

SIZE: Final = (1280, 720)
FRAMES: Final = 32
SCENE: Final = "interior"


def main() -> None:
    parameters = config.load(None, ["display.mark_bad=on", "render.jitter=on"])
    state = State(parameters, "svgf", hud=True, split=True)
    with ExitStack() as stack:
        ctx = create_headless()
        stack.callback(ctx.release)
        renderer, presenter, overlay = Renderer(ctx), Presenter(ctx), Overlay(ctx)
        for item in (renderer, presenter, overlay):
            stack.callback(item.release)
        shot = open_shot(SCENE, parameters, "still", animate=True, jitter=True)
        stack.enter_context(shot.tracer)
        profiler = Profiler(ctx)
        for index in range(FRAMES):
            packet = shot.frame(index)
            result = renderer.run(packet, parameters, state.denoiser, profiler=profiler, split=True)
        trace_ms = packet.timings["trace"] * 1e3
        status = Status(SCENE, str(ctx.info["GL_RENDERER"]), packet.size, packet=packet, result=result)
        status.fps, status.trace_ms, status.passes = 1e3 / (trace_ms + profiler.total), trace_ms, profiler.rows()
        status.bad, status.triangles = count_bad(result), shot.scene.scene.triangle_count
        state.textures = tuple(tex.name for tex in result.plan.imports)

        screen = ctx.texture(SIZE, 4)
        target = ctx.framebuffer([screen])
        for _ in range(3):  # the first frames of ImGui measure what the next ones place
            presenter.draw(result.outputs["display"], target, SIZE, result.outputs["noisy"], SIZE[0] // 2 - 60)
            overlay.draw(SIZE, SIZE, 1.0, state, status)
        pixels = (read(screen)[..., :3] * 255.0 + 0.5).astype(np.uint8)
        ctx.detect_framebuffer(0).use()
        target.release()
        screen.release()
    write_png(PICTURE, pixels)
    print(PICTURE.relative_to(ROOT))


if __name__ == "__main__":
    main()
