"""Converged references of single frames, kept on disk and refined slice by slice.

A file holds the sums of two disjoint sets of paths, its halves. Their mean is the reference; their difference tells how
noisy that still is: with n_a and n_b paths in the halves, the difference of their means has the variance
s² (1/n_a + 1/n_b), the mean of all paths s² / (n_a + n_b), which is n_a n_b / (n_a + n_b)² of the former.
"""

from __future__ import annotations

import dataclasses
import hashlib
import sys
import time
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.metrics import Mask, temporal_difference
from console import Progress
from raytrace.frame import FramePacket
from raytrace.shot import Shot
from storage import replace_file

F64 = NDArray[np.float64]

FOLDER = Path(__file__).resolve().parent.parent / ".cache" / "references"

_PROBE_SIZE = (32, 18)


@dataclass(frozen=True)
class Reference:
    """``sums`` (2, H, W, C) float64: illumination (direct + indirect, divided by the albedo) summed over the paths of
    each half; in a scene with specular surfaces C is 6, and the last three are specular, divided by its albedo.
    ``counts``: paths per pixel in each half."""

    sums: F64
    counts: tuple[int, int]

    @staticmethod
    def empty(size: tuple[int, int], specular: bool = False) -> Reference:
        return Reference(np.zeros((2, size[1], size[0], 6 if specular else 3)), (0, 0))

    @property
    def samples(self) -> int:
        """Paths per pixel."""
        return sum(self.counts)

    def plus(self, mean: F64, samples: int) -> Reference:
        """With ``samples`` more paths of that ``mean`` (H, W, C), which go to the half that has fewer."""
        half = int(self.counts[1] < self.counts[0])
        sums = self.sums.copy()
        sums[half] += mean * samples
        counts = (self.counts[0] + samples * (1 - half), self.counts[1] + samples * half)
        return Reference(sums, counts)

    def radiance(self, packet: FramePacket) -> F64:
        """Linear radiance in the frame of ``packet``, (H, W, 3)."""
        return _modulated(self.sums.sum(axis=0) / self.samples, packet)

    def halves(self, packet: FramePacket) -> tuple[F64, F64]:
        """Linear radiance of each half, (H, W, 3). Raises ValueError when one is still empty."""
        if min(self.counts) == 0:
            raise ValueError("a reference of a single slice cannot tell its noise")
        first, second = (_modulated(self.sums[k] / self.counts[k], packet) for k in range(2))
        return first, second

    @property
    def share(self) -> float:
        """Standard deviation of the mean over that of the difference of the halves."""
        return float(np.sqrt(self.counts[0] * self.counts[1])) / self.samples

    def noise(self, packet: FramePacket, mask: Mask) -> float:
        """Estimated RMSE of the reference itself on the pixels of ``mask``, linear radiance."""
        first, second = self.halves(packet)
        difference = (first - second)[mask]
        return float(np.sqrt(np.mean(difference * difference))) * self.share


def _modulated(illumination: F64, packet: FramePacket) -> F64:
    diffuse, specular = illumination[..., :3], illumination[..., 3:]
    radiance = packet.modulated(diffuse, np.zeros_like(diffuse), specular if specular.size else None)
    return np.asarray(radiance, dtype=np.float64)


def temporal_noise(now: tuple[Reference, FramePacket], before: tuple[Reference, FramePacket], mask: Mask) -> float:
    """Estimated temporal difference error that two consecutive references have by their own noise.

    That of one pair of halves against the other, scaled as if it were Gaussian.
    """
    first, second = now[0].halves(now[1])
    first_before, second_before = before[0].halves(before[1])
    return temporal_difference(first, first_before, second, second_before, mask) * now[0].share


