"""The tracer: frames at one path per pixel, and converged references of the same frames.

Two cores, as adaptive temporal filtering needs them (Schied et al. 2018): :meth:`Tracer.primary` finds the surface
points that the camera sees, :meth:`Tracer.shade` estimates the light at any surface points with given random numbers.
An image is cut into tiles; each is carried from camera ray to result by one worker thread, through compiled kernels and
Embree calls that both run without Python's global lock.
"""

from __future__ import annotations

import itertools
import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raytrace import kernels, kernels_glossy
from raytrace.buffers import Buffers
from raytrace.camera import Camera
from raytrace.compiled import CompiledScene
from raytrace.cutouts import CutoutCaster, cutouts_of
from raytrace.embree import open_caster
from raytrace.features import ILLUMINATION, images_of
from raytrace.frame import STRATUM, FramePacket
from raytrace.gradients import Gloss, Memory, Moment, Reshading
from raytrace.guides import Outputs, camera_rays, guide_kernel
from raytrace.lights import SHADOW_END
from raytrace.sampling import HALTON, HASH, PAIR_LOBE, PAIR_SELECT, draw
from raytrace.tables import Variant, tables_of, variant_of

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
U32 = NDArray[np.uint32]

REFERENCE_SEED = 0x5EED0000
"""Added to the run's seed for references, whose frame numbers moreover start at :data:`FIRST_SAMPLE`: they draw other
numbers than any frame does."""

FIRST_SAMPLE = 1 << 31


_identities = itertools.count(1)
_NO_GLOSS = np.zeros((1, 3), np.float32)
"""Stands for the specular signal that a scene has not; nothing is written there but its zeros."""


@dataclass(frozen=True)
class Hits:
    """Surface points: ``triangle`` (n,) int32, -1 = none; barycentrics ``u``, ``v`` (n,) float32 of its second and
    third corner; ``object`` (n,) int32, -1 = none."""

    triangle: I32
    u: F32
    v: F32
    object: I32


@dataclass(frozen=True)
class Seeds:
    """Whose random numbers a path uses: ``pixel`` and ``frame`` (n,) uint32. Copying a pair repeats the path."""

    pixel: U32
    frame: U32


@dataclass(frozen=True)
class View:
    """A camera prepared for one image size: float32 arrays relative to the scene's origin."""

    size: tuple[int, int]
    eye: F32
    right: F32
    up: F32
    forward: F32
    matrix: F32
    jitter: F32

    @property
    def pixel(self) -> float:
        """Width of a pixel at depth 1: ``up`` spans half the image."""
        return float(np.linalg.norm(self.up)) * 2.0 / self.size[1]

    @staticmethod
    def of(camera: Camera, size: tuple[int, int], origin: F64) -> View:
        aspect = size[0] / size[1]
        right, up, forward = camera.basis()
        tangent = np.tan(camera.yfov / 2)
        return View(
            size,
            (np.asarray(camera.position) - origin).astype(np.float32),
            (right * tangent * aspect).astype(np.float32),
            (up * tangent).astype(np.float32),
            forward.astype(np.float32),
            camera.view_projection(aspect, origin),
            np.array(camera.jitter, dtype=np.float32),
        )


class _Scratch(threading.local):
    """Buffers of one thread for tiles of up to ``capacity`` paths, made on first use."""

    def __init__(self) -> None:
        self.capacity = self.glossy_capacity = 0

    def reserve(self, count: int) -> None:
        if count <= self.capacity:
            return
        self.capacity = count
        rays = np.empty((6, count, 3), np.float32)
        self.origins, self.directions, self.shadow_o, self.shadow_d, self.bounce_o, self.bounce_d = rays
        self.light = np.empty((count, 3), np.float32)
        self.index, self.bounce_index = np.empty((2, count), np.int32)
        self.bounce_pdf, self.limit = np.empty((2, count), np.float32)
        self.keys = np.empty(count, np.uint32)
        self.numbers = np.empty((PAIR_SELECT + 1, 2, count), np.float32)
        self.glossy_capacity = 0

    def reserve_glossy(self, count: int) -> None:
        """What paths over glossy surfaces need besides."""
        if count <= self.glossy_capacity:
            return
        self.glossy_capacity = count
        self.gloss = np.empty((count, 3), np.float32)
        self.glossy_numbers = np.empty((PAIR_LOBE + 1, 2, count), np.float32)
        self.bounce_cosine, self.bounce_weight = np.empty(count, np.float32), np.empty((count, 4), np.float32)


