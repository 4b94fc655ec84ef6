"""What the window knows about the frame it shows; the panel reads it, and nothing in here is ever set by it."""

from __future__ import annotations

from dataclasses import dataclass, field

from bench.judge import Verdict
from gl.executor import Result
from gl.profiler import Row
from gl.resources import VALID
from raytrace.frame import FramePacket


@dataclass
class Status:
    """``renderer``: GL_RENDERER. ``size``: of the picture, (width, height) in pixels. ``triangles``: of the scene; 0
    where nobody says.

    ``fps``: pictures a second. ``trace_ms``: median time of tracing a frame, or of other ``work`` that brings it.
    ``passes``: what the profiler measured, in order; empty while the panel is hidden, because measuring takes time on
    software renderers. ``bad``: noisy samples and pixels of the picture that were NaN or infinite in the last frame;
    None where nobody counts them.

    ``progress``: what is being prepared in the background, "" for nothing. ``errors``: shaders that do not compile as
    they are on disk now, and scenes that could not be opened.

    ``packet`` and ``result``: the frame shown. ``cursor``: the pixel of the picture that the mouse is over, (x, y) with
    row 0 at the bottom; None outside.

    ``resting``: nothing moves, so that a reference can be traced. ``errors_now``: of the picture against it, as they
    were last found; None while there are none.

    ``lapse``: why histories were void when they last were, ``frames`` so many frames ago: see :meth:`show`.
    """

    scene: str
    renderer: str
    size: tuple[int, int]
    triangles: int = 0
    fps: float = 0.0
    trace_ms: float = 0.0
    work: str = "tracing"
    passes: list[Row] = field(default_factory=list)
    bad: tuple[int, int] | None = None
    progress: str = ""
    errors: list[str] = field(default_factory=list)
    packet: FramePacket | None = None
    result: Result | None = None
    cursor: tuple[int, int] | None = None
    lapse: str = ""
    frames: int = 0
    resting: bool = False
    errors_now: Verdict | None = None

    def show(self, packet: FramePacket, result: Result) -> None:
        """Another frame is shown. A history is void for one frame only: too short to be read, so that is kept."""
        self.packet, self.result, self.size = packet, result, packet.size
        reasons = [reason for reason in result.histories.values() if reason != VALID]
        if reasons:
            self.lapse, self.frames = reasons[0], 0
        else:
            self.frames += 1
