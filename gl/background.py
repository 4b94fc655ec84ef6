"""Shaders compiled beside the loop that draws: on a thread and in a context of their own.

Programs cannot be handed over: moderngl adopts none that it has not made, and some drivers keep machine code by context
even where objects are shared. What carries over is the driver's cache, which the thread fills by compiling and drawing
exactly what the caller is about to draw, in another context of the same driver; then the caller compiles it again at
little cost. Measured with llvmpipe, SVGF at 640x360, nothing cached: the first frame stops the caller for 0.7 s instead
of 3.2 s, where a frame takes 0.6 s anyway, and while the thread compiled, others waited 16 ms at most
(:mod:`gl.unlocked`; 240 ms without). A process of its own would do no better, and misses what drivers cache in memory.

Where the driver's cache is off or cannot be written, the caller compiles everything itself. It therefore takes variants
over one by one, for a little time in every frame, so that no stop is longer than one of them takes.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import moderngl

from errors import Notices
from gl.executor import Executor
from gl.plan import Node, Plan
from gl.ports import GraphError
from gl.shader import ShaderError
from gl.variants import Size, Variant, variants

TAKE_OVER: Final = 0.025
"""Seconds per call of :meth:`Compiler.ready` after which it takes nothing more over."""

SETTLED: Final = 0.5
"""Seconds after which something compiled in the background is taken over, or as long as that has taken if it is longer:
drivers write their cache behind the scenes. Mesa's, asked at once on a busy machine, held nine of twelve variants."""

LOOK_EVERY: Final = 0.3
"""Seconds between two looks at the shader files."""

OpenContext = Callable[[], moderngl.Context]
Wanted = dict[Variant, Node]


class Compiler:
    """Has the plans of ``executor`` compiled before they run::

        if compiler.ready(plan, size):
            executor.run(plan, size, ...)
        else:
            executor.run(the_plan_before, size, ...)
            print(compiler.text)

    All methods belong to the thread of ``executor``. What goes wrong in the background is noted in :attr:`notices` and
    ends nothing: the caller compiles it itself then, and meets the error where it can be told.

    Args:
        open_context: called on the new thread; makes a context of the same driver current there and wraps it, with
            :class:`gl.unlocked.UnlockedLoader` so that others run meanwhile. None: no thread, all is done in
            :meth:`ready`.
        notify: called on the new thread whenever :meth:`ready` may answer otherwise than before; must not raise.
    """

    def __init__(
        self, executor: Executor, open_context: OpenContext | None, notify: Callable[[], None] = lambda: None
    ) -> None:
        self.notices = Notices()
        self._executor = executor
        self._background: _Background | None = None
        if open_context is not None:
            self._background = _Background(executor.shader_root, open_context, notify, self.notices)
        self._batch: set[Variant] = set()
        self._missing: Wanted = {}
        self._plan: tuple[Wanted, Size] = {}, (1, 1)
        self._errors: list[ShaderError] = []
        self._look_at = time.monotonic() + LOOK_EVERY

    @property
    def progress(self) -> tuple[int, int]:
        """How many of the variants that the plan asked for last needs are there, of how many; (0, 0) if all are."""
        return (len(self._batch) - len(self._missing), len(self._batch)) if self._missing else (0, 0)

    @property
    def text(self) -> str:
        """A line for people: ``"compiling 3 of 9 shaders"``, the third being under way; "" if nothing is."""
        done, total = self.progress
        return f"compiling {done + 1} of {total} shaders" if total else ""

    def ready(self, plan: Plan, size: Size) -> bool:
        """Whether a run of ``plan`` in frames of ``size`` compiles nothing. Asks for what is missing.

        Raises:
            ShaderError, GraphError: as :meth:`gl.executor.Executor.run` would for this plan.
        """
        self._plan = variants(plan, size), size
        self._missing = self._executor.unprepared(self._plan[0])
        if not self._missing or not self._missing.keys() <= self._batch:
            self._batch = set(self._missing)
        finished = list(self._missing)
        if self._background is not None:
            finished = self._background.want(self._missing, size)
        stop = time.monotonic() + TAKE_OVER
        for key in finished:
            self._executor.prepare(self._missing[key], size)
            del self._missing[key]
            if time.monotonic() > stop:
                break
        return not self._missing

    def reload(self) -> list[ShaderError]:
        """What is wrong with the shader files as they are now. Where they change, the plan asked for last is compiled
        anew, in the background first; a program whose files do not compile stays as it was. Looks at the files every
        :data:`LOOK_EVERY` seconds only.
        """
        if self._background is not None and self._background.take_reloaded():
            self._errors = self._executor.reload_shaders()
        elif time.monotonic() >= self._look_at:
            self._look_at = time.monotonic() + LOOK_EVERY
            if self._executor.shaders_changed():
                if self._background is not None and self._background.alive:
                    self._background.reload(*self._plan)
                else:
                    self._errors = self._executor.reload_shaders()
        return self._errors

    def close(self) -> None:
        """End the thread, which waits for the shader it is at. Closing twice does no harm."""
        if self._background is not None:
            self._background.close()