@dataclass
class Settings:
    """How frames are traced. ``generator``: HALTON or HASH; ``threads`` 0 = one per core; ``tile`` pixels per tile;
    ``positions``: frames carry world positions; ``backend``: see :func:`raytrace.embree.open_caster`; ``regularize``:
    narrow lobes are widened at a path's second hit, never in references; ``separable``: Smith's masking in its older,
    separable form, as some renderers have it."""

    seed: int = 0
    generator: int = HALTON
    threads: int = 0
    tile: int = 10240
    positions: bool = False
    backend: str = "auto"
    regularize: bool = True
    separable: bool = False


class Tracer:
    """Traces one compiled scene. ``with Tracer(...)`` or :meth:`close` ends its threads.

    ``variant``: what is compiled in, if that is to be more than the scene needs. ``images``: names of those its frames
    have. ``scene_id``: their number, which no other tracer of this process gives.
    """

    def __init__(self, scene: CompiledScene, settings: Settings | None = None, variant: Variant | None = None) -> None:
        self.scene = scene
        self.settings = settings or Settings()
        self.variant: Variant = variant or variant_of(scene)
        self.images = images_of(self.variant, self.settings.positions)
        self.scene_id = next(_identities)
        self.rays = open_caster(scene.triangles, scene.static_count, self.settings.backend)
        if self.variant.cutout:
            self.rays = CutoutCaster(self.rays, cutouts_of(scene))
        self.tables = tables_of(scene, self.variant)
        self._guides = guide_kernel(self.variant, self.settings.positions)
        self._detailed = self.variant.specular or self.variant.bumps
        if self._detailed:
            self._first_hit = kernels_glossy.first_hit_kernel(self.variant, self.settings.separable)
            self._second_hit = kernels_glossy.second_hit_kernel(self.variant, self.settings.separable)
        else:
            self._first_hit = kernels.first_hit_kernel(self.variant)
            self._second_hit = kernels.second_hit_kernel(self.variant)
        self._scratch = _Scratch()
        self._memory = Memory()
        self._buffers = Buffers()
        self.threads = self.settings.threads or len(os.sched_getaffinity(0))
        self._pool = ThreadPoolExecutor(self.threads, "trace") if self.threads > 1 else None
        self._time: tuple[float, float] | None = (0.0, 0.0) if not scene.moves else None
        self._lamps: tuple[float, float] | None = None

    @property
    def kernels(self) -> tuple[Callable[..., object], ...]:
        """The shading loops made for scenes of this kind; compiled when they first run."""
        return self._guides, self._first_hit, self._second_hit

    def __enter__(self) -> Tracer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown()
        self.rays.close()

    def carry_positions(self, wanted: bool) -> None:
        """Whether frames from now on have world positions, whatever the settings said; not while one is traced."""
        if wanted != self.settings.positions:
            self.settings = replace(self.settings, positions=wanted)
            self.images = images_of(self.variant, wanted)
            self._guides = guide_kernel(self.variant, wanted)

    def warm_up(self) -> None:
        """Compile, or load from the disk cache, every kernel that frames of this scene need."""
        camera = self.scene.scene.camera
        self.frame(0, camera, camera, (16, 16))
        if self.scene.has_motion:
            self.set_time(0.0, 0.0)

    def set_time(self, now: float, previous: float, lamps: float = 1.0) -> None:
        """Move what moves to time ``now``; the previous positions are those at ``previous`` (seconds).

        Lamps shine as their dimmers are at ``now``, times ``lamps``.
        """
        if self._lamps != (now, lamps):
            self.scene.dim(now, lamps)
            self._lamps = (now, lamps)
        if self.scene.moves and self._time != (now, previous):
            self.scene.move_to(now, previous)
            if self.scene.has_motion:
                self.rays.move(self.scene.triangles, self.scene.moving_box())
            self._time = (now, previous)

    def primary(self, view: View, pixels: I32) -> Hits:
        """Surface points seen through ``pixels`` (n,) int32 = y·width + x, row 0 at the bottom."""
        hits, _ = self._camera_hits(view, pixels, whole_rows=False)
        return hits

    def _camera_hits(self, view: View, pixels: I32, whole_rows: bool) -> tuple[Hits, F32]:
        """Hits, and the ray directions (in scratch memory). ``whole_rows``: four image rows or a multiple, from a
        multiple of four on, as tiles are: those are traced as packets."""
        count = len(pixels)
        scratch = self._scratch
        scratch.reserve(count)
        origins, directions = scratch.origins[:count], scratch.directions[:count]
        camera_rays(pixels, *view.size, view.eye, view.right, view.up, view.forward, view.jitter, origins, directions)
        if whole_rows:
            triangle, u, v = self.rays.intersect_rows(origins, directions, view.size[0])
        else:
            triangle, u, v = self.rays.intersect(origins, directions)
        objects = np.empty(count, np.int32)
        kernels.objects_of(triangle, self.scene.triangle_info, objects)
        return Hits(triangle, u, v, objects), directions

    def shade(
        self,
        hits: Hits,
        seeds: Seeds,
        eye: F32,
        direct: F32,
        indirect: F32,
        specular: F32 | None = None,
        *,
        pixel: float = 0.0,
    ) -> None:
        """One path from each of ``hits``, with the random numbers of ``seeds``, at the time last set.

        Writes ``direct`` and ``indirect`` (n, 3 or 4) float32: radiance towards ``eye`` (3,) float32 divided by the
        albedo; 0 where there is no hit; 1 in a fourth channel. Depends on nothing but the surface point, the seeds, the
        time and the side of the surface that ``eye`` is on.

        In a scene with specular surfaces also ``specular``, divided by theirs; there it depends on ``eye`` itself, and
        on ``pixel``, the width of a pixel at distance 1, by which textures are filtered.
        """
        if self._detailed:
            self._shade_detailed(hits, seeds, eye, direct, indirect, specular, pixel)
            return
        count = len(hits.triangle)
        s = self._scratch
        s.reserve(count)
        settings = self.settings
        kernels.clear(direct)
        kernels.clear(indirect)
        draw(seeds.pixel, seeds.frame, settings.seed, settings.generator, s.keys, s.numbers)
        shadows, bounces = self._first_hit(
            self.tables, hits.triangle, hits.u, hits.v, eye, s.numbers, s.shadow_o, s.shadow_d, s.index, s.light,
            s.bounce_o, s.bounce_d, s.bounce_index, s.bounce_pdf,
        )  # fmt: skip
        self._trace_shadows(shadows, direct)
        if bounces == 0:
            return
        bounce_o, bounce_d = s.bounce_o[:bounces], s.bounce_d[:bounces]
        triangle, u, v = self.rays.intersect(bounce_o, bounce_d)
        shadows = self._second_hit(
            self.tables, triangle, u, v, bounce_o, bounce_d, s.bounce_index, s.bounce_pdf, s.numbers, direct,
            s.shadow_o, s.shadow_d, s.index, s.light,
        )  # fmt: skip
        self._trace_shadows(shadows, indirect)

    def _shade_detailed(
        self, hits: Hits, seeds: Seeds, eye: F32, direct: F32, indirect: F32, specular: F32 | None, pixel: float
    ) -> None:
        """:meth:`shade` where surfaces are metallic, glossy or bumpy; ``specular`` None if only bumpy."""
        count = len(hits.triangle)
        s, settings = self._scratch, self.settings
        s.reserve(count)
        s.reserve_glossy(count)
        gloss = _NO_GLOSS if specular is None else specular
        for image in (direct, indirect, gloss):
            kernels.clear(image)
        draw(seeds.pixel, seeds.frame, settings.seed, settings.generator, s.keys, s.glossy_numbers)
        shadows, bounces = self._first_hit(
            self.tables, hits.triangle, hits.u, hits.v, eye, np.float32(pixel), s.glossy_numbers,
            s.shadow_o, s.shadow_d, s.index, s.light, s.gloss, s.bounce_o,
            s.bounce_d, s.bounce_index, s.bounce_pdf, s.bounce_cosine, s.bounce_weight,
        )  # fmt: skip
        self._trace_shadows(shadows, direct, specular)
        if bounces == 0:
            return
        bounce_o, bounce_d = s.bounce_o[:bounces], s.bounce_d[:bounces]
        triangle, u, v = self.rays.intersect(bounce_o, bounce_d)
        shadows = self._second_hit(
            self.tables, triangle, u, v, bounce_o, bounce_d, s.bounce_index, s.bounce_pdf, s.bounce_cosine,
            s.bounce_weight, s.glossy_numbers, settings.regularize, direct,
            gloss, s.shadow_o, s.shadow_d, s.index, s.light, s.gloss,
        )  # fmt: skip
        self._trace_shadows(shadows, indirect, specular)

    def _trace_shadows(self, count: int, out: F32, gloss: F32 | None = None) -> None:
        if count == 0:
            return
        s = self._scratch
        kernels.fill(s.limit, count, SHADOW_END)
        blocked = self.rays.occluded(s.shadow_o[:count], s.shadow_d[:count], s.limit[:count])
        kernels.add_unoccluded(blocked, s.index, s.light, out)
        if gloss is not None:
            kernels.add_unoccluded(blocked, s.index, s.gloss, gloss)

    def frame(
        self,
        index: int,
        camera: Camera,
        previous_camera: Camera,
        size: tuple[int, int],
        now: float = 0.0,
        previous: float = 0.0,
        cut: bool = False,
        remember: str = "",
        lamps: float = 1.0,
    ) -> FramePacket:
        """Frame ``index`` of the run at one path per pixel, ``size`` = (width, height).

        ``now``, ``previous``: times in seconds of this frame and the one before it. ``cut``: the frame does not
        continue the one before it. ``remember``: one of :data:`raytrace.gradients.RULES`, for a frame with temporal
        gradients, that depends on the frame before if that was traced just before it and remembered as well; "" for
        one without. ``lamps``: share of their light that lamps give.
        """
        start = time.perf_counter()
        self.set_time(now, previous, lamps)
        view, before = self._views(camera, previous_camera, size)
        moment = Moment(index, now, size, (self.settings.seed, self.settings.generator))
        reshading = self._reshading(moment, previous, view, camera, cut, remember) if remember else None
        count = size[0] * size[1]
        signals = self._buffers.empty(3 if self.variant.specular else 2, count, 4)
        outputs = self._outputs(count)

        def tile(pixels: I32) -> None:
            hits, directions = self._camera_hits(view, pixels, whole_rows=True)
            self._write_guides(view, before, pixels, hits, directions, outputs)
            seeds = Seeds(pixels.astype(np.uint32), np.full(len(pixels), index, np.uint32))
            first = int(pixels[0])
            part = slice(first, int(pixels[-1]) + 1)
            if reshading is not None:
                reshading.replace(first, hits.triangle, hits.u, hits.v, seeds.pixel, seeds.frame)
            self.shade(hits, seeds, view.eye, *signals[:, part], pixel=view.pixel)
            if reshading is not None:
                gloss = None
                if self.variant.specular:
                    gloss = Gloss(signals[2, part], outputs.albedo[part], outputs.specular_albedo[part])
                reshading.note(first, hits.triangle, hits.u, hits.v, signals[0, part], signals[1, part], gloss)

        embree = self.for_each_tile(tile, size, 4 if reshading is None else 4 * STRATUM)
        timings = {"trace": time.perf_counter() - start, "embree": embree}
        packet = self._packet(index, now, size, signals, outputs, cut, camera, previous_camera, timings)
        if reshading is None:
            return packet
        self._memory.keep(moment, reshading.points)
        return replace(packet, temporal_gradient=reshading.gradient, temporal_gradient_specular=reshading.specular)

    def _reshading(
        self, moment: Moment, previous: float, view: View, camera: Camera, cut: bool, rule: str
    ) -> Reshading:
        """What carries the points of the last frame into the frame of ``moment``."""
        return Reshading(
            self.scene.triangles,
            self.scene.triangle_info,
            None if cut else self._memory.recall(moment, previous),
            moment.index,
            moment.size,
            view.eye,
            view.matrix,
            view.jitter,
            camera.pixel_size(moment.size[1]),
            self.settings.seed,
            rule == "brightest",
            self.variant.specular,
        )

    def reference(
        self,
        camera: Camera,
        size: tuple[int, int],
        samples: int,
        now: float = 0.0,
        first_sample: int = 0,
        progress: Callable[[float], None] | None = None,
    ) -> tuple[F64, ...]:
        """Plain means of ``samples`` independent paths per pixel: direct, indirect and, in a scene with specular
        surfaces, specular, (H, W, 3) float64 each, demodulated.

        Uncycled hash numbers under a seed of their own; no clamp, no regularisation. Means over disjoint
        ranges of ``first_sample`` may be averaged.
        """
        self.set_time(now, now)
        view, _ = self._views(camera, camera, size)
        count = size[0] * size[1]
        signals = 3 if self.variant.specular else 2
        sums = np.zeros((signals, count, 3))
        done = [0]

        def tile(pixels: I32) -> None:
            hits, _ = self._camera_hits(view, pixels, whole_rows=True)
            part = slice(int(pixels[0]), int(pixels[-1]) + 1)
            sample_of = np.empty((signals, len(pixels), 3), np.float32)
            seeds = Seeds(pixels.astype(np.uint32), np.empty(len(pixels), np.uint32))
            for sample in range(first_sample, first_sample + samples):
                seeds.frame[:] = FIRST_SAMPLE + sample
                self.shade(hits, seeds, view.eye, *sample_of, pixel=view.pixel)
                sums[:, part] += sample_of
            done[0] += len(pixels)
            if progress is not None:
                progress(done[0] / count)

        with self._reference_numbers():
            self.for_each_tile(tile, size)
        return tuple((sums / samples).reshape(signals, size[1], size[0], 3))

    def reference_frame(
        self, sample: int, camera: Camera, size: tuple[int, int], now: float, lamps: float = 1.0
    ) -> FramePacket:
        """Sample ``sample`` of a reference, whose paths share no number with any frame's, as a frame of its own."""
        with self._reference_numbers():
            return self.frame(FIRST_SAMPLE + sample, camera, camera, size, now, now, lamps=lamps)

    @contextmanager
    def _reference_numbers(self) -> Iterator[None]:
        """Meanwhile paths are drawn with uncycled hash numbers under a seed of their own, without regularisation."""
        normal = self.settings
        seed = (normal.seed + REFERENCE_SEED) & 0xFFFFFFFF
        self.settings = replace(normal, seed=seed, generator=HASH, regularize=False)
        try:
            yield
        finally:
            self.settings = normal

    def for_each_tile(self, work: Callable[[I32], None], size: tuple[int, int], rows: int = 4) -> float:
        """Run ``work`` on tiles of consecutive pixels; returns seconds inside Embree, averaged over the threads.

        Tiles are whole rows, ``rows`` or a multiple, which is one of four, so that packets of 4x4 pixels are the same
        for every tile size.
        """
        width, height = size
        count = width * height
        step = width * rows * max(1, self.settings.tile // (width * rows))
        tiles = [np.arange(i, min(i + step, count), dtype=np.int32) for i in range(0, count, step)]

        def timed(pixels: I32) -> float:
            self.rays.clock.seconds = 0.0
            work(pixels)
            return self.rays.clock.seconds

        if self._pool is None:
            return sum(timed(t) for t in tiles)
        return sum(self._pool.map(timed, tiles)) / self.threads

    def _views(self, camera: Camera, previous: Camera, size: tuple[int, int]) -> tuple[View, View]:
        origin = self.scene.origin
        return View.of(camera, size, origin), View.of(previous, size, origin)

    def _outputs(self, count: int) -> Outputs:
        none = np.zeros((1, 4), np.float32)
        four = self._buffers.empty(4, count, 4)
        four[1, :, 3] = 1.0

        def optional(name: str) -> F32:
            return self._buffers.empty(count, 4) if name in self.images else none

        return Outputs(
            albedo=four[0],
            emission=four[1],
            surface=four[2],
            gradient=self._buffers.empty(count, 2),
            motion=four[3],
            prev_normal=optional("prev_normal"),
            position=optional("position"),
            prev_position=optional("prev_position"),
            specular_albedo=optional("specular_albedo"),
        )

    def _write_guides(
        self, view: View, before: View, pixels: I32, hits: Hits, directions: F32, outputs: Outputs
    ) -> None:
        self._guides(
            self.tables, pixels, directions, hits.triangle, hits.u, hits.v, view.eye, view.right, view.up, view.forward,
            view.matrix, before.matrix, view.size, outputs,
        )  # fmt: skip

    def _packet(
        self,
        index: int,
        now: float,
        size: tuple[int, int],
        signals: F32,
        out: Outputs,
        cut: bool,
        camera: Camera,
        previous_camera: Camera,
        timings: dict[str, float],
    ) -> FramePacket:
        width, height = size

        def image(values: F32) -> F32:
            return values.reshape(height, width, -1)

        guides = {name: image(values) for name, values in out._asdict().items() if name in self.images}
        return FramePacket(
            index=index,
            time=now,
            **{name: image(values) for name, values in zip(ILLUMINATION, signals, strict=False)},
            **guides,
            scene=self.scene.scene.name,
            scene_id=self.scene_id,
            cut=cut,
            basis=camera.axes(),
            jitter=camera.jitter,
            pixel_size=camera.pixel_size(height),
            camera_step=camera.step_from(previous_camera),
            timings=timings,
        )
