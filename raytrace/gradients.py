"""Temporal gradients: how the light at surface points seen in the last frame has changed since, without its noise.

Schied et al. 2018, "Gradient Estimation for Real-Time Adaptive Temporal Filtering", sec. 4. One pixel of each stratum
of 3x3 is remembered. In the next frame its surface point, wherever its triangle has moved, is shaded again with the
random numbers that it had; the difference to what it was then is a sample of the gradient. What did not change gives 0
to the bit, because the tracer's paths depend on nothing but the point, the numbers and the time.

The point takes the place of the sample of the pixel that it is seen in, so there are no more rays than without. Whether
it is seen is asked of that pixel's own camera ray: same object, same plane, same side, like normal.

Deviations from the paper:

* The guides of the pixel stay those of its centre, where the paper writes the remembered point into the visibility
  buffer: the filters' guides are then the same for every method.
* A point that was carried over is not remembered again, as in Q2RTX: numbers that were followed through many frames
  would be those of one lucky or unlucky path.
* Of several points that land in one stratum the nearest to the camera counts, of equally near ones that of the lowest
  pixel, instead of the first to be written: the picture then does not depend on the order of threads.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numba import uint32
from numpy.typing import NDArray

from raytrace.compilation import device, kernel
from raytrace.compiled import FACE_NORMAL, OBJECT, SMOOTH
from raytrace.frame import STRATUM
from raytrace.sampling import path_key, wang
from raytrace.tables import interpolate, shading_normal

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]
U32 = NDArray[np.uint32]

RULES: Final = ("random", "brightest")
"""Which pixel of a stratum is remembered. The brightest finds more of what changes, but since its sample takes the
place of another one, it also makes the picture brighter (docs/asvgf.md)."""

ORDINARY, CARRIED, REMEMBERED = np.float32(1.0), np.float32(0.0), np.float32(2.0)
"""What ``a`` of ``direct``, ``indirect`` and ``specular`` tells of a sample: it is of this frame alone, it was carried
over from the last one, it was chosen to be carried into the next."""

_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_PLANE_TOLERANCE = np.float32(0.5)  # widths of a pixel
_NORMAL_TOLERANCE = np.float32(0.9)  # cosine
_FAR = np.float32(np.inf)
_RED, _GREEN, _BLUE = np.float32(0.2126), np.float32(0.7152), np.float32(0.0722)


class Points(NamedTuple):
    """One remembered pixel of each stratum, S of them, row by row.

    ``triangle`` (S,) int32, -1 = none; barycentrics ``u``, ``v`` (S,) float32; ``front`` (S,) int32: 1 if the face's
    front was seen; ``pixel`` (S,) uint32: whose random numbers it had; ``light`` (S, 2 or 3) float32: luminance of its
    direct, indirect and, in a scene with specular surfaces, specular sample.
    """

    triangle: Any
    u: Any
    v: Any
    front: Any
    pixel: Any
    light: Any

    @staticmethod
    def none(count: int, signals: int = 2) -> Points:
        u, v = np.zeros((2, count), np.float32)
        triangle, front = np.full(count, -1, np.int32), np.zeros(count, np.int32)
        return Points(triangle, u, v, front, np.zeros(count, np.uint32), np.zeros((count, signals), np.float32))


class Gloss(NamedTuple):
    """Of a tile in a scene with specular surfaces, (N, 4) float32 each: the ``specular`` samples, and the pixels'
    ``albedo`` and ``specular_albedo``."""

    specular: Any
    albedo: Any
    specular_albedo: Any


_NO_GLOSS = np.zeros((0, 4), np.float32)


class Landings(NamedTuple):
    """Where remembered points are in this frame: ``first`` (S,) int32, the first point in a stratum of this frame, -1 =
    none; ``following`` (S,) int32, the point after another one; ``pixel`` (S,) int32, ``depth`` (S,) float32, of each
    point."""

    first: Any
    following: Any
    pixel: Any
    depth: Any


@dataclass(frozen=True)
class Moment:
    """Which frame it was: points are carried over to the frame after it only."""

    index: int
    time: float
    size: tuple[int, int]
    numbers: tuple[int, int]
    """Seed and generator."""


class Memory:
    """What a tracer remembers of its last frame."""

    def __init__(self) -> None:
        self._moment: Moment | None = None
        self._points = Points.none(0)

    def recall(self, now: Moment, previous_time: float) -> Points | None:
        """The points of the frame before ``now``, whose time was ``previous_time``; None if they are not there."""
        then = self._moment
        if then is None or then.index != now.index - 1 or then.time != previous_time:
            return None
        return self._points if (then.size, then.numbers) == (now.size, now.numbers) else None

    def keep(self, now: Moment, points: Points) -> None:
        """Remember ``points`` of the frame ``now``, and nothing else."""
        self._moment, self._points = now, points


class Reshading:
    """One frame's share of the work: :meth:`replace` a tile's samples, shade them, :meth:`note` what came out.

    Tiles hold whole strata. ``gradient`` and, in a scene with specular surfaces, ``specular`` (strata in y, in x, 4)
    float32 afterwards hold what :attr:`raytrace.frame.FramePacket.temporal_gradient` and ``temporal_gradient_specular``
    do, ``points`` what is to be carried into the next frame.
    """

    def __init__(
        self,
        triangles: F32,
        info: I32,
        before: Points | None,
        index: int,
        size: tuple[int, int],
        eye: F32,
        matrix: F32,
        jitter: F32,
        pixel_size: float,
        seed: int,
        brightest: bool,
        glossy: bool = False,
    ) -> None:
        """``triangles``, ``info``: the scene's; ``eye``, ``matrix``, ``jitter``: the view's; ``pixel_size``: scene
        units that a pixel is wide at depth 1; ``before``: points of the last frame, None without one; ``glossy``: the
        scene has specular surfaces."""
        across, down = strata(size)
        self._triangles, self._info, self._index, self._size, self._eye = triangles, info, index, size, eye
        self._pixel_size, self._seed, self._brightest = np.float32(pixel_size), seed, brightest
        self._before = before
        self._chosen = np.full(across * down, -1, np.int32)
        self.points = Points.none(across * down, 3 if glossy else 2)
        self.gradient = np.zeros((down, across, 4), np.float32)
        self.specular = np.zeros((down, across, 4), np.float32) if glossy else None
        count = across * down
        nowhere, following, pixel = np.full((3, count), -1, np.int32)
        self._landings = Landings(nowhere, following, pixel, np.zeros(count, np.float32))
        if before is not None:
            _land(triangles, before, matrix, jitter, size[0], size[1], self._landings)

    def replace(self, first: int, triangle: I32, u: F32, v: F32, pixels: U32, frames: U32) -> None:
        """Put the points that are seen in a tile in the place of its own samples.

        The tile begins at pixel ``first``; its hits and the seeds of its paths are changed in place.
        """
        if self._before is not None:
            _replace(
                self._triangles, self._info, self._before, self._landings, self._eye, self._pixel_size, self._size[0],
                first, uint32(self._index - 1), triangle, u, v, pixels, frames, self._chosen,
            )  # fmt: skip

    def note(
        self, first: int, triangle: I32, u: F32, v: F32, direct: F32, indirect: F32, gloss: Gloss | None = None
    ) -> None:
        """Take the gradients from a tile's shaded samples, choose what to remember, and mark both.

        ``gloss``: of a scene with specular surfaces.
        """
        before = self._before if self._before is not None else self.points
        specular = _NO_GLOSS if gloss is None else gloss.specular
        _note(
            self._triangles, before, self._landings, self._eye, self._size[0], first, self._seed, uint32(self._index),
            self._brightest, triangle, u, v, direct, indirect, specular, self._chosen,
            self.gradient.reshape(-1, 4), self.points,
        )  # fmt: skip
        if gloss is not None and self.specular is not None:
            rows = len(triangle) // self._size[0]
            across = self.specular.shape[1]
            start = first // self._size[0] // STRATUM * across
            _note_specular(
                start, start + -(-rows // STRATUM) * across, before, self._landings, first, direct, indirect, gloss,
                self._chosen, self.specular.reshape(-1, 4), self.points,
            )  # fmt: skip


def strata(size: tuple[int, int]) -> tuple[int, int]:
    """How many strata there are across and down an image of ``size`` (width, height); the last ones may be cut."""
    return -(-size[0] // STRATUM), -(-size[1] // STRATUM)


@device
def _luminance(color, i):  # type: ignore[no-untyped-def]
    return _RED * color[i, 0] + _GREEN * color[i, 1] + _BLUE * color[i, 2]


@device
def _sees_front(record, x, y, z, eye):  # type: ignore[no-untyped-def]
    """1 if ``eye`` is on the front side of the triangle's plane at a point of it, as the shading kernels decide."""
    g = record[FACE_NORMAL] * (eye[0] - x) + record[FACE_NORMAL + 1] * (eye[1] - y)
    g += record[FACE_NORMAL + 2] * (eye[2] - z)
    return 0 if g < _ZERO else 1


