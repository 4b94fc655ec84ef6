"""A shot: a scene, what of it moves, and the camera over time. Turns frame numbers into frames."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from errors import UserError
from raytrace.camera import Camera
from raytrace.compiled import CompiledScene
from raytrace.frame import FramePacket
from raytrace.integrator import Tracer
from raytrace.sampling import radical_inverse

FPS = 30.0
"""Frames per second of a scene's own time, whatever the speed at which they are made."""

_JITTER = 16  # length of the Halton cycle of sub-pixel positions


def read_camera_path(path: Path) -> list[Camera]:
    """Cameras of a JSON file: ``{"frames": [{"camera_to_world_gl": 4x4 rows, "yfov_deg": number}, ...]}``.

    The matrix has OpenGL's axes (looking along -z) and acts on column vectors.
    Raises UserError for a missing file, broken JSON, missing keys, or numbers that are no camera.
    """
    try:
        frames = json.loads(path.read_text(encoding="utf-8"))["frames"]
        cameras = []
        for number, frame in enumerate(frames):
            matrix = np.array(frame["camera_to_world_gl"], dtype=np.float64)
            yfov = float(frame["yfov_deg"])
            usable = matrix.shape == (4, 4) and np.isfinite(matrix).all() and 0.0 < yfov < 180.0
            if not usable or (np.linalg.norm(matrix[:3, :3], axis=0) < 1e-12).any():
                raise UserError(f"{path}: frame {number} is no camera (4x4 finite matrix, 0 < yfov_deg < 180)")
            cameras.append(Camera.from_matrix(matrix, math.radians(yfov)))
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError) as error:
        raise UserError(
            f"{path}: is not a camera path ({type(error).__name__}: {error})",
            'expected {"frames": [{"camera_to_world_gl": [[...], ...], "yfov_deg": 45}, ...]}',
        ) from error
    if not cameras:
        raise UserError(f"{path}: there is no frame in this camera path")
    return cameras


def jitter_of(index: int) -> tuple[float, float]:
    """Sub-pixel offset of frame ``index`` in pixels, each in (-0.5, 0.5): Halton in bases 2 and 3, cycled."""
    point = index % _JITTER + 1  # point 0 is the corner of the square
    return (
        float(radical_inverse(2, point + 1)[point]) - 0.5,
        float(radical_inverse(3, point + 1)[point]) - 0.5,
    )


class Shot:
    """``camera``: "still", "flight", or a list of cameras, the last of which stays. ``animate``: objects move.

    ``remember``: as in :meth:`raytrace.integrator.Tracer.frame`; may be changed between frames.
    """

    def __init__(
        self,
        scene: CompiledScene,
        tracer: Tracer,
        size: tuple[int, int],
        camera: str | list[Camera] = "still",
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
