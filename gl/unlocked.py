"""OpenGL that lets other Python threads run while it compiles.

moderngl keeps Python's global lock during every call, so that a thread which compiles a shader stops all others. It
takes the addresses of OpenGL's functions from a loader, however, and :class:`UnlockedLoader` hands it other ones for
the few that may take long: callbacks into :mod:`ctypes`, which gives the lock back around each foreign call. A call
costs some microseconds more, which is why the context that draws every frame does without.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, Final

_UINT, _INT, _POINTER = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p

# Where drivers compile: on request, when the outcome is asked for, and when a program first draws. On Windows OpenGL
# is stdcall, which on 64 bits is the same.
_SLOW: Final[dict[str, tuple[Any, ...]]] = {
    "glCompileShader": (_UINT,),
    "glGetShaderiv": (_UINT, _UINT, _POINTER),
    "glLinkProgram": (_UINT,),
    "glGetProgramiv": (_UINT, _UINT, _POINTER),
    "glUseProgram": (_UINT,),
    "glDrawArraysInstanced": (_UINT, _INT, _INT, _INT),
    "glDispatchCompute": (_UINT, _UINT, _UINT),
    "glFinish": (),
}


class UnlockedLoader:
    """``moderngl.create_context(context=UnlockedLoader(find))``: a context for a thread beside others.

    Args:
        find: address of the OpenGL function of that name, 0 if there is none, in the context that is current.
        end: called when moderngl lets go of the context, on the thread that does.
    """

    def __init__(self, find: Callable[[str], int], end: Callable[[], None]) -> None:
        self._find, self._end = find, end
        self._kept: list[object] = []  # callbacks must outlive the context that calls them

    def load_opengl_function(self, name: str) -> int:
        """What moderngl asks for once per function."""
        address = self._find(name)
        if name not in _SLOW or not address:
            return address
        prototype = ctypes.CFUNCTYPE(None, *_SLOW[name])
        callback = prototype(prototype(address))
        self._kept.append(callback)
        return ctypes.cast(callback, ctypes.c_void_p).value or 0

    def __enter__(self) -> UnlockedLoader:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def release(self) -> None:
        self._end()
