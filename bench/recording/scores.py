"""Errors of replayed frames against their references."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.metrics import Mask, pooled, rmse, temporal_difference
from bench.recording.converge import surfaces
from raytrace.frame import FramePacket

F32 = NDArray[np.float32]


class Scores:
    """Collects the errors of one method, frame by frame, in ascending order.

    ``noise``: what is noted of the references, by frame number as text; {} where nothing is known.
    """

    def __init__(self, notes: Mapping[str, Any]) -> None:
        self._notes = notes
        self._rows: list[dict[str, Any]] = []
        self._last: tuple[int, F32, F32, Mask] | None = None

    def add(self, packet: FramePacket, image: F32, reference: F32) -> None:
        """``image`` (H, W, 3): the method's radiance of the frame ``packet``; ``reference``: what it should be."""
        mask = surfaces(packet)
        note = self._notes.get(str(packet.index), {})
        row: dict[str, Any] = {"frame": packet.index, "reference_samples": note.get("samples")}
        if mask.any():
            noisy = packet.radiance()
            row |= _measure("", image, reference, mask)
            row |= _measure("noisy_", noisy, reference, mask)
            _judge(row, "rmse", note.get("noise"))
            if self._last is not None and self._last[0] == packet.index - 1:
                _, before, reference_before, mask_before = self._last
                both = mask & mask_before
                if both.any():
                    row["temporal"] = temporal_difference(image, before, reference, reference_before, both)
                    _judge(row, "temporal", note.get("temporal_noise"))
            self._last = packet.index, image, reference, mask
        self._rows.append(row)

    @property
    def rows(self) -> list[dict[str, Any]]:
        return self._rows

    def summary(self) -> dict[str, Any]:
        """Of all frames: RMSE pooled, the temporal error's mean; with the noise of the references beside them."""
        found: dict[str, Any] = {}
        for name, join in (("rmse", pooled), ("noisy_rmse", pooled), ("temporal", _mean)):
            values = [row[name] for row in self._rows if name in row]
            if values:
                found[name] = join(values)
        for name, key, join in (("rmse", "noise", pooled), ("temporal", "temporal_noise", _mean)):
            frames = [str(row["frame"]) for row in self._rows if name in row]
            floors = [self._notes.get(frame, {}).get(key) for frame in frames]
            if name in found:
                _judge(found, name, join(floors) if floors and None not in floors else None)
        return found


def _measure(prefix: str, image: F32, reference: F32, mask: Mask) -> dict[str, float]:
    """Every error of one picture, by name: the one place to add another."""
    return {f"{prefix}rmse": rmse(image, reference, mask)}


def _judge(row: dict[str, Any], name: str, floor: float | None) -> None:
    """Set the reference's own noise beside the error: one that is not above it is no measurement."""
    row[f"{name}_of_reference"] = floor
    row[f"{name}_means_something"] = None if floor is None else bool(row[name] > floor)


def _mean(values: list[float]) -> float:
    return float(np.mean(values))
