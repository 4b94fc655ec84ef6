"""A shot: a scene, what of it moves, and the camera over time. Turns frame numbers into frames."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.compiled import CompiledScene
from raytrace.frame import FramePacket
from raytrace.integrator import Tracer
from raytrace.sampling import radical_inverse

FPS = 30.0
"""Frames per second of a scene's own time, whatever the speed at which they are made."""

_JITTER = 16  # length of the Halton cycle of sub-pixel positions


CameraPath = str | list[Camera] | Callable[[float], Camera]
"""How the camera of a shot goes: "still", "flight", one camera for each frame, or the camera at a time in seconds."""


def jitter_of(index: int) -> tuple[float, float]:
    """Sub-pixel offset of frame ``index`` in pixels, each in (-0.5, 0.5): Halton in bases 2 and 3, cycled."""
    point = index % _JITTER + 1  # point 0 is the corner of the square
    return (
        float(radical_inverse(2, point + 1)[point]) - 0.5,
        float(radical_inverse(3, point + 1)[point]) - 0.5,
    )


class Shot:
    """``camera``: of a list of cameras the last stays. ``animate``: objects and lights move.

    ``remember``: as in :meth:`raytrace.integrator.Tracer.frame`; may be changed between frames.
    """

    def __init__(
        self,
        scene: CompiledScene,
        tracer: Tracer,
        size: tuple[int, int],
        camera: CameraPath = "still",
        animate: bool = False,
        jitter: bool = False,
        remember: str = "",
    ) -> None:
        self.scene, self.tracer, self.size = scene, tracer, size
        self.remember = remember
        self._camera, self._animate, self._jitter = camera, animate, jitter

    def time(self, index: int) -> float:
        """Scene time of a frame in seconds: 0 for all unless objects move."""
        return index / FPS if self._animate else 0.0

    def camera(self, index: int) -> Camera:
        """Camera of a frame, without jitter."""
        if isinstance(self._camera, list):
            return self._camera[min(max(index, 0), len(self._camera) - 1)]
        if callable(self._camera):
            return self._camera(index / FPS)
        return self.scene.camera_at(index / FPS, self._camera == "flight")

    def frame(self, index: int) -> FramePacket:
        """Trace frame ``index``. Frame 0 continues nothing: nothing has moved since.

        Where points are remembered, a frame has gradients only if the one before it was traced just before.
        """
        before = max(index - 1, 0)
        camera = self.camera(index)
        if self._jitter:
            camera = camera.with_jitter(jitter_of(index))
        return self.tracer.frame(
            index,
            camera,
            self.camera(before),
            self.size,
            self.time(index),
            self.time(before),
            cut=index == 0,
            remember=self.remember,
        )

    def reference(
        self, index: int, samples: int, progress: Callable[[float], None] | None = None
    ) -> tuple[NDArray[np.float64], ...]:
        """Converged illumination of frame ``index``: what :meth:`raytrace.integrator.Tracer.reference` gives."""
        return self.tracer.reference(self.camera(index), self.size, samples, self.time(index), progress=progress)


def modulate(packet: FramePacket, *signals: NDArray[np.float64]) -> NDArray[np.float32]:
    """Full radiance of demodulated illumination in the frame of ``packet``, (H, W, 4) float32.

    ``signals``: direct, indirect and, where the frame has it, specular.
    """
    radiance = np.ones((*signals[0].shape[:2], 4), np.float32)
    radiance[..., :3] = packet.modulated(*signals)
    return radiance
