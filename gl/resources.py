"""The executor's textures: slots that passes take turns in, histories that outlive frames, and their framebuffers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import moderngl

from gl.formats import lookup
from gl.plan import History, Slot, texture_size

KEEP_RUNS: Final = 8
"""What no run has used for this many runs is released: long enough to switch something off and on again."""

VALID: Final = "valid"

Size = tuple[int, int]


class Textures:
    """Creates and releases textures, together with the framebuffers they are attached to."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._framebuffers: dict[tuple[int, ...], moderngl.Framebuffer] = {}

    def create(self, fmt: str, size: Size) -> moderngl.Texture:
        """A texture of zeros, read without filtering or wrapping around."""
        spec = lookup(fmt)
        zeros = bytes(size[0] * size[1] * spec.bytes_per_pixel)
        texture = self._ctx.texture(size, spec.components, zeros, dtype=spec.dtype)
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        texture.repeat_x = texture.repeat_y = False
        return texture

    def framebuffer(self, textures: Iterable[moderngl.Texture]) -> moderngl.Framebuffer:
        """The framebuffer that writes ``textures`` in this order; made on first use."""
        attachments = list(textures)
        key = tuple(texture.glo for texture in attachments)
        framebuffer = self._framebuffers.get(key)
        if framebuffer is None:
            framebuffer = self._framebuffers[key] = self._ctx.framebuffer(attachments)
        return framebuffer

    def release(self, texture: moderngl.Texture) -> None:
        """Free ``texture`` and every framebuffer that writes it."""
        for key in [key for key in self._framebuffers if texture.glo in key]:
            self._framebuffers.pop(key).release()
        texture.release()


class Slots:
    """One texture per slot of the plan, shared by all plans; slots are recognised by format, divisor and rank."""

    def __init__(self, textures: Textures) -> None:
        self._textures = textures
        self._size: Size = (0, 0)
        self._owned: dict[Slot, moderngl.Texture] = {}
        self._last_run: dict[Slot, int] = {}

    def __len__(self) -> int:
        return len(self._owned)

    def acquire(self, slots: Iterable[Slot], size: Size, run: int) -> list[moderngl.Texture]:
        """The textures for ``slots`` in a frame of ``size``; those of another size are released."""
        if size != self._size:
            self.release()
            self._size = size
        result = []
        for slot in slots:
            texture = self._owned.get(slot)
            if texture is None:
                texture = self._owned[slot] = self._textures.create(slot.fmt, texture_size(size, slot.divisor))
            self._last_run[slot] = run
            result.append(texture)
        return result

    def release_unused(self, run: int) -> None:
        """Free what has not been used for :data:`KEEP_RUNS` runs."""
        for slot in [slot for slot, last in self._last_run.items() if run - last >= KEEP_RUNS]:
            del self._last_run[slot]
            self._textures.release(self._owned.pop(slot))

    def release(self) -> None:
        """Free everything."""
        for texture in self._owned.values():
            self._textures.release(texture)
        self._owned.clear()
        self._last_run.clear()


@dataclass(slots=True)
class Pair:
    """The two halves of a history: last frame's, which is read, and this frame's, which is written.

    ``frame`` is the frame's size, not the textures': two frames may differ and round up to the same small texture.
    """

    fmt: str
    divisor: int
    frame: Size
    read: moderngl.Texture
    write: moderngl.Texture
    last_run: int
    fed_run: int = -1
    fed_before: int = -1


class Histories:
    """The histories by name. They survive rebuilt graphs; what is in them counts only if last frame wrote it."""

    def __init__(self, textures: Textures) -> None:
        self._textures = textures
        self._pairs: dict[str, Pair] = {}

    def __len__(self) -> int:
        return len(self._pairs)

    def acquire(self, histories: Iterable[History], size: Size, run: int, reset: str) -> dict[str, str]:
        """Provide ``histories`` for a frame of ``size``.

        Returns:
            For each name :data:`VALID`, or the reason why the half to be read does not hold the last frame.
        """
        status: dict[str, str] = {}
        for history in histories:
            pair = self._pairs.get(history.name)
            if pair is None:
                reason = "first use"
            elif (pair.fmt, pair.divisor) != (history.fmt, history.divisor):
                reason = "format changed"
            elif pair.frame != size:
                reason = "resized"
            elif pair.fed_run != run - 1:
                reason = "not fed last frame"
            else:
                reason = f"reset: {reset}" if reset else VALID
            wanted = history.fmt, history.divisor, size
            if pair is None or (pair.fmt, pair.divisor, pair.frame) != wanted:
                self._drop(history.name)
                read, write = (
                    self._textures.create(history.fmt, texture_size(size, history.divisor)) for _ in range(2)
                )
                pair = self._pairs[history.name] = Pair(*wanted, read, write, run)
            pair.last_run = run
            status[history.name] = reason
        return status

    def read(self, history: History) -> moderngl.Texture:
        """What was fed to ``history`` in the run before."""
        return self._pairs[history.name].read

    def write(self, history: History) -> moderngl.Texture:
        """Where this run's feeder writes."""
        return self._pairs[history.name].write

    def swap(self, histories: Iterable[History], run: int) -> None:
        """Let what was written in this run be what is read in the next."""
        for history in histories:
            pair = self._pairs[history.name]
            pair.read, pair.write = pair.write, pair.read
            pair.fed_before, pair.fed_run = pair.fed_run, run

    def unswap(self, run: int) -> None:
        """Take back the swaps of ``run``, the last one: it is to be made again."""
        for pair in self._pairs.values():
            if pair.fed_run == run:
                pair.read, pair.write = pair.write, pair.read
                pair.fed_run = pair.fed_before

    def release_unused(self, run: int) -> None:
        """Free what has not been used for :data:`KEEP_RUNS` runs."""
        for name in [name for name, pair in self._pairs.items() if run - pair.last_run >= KEEP_RUNS]:
            self._drop(name)

    def release(self) -> None:
        """Free everything."""
        for name in list(self._pairs):
            self._drop(name)

    def _drop(self, name: str) -> None:
        pair = self._pairs.pop(name, None)
        if pair is not None:
            self._textures.release(pair.read)
            self._textures.release(pair.write)
