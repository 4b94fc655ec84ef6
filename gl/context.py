"""Headless OpenGL through EGL."""

from __future__ import annotations

import moderngl

from errors import UserError

REQUIRED_VERSION = 430
"""OpenGL 4.3: the first with compute shaders."""


def create_headless() -> moderngl.Context:
    """A context without a window.

    Raises:
        UserError: EGL is missing, no driver answers, or its OpenGL is older than 4.3.
    """
    try:
        ctx = moderngl.create_context(standalone=True, backend="egl")  # type: ignore[arg-type]  # its stub is wrong
    except Exception as error:  # glcontext raises bare Exception with the name of the EGL call that failed
        raise UserError(
            f"no headless OpenGL: {error}",
            "install EGL and a driver (Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri), then try: app.py doctor",
        ) from error
    check_version(ctx)
    return ctx


def check_version(ctx: moderngl.Context) -> None:
    """Raises UserError when the context is older than OpenGL 4.3, which it then releases."""
    if ctx.version_code < REQUIRED_VERSION:
        version, renderer = ctx.version_code, ctx.info["GL_RENDERER"]
        ctx.release()
        raise UserError(
            f"OpenGL {version // 100}.{version % 100 // 10} of {renderer} is too old, 4.3 is needed",
            "update the graphics driver, or use Mesa's software renderer: LIBGL_ALWAYS_SOFTWARE=1",
        )
