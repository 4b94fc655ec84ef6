"""A scene opened on a thread of its own, while the window goes on with the one before it."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from config import Config
from raytrace.shot import Shot
from session import open_shot

_one_at_a_time = threading.Lock()


class Opening:
    """Begins at once::

        opening = Opening("interior", config, None, animate=True, notify=window.wake)
        while not opening.done:
            show(opening.progress)
        shot = opening.result()

    Nothing is printed. The window stays responsive: most of the work is done without Python's global lock, and with no
    kernels on disk ``interior``, in 17 s, stopped a ticker of 10 ms for 24 ms at most (:func:`_no_full_collections`).
    Openings take turns, since kernels are compiled one at a time anyway.

    Args:
        name, config, camera, animate: as for :func:`session.open_shot`.
        notify: called on the thread when :attr:`progress` or :attr:`done` has changed; must not raise.

    Attributes:
        progress: one line: ``"interior: preparing 161,336 triangles"``.
        notices: what the loader repaired or approximated, one line each.
    """

    def __init__(
        self,
        name: str,
        config: Config,
        camera: str | None,
        animate: bool,
        notify: Callable[[], None] = lambda: None,
    ) -> None:
        self.name = name
        self.progress = f"{name}: waiting"
        self.notices: list[str] = []
        self._arguments = (name, config, camera, animate)
        self._notify = notify
        self._closing = False
        self._outcome: Shot | BaseException | None = None
        self._guard = threading.Lock()  # of these two
        self._finished = threading.Event()
        self._thread = threading.Thread(target=self._work, name="opening")
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether :meth:`result` returns or raises at once."""
        return self._finished.is_set()

    def result(self) -> Shot:
        """The shot, whose tracer now belongs to the caller; waits for it.

        Raises whatever went wrong, as :func:`session.open_shot` does.

        Raises:
            RuntimeError: it was asked for before, or this was closed.
        """
        self._finished.wait()
        with self._guard:
            outcome, self._outcome = self._outcome, None
        if outcome is None:
            raise RuntimeError(f"{self.name}: the result was taken, or is not wanted")
        if isinstance(outcome, BaseException):
            try:
                raise outcome
            finally:
                del outcome  # see _work
        return outcome

    def close(self) -> None:
        """Not wanted any more: returns at once. The thread ends after the stage or the kernel it is at, seconds later,
        and frees what it has made, unless that was taken."""
        with self._guard:
            self._closing = True
            shot, self._outcome = self._outcome, None
        if isinstance(shot, Shot):
            shot.tracer.close()

    # What session.open_shot calls, on the thread.

    @contextmanager
    def stage(self, text: str) -> Iterator[None]:
        self._tell(text)
        yield

    def compiling(self, kernel: str) -> None:
        self._tell(f"{self.name}: compiling the tracer's kernels, once for each kind of scene ({kernel})")

    def notice(self, text: str) -> None:
        self.notices.append(text)

    def _tell(self, text: str) -> None:
        if self._closing:
            raise _ClosedError
        self.progress = text
        self._notify()

    def _work(self) -> None:
        # An error and a frame of its traceback that knows it by name keep each other, and with them all that the frames
        # hold, such as half a scene. Nobody would collect that cycle: see _no_full_collections.
        outcome: Shot | BaseException | None = None
        try:
            with _one_at_a_time, _no_full_collections():
                outcome = open_shot(*self._arguments, log=self)
        except _ClosedError:
            pass  # raised by _tell: close() was called, so nobody will ask for an outcome
        except BaseException as error:  # whatever it is, it is raised where the shot is waited for
            outcome = error
        with self._guard:
            wanted = not self._closing
            self._outcome = outcome if wanted else None
        if isinstance(outcome, Shot) and not wanted:
            outcome.tracer.close()
        del outcome
        self._finished.set()
        self._notify()


class _ClosedError(Exception):
    """Ends an opening that is not wanted any more."""


@contextmanager
def _no_full_collections() -> Iterator[None]:
    """Keeps Python's garbage collector from looking at all objects, which stops every thread for as long.

    Numba makes so many of them that it did so ten times while kernels were compiled, for up to 355 ms. What it leaves
    behind lives as long as the program, and is set aside for good at the end, where the next collection would stop
    everything for 0.4 s once more. Cycles among it are not freed: 60 MB, in a run that has compiled kernels. What
    is large, scenes and frames, is in no cycle, and freed without the collector.
    """
    before = gc.get_threshold()
    gc.set_threshold(before[0], before[1], 1 << 30)
    try:
        yield
    finally:
        gc.freeze()
        gc.set_threshold(*before)