class ReferenceCache:
    """References on disk, named by everything that they depend on."""

    def __init__(self, folder: Path = FOLDER) -> None:
        self._folder = folder

    def path(self, shot: Shot, index: int) -> Path:
        """The file of frame ``index``: scene, size and frame to read, a digest of the rest (see :func:`_content`)."""
        digest = hashlib.blake2b(digest_size=10)
        for part in _content(shot, index):
            digest.update(part)
        width, height = shot.size
        name = "".join(c if c.isalnum() else "_" for c in Path(shot.scene.scene.name).stem)
        return self._folder / f"{name}-{width}x{height}-frame{index:04d}-{digest.hexdigest()}.npz"

    def fill(
        self, shot: Shot, indices: Sequence[int], samples: int, slice_samples: int
    ) -> tuple[dict[int, Reference], float]:
        """References of the frames ``indices`` with at least ``samples`` paths per pixel each, by frame.

        Adds what is missing in slices of ``slice_samples`` paths; each is saved as soon as it is traced, so that an
        interruption costs one of them. Also returns the seconds that this took. Raises UserError where the folder
        cannot be written.
        """
        start = time.perf_counter()
        paths = {index: self.path(shot, index) for index in indices}
        specular = shot.tracer.variant.specular
        found = {index: load(path, shot.size, specular) for index, path in paths.items()}
        missing = sum(max(0, samples - reference.samples) for reference in found.values())
        if missing == 0:
            return found, time.perf_counter() - start
        print(f"{shot.scene.scene.name}: {len(found)} references of {samples} paths per pixel, kept in {self._folder}")
        done = 0
        with Progress(f"{shot.scene.scene.name}: references") as progress:
            for index, reference in found.items():
                while reference.samples < samples:
                    count = min(slice_samples, samples - reference.samples)
                    before = done / missing

                    def advance(share: float, before: float = before, count: int = count) -> None:
                        progress.update(before + share * count / missing)

                    means = shot.tracer.reference(
                        shot.camera(index), shot.size, count, shot.time(index), reference.samples, advance
                    )
                    reference = reference.plus(np.concatenate([means[0] + means[1], *means[2:]], axis=-1), count)
                    save(paths[index], reference)
                    done += count
                found[index] = reference
        return found, time.perf_counter() - start


def save(path: Path, reference: Reference) -> None:
    """Write ``reference``, replacing the file as a whole. Raises UserError where that fails."""
    counts = np.array(reference.counts, dtype=np.int64)
    replace_file(path, lambda target: np.savez(target, sums=reference.sums, counts=counts))


def load(path: Path, size: tuple[int, int], specular: bool = False) -> Reference:
    """The reference in ``path``; an empty one when there is no file, or, with a line on stderr, when it is damaged."""
    empty = Reference.empty(size, specular)
    if not path.exists():
        return empty
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            sums, counts = data["sums"], data["counts"]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        print(f"{path}: damaged ({error}); rendering it again", file=sys.stderr)
        return empty
    sound = sums.shape == empty.sums.shape and counts.shape == (2,) and (counts >= 0).all() and np.isfinite(sums).all()
    if not sound:
        print(f"{path}: holds no reference of {size[0]}x{size[1]}; rendering it again", file=sys.stderr)
        return empty
    return Reference(sums.astype(np.float64), (int(counts[0]), int(counts[1])))


def _content(shot: Shot, index: int) -> Iterator[bytes]:
    """All that the reference of a frame depends on.

    The compiled scene at the frame's time, camera, size and seed; and what the tracer makes of them in a thumbnail of
    one path per pixel, so that a tracer that computes otherwise does not go on with another one's sums.
    """
    time_, camera, tracer = shot.time(index), shot.camera(index), shot.tracer
    tracer.set_time(time_, time_)
    yield shot.scene.scene.name.encode()
    yield repr((camera, shot.size, tracer.settings.seed, time_)).encode()
    yield from _arrays(shot.scene)
    for image in tracer.reference(camera, _PROBE_SIZE, 1, time_):
        yield image.tobytes()


def _arrays(value: Any) -> Iterator[bytes]:
    """Every array in a dataclass and the dataclasses in it, with the name of its field; other fields are left out."""
    for item in dataclasses.fields(value):
        part = getattr(value, item.name)
        if isinstance(part, np.ndarray):
            yield f"{item.name} {part.dtype} {part.shape}".encode()
            yield np.ascontiguousarray(part).tobytes()
        elif dataclasses.is_dataclass(part) and item.name != "scene":  # the source of all the other fields
            yield from _arrays(part)
