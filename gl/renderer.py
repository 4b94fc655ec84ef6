"""A frame packet in, textures out: the whole GL side of one frame behind one call."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import nullcontext

import moderngl
import numpy as np
from numpy.typing import NDArray

from config import Config
from gl.executor import Executor, Result
from gl.formats import lookup
from gl.pipelines import FrameTraits, build
from gl.plan import Plan
from gl.profiler import Profiler
from gl.upload import Uploader
from raytrace.frame import FramePacket


class Renderer:
    """Builds the graph of each frame, uploads what it imports, runs it."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self._uploader = Uploader(ctx)
        self._executor = Executor(ctx)
        self._scene = ""

    def plan(self, packet: FramePacket, config: Config, denoiser: str, keep: Iterable[str] = ()) -> Plan:
        """The compiled graph for ``packet``; raises GraphError when ``keep`` names a texture it does not make."""
        traits = FrameTraits(moving=packet.prev_normal is not None, pixel_size=packet.pixel_size)
        return build(config, denoiser, traits).compile(keep=keep)

    def run(
        self,
        packet: FramePacket,
        config: Config,
        denoiser: str,
        reference: NDArray[np.float32] | None = None,
        keep: Iterable[str] = (),
        reset: str = "",
        profiler: Profiler | None = None,
    ) -> Result:
        """Filter ``packet`` by ``denoiser``.

        ``reference`` (H, W, 4) float32 radiance, for the denoiser of that name. ``keep``: textures to leave readable.
        ``reset``: why histories are void, if they are; a cut or another scene is noticed here.
        """
        plan = self.plan(packet, config, denoiser, keep)
        if packet.scene != self._scene:
            reset, self._scene = reset or "another scene", packet.scene
        elif packet.cut:
            reset = reset or "camera cut"
        with profiler.frame() if profiler else nullcontext():
            with profiler.measure("upload") if profiler else nullcontext():
                self._uploader.upload(packet, (tex.name for tex in plan.imports))
                if reference is not None:
                    self._uploader.write("frame.reference", reference)
            return self._executor.run(plan, packet.size, self._uploader.textures, reset, profiler)

    def release(self) -> None:
        """Free every GL object; the context itself belongs to the caller."""
        self._executor.release()
        self._uploader.release()


def read(texture: moderngl.Texture) -> NDArray[np.float32]:
    """Pixels of a texture, (H, W, C) float32, row 0 = bottom; 8-bit ones scaled to [0, 1]."""
    dtypes = {"f4": np.float32, "f2": np.float16, "f1": np.uint8, "u4": np.uint32}
    kind = dtypes[texture.dtype]
    # Rows without padding: the default alignment of 4 bytes pads rows of narrow formats.
    values = np.frombuffer(texture.read(alignment=1), dtype=kind)
    image = values.reshape(texture.height, texture.width, texture.components).astype(np.float32)
    return image / 255.0 if kind is np.uint8 else image


def format_bytes(fmt: str) -> int:
    """Bytes per texel of a graph format."""
    return lookup(fmt).bytes_per_pixel
