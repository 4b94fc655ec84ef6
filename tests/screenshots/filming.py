"""A few frames of any scene as ``app.py render`` makes them, down to the bytes of its picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from config import Config, Surroundings
from gl.pipelines import remembered
from gl.renderer import Renderer, read
from session import open_shot

U8 = NDArray[np.uint8]

SIZE = (128, 72)
FRAMES = 8


def film(
    renderer: Renderer,
    scene: str,
    denoiser: str,
    *,
    camera: str | None = None,
    animate: bool = True,
    surroundings: Surroundings | None = None,
    size: tuple[int, int] = SIZE,
    frames: int = FRAMES,
) -> U8:
    """The last of ``frames`` as it is shown, (H, W, 3), row 0 = bottom. What goes in is finite in every frame."""
    config = Config()
    config = replace(
        config,
        render=replace(config.render, width=size[0], height=size[1]),
        surroundings=surroundings or config.surroundings,
    )
    shot = open_shot(scene, config, camera, animate)
    shot.remember = remembered(config, denoiser)
    with shot.tracer:
        for index in range(frames):
            packet = shot.frame(index)
            assert np.isfinite(packet.radiance()).all(), f"{scene}: frame {index}"
            result = renderer.run(packet, config, denoiser)
    shown: U8 = np.rint(read(result.outputs["display"])[..., :3] * 255.0).astype(np.uint8)
    return shown
