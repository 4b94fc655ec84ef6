"""One or a few passes, or a whole denoiser, on synthetic frames: build, run some frames, read back."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from config import Config, Svgf, Taa, load
from gl.executor import SHADER_ROOT, Executor, Result
from gl.graph import ComputePass, FragmentPass, Graph, In, Out, Tex
from gl.passes.svgf import Atrous
from gl.passes.taa import taa
from gl.passes.temporal import Guides, accumulate, reproject
from gl.passes.variance import Variance
from gl.pipelines import FrameTraits, build
from gl.renderer import read
from gl.upload import Uploader
from raytrace.frame import MISS, FramePacket

F32 = NDArray[np.float32]
Size = tuple[int, int]

DEPTH = 4.0
PIXEL_SIZE = 0.02
PAPER = load(None, ("svgf.preset=paper",)).svgf
HALF = 2.0**-11
"""Largest relative error of one rounding to half precision."""

SIZES: tuple[Size, ...] = ((60, 44), (31, 33), (1, 1), (1, 9), (9, 1))
"""Width and height: ordinary, odd, and too small for any filter's window. Elsewhere too no side is a power of two:
llvmpipe compiles every shader anew for each combination of such sides."""


def frame(
    size: Size = (18, 12),
    *,
    direct: ArrayLike = 0.0,
    indirect: ArrayLike = 0.0,
    albedo: ArrayLike = 1.0,
    emission: ArrayLike = 0.0,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    depth: ArrayLike = DEPTH,
    gradient: ArrayLike = (0.0, 0.0),
    shift: ArrayLike = (0.0, 0.0),
    previous_depth: ArrayLike | None = None,
    object_id: ArrayLike = 0.0,
    previous_normal: ArrayLike | None = None,
    pixel_size: float = PIXEL_SIZE,
) -> FramePacket:
    """A frame packet, by default a still wall that faces the camera.

    Colours, normals and ``shift`` (pixels from here to the place in the last frame) are broadcast to (H, W, 3 or 2),
    a scalar or (H, W) colour is grey; ``depth``, ``previous_depth`` (by default ``depth``) and ``object_id`` to (H, W).
    """
    width, height = size

    def image(values: ArrayLike, channels: int, last: ArrayLike | None = 1.0) -> F32:
        array = np.asarray(values, np.float32)
        if channels == 3 and array.shape in ((), (height, width)):
            array = array[..., None]
        array = np.broadcast_to(array, (height, width, channels))
        if last is None:
            return np.ascontiguousarray(array)
        alpha = np.broadcast_to(np.asarray(last, np.float32), (height, width))
        return np.concatenate([array, alpha[..., None]], axis=2)

    motion = image(np.asarray(shift, np.float32) / np.array(size, np.float32), 2, last=None)
    before = depth if previous_depth is None else previous_depth
    motion = np.concatenate([motion, *(image(np.asarray(v)[..., None], 1, last=None) for v in (before, object_id))], 2)
    return FramePacket(
        index=0,
        time=0.0,
        direct=image(direct, 3),
        indirect=image(indirect, 3),
        albedo=image(albedo, 3),
        emission=image(emission, 3),
        surface=image(normal, 3, depth),
        gradient=image(gradient, 2, last=None),
        motion=motion,
        prev_normal=None if previous_normal is None else image(previous_normal, 3, 0.0),
        scene="synthetic",
        pixel_size=pixel_size,
    )


def with_sky(packet: FramePacket, sky: NDArray[np.bool_]) -> FramePacket:
    """``packet`` with misses where ``sky`` (H, W) is set, as the tracer writes them."""

    def cleared(values: F32) -> F32:
        return np.where(sky[..., None], np.float32(0.0), values)

    motion = packet.motion.copy()
    motion[sky, 2:] = 0.0, MISS
    return replace(
        packet,
        direct=cleared(packet.direct),
        indirect=cleared(packet.indirect),
        albedo=cleared(packet.albedo),
        surface=cleared(packet.surface),
        gradient=cleared(packet.gradient),
        motion=motion,
    )


def noise(size: Size, seed: int, mean: float = 1.0) -> F32:
    """(H, W, 3) grey noise of one path per pixel: a few bright samples among dark ones. Its variance is mean²."""
    values = np.random.default_rng(seed).exponential(mean, (size[1], size[0], 1))
    return np.repeat(values, 3, axis=2).astype(np.float32)


def signal(size: Size, color: ArrayLike, sigma: ArrayLike = 0.0) -> dict[str, F32]:
    """Upload for :func:`atrous` and :func:`variance`: grey or (H, W, 3) ``color`` and its standard deviation."""
    height, width = size[1], size[0]
    values = np.asarray(color, np.float32)
    values = np.broadcast_to(values[..., None] if values.shape in ((), (height, width)) else values, (height, width, 3))
    deviation = np.broadcast_to(np.asarray(sigma, np.float32), (height, width))
    return {"frame.signal": np.concatenate([values, deviation[..., None]], axis=2)}


def columns(size: Size, values: ArrayLike) -> NDArray[np.float64]:
    """(H, W) from one value for each column."""
    return np.broadcast_to(np.asarray(values, np.float64), (size[1], size[0])).copy()


class Poison(FragmentPass):
    """Spoil what comes by, so that a test can put anything into a history."""

    shader = "test/poison.frag"
    in_color = In("anything")
    in_poison = In("what to write instead; a = 0: leave as it is")
    out_color = Out("rgba32f", "one or the other")


class Increment(ComputePass):
    """Add the right neighbour, wrapped around: every work group reads what another one wrote."""

    shader = "test/increment.comp"
    in_value = In("a number")
    out_value = Out("r32f", "the number plus its right neighbour's")


SHADERS = {
    "test/poison.frag": """
        uniform sampler2D in_color, in_poison;
        layout(location = 0) out vec4 out_color;
        void main() {
            ivec2 p = ivec2(gl_FragCoord.xy);
            vec4 poison = texelFetch(in_poison, p, 0);
            out_color = poison.a != 0.0 ? poison : texelFetch(in_color, p, 0);
        }""",
    "test/increment.comp": """
        layout(local_size_x = GROUP_X, local_size_y = GROUP_Y) in;
        uniform sampler2D in_value;
        layout(r32f, binding = 0) writeonly uniform image2D out_value;
        void main() {
            ivec2 p = ivec2(gl_GlobalInvocationID.xy), size = imageSize(out_value);
            if (any(greaterThanEqual(p, size))) return;
            float right = texelFetch(in_value, ivec2((p.x + 1) % size.x, p.y), 0).x;
            imageStore(out_value, p, vec4(texelFetch(in_value, p, 0).x + right));
        }""",
}


@dataclass(frozen=True)
class Images:
    """A finished run; its pixels must be read before the next one."""

    result: Result

    def __getitem__(self, name: str) -> F32:
        """(H, W, C) float32 of the output ``name``, or of a kept texture by its name in the graph."""
        texture = self.result.outputs.get(name)
        return read(self.result.texture(name) if texture is None else texture)

    @property
    def histories(self) -> dict[str, str]:
        return self.result.histories


class Bench:
    """An executor whose shader folder holds the program's shaders and this module's own."""

    def __init__(self, ctx: moderngl.Context, root: Path) -> None:
        shutil.copytree(SHADER_ROOT, root, dirs_exist_ok=True)
        for path, text in SHADERS.items():
            (root / path).parent.mkdir(exist_ok=True)
            (root / path).write_text(text)
        self.executor = Executor(ctx, root)
        self._uploader = Uploader(ctx)
        self._restart = True

    def restart(self) -> None:
        """Begin a new sequence: the next frame has no history."""
        self._restart = True

    def run(
        self,
        packet: FramePacket,
        graph: Graph,
        keep: Iterable[str] = (),
        reset: str = "",
        extra: dict[str, F32] | None = None,
    ) -> Images:
        """One frame through ``graph``; ``extra``: uploads beyond the packet's, by name."""
        plan = graph.compile(keep)
        self._uploader.upload(packet, (tex.name for tex in plan.imports))
        for name, values in (extra or {}).items():
            self._uploader.write(name, values)
        if self._restart:
            reset, self._restart = reset or "new sequence", False
        return Images(self.executor.run(plan, packet.size, self._uploader.textures, reset))

    def denoise(
        self,
        packet: FramePacket,
        config: Config | None = None,
        denoiser: str = "svgf",
        keep: Iterable[str] = (),
        reset: str = "",
    ) -> Images:
        """One frame through a whole denoiser; outputs ``radiance`` and ``display``."""
        traits = FrameTraits.of(packet)
        return self.run(packet, build(config or Config(), denoiser, traits), keep, reset)

    def release(self) -> None:
        self.executor.release()
        self._uploader.release()


