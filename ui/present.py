"""The picture onto the screen: scaled to the window, its shape kept."""

from __future__ import annotations

from typing import Final

import moderngl

Size = tuple[int, int]
Box = tuple[int, int, int, int]

_VERTEX: Final = """
#version 430
out vec2 uv;
void main() {
    // One triangle that covers the viewport: (0, 0), (2, 0), (0, 2) in texture coordinates.
    uv = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(2.0 * uv - 1.0, 0.0, 1.0);
}
"""

_FRAGMENT: Final = """
#version 430
layout(binding = 0) uniform sampler2D in_picture;  // sRGB, as the screen wants it
in vec2 uv;
layout(location = 0) out vec4 out_color;
void main() { out_color = vec4(texture(in_picture, uv).rgb, 1.0); }
"""

_LINE: Final = (0.9, 0.9, 0.9)  # between two pictures

BORDER: Final = (0.05, 0.05, 0.05)


def letterbox(picture: Size, window: Size) -> Box:
    """x, y, width, height in pixels of the largest centred box in ``window`` that has the shape of ``picture``."""
    scale = min(window[0] / picture[0], window[1] / picture[1])
    width, height = (max(1, min(round(scale * side), limit)) for side, limit in zip(picture, window, strict=True))
    return (window[0] - width) // 2, (window[1] - height) // 2, width, height


class Presenter:
    """Draws textures into framebuffers of any size."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = ctx.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        self._triangle = ctx.vertex_array(self._program, [])
        # Samplers, because the texture's own filtering is the affair of the passes that read it.
        self._sharp = ctx.sampler(filter=(moderngl.NEAREST, moderngl.NEAREST), repeat_x=False, repeat_y=False)
        self._smooth = ctx.sampler(filter=(moderngl.LINEAR, moderngl.LINEAR), repeat_x=False, repeat_y=False)

    def draw(
        self,
        picture: moderngl.Texture,
        target: moderngl.Framebuffer,
        size: Size,
        left: moderngl.Texture | None = None,
        split: int = 0,
    ) -> None:
        """Fill ``target``, ``size`` pixels, with ``picture`` and a border. At whole scales pixels stay sharp.

        ``left``: another picture of the same size, shown to the left of column ``split`` of ``target``.
        """
        box = letterbox(picture.size, size)
        whole = box[2] % picture.width == 0 and box[3] % picture.height == 0
        sampler = self._sharp if whole else self._smooth
        self._ctx.enable_only(moderngl.NOTHING)
        target.use()
        target.viewport = (0, 0, *size)
        target.clear(*BORDER)
        target.viewport = box
        sampler.use(0)
        picture.use(0)
        self._triangle.render(moderngl.TRIANGLES, 3)
        if left is not None and split > 0:
            # The same triangle once more, cut off at the column: both pictures lie on the same pixels.
            target.scissor = (0, 0, min(split, size[0]), size[1])
            left.use(0)
            self._triangle.render(moderngl.TRIANGLES, 3)
            if split < size[0]:
                target.scissor = (split, 0, 1, size[1])
                target.clear(*_LINE)
            target.scissor = None  # type: ignore[assignment]  # None is how moderngl takes it back
        sampler.clear(0)
        target.viewport = (0, 0, *size)

    def release(self) -> None:
        for item in (self._triangle, self._program, self._sharp, self._smooth):
            item.release()
