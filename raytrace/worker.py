"""The tracer in a thread of its own, one frame ahead: it traces frame n + 1 while the GPU filters frame n.

Between the frames of a view at rest it refines a reference of that view, if somebody wants one.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Final, Protocol

from raytrace.camera import Camera
from raytrace.frame import FramePacket
from raytrace.shot import jitter_of
from raytrace.still import SampleSource, Snapshot, StillReference, StillView

_FRAMES_PER_SAMPLE: Final = 3
"""After so many frames the reference gets its turn even if the next frame is waited for."""


class FrameSource(Protocol):
    """What the worker needs of :class:`raytrace.integrator.Tracer`."""

    def frame(
        self,
        index: int,
        camera: Camera,
        previous_camera: Camera,
        size: tuple[int, int],
        now: float,
        previous: float,
        cut: bool,
        remember: str,
        lamps: float,
    ) -> FramePacket: ...


@dataclass(frozen=True)
class Request:
    """What the next frame shows.

    ``camera`` is without jitter, which ``jitter`` asks for. ``size``: (width, height) in pixels. ``time``: the scene's,
    in seconds. ``cut``: the frame does not continue the one before it. ``remember``, ``lamps``: as in
    :meth:`raytrace.integrator.Tracer.frame`.
    """

    camera: Camera
    size: tuple[int, int]
    time: float = 0.0
    jitter: bool = False
    cut: bool = False
    remember: str = ""
    lamps: float = 1.0


class Worker:
    """Hands requests in and packets out, one of either at a time::

        worker.submit(request)
        while True:
            packet = worker.take(timeout=None)
            worker.submit(next_request)  # traced while the caller works on `packet`
            ...

    Motion vectors lead to the frame traced before, whenever that was: its camera and time are remembered here. A frame
    is marked as a cut if it is the first, differs in size from the one before, or is asked to be.

    ``samples``: makes the samples of references; None: there are none (:meth:`accumulate`).
    ``notify`` is called from the worker's thread whenever :meth:`take` has something to return; it must not raise.
    All other methods belong to one thread. ``with Worker(...)`` or :meth:`close` ends the worker's thread.
    """

    def __init__(
        self,
        tracer: FrameSource,
        notify: Callable[[], None] | None = None,
        samples: SampleSource | None = None,
    ) -> None:
        self._tracer, self._notify, self._samples = tracer, notify, samples
        self._requests: SimpleQueue[Request | None] = SimpleQueue()
        self._outcomes: SimpleQueue[FramePacket | BaseException] = SimpleQueue()
        self._busy = False
        self._index = 0
        self._last: Request | None = None
        self._view: StillView | None = None
        self._reference: StillReference | None = None
        self._frames = 0  # since the last sample of the reference
        self._trouble: BaseException | None = None
        self.snapshot: Snapshot | None = None
        self._thread = threading.Thread(target=self._work, name="tracer")
        self._thread.start()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def busy(self) -> bool:
        """Whether a frame was submitted and not yet taken."""
        return self._busy

    def submit(self, request: Request) -> None:
        """Begin with the next frame.

        Raises:
            RuntimeError: the frame before has not been taken, or the worker is closed.
        """
        if self._busy or not self._thread.is_alive():
            raise RuntimeError("a frame is under way: take it first" if self._busy else "the worker is closed")
        self._busy = True
        self._requests.put(request)

    def accumulate(self, view: StillView | None) -> None:
        """From the next frame on, refine the reference of ``view`` in between; None: of none.

        What there is of it is in ``snapshot``, of the view accumulated last or, for a moment, of the one before.
        """
        self._view = None if self._samples is None else view

    def take(self, timeout: float | None = 0.0) -> FramePacket | None:
        """The frame submitted, or None if it is not ready within ``timeout`` seconds (None: wait for it).

        Raises whatever went wrong while it was traced; the frame after that is a cut.

        Raises:
            RuntimeError: no frame was submitted.
        """
        if not self._busy:
            raise RuntimeError("no frame is under way: submit one first")
        try:
            outcome = self._outcomes.get(block=timeout != 0.0, timeout=timeout)
        except Empty:
            return None
        self._busy = False
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome

    def close(self) -> None:
        """End the thread; waits for the frame under way, which is lost. Closing twice does no harm."""
        self._requests.put(None)
        self._thread.join()
        self._busy = False

    def _work(self) -> None:
        while (request := self._next()) is not None:
            outcome: FramePacket | BaseException
            try:
                outcome = self._trace(request)
            except BaseException as error:  # whatever it is, it is raised where the frame is waited for
                outcome = error
            trouble, self._trouble = self._trouble, None
            self._outcomes.put(trouble or outcome)
            if self._notify is not None:
                self._notify()

    def _next(self) -> Request | None:
        """The next request. While there is none the reference wanted is refined, for half of the time at most, so that
        who filters on the same processor gets on; once in a few frames it is refined whatever waits."""
        pause = 0.0
        self._frames += 1
        while (view := self._view) is not None:
            if self._frames < _FRAMES_PER_SAMPLE:
                with suppress(Empty):
                    return self._requests.get(block=pause > 0.0, timeout=pause)
            start = time.perf_counter()
            self._refine(view)
            pause = time.perf_counter() - start
            self._frames = 0
        self._reference = self.snapshot = None
        return self._requests.get()

    def _refine(self, view: StillView) -> None:
        """Add a sample to the reference of ``view``; what goes wrong is raised where the next frame is waited for."""
        assert self._samples is not None
        if self._reference is None or self._reference.view != view:
            self._reference = StillReference(view)
        try:
            self.snapshot = self._reference.refine(self._samples)
        except BaseException as error:
            self._view, self._trouble = None, error

    def _trace(self, request: Request) -> FramePacket:
        last, self._last = self._last, None  # stays None if tracing fails: what comes next continues nothing
        cut = request.cut or last is None or last.size != request.size
        before = request if cut or last is None else last
        camera = request.camera.with_jitter(jitter_of(self._index)) if request.jitter else request.camera
        packet = self._tracer.frame(
            self._index,
            camera,
            before.camera,
            request.size,
            request.time,
            before.time,
            cut=cut,
            remember=request.remember,
            lamps=request.lamps,
        )
        self._index += 1
        self._last = request
        return packet