class _Background:
    """The thread and what it is asked for. Only :meth:`_work` and what it calls run on it."""

    def __init__(self, root: Path, open_context: OpenContext, notify: Callable[[], None], notices: Notices) -> None:
        self._root, self._open, self._notify, self._notices = root, open_context, notify, notices
        self._news = threading.Condition()  # guards all that follows
        self._wanted: Wanted = {}
        self._size: Size = (1, 1)
        self._finished: Wanted = {}
        self._settled_at: dict[Variant, float] = {}
        self._reload: tuple[Wanted, Size] | None = None
        self._closing = False
        self._reloaded_at: float | None = None
        self.alive = True
        self._thread: threading.Thread | None = None

    def want(self, missing: Wanted, size: Size) -> list[Variant]:
        """Ask for ``missing`` and nothing else from now on; returns what of it can be taken over."""
        with self._news:
            if not self.alive:
                return list(missing)
            self._wanted = {key: node for key, node in missing.items() if key not in self._finished}
            self._size = size
            if self._wanted:
                self._wake()
            now = time.monotonic()
            return [key for key in missing if key in self._finished and now >= self._settled_at[key]]

    def reload(self, again: Wanted, size: Size) -> None:
        """Compile what has changed on disk, and prepare ``again`` anew; then :meth:`take_reloaded` is true, once."""
        with self._news:
            if self._reload is None and self._reloaded_at is None:
                self._reload = again, size
                self._wake()

    def take_reloaded(self) -> bool:
        """Whether a reload that was asked for is done, and the driver's cache written."""
        with self._news:
            if self._reloaded_at is None or time.monotonic() < self._reloaded_at:
                return False
            self._reloaded_at = None
            return True

    def close(self) -> None:
        with self._news:
            self._closing = True
            self._news.notify()
        if self._thread is not None:
            self._thread.join()

    def _wake(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name="shaders")
            self._thread.start()
        self._news.notify()

    def _work(self) -> None:
        with ExitStack() as stack:
            try:
                ctx = self._open()
                stack.callback(ctx.release)
                executor = Executor(ctx, self._root)
                stack.callback(executor.release)
                while self._next(ctx, executor):
                    self._notify()
            except Exception as error:  # whatever it is, the caller can do without
                self._notices.add(f"shaders are not compiled in the background: {type(error).__name__}: {error}")
                with self._news:
                    self.alive = False
                self._notify()

    def _next(self, ctx: moderngl.Context, executor: Executor) -> bool:
        """Wait for something to do and do it; False when there is to be no more."""
        with self._news:
            self._news.wait_for(lambda: self._closing or self._reload is not None or self._wanted)
            if self._closing:
                return False
            start = time.monotonic()
            reload = self._reload
            if reload is None:
                key, node = next(iter(self._wanted.items()))
                size = self._size
        if reload is not None:
            self._obey_reload(ctx, executor, *reload, start)
        else:
            self._prepare(ctx, executor, node, size)
            with self._news:
                self._finish({key: node}, start)
                self._wanted.pop(key, None)
        return True

    def _finish(self, made: Wanted, start: float) -> float:
        """Note what was made since ``start``, and return when it can be taken over."""
        now = time.monotonic()
        settled_at = now + max(SETTLED, now - start)
        self._finished |= made
        self._settled_at |= dict.fromkeys(made, settled_at)
        return settled_at

    def _obey_reload(self, ctx: moderngl.Context, executor: Executor, again: Wanted, size: Size, start: float) -> None:
        executor.reload_shaders()  # what it returns is for the caller's own reload to tell
        for node in executor.unprepared(again).values():
            if not self._closing:
                self._prepare(ctx, executor, node, size)
        with self._news:
            for key in executor.unprepared(self._finished):
                del self._finished[key]
            stale = executor.unprepared(again)
            self._reloaded_at = self._finish({key: node for key, node in again.items() if key not in stale}, start)
            self._reload = None

    def _prepare(self, ctx: moderngl.Context, executor: Executor, node: Node, size: Size) -> None:
        try:
            executor.prepare(node, size)
        except (GraphError, ShaderError):
            return  # the caller will meet the same error, and can tell the user
        ctx.finish()
