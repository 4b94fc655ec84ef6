"""Functions of ``gl/shaders/common`` called with arrays: one fragment per call, arguments and results in textures."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gl.executor import SHADER_ROOT
from gl.programs import FULLSCREEN
from gl.shader import expand

TEMPLATE = """
#include "{include}"
{samplers}
layout(location = 0) out vec4 out_result;
void main() {{
    ivec2 p = ivec2(gl_FragCoord.xy);
{arguments}
    out_result = {expression};
}}
"""


class Glsl:
    """Evaluates expressions in the functions of one include file.

    ``Glsl(ctx, "common/color.glsl")("vec4(luminance(a.rgb))", values)``: ``a``, ``b``, ... are the arguments, vec4.
    """

    def __init__(self, ctx: moderngl.Context, include: str) -> None:
        self._ctx, self._include = ctx, include

    def __call__(self, expression: str, *arguments: ArrayLike) -> NDArray[np.float32]:
        """``expression``, a vec4, for each row of ``arguments``, each (n,) or (n, 1 to 4) float32; returns (n, 4).

        Missing channels are 0. Values go through textures of single precision, so NaN and infinity arrive as they are.
        """
        names = "abcd"[: len(arguments)]
        padded = [_four_channels(values) for values in arguments]
        count = len(padded[0])
        text = TEMPLATE.format(
            include=self._include,
            samplers="\n".join(f"uniform sampler2D in_{name};" for name in names),
            arguments="\n".join(f"    vec4 {name} = texelFetch(in_{name}, p, 0);" for name in names),
            expression=expression,
        )
        source = expand(SHADER_ROOT, "made in a test", text=text)
        program = self._ctx.program(expand(SHADER_ROOT, FULLSCREEN).text, source.text)
        vertices = self._ctx.vertex_array(program, [])
        textures = [self._ctx.texture((count, 1), 4, values.tobytes(), dtype="f4") for values in padded]
        target = self._ctx.texture((count, 1), 4, dtype="f4")
        framebuffer = self._ctx.framebuffer([target])
        for unit, (name, texture) in enumerate(zip(names, textures, strict=True)):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            texture.use(unit)
            program[f"in_{name}"] = unit
        framebuffer.use()
        vertices.render(moderngl.TRIANGLES, 3)
        self._ctx.detect_framebuffer(0).use()
        result = np.frombuffer(target.read(), np.float32).reshape(count, 4)
        framebuffer.release()
        for texture in (target, *textures):
            texture.release()
        vertices.release()
        program.release()
        return result


def _four_channels(values: ArrayLike) -> NDArray[np.float32]:
    array = np.asarray(values, np.float32)
    array = array.reshape(len(array), -1)
    padded = np.zeros((len(array), 4), np.float32)
    padded[:, : array.shape[1]] = array
    return padded
