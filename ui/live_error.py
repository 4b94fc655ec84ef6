"""The error of the picture while nothing moves: numbers for the panel, and a map to look at."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from bench.judge import Judge, Verdict
from gl.executor import Result
from gl.renderer import read
from raytrace.still import Snapshot, StillView

U8 = NDArray[np.uint8]

EVERY: Final = 0.5
"""Seconds between two comparisons: each reads the picture back."""

LEAST: Final = 4
"""Paths per pixel from which a reference is worth comparing with."""

MAP_TOP: Final = 0.25
"""FLIP that is the brightest of the map."""

# The colour map magma (Smith and van der Walt, CC0), every 32nd of its colours; in between they are interpolated.
_MAGMA: Final = np.array(
    [(0, 0, 4), (28, 16, 68), (79, 18, 123), (129, 37, 129), (181, 54, 122), (229, 80, 100), (251, 135, 97),
     (254, 194, 135), (252, 253, 191)],
    dtype=np.float64,
)  # fmt: skip


class LiveError:
    """Compares what is shown with the reference of the view at rest.

    ``wake``: called, from another thread, when there is something new.
    """

    def __init__(self, ctx: moderngl.Context, wake: Callable[[], None]) -> None:
        self._ctx = ctx
        self._judge = Judge(wake)
        self._asked = float("-inf")
        self._view: StillView | None = None
        self._judged: StillView | None = None
        self._verdict: Verdict | None = None
        self._texture: moderngl.Texture | None = None

    def update(self, now: float, result: Result, snapshot: Snapshot | None, wants_map: bool) -> Verdict | None:
        """What is known of the error of the picture ``result``; None without a reference to compare with.

        ``now``: seconds of any clock. Reads the picture now and then; everything else is done elsewhere.
        """
        if snapshot is None:
            self._view = self._verdict = None
            return None
        if snapshot.view != self._view:
            self._view, self._verdict = snapshot.view, None
        judge = self._judge
        if not judge.busy and judge.verdict is not None:
            found, judge.verdict = judge.verdict, None
            if self._judged == snapshot.view:  # or it is of one that has been left
                self._verdict = found
        if self._verdict is not None and wants_map:
            self._show(self._verdict)
        due = now - self._asked >= EVERY and not judge.busy and not judge.trouble
        if due and snapshot.samples >= LEAST and result.outputs["radiance"].size == snapshot.view.size:
            self._asked, self._judged = now, snapshot.view
            judge.ask(read(result.outputs["radiance"])[..., :3], snapshot)
        return self._verdict

    @property
    def trouble(self) -> str:
        """Why there are no numbers and will be none, "" for nothing."""
        return f"the error of the picture: {self._judge.trouble}" if self._judge.trouble else ""

    @property
    def map(self) -> moderngl.Texture | None:
        """The error map, sRGB; None while there is none."""
        return self._texture if self._verdict is not None else None

    def _show(self, verdict: Verdict) -> None:
        pixels = colored(verdict.flip_map)
        size = (pixels.shape[1], pixels.shape[0])
        if self._texture is None or self._texture.size != size:
            if self._texture is not None:
                self._texture.release()
            self._texture = self._ctx.texture(size, 3, alignment=1)
        self._texture.write(pixels.tobytes(), alignment=1)

    def release(self) -> None:
        """Free the texture and end the judge."""
        self._judge.close()
        if self._texture is not None:
            self._texture.release()
            self._texture = None


def colored(errors: NDArray[np.floating]) -> U8:
    """FLIP per pixel, (H, W), in colours: black is 0, the brightest :data:`MAP_TOP` and more."""
    at = np.clip(errors.astype(np.float64) / MAP_TOP, 0.0, 1.0) * (len(_MAGMA) - 1)
    low = np.minimum(at.astype(np.int64), len(_MAGMA) - 2)
    part = (at - low)[..., None]
    pixels: U8 = np.rint(_MAGMA[low] * (1.0 - part) + _MAGMA[low + 1] * part).astype(np.uint8)
    return pixels
