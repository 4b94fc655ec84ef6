"""Runs plans: textures, programs, bindings, draw calls and dispatches, barriers, and the swap of histories."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import moderngl

from errors import did_you_mean
from gl.formats import lookup
from gl.plan import History, Node, Plan, Tex, texture_size
from gl.ports import ComputePass, GraphError
from gl.profiler import Profiler
from gl.programs import Program, Programs
from gl.resources import VALID, Histories, Size, Slots, Textures
from gl.shader import ShaderError
from gl.variants import Variant, stand_in, variant

SHADER_ROOT: Final = Path(__file__).parent / "shaders"

COMPUTE_BARRIER: Final = (
    moderngl.TEXTURE_FETCH_BARRIER_BIT
    | moderngl.SHADER_IMAGE_ACCESS_BARRIER_BIT
    | moderngl.FRAMEBUFFER_BARRIER_BIT
    | moderngl.TEXTURE_UPDATE_BARRIER_BIT
)
"""Image stores are made visible to sampling, other images, rendering, and reading back to the CPU."""


@dataclass(frozen=True, slots=True)
class Result:
    """What a run leaves. Its textures belong to the executor and hold their pixels until the next run.

    Attributes:
        outputs: the plan's outputs by name.
        histories: for every history that was read ``"valid"``, or why it was not: ``"first use"``, ``"resized"``,
            ``"format changed"``, ``"not fed last frame"``, ``"reset: <reason>"``.
        barriers: how many memory barriers were issued.
    """

    outputs: dict[str, moderngl.Texture]
    histories: dict[str, str]
    barriers: int
    plan: Plan
    textures: dict[Tex, moderngl.Texture]

    def texture(self, name: str) -> moderngl.Texture:
        """The texture that the graph calls ``name`` (``"svgf.temporal.out_color"``).

        Raises:
            GraphError: it was not made, or another texture was written over it; then compile the plan with ``keep``.
        """
        final = self.plan.final_textures()
        if name in final:
            return self.textures[final[name]]
        if any(tex.name == name for tex in self.textures):
            raise GraphError(
                f"texture {name!r} was written over later in the frame: compile the plan with keep=({name!r},)"
            )
        known = [tex.name for tex in self.textures]
        raise GraphError(
            f"no texture {name!r} in this frame{did_you_mean(name, known)} (there are: {', '.join(known)})"
        )


class Executor:
    """Runs one plan after the other on a context and owns every GL object this needs.

    A run leaves the screen bound (without a window: no framebuffer), and blending, depth test and culling off.

    Args:
        ctx: OpenGL 4.3 or later.
        shader_root: the folder that the passes' ``shader`` paths start at.
    """

    def __init__(self, ctx: moderngl.Context, shader_root: Path = SHADER_ROOT) -> None:
        self._ctx = ctx
        self.shader_root: Final = shader_root
        self._programs = Programs(ctx, shader_root)
        self._textures = Textures(ctx)
        self._slots = Slots(self._textures)
        self._histories = Histories(self._textures)
        # Bound after every run. moderngl binds the current framebuffer again whenever it has made another one, which
        # fails if ours is still the current one when it is released.
        self._idle = ctx.screen or ctx.detect_framebuffer(0)
        self._run = 0
        self._prepared: dict[Variant, tuple[Node, Program]] = {}

    def run(
        self,
        plan: Plan,
        size: Size,
        uploads: Mapping[str, moderngl.Texture],
        reset: str = "",
        profiler: Profiler | None = None,
        again: bool = False,
    ) -> Result:
        """Run all passes of ``plan``.

        Args:
            size: width and height of the frame in pixels.
            uploads: the graph's imports by name; more than the plan needs do no harm. They keep their own sampling
                state, so set them to nearest and not repeating.
            reset: why no history may be used in this frame (``"cut"``); empty if they may.
            profiler: measures every pass; without one nothing is measured and nothing waits.
            again: the last frame once more, with the histories that it had then.

        Raises:
            GraphError: an upload is missing or of another format, a uniform's value does not fit, or ``size`` is empty.
            ShaderError: a pass runs for the first time and its shader cannot be used.
        """
        if min(size) < 1:
            raise GraphError(f"the frame's size is {size[0]} x {size[1]}")
        if again:
            self._histories.unswap(self._run)
        else:
            self._run += 1
        status = self._histories.acquire(plan.feeds.values(), size, self._run, reset)
        textures = self._place(plan, size, uploads)
        self._ctx.enable_only(moderngl.NOTHING)
        try:
            barriers = self._run_passes(plan, textures, status, profiler)
        finally:
            self._idle.use()
        self._histories.swap(plan.feeds.values(), self._run)
        self._histories.release_unused(self._run)
        self._slots.release_unused(self._run)
        outputs = {name: textures[tex] for name, tex in plan.outputs.items()}
        return Result(outputs, status, barriers, plan, textures)

    def unprepared(self, variants: Mapping[Variant, Node]) -> dict[Variant, Node]:
        """Those of ``variants`` that :meth:`prepare` was not called for, or whose program was replaced since."""
        return {key: node for key, node in variants.items() if key not in self._prepared}

    def prepare(self, node: Node, size: Size) -> None:
        """Compile the program of ``node`` and draw with it once, into small textures of its own.

        Then a run in frames of ``size`` meets nothing new: drivers finish a program when it first draws.

        Raises:
            GraphError: a uniform's value does not fit.
            ShaderError: the shader cannot be used.
        """
        program = self._programs.get(node)
        sources: dict[str, Tex | History] = {**node.reads, **node.prevs}
        small = stand_in(size, {tex.divisor for tex in (*sources.values(), *node.writes.values())})
        made: list[moderngl.Texture] = []

        def texture(tex: Tex | History) -> moderngl.Texture:
            made.append(self._textures.create(tex.fmt, texture_size(small, tex.divisor)))
            return made[-1]

        inputs = {port: texture(source) for port, source in sources.items()}
        targets = [texture(target) for target in node.writes.values()]
        self._ctx.enable_only(moderngl.NOTHING)
        try:
            self._draw(program, node, inputs, targets, valid=False)
        finally:
            self._idle.use()
            for scratch in made:
                self._textures.release(scratch)
        self._prepared[variant(node, size)] = node, program

    def shaders_changed(self) -> bool:
        """Whether a shader file was written since they were last looked at for :meth:`reload_shaders`."""
        return self._programs.changed()

    def reload_shaders(self) -> list[ShaderError]:
        """Compile again what has changed on disk. A program that fails stays as it was, and its error is returned."""
        errors = self._programs.reload()
        for key, (node, program) in list(self._prepared.items()):
            if self._programs.get(node) is not program:
                del self._prepared[key]
        return errors

    def release(self) -> None:
        """Free all textures, framebuffers and programs. Results of earlier runs are void then."""
        self._histories.release()
        self._slots.release()
        self._programs.release()
        self._prepared.clear()

    def _place(self, plan: Plan, size: Size, uploads: Mapping[str, moderngl.Texture]) -> dict[Tex, moderngl.Texture]:
        """The texture object behind every handle of the plan."""
        textures = {tex: _upload(tex, uploads) for tex in plan.imports}
        slots = self._slots.acquire(plan.slots, size, self._run)
        for tex, index in plan.slot_of.items():
            textures[tex] = slots[index]
        for tex, history in plan.feeds.items():
            textures[tex] = self._histories.write(history)
        return textures

    def _run_passes(
        self, plan: Plan, textures: Mapping[Tex, moderngl.Texture], status: Mapping[str, str], profiler: Profiler | None
    ) -> int:
        """Run all passes and return the number of barriers."""
        if profiler is None:
            return sum(self._run_pass(node, textures, status) for node in plan.passes)
        barriers = 0
        with profiler.frame():
            for node in plan.passes:
                with profiler.measure(node.name):
                    barriers += self._run_pass(node, textures, status)
        return barriers

    def _run_pass(self, node: Node, textures: Mapping[Tex, moderngl.Texture], status: Mapping[str, str]) -> int:
        """Run one pass and return the number of barriers it took."""
        inputs = {port: textures[tex] for port, tex in node.reads.items()}
        inputs |= {port: self._histories.read(history) for port, history in node.prevs.items()}
        targets = [textures[tex] for tex in node.writes.values()]
        valid = all(status[history.name] == VALID for history in node.prevs.values())
        return self._draw(self._programs.get(node), node, inputs, targets, valid)

    def _draw(
        self,
        program: Program,
        node: Node,
        inputs: Mapping[str, moderngl.Texture],
        targets: list[moderngl.Texture],
        valid: bool,
    ) -> int:
        """Bind ``inputs`` by port and run ``program`` into ``targets``; the number of barriers it took."""
        for unit, port in program.samplers:
            inputs[port].use(unit)
        if program.history_flag is not None:
            program.history_flag.value = valid
        program.set_uniforms(node)
        if isinstance(node.work, ComputePass):
            return self._dispatch(program, node.work, targets)
        self._textures.framebuffer(targets).use()
        assert program.vertices is not None
        program.vertices.render(moderngl.TRIANGLES, 3)
        return 0

    def _dispatch(self, program: Program, work: ComputePass, targets: list[moderngl.Texture]) -> int:
        for unit, target in enumerate(targets):
            target.bind_to_image(unit, read=False, write=True)
        program.code.run(*work.work_groups(targets[0].size))
        self._ctx.memory_barrier(COMPUTE_BARRIER)
        return 1


def _upload(tex: Tex, uploads: Mapping[str, moderngl.Texture]) -> moderngl.Texture:
    texture = uploads.get(tex.name)
    if texture is None:
        raise GraphError(f"import {tex.name!r} was not uploaded{did_you_mean(tex.name, uploads)}")
    fmt = lookup(tex.fmt)
    if (texture.components, texture.dtype) != (fmt.components, fmt.dtype):
        raise GraphError(
            f"import {tex.name!r} is {tex.fmt} ({fmt.components} x {fmt.dtype}),"
            f" but {texture.components} x {texture.dtype} was uploaded"
        )
    return texture
