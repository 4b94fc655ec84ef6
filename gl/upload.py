"""Frame packets to textures."""

from __future__ import annotations

from collections.abc import Iterable

import moderngl
import numpy as np
from numpy.typing import NDArray

from gl.plan import texture_size
from raytrace.frame import STRATUM, FramePacket

PREFIX = "frame."


class Uploader:
    """Keeps one texture per image of a packet and writes into it every frame."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self.textures: dict[str, moderngl.Texture] = {}

    def upload(self, packet: FramePacket, names: Iterable[str]) -> None:
        """Write those images of ``packet`` that a plan imports, ``frame.direct`` being ``packet.direct``."""
        for name in names:
            values = getattr(packet, name.removeprefix(PREFIX), None)
            if values is None and name.startswith(f"{PREFIX}temporal_gradient"):
                # A frame that was traced before anybody asked for gradients: nothing is known to have changed.
                across, down = texture_size(packet.size, STRATUM)
                values = np.zeros((down, across, 4), np.float32)
            if values is not None:
                self.write(name, values)

    def write(self, name: str, values: NDArray[np.float32]) -> None:
        """Write (H, W, C) float32 ``values`` into texture ``name``, made anew where size or channels differ."""
        height, width, channels = values.shape
        texture = self.textures.get(name)
        if texture is None or texture.size != (width, height) or texture.components != channels:
            if texture is not None:
                texture.release()
            texture = self._ctx.texture((width, height), channels, dtype="f4")
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            texture.repeat_x = texture.repeat_y = False
            self.textures[name] = texture
        texture.write(np.ascontiguousarray(values, dtype=np.float32))

    def release(self) -> None:
        for texture in self.textures.values():
            texture.release()
        self.textures.clear()
