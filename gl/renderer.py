"""A frame packet in, textures out: the whole GL side of one frame behind one call."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import nullcontext
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from config import Config
from gl.executor import Executor, Result
from gl.pipelines import FrameTraits, build
from gl.plan import Plan
from gl.profiler import Profiler, is_software
from gl.shader import ShaderError
from gl.upload import Uploader
from raytrace.frame import FramePacket


class Renderer:
    """Builds the graph of each frame, uploads what it imports, runs it."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self._uploader = Uploader(ctx)
        self.executor = Executor(ctx)
        self._software = is_software(ctx)
        self._scene_id = -1
        self._index = -1

    def plan(
        self, packet: FramePacket, config: Config, denoiser: str, keep: Iterable[str] = (), split: bool = False
    ) -> Plan:
        """The compiled graph for ``packet``; raises GraphError when ``keep`` names a texture it does not make."""
        traits = FrameTraits.of(packet, self._software)
        return build(config, denoiser, traits, split).compile(keep=keep)

    def run(
        self,
        packet: FramePacket,
        config: Config,
        denoiser: str,
        reference: NDArray[np.float32] | None = None,
        keep: Iterable[str] = (),
        reset: str = "",
        profiler: Profiler | None = None,
        split: bool = False,
        again: bool = False,
    ) -> Result:
        """Filter ``packet`` by ``denoiser``.

        ``reference`` (H, W, 4) float32 radiance, for the denoiser of that name. ``keep``: textures to leave readable.
        ``reset``: why histories are void, if they are; another scene, a cut and a skipped frame are noticed here.
        ``split``: the noisy frame is an output as well (:func:`gl.pipelines.build`). ``again``: ``packet`` is the one
        run last, and is filtered with the histories that it had then.
        """
        plan = self.plan(packet, config, denoiser, keep, split)
        reset = reset or self._discontinuity(packet)
        if (packet.scene_id, packet.index) == (self._scene_id, self._index):
            # Filtered again: histories have followed its light already.
            packet = replace(packet, temporal_gradient=None, temporal_gradient_specular=None)
        with profiler.frame() if profiler else nullcontext():
            with profiler.measure("upload") if profiler else nullcontext():
                self._uploader.upload(packet, (tex.name for tex in plan.imports))
                if reference is not None:
                    self._uploader.write("frame.reference", reference)
            result = self.executor.run(plan, packet.size, self._uploader.textures, reset, profiler, again)
        # Only now: a frame that failed is one that was skipped.
        self._scene_id, self._index = packet.scene_id, packet.index
        return result

    def _discontinuity(self, packet: FramePacket) -> str:
        """Why ``packet`` does not continue the frame run before; empty if it does.

        Motion vectors lead to the frame of the index before. The same frame may be filtered again, as while paused.
        """
        if packet.scene_id != self._scene_id:
            return "another scene"
        if packet.cut:
            return "camera cut"
        return "" if packet.index - self._index in (0, 1) else "frame skipped"

    def reload_shaders(self) -> list[ShaderError]:
        """Compile again what has changed on disk, here and now (:mod:`gl.background` does it on another thread).

        Returns what is wrong with the shader files as they are: such a program stays as it last was.
        """
        return self.executor.reload_shaders()

    def release(self) -> None:
        """Free every GL object; the context itself belongs to the caller."""
        self.executor.release()
        self._uploader.release()


def read(texture: moderngl.Texture) -> NDArray[np.float32]:
    """Pixels of a texture, (H, W, C) float32, row 0 = bottom; 8-bit ones scaled to [0, 1]."""
    dtypes = {"f4": np.float32, "f2": np.float16, "f1": np.uint8, "u4": np.uint32}
    kind = dtypes[texture.dtype]
    # Rows without padding: the default alignment of 4 bytes pads rows of narrow formats.
    values = np.frombuffer(texture.read(alignment=1), dtype=kind)
    image = values.reshape(texture.height, texture.width, texture.components).astype(np.float32)
    return image / 255.0 if kind is np.uint8 else image


def count_bad(result: Result) -> tuple[int, int] | None:
    """How many pixels of a frame have a sample, and how many have radiance, that is NaN or infinite.

    None where the frame's graph does not count them (``display.mark_bad``). Waits for the GPU.
    """
    texture = result.outputs.get("bad")
    if texture is None:
        return None
    samples, radiance = np.frombuffer(texture.read(), np.uint32).reshape(-1, 2).sum(axis=0, dtype=np.int64)
    return int(samples), int(radiance)
