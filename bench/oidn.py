"""Intel Open Image Denoise on the same frames, where the package ``pyoidn`` is installed (requirements-compare.txt).

The filter RT on high dynamic range, with albedo and normal that are free of noise (``cleanAux``), on the CPU. What it
gets is what our filters get: emission is kept out and added afterwards.
"""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytrace.frame import FramePacket

F32 = NDArray[np.float32]

INSTALL = "install requirements-compare.txt to have Intel Open Image Denoise beside them"


def installed() -> bool:
    """Whether the package is there."""
    return importlib.util.find_spec("pyoidn") is not None


class Filter:
    """For pictures of ``size`` (width, height), of quality "fast", "balanced" or "high".

    Buffers are bound and the network is built once, as an application would do it; a frame copies its images in and
    filters. Raises RuntimeError where the library refuses.
    """

    def __init__(self, size: tuple[int, int], quality: str) -> None:
        import pyoidn

        self.size = size
        self._color, self._albedo, self._normal, self._out = np.zeros((4, size[1], size[0], 3), np.float32)
        self._dark = np.zeros((size[1], size[0], 4), np.float32)
        self._device: Any = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU)
        self._device.commit()
        self._filter: Any = pyoidn.Filter(self._device, pyoidn.OIDN_FILTER_TYPE_RT)
        images = {"color": self._color, "albedo": self._albedo, "normal": self._normal, "output": self._out}
        for name, image in images.items():
            self._filter.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
        self._filter.set_bool("hdr", True)
        self._filter.set_bool("cleanAux", True)
        self._filter.set_quality(getattr(pyoidn, f"OIDN_QUALITY_{quality.upper()}"))
        self._filter.commit()
        self._check()

    def run(self, packet: FramePacket) -> F32:
        """Linear radiance of ``packet``, filtered, (H, W, 4)."""
        self._color[:] = replace(packet, emission=self._dark).radiance()
        self._albedo[:] = packet.albedo[..., :3]
        if packet.specular_albedo is not None:
            self._albedo += packet.specular_albedo[..., :3]
        self._normal[:] = packet.surface[..., :3]
        self._filter.execute()
        self._check()
        radiance = np.ones((*self._out.shape[:2], 4), np.float32)
        np.add(self._out, packet.emission[..., :3], out=radiance[..., :3])
        return radiance

    def _check(self) -> None:
        if (error := self._device.get_error()) is not None:
            raise RuntimeError(f"Open Image Denoise: {error}")
