"""Small passes with shaders of their own, and what the tests of the executor share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np
import numpy.typing as npt

from gl.executor import Executor, Result
from gl.formats import FORMATS
from gl.graph import ComputePass, FragmentPass, Graph, In, Out, Plan, Prev, Uniform

SIZE = (13, 7)  # odd on purpose: no multiple of a work group or a divisor

SHADERS = {
    "fill.frag": """
        uniform vec4 u_color;
        layout(location = 0) out vec4 out_color;
        void main() { out_color = u_color; }""",
    "place.frag": """
        layout(location = 0) out vec2 out_pixel;
        layout(location = 1) out uvec4 out_index;
        void main() { out_pixel = gl_FragCoord.xy; out_index = uvec4(gl_FragCoord.xy, 7u, 8u); }""",
    "add.frag": """
        uniform sampler2D in_a;
        #if HAS_IN_B
        uniform sampler2D in_b;
        #endif
        layout(location = 0) out vec4 out_color;
        void main() {
            ivec2 p = ivec2(gl_FragCoord.xy);
            out_color = texelFetch(in_a, p, 0) * FACTOR;
        #if HAS_IN_B
            out_color += texelFetch(in_b, p, 0);
        #endif
        }""",
    "count.frag": """
        uniform sampler2D in_start, prev_count;
        uniform bool u_history_valid;
        layout(location = 0) out vec4 out_count;
        void main() {
            ivec2 p = ivec2(gl_FragCoord.xy);
            vec4 before = texelFetch(prev_count, p, 0);
            out_count = u_history_valid ? before + 1.0 : texelFetch(in_start, p, 0);
            out_count.w = before.x; // what the history holds, valid or not
        }""",
    "index.comp": """
        layout(local_size_x = GROUP_X, local_size_y = GROUP_Y) in;
        uniform usampler2D in_index;
        layout(rg32f, binding = 0) writeonly uniform image2D out_pixel;
        layout(r32ui, binding = 1) writeonly uniform uimage2D out_id;
        void main() {
            ivec2 p = ivec2(gl_GlobalInvocationID.xy);
            if (any(greaterThanEqual(p, imageSize(out_pixel)))) return;
            imageStore(out_pixel, p, vec4(texelFetch(in_index, p, 0)));
            imageStore(out_id, p, uvec4(1000 * p.y + p.x));
        }""",
    "third.frag": """
        layout(location = 0) out vec4 out_color;
        void main() { out_color = vec4(gl_FragCoord.xy, 0.0, 1.0); }""",
    "uniforms.frag": """
        uniform int u_int; uniform uint u_uint; uniform bool u_bool;
        uniform vec2 u_vec; uniform ivec3 u_ivec; uniform mat3 u_mat; uniform float u_unused;
        layout(location = 0) out vec4 out_a;
        layout(location = 1) out vec4 out_b;
        void main() {
            out_a = vec4(u_int, u_uint, u_bool, u_vec.y);
            out_b = vec4(u_mat * vec3(1.0, 0.0, 0.0), u_ivec.z);
        }""",
}


class Fill(FragmentPass):
    shader = "fill.frag"
    out_color = Out("rgba32f", "c")
    u_color = Uniform("vec4", "c")


class Place(FragmentPass):
    shader = "place.frag"
    out_pixel = Out("rg32f", "centre of the pixel")
    out_index = Out("rgba32ui", "index of the pixel, 7, 8")


class Add(FragmentPass):
    shader = "add.frag"
    in_a = In("a")
    in_b = In("b", optional=True)
    out_color = Out("rgba32f", "a * FACTOR + b")


class Count(FragmentPass):
    shader = "count.frag"
    in_start = In("value of the first frame")
    prev_count = Prev("last frame's")
    out_count = Out("rgba16f", "count")


class Index(ComputePass):
    shader = "index.comp"
    in_index = In("index of the pixel")
    out_pixel = Out("rg32f", "index of the pixel")
    out_id = Out("r32ui", "1000 y + x")


class Third(FragmentPass):
    shader = "third.frag"
    out_color = Out("rgba32f", "centre of the pixel", divisor=3)


@dataclass
class Stage:
    """An executor with the shaders of this file in a folder of their own."""

    ctx: moderngl.Context
    root: Path
    executor: Executor

    def run(
        self,
        plan: Plan,
        size: tuple[int, int] = SIZE,
        reset: str = "",
        again: bool = False,
        **uploads: moderngl.Texture,
    ) -> Result:
        return self.executor.run(plan, size, uploads, reset, again=again)

    def upload(self, values: npt.NDArray[np.float32]) -> moderngl.Texture:
        """An rgba32f texture from an array (h, w, 4)."""
        height, width, _ = values.shape
        return self.ctx.texture((width, height), 4, values.tobytes(), dtype="f4")


def pixels(texture: moderngl.Texture) -> npt.NDArray[np.generic]:
    """Array (h, w, c), row 0 at the bottom."""
    kind = next(fmt for fmt in FORMATS.values() if (fmt.components, fmt.dtype) == (texture.components, texture.dtype))
    return np.frombuffer(texture.read(), kind.numpy).reshape(texture.height, texture.width, kind.components)


def fill_plan(color: tuple[float, ...] = (1, 2, 3, 4)) -> Plan:
    g = Graph()
    g.output("display", g.add(Fill(u_color=color)).out_color)
    return g.compile()


def add_plan() -> Plan:
    g = Graph()
    g.output("display", g.add(Add(defines={"FACTOR": 2}), in_a=g.add(Fill(u_color=(1, 1, 1, 1))).out_color).out_color)
    return g.compile()


def count_plan(fmt: str = "rgba16f") -> Plan:
    g = Graph()
    history = g.history("count", fmt)
    start = g.add(Fill(u_color=(5, 5, 5, 5))).out_color
    counted = g.add(Count(formats={"out_count": fmt}), in_start=start, prev_count=history).out_count
    g.feed(history, counted)
    g.output("display", counted)
    return g.compile()
