"""Compiled programs: made when a pass first runs, kept by shader, defines and formats, replaced when a file changes."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import moderngl
import numpy as np

from gl import interface
from gl.plan import Node
from gl.ports import HISTORY_FLAG, ComputePass, GraphError
from gl.shader import ShaderError, Source, expand

FULLSCREEN: Final = "common/fullscreen.vert"


class Program:
    """A linked program with everything looked up that is needed to run it every frame.

    What the compiler optimised away is missing from ``uniforms`` and ``history_flag``; that is no mistake, because the
    interface check has already found the declarations complete.

    Raises:
        ShaderError: a file is missing, disagrees with the pass's ports, or does not compile or link.
    """

    def __init__(self, ctx: moderngl.Context, root: Path, node: Node) -> None:
        self.source = interface.load(root, node)
        vertex = expand(root, FULLSCREEN)
        self.vertices: moderngl.VertexArray | None = None
        self.code: Any  # moderngl.Program or ComputeShader; what the stubs say [] returns fits no use of it
        if isinstance(node.work, ComputePass):
            self.code = _compile(node, self.source, vertex, lambda: ctx.compute_shader(self.source.text))
        else:
            self.code = _compile(node, self.source, vertex, lambda: ctx.program(vertex.text, self.source.text))
            self.vertices = ctx.vertex_array(self.code, [])
        ports = node.work.ports
        connected = node.reads.keys() | node.prevs.keys()
        self.samplers = [(unit, port) for unit, port in enumerate(ports.samplers) if port in connected]
        for unit, port in self.samplers:
            sampler = self.code.get(port, None)
            if sampler is not None:
                sampler.value = unit
        self.history_flag = self.code.get(HISTORY_FLAG, None)
        found = [(name, port.type, self.code.get(name, None)) for name, port in ports.uniforms.items()]
        self.uniforms = [(name, type_, uniform) for name, type_, uniform in found if uniform is not None]

    def set_uniforms(self, node: Node) -> None:
        """Send the parameters of ``node``.

        Raises:
            GraphError: a value does not fit the uniform's type.
        """
        values = node.work.uniforms
        for name, type_, uniform in self.uniforms:
            try:
                if type_.startswith("mat"):
                    uniform.write(_matrix(values[name], int(type_[3])))
                else:
                    uniform.value = values[name]
            except (struct.error, TypeError, ValueError) as error:
                raise GraphError(f"{node.name}.{name} = {values[name]!r} is not a {type_} ({error})") from None

    def release(self) -> None:
        """Free the program."""
        if self.vertices is not None:
            self.vertices.release()
        self.code.release()


class Programs:
    """All programs of an executor, by :attr:`gl.plan.Node.program`."""

    def __init__(self, ctx: moderngl.Context, root: Path) -> None:
        self._ctx = ctx
        self._root = root
        self._programs: dict[tuple[object, ...], tuple[Program, Node]] = {}
        self._errors: dict[tuple[object, ...], ShaderError] = {}
        self._stamps = self._read_stamps()

    def __len__(self) -> int:
        return len(self._programs)

    def get(self, node: Node) -> Program:
        """The program that ``node`` runs, compiled now if it is new.

        Raises:
            ShaderError: it is new and unusable.
        """
        try:
            return self._programs[node.program][0]
        except KeyError:
            program = Program(self._ctx, self._root, node)
            self._programs[node.program] = program, node
            return program

    def changed(self) -> bool:
        """Whether a file was written, made or removed since the last :meth:`reload`."""
        return self._read_stamps() != self._stamps

    def reload(self) -> list[ShaderError]:
        """Compile again what has changed on disk since the last call; where that fails, the last good program stays.

        Returns:
            What is wrong with the files as they are now, until they are mended.
        """
        old, self._stamps = self._stamps, self._read_stamps()
        changed = {file for file in old.keys() | self._stamps.keys() if old.get(file) != self._stamps.get(file)}
        for key, (program, node) in list(self._programs.items()):
            # A failed program may depend on a file that the good one does not include: any change may have mended it.
            if not changed or (key not in self._errors and changed.isdisjoint([*program.source.files, FULLSCREEN])):
                continue
            try:
                fresh = Program(self._ctx, self._root, node)
            except ShaderError as error:
                self._errors[key] = error
            else:
                self._errors.pop(key, None)
                self._programs[key] = fresh, node
                program.release()
        return list(self._errors.values())

    def release(self) -> None:
        """Free all programs."""
        for program, _ in self._programs.values():
            program.release()
        self._programs.clear()
        self._errors.clear()

    def _read_stamps(self) -> dict[str, tuple[int, int]]:
        """When each shader file was last written, in nanoseconds, and its length: clocks of file systems are coarse."""
        stamps: dict[str, tuple[int, int]] = {}
        for folder, _, names in os.walk(self._root):
            for name in names:
                file = Path(folder, name)
                with suppress(FileNotFoundError):  # an editor's temporary file, gone since the folder was listed
                    found = file.stat()
                    stamps[file.relative_to(self._root).as_posix()] = found.st_mtime_ns, found.st_size
        return stamps


def _compile(node: Node, source: Source, vertex: Source, make: Callable[[], Any]) -> Any:
    """Call ``make``; what the driver has to say is turned into an error with real files and lines."""
    try:
        return make()
    except moderngl.Error as error:
        # moderngl writes "GLSL Compiler failed", a blank line, the stage, a line of "=", and the driver's log.
        headline, _, log = str(error).partition("=\n")
        source = vertex if "vertex_shader" in headline else source
        defines = ", ".join(f"{name}={value}" for name, value in node.defines().items())
        where = f"{source.path} ({defines})" if defines else source.path
        raise ShaderError(f"{where}: {headline.splitlines()[0]}\n{source.explain(log)}") from None


def _matrix(value: object, side: int) -> bytes:
    """Rows, as written on paper, to the columns that OpenGL wants."""
    rows = np.asarray(value, np.float32)
    if rows.shape != (side, side):
        raise ValueError(f"its shape is {rows.shape}")
    return rows.T.tobytes()