@kernel
def _land(triangles, points, matrix, jitter, width, height, landings):  # type: ignore[no-untyped-def]
    """Project every point into this frame and list it under the stratum that it lands in, lowest pixel first."""
    across = (width + STRATUM - 1) // STRATUM
    for back in range(points.triangle.shape[0]):
        s = points.triangle.shape[0] - 1 - back
        t = points.triangle[s]
        if t < 0:
            continue
        x, y, z = interpolate(triangles[t], 0, points.u[s], points.v[s])
        w = matrix[3, 0] * x + matrix[3, 1] * y + matrix[3, 2] * z + matrix[3, 3]
        if w <= _ZERO:
            continue
        px = matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]
        py = matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]
        # The pixel whose camera ray passes nearest.
        px = (px / w * _HALF + _HALF) * np.float32(width) - jitter[0]
        py = (py / w * _HALF + _HALF) * np.float32(height) - jitter[1]
        if px < _ZERO or py < _ZERO or px >= np.float32(width) or py >= np.float32(height):
            continue
        column, row = int(px), int(py)
        k = (row // STRATUM) * across + column // STRATUM
        landings.pixel[s] = row * width + column
        landings.depth[s] = w
        landings.following[s] = landings.first[k]
        landings.first[k] = s


@kernel
def _replace(  # type: ignore[no-untyped-def]
    triangles, info, points, landings, eye, pixel_size, width, first, frame, triangle, u, v, pixels, frames, chosen
):
    across = (width + STRATUM - 1) // STRATUM
    start = first // width // STRATUM
    rows = triangle.shape[0] // width
    for k in range(start * across, (start + (rows + STRATUM - 1) // STRATUM) * across):
        best, nearest = -1, _FAR
        s = landings.first[k]
        while s >= 0:
            depth = landings.depth[s]
            i = landings.pixel[s] - first
            seen = triangle[i]
            t = points.triangle[s]
            if depth < nearest and seen >= 0 and info[t, OBJECT] == info[seen, OBJECT]:
                record, other = triangles[t], triangles[seen]
                x, y, z = interpolate(record, 0, points.u[s], points.v[s])
                ax, ay, az = interpolate(other, 0, u[i], v[i])
                gx, gy, gz = other[FACE_NORMAL], other[FACE_NORMAL + 1], other[FACE_NORMAL + 2]
                apart = abs(gx * (x - ax) + gy * (y - ay) + gz * (z - az))
                front, other_front = _sees_front(record, x, y, z, eye), _sees_front(other, ax, ay, az, eye)
                nx, ny, nz = shading_normal(record, info[t, SMOOTH], points.u[s], points.v[s])
                mx, my, mz = shading_normal(other, info[seen, SMOOTH], u[i], v[i])
                cosine = nx * mx + ny * my + nz * mz
                if front != other_front:
                    cosine = -cosine
                near = apart <= _PLANE_TOLERANCE * pixel_size * depth
                if near and cosine >= _NORMAL_TOLERANCE and front == points.front[s]:
                    best, nearest = s, depth
            s = landings.following[s]
        chosen[k] = best
        if best >= 0:
            i = landings.pixel[best] - first
            triangle[i], u[i], v[i] = points.triangle[best], points.u[best], points.v[best]
            pixels[i], frames[i] = points.pixel[best], frame


@device
def _spread(carried, k, chosen, before, direct, indirect, gradient):  # type: ignore[no-untyped-def]
    """Write the gradient of stratum ``k``, whose sample in pixel ``carried`` of the tile was carried over."""
    for signal in range(2):
        now = _luminance(direct, carried) if signal == 0 else _luminance(indirect, carried)
        then = before.light[chosen, signal]
        # Not a number and infinity take no part: they would be spread over all the strata around.
        if abs(now) < _FAR and abs(then) < _FAR:
            gradient[k, 2 * signal] = now - then
            gradient[k, 2 * signal + 1] = max(now, then)


@kernel
def _note_specular(  # type: ignore[no-untyped-def]
    start, end, before, landings, first, direct, indirect, gloss, chosen, gradient, points
):
    """The same of specular light, and of all light in the surface's whole albedo, for the strata that :func:`_note` has
    been through.

    What the surface reflects then and now is weighted by its albedos now, so that whole light in which nothing changed
    is the same to the bit, too, wherever the pixels' centres have moved to.
    """
    specular, albedo, specular_albedo = gloss
    for k in range(start, end):
        if chosen[k] >= 0:
            i, s = landings.pixel[chosen[k]] - first, chosen[k]
            specular[i, 3] = CARRIED
            now, then = _luminance(specular, i), before.light[s, 2]
            diffuse, glossy = _luminance(albedo, i), _luminance(specular_albedo, i)
            part = glossy / (diffuse + glossy) if glossy > _ZERO else _ZERO
            all_now = (_luminance(direct, i) + _luminance(indirect, i)) * (_ONE - part) + now * part
            all_then = (before.light[s, 0] + before.light[s, 1]) * (_ONE - part) + then * part
            if abs(now) < _FAR and abs(then) < _FAR:
                gradient[k, 0] = now - then
                gradient[k, 1] = max(now, then)
            if abs(all_now) < _FAR and abs(all_then) < _FAR:
                gradient[k, 2] = all_now - all_then
                gradient[k, 3] = max(all_now, all_then)
        if points.triangle[k] >= 0:
            best = int(points.pixel[k]) - first
            specular[best, 3] = REMEMBERED
            points.light[k, 2] = _luminance(specular, best)


@device
def _brightest(corner, columns, lines, width, carried, triangle, direct, indirect, specular):  # type: ignore[no-untyped-def]
    """The pixel with the brightest sample of its own; -1 where all are dark."""
    best, most = -1, _ZERO
    for y in range(lines):
        for i in range(corner + y * width, corner + y * width + columns):
            light = _luminance(direct, i) + _luminance(indirect, i)
            if specular.shape[0] > 0:
                light += _luminance(specular, i)
            if triangle[i] >= 0 and i != carried and light > most:
                best, most = i, light
    return best


@device
def _random(corner, columns, lines, width, carried, triangle, bits):  # type: ignore[no-untyped-def]
    """One of the pixels that show a surface and have a sample of their own, each with the same chance; -1 for none."""
    count = 0
    for y in range(lines):
        for i in range(corner + y * width, corner + y * width + columns):
            if triangle[i] >= 0 and i != carried:
                count += 1
    if count == 0:
        return -1
    place = int(bits % uint32(count))
    for y in range(lines):
        for i in range(corner + y * width, corner + y * width + columns):
            if triangle[i] >= 0 and i != carried:
                if place == 0:
                    return i
                place -= 1
    return -1


@kernel
def _note(  # type: ignore[no-untyped-def]
    triangles, before, landings, eye, width, first, seed, frame, brightest, triangle, u, v, direct, indirect, specular,
    chosen, gradient, points,
):  # fmt: skip
    across = (width + STRATUM - 1) // STRATUM
    start = first // width
    rows = triangle.shape[0] // width
    salt = uint32(frame * uint32(0x9E3779B9))
    for row in range((rows + STRATUM - 1) // STRATUM):
        lines = min(STRATUM, rows - row * STRATUM)
        for column in range(across):
            k = (start // STRATUM + row) * across + column
            carried = -1
            if chosen[k] >= 0:
                carried = landings.pixel[chosen[k]] - first
                direct[carried, 3] = indirect[carried, 3] = CARRIED
                _spread(carried, k, chosen[k], before, direct, indirect, gradient)
            corner = row * STRATUM * width + column * STRATUM
            columns = min(STRATUM, width - column * STRATUM)
            if brightest:
                best = _brightest(corner, columns, lines, width, carried, triangle, direct, indirect, specular)
            else:
                bits = wang(uint32(path_key(seed, k) ^ salt))
                best = _random(corner, columns, lines, width, carried, triangle, bits)
            points.triangle[k] = -1
            if best >= 0:
                direct[best, 3] = indirect[best, 3] = REMEMBERED
                points.triangle[k], points.u[k], points.v[k] = triangle[best], u[best], v[best]
                x, y, z = interpolate(triangles[triangle[best]], 0, u[best], v[best])
                points.front[k] = _sees_front(triangles[triangle[best]], x, y, z, eye)
                points.pixel[k] = first + best
                points.light[k, 0] = _luminance(direct, best)
                points.light[k, 1] = _luminance(indirect, best)
