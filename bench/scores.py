"""What a method's pictures are worth: all errors of one method on one sequence, and pictures kept for people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.cases import FRAMES, SCORED, SCORED_PAIRS
from bench.metrics import Mask, display_curve, display_mse, pooled, psnr, relmse, rmse, temporal_difference
from bench.metrics_visual import flip_map, ssim
from bench.references import Reference, temporal_noise
from errors import UserError
from raytrace.frame import FramePacket

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

SHOWN = SCORED[-1]
"""The frame whose pictures are kept."""

MAP_TOP = 0.25
"""FLIP that is the brightest in a map: in the full range, 0 to 1, filtered pictures would all be black."""

FRAMES_OF_STRIP = tuple(range(FRAMES))
"""The frames of which one line of pixels is kept."""


@dataclass(frozen=True)
class FrameErrors:
    """Errors of one scored frame."""

    frame: int
    rmse: float
    relmse: float
    psnr: float
    ssim: float
    flip: float


@dataclass(frozen=True)
class Errors:
    """Errors over a sequence: ``rmse`` pooled over its scored frames, ``psnr`` of the mean of their mean squares, the
    others means; ``temporal`` over its pairs. ``frames``: one by one."""

    rmse: float
    relmse: float
    psnr: float
    ssim: float
    flip: float
    temporal: float
    frames: tuple[FrameErrors, ...] = ()


@dataclass(frozen=True)
class Pictures:
    """For people, row 0 at the bottom: ``picture``, frame :data:`SHOWN` (H, W, 3) on the display curve; ``flip``, its
    FLIP map (H, W), of which :data:`MAP_TOP` becomes 255; ``strip`` (FRAMES, W, 3), one line of pixels, at half the
    height, in every frame, black where a frame has none."""

    picture: U8
    flip: U8
    strip: U8


class Truth:
    """References of the scored frames beside what the error is measured on.

    Raises UserError where a frame shows no surface that does not emit.
    """

    def __init__(self, packets: Sequence[FramePacket], references: dict[int, Reference]) -> None:
        self._packets, self._references = packets, references
        self.radiance = {index: references[index].radiance(packets[index]) for index in SCORED}
        self.masks: dict[int, Mask] = {index: packets[index].emission[..., :3].max(axis=2) == 0.0 for index in SCORED}
        if blind := [index for index, mask in self.masks.items() if not mask.any()]:
            raise UserError(
                f"{packets[0].scene}: frame {blind[0]} shows nothing but sky and light sources",
                "errors are measured on surfaces: choose a scene whose camera sees some",
            )

    @property
    def samples(self) -> int:
        """Paths per pixel of the least converged reference."""
        return min(self._references[index].samples for index in SCORED)

    def noise(self) -> float:
        """RMSE that the references themselves have, pooled."""
        return pooled([self._references[i].noise(self._packets[i], self.masks[i]) for i in SCORED])

    def temporal_noise(self) -> float:
        """Mean temporal difference error of the references themselves."""
        values = []
        for before, now in SCORED_PAIRS:
            pair = [(self._references[i], self._packets[i]) for i in (now, before)]
            values.append(temporal_noise(pair[0], pair[1], self.masks[now] & self.masks[before]))
        return float(np.mean(values))

    def floors(self) -> Errors:
        """What the references' own noise makes of every error: below it, none means anything.

        One half of the paths is judged by the other, as if that were the truth. Their difference has a variance
        1 / share² times that of the mean of all paths: mean squares shrink by share², FLIP, as good as linear in small
        differences, by the share, and so does what SSIM lacks to 1 by share².
        """
        shares, relative, squares, similar, flips = [], [], [], [], []
        for index in SCORED:
            reference, packet = self._references[index], self._packets[index]
            first, second = reference.halves(packet)
            share = reference.share
            shares.append(share)
            relative.append(relmse(first, second, self.masks[index]) * share**2)
            squares.append(display_mse(first, second) * share**2)
            similar.append(1.0 - (1.0 - ssim(first, second)) * share**2)
            flips.append(float(flip_map(first, second).mean()) * share)
        return Errors(
            rmse=self.noise(),
            relmse=float(np.mean(relative)),
            psnr=psnr(float(np.mean(squares))),
            ssim=float(np.mean(similar)),
            flip=float(np.mean(flips)),
            temporal=self.temporal_noise(),
        )

    def pictures(self) -> Pictures:
        """The references', with an empty FLIP map."""
        strip = np.zeros((FRAMES, self.radiance[SHOWN].shape[1], 3), np.uint8)
        for index, image in self.radiance.items():
            strip[index] = to_display8(image[image.shape[0] // 2])
        shown = self.radiance[SHOWN]
        return Pictures(to_display8(shown), np.zeros(shown.shape[:2], np.uint8), strip)


def to_display8(image: NDArray[np.floating]) -> U8:
    """Linear radiance on the display curve, rounded to 8 bits."""
    return np.rint(display_curve(image) * 255.0).astype(np.uint8)


class Score:
    """Errors of one method, frame by frame."""

    def __init__(self, truth: Truth) -> None:
        self._truth = truth
        self._frames: list[FrameErrors] = []
        self._squares: list[float] = []
        self._temporal: list[float] = []
        self._last: tuple[int, F32] | None = None
        self._shown: tuple[U8, U8] | None = None
        self._strip: dict[int, U8] = {}

    def watch(self, index: int, image: F32) -> None:
        """``image`` (H, W, 3) is the method's radiance in frame ``index``: kept for people as far as they see it."""
        self._strip[index] = to_display8(image[image.shape[0] // 2])

    def add(self, index: int, image: F32) -> None:
        """``image`` (H, W, 3) is the method's radiance in the scored frame ``index``; in ascending order."""
        truth, mask = self._truth.radiance[index], self._truth.masks[index]
        squares, flips = display_mse(image, truth), flip_map(image, truth)
        self._squares.append(squares)
        self._frames.append(
            FrameErrors(
                frame=index,
                rmse=rmse(image, truth, mask),
                relmse=relmse(image, truth, mask),
                psnr=psnr(squares),
                ssim=ssim(image, truth),
                flip=float(flips.mean(dtype=np.float64)),
            )
        )
        if self._last is not None and (self._last[0], index) in SCORED_PAIRS:
            before, previous = self._last
            both = mask & self._truth.masks[before]
            self._temporal.append(temporal_difference(image, previous, truth, self._truth.radiance[before], both))
        self._last = (index, image)
        if index == SHOWN:
            self._shown = to_display8(image), np.rint(np.clip(flips / MAP_TOP, 0.0, 1.0) * 255.0).astype(np.uint8)

    def rmse(self) -> float:
        """Pooled over the frames so far."""
        return pooled([frame.rmse for frame in self._frames])

    def temporal(self) -> float:
        """Mean over the pairs so far."""
        return float(np.mean(self._temporal))

    def errors(self) -> Errors:
        """All of them, over all frames so far."""

        def mean(name: str) -> float:
            return float(np.mean([getattr(frame, name) for frame in self._frames]))

        return Errors(
            rmse=self.rmse(),
            relmse=mean("relmse"),
            psnr=psnr(float(np.mean(self._squares))),
            ssim=mean("ssim"),
            flip=mean("flip"),
            temporal=self.temporal(),
            frames=tuple(self._frames),
        )

    def pictures(self) -> Pictures | None:
        """None if frame :data:`SHOWN` was not scored."""
        if self._shown is None:
            return None
        picture, flips = self._shown
        strip = np.zeros((FRAMES, picture.shape[1], 3), np.uint8)
        for index, line in self._strip.items():
            strip[index] = line
        return Pictures(picture, flips, strip)