def accumulation(p: Svgf | None = None, *, moving: bool = False, fmt: str = "rgba32f") -> Graph:
    """Reprojection and accumulation of the direct light alone.

    Outputs ``color``, ``moments``, ``reprojection``; single precision unless ``fmt`` says otherwise.
    """
    p = p or Svgf()
    g = Graph()
    found = reproject(g, Guides(g, moving), "test", p, PIXEL_SIZE)
    history = g.history("test.color", fmt)
    color, moments = accumulate(g, g.import_("frame.direct", "rgba32f"), found, history, p, fmt)
    g.feed(history, color)
    g.output("color", color)
    g.output("moments", moments)
    g.output("reprojection", found)
    return g


def _shape(g: Graph) -> dict[str, Tex]:
    return {"in_surface": g.import_("frame.surface", "rgba32f"), "in_gradient": g.import_("frame.gradient", "rg32f")}


def atrous(p: Svgf | None = None, steps: Iterable[int] = (1,), pixel_size: float = PIXEL_SIZE) -> Graph:
    """À-trous iterations on ``frame.signal`` (rgb irradiance, a standard deviation); output ``color``."""
    g = Graph()
    x = g.import_("frame.signal", "rgba32f")
    for step in steps:
        work = Atrous(p or Svgf(), step, pixel_size)
        work.formats = {"out_color": "rgba32f"}  # what is tested is the filter, not the rounding of its result
        x = g.add(work, in_color=x, **_shape(g)).out_color
    g.output("color", x)
    return g


def variance(p: Svgf | None = None, *, temporal: bool = False, pixel_size: float = PIXEL_SIZE) -> Graph:
    """The variance estimate of ``frame.signal``; with ``temporal`` from ``frame.moments`` and ``frame.history``."""
    g = Graph()
    optional = {}
    if temporal:
        optional = {
            "in_moments": g.import_("frame.moments", "rg32f"),
            "in_reprojection": g.import_("frame.history", "rgba32f"),
        }
    work = Variance(u_sigma_z=(p or Svgf()).sigma_z, u_pixel_size=pixel_size, formats={"out_color": "rgba32f"})
    g.output("color", g.add(work, in_color=g.import_("frame.signal", "rgba32f"), **_shape(g), **optional).out_color)
    return g


def anti_aliasing(p: Taa | None = None) -> Graph:
    """TAA of ``frame.color`` (rgb, tone-mapped); output ``color``."""
    g = Graph()
    g.output("color", taa(g, g.import_("frame.color", "rgba32f"), Guides(g, False), p or Taa(), "test"))
    return g
