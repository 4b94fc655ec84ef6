"""Errors of the picture in the window, found by a process of its own.

FLIP holds Python's global lock while it computes, for a tenth of a second and more: in the window's process nothing
else would move. The judge is started when it is first needed, works at a lower priority, and ends with its input.
"""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import IO, Final

import numpy as np
from numpy.typing import NDArray

from raytrace.still import Snapshot

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]

_ROOT: Final = Path(__file__).resolve().parent.parent
_REQUEST: Final = struct.Struct("<II")  # width, height; the two pictures and the mask follow
_ANSWER: Final = struct.Struct("<ddd")  # RMSE, PSNR, FLIP; the FLIP map follows
_NICENESS: Final = 10


@dataclass(frozen=True)
class Verdict:
    """Errors of one picture against ``samples`` paths per pixel, whose own RMSE is ``noise`` (NaN: not known yet).

    ``flip_map`` (H, W) float32 in [0, 1], row 0 at the bottom.
    """

    rmse: float
    psnr: float
    flip: float
    noise: float
    samples: int
    flip_map: F32


class Judge:
    """Compares one picture at a time::

        judge.ask(image, snapshot)
        while judge.busy:
            ...
        judge.verdict

    ``notify`` is called from another thread when a verdict is there. ``close`` ends the process.
    """

    def __init__(self, notify: Callable[[], None] | None = None) -> None:
        self._notify = notify
        self._requests: SimpleQueue[tuple[F32, Snapshot] | None] = SimpleQueue()
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None
        self.busy = False
        self.verdict: Verdict | None = None
        self.trouble = ""

    def ask(self, image: F32, snapshot: Snapshot) -> None:
        """Begin to compare ``image`` (H, W, 3), linear radiance. Raises RuntimeError while one is compared."""
        if self.busy:
            raise RuntimeError("a picture is being compared")
        self.busy = True
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name="judge", daemon=True)
            self._thread.start()
        self._requests.put((image, snapshot))

    def close(self) -> None:
        """End the process, and wait for that. Closing twice does no harm."""
        self._requests.put(None)
        if self._process is not None:
            self._process.kill()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _work(self) -> None:
        try:
            process = self._process = start()
            with process:
                assert process.stdin is not None
                assert process.stdout is not None
                for image, snapshot in iter(self._requests.get, None):
                    self.verdict = _exchange(process.stdin, process.stdout, image, snapshot)
                    self.busy = False
                    if self._notify is not None:
                        self._notify()
                process.kill()
        except (OSError, EOFError, ValueError) as error:  # killed, by close() or by whoever needs memory
            self.trouble = str(error) or type(error).__name__


def start() -> subprocess.Popen[bytes]:
    """The judge's process. One thread: the others are at work on the picture."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        [sys.executable, "-m", __name__], cwd=_ROOT, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )


def _exchange(to: IO[bytes], back: IO[bytes], image: F32, snapshot: Snapshot) -> Verdict:
    height, width = image.shape[:2]
    to.write(_REQUEST.pack(width, height))
    for picture in (image, snapshot.radiance):
        to.write(np.ascontiguousarray(picture, dtype=np.float32).tobytes())
    to.write(snapshot.mask.astype(np.uint8).tobytes())
    to.flush()
    rmse, psnr, flip = _ANSWER.unpack(_read(back, _ANSWER.size))
    values = np.frombuffer(_read(back, 4 * width * height), np.float32).reshape(height, width)
    return Verdict(rmse, psnr, flip, snapshot.noise, snapshot.samples, values)


def _read(stream: IO[bytes], count: int) -> bytes:
    """Raises EOFError if the other side has ended."""
    data = stream.read(count)
    if len(data) < count:
        raise EOFError("the other process has ended")
    return data


def serve(requests: IO[bytes], answers: IO[bytes]) -> None:
    """Answer until the input ends."""
    from bench.metrics import display_mse, psnr, rmse
    from bench.metrics_visual import flip_map

    while True:
        try:
            width, height = _REQUEST.unpack(_read(requests, _REQUEST.size))
            shape = (height, width, 3)
            image, truth = (
                np.frombuffer(_read(requests, 12 * width * height), np.float32).reshape(shape) for _ in range(2)
            )
            mask = np.frombuffer(_read(requests, width * height), np.uint8).reshape(height, width) > 0
        except EOFError:
            return
        image = np.nan_to_num(image, posinf=65504.0, neginf=0.0)
        errors = flip_map(image, truth)
        linear = rmse(image, truth, mask) if mask.any() else float("nan")
        answers.write(_ANSWER.pack(linear, psnr(display_mse(image, truth)), float(errors.mean(dtype=np.float64))))
        answers.write(errors.tobytes())
        answers.flush()


def main() -> None:
    if hasattr(os, "nice"):
        os.nice(_NICENESS)
    # What a library prints must not get among the answers.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    serve(sys.stdin.buffer, answers)


if __name__ == "__main__":
    main()
