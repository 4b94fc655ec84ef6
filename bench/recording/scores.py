"""Errors of replayed frames against their references."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench.metrics import Mask, display_mse, pooled, psnr, relmse, rmse, temporal_difference
from bench.metrics_visual import flip, ssim
from bench.recording.converge import surfaces
from raytrace.frame import FramePacket

F32 = NDArray[np.float32]

HIGHER_IS_BETTER: Final = ("psnr", "ssim")

ERRORS: Final = ("rmse", "relmse", "psnr", "ssim", "flip", "temporal")
"""In the order in which they are told."""


def measure(image: F32, reference: F32, mask: Mask) -> dict[str, float]:
    """Every error of one picture, by name; ``mask`` (H, W): the pixels that RMSE and relMSE are taken of."""
    return {
        "rmse": rmse(image, reference, mask),
        "relmse": relmse(image, reference, mask),
        "psnr": psnr(display_mse(image, reference)),
        "ssim": ssim(image, reference),
        "flip": flip(image, reference),
    }


class Scores:
    """Collects the errors of one method, frame by frame, in ascending order.

    ``notes``: what is noted of the references, by frame number as text; {} where nothing is known.
    """

    def __init__(self, notes: Mapping[str, Any]) -> None:
        self._notes = notes
        self.rows: list[dict[str, Any]] = []
        self._last: tuple[int, dict[str, F32], F32, Mask] | None = None

    def add(self, packet: FramePacket, image: F32, reference: F32) -> None:
        """``image`` (H, W, 3): the method's radiance of the frame ``packet``; ``reference``: what it should be."""
        mask, note = surfaces(packet), self._notes.get(str(packet.index), {})
        row: dict[str, Any] = {"frame": packet.index, "reference_samples": note.get("samples")}
        self.rows.append(row)
        if not mask.any():
            return
        images = {"errors": image, "noisy": packet.radiance()}
        row |= {kind: measure(one, reference, mask) for kind, one in images.items()}
        row["of_reference"] = dict(note.get("floors", {}))
        if self._last is not None and self._last[0] == packet.index - 1:
            _, before, expected, mask_before = self._last
            if (both := mask & mask_before).any():
                for kind, one in images.items():
                    row[kind]["temporal"] = temporal_difference(one, before[kind], reference, expected, both)
                row["of_reference"]["temporal"] = note.get("temporal_noise")
        row["means_something"] = meaning(row["errors"], row["of_reference"])
        self._last = packet.index, images, reference, mask

    def summary(self) -> dict[str, Any]:
        """Of all frames: RMSE pooled, PSNR of the mean of the mean squares, the others' means."""
        found = {
            kind: {name: value for name in ERRORS if (value := self._join(kind, name)) is not None}
            for kind in ("errors", "noisy", "of_reference")
        }
        return {**found, "means_something": meaning(found["errors"], found["of_reference"])}

    def _join(self, kind: str, name: str) -> float | None:
        """One number of all frames that have the error; None where one of them has none of this ``kind``."""
        rows = [row for row in self.rows if name in row.get("errors", {})]
        values = [row[kind].get(name) for row in rows]
        if not values or None in values:
            return None
        if name == "rmse":
            return pooled(values)
        if name == "psnr":
            return psnr(float(np.mean([10.0 ** (-value / 10.0) for value in values])))
        return float(np.mean(values))


def meaning(errors: Mapping[str, float], floors: Mapping[str, float | None]) -> dict[str, bool | None]:
    """For each error whether it is worse than that of the reference itself; None where that is not known."""
    found: dict[str, bool | None] = {}
    for name, value in errors.items():
        floor = floors.get(name)
        if floor is None or math.isnan(floor):
            found[name] = None
        else:
            found[name] = value < floor if name in HIGHER_IS_BETTER else value > floor
    return found
