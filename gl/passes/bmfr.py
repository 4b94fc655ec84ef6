"""BMFR. Koskela et al. 2019, "Blockwise Multi-Order Feature Regression for Real-Time Path-Tracing Reconstruction".

Accumulate the noisy frames, fit each block of the result by a linear combination of noise-free features, accumulate the
fits. The features are data (``bmfr.features``); the shader is compiled for them.

Deviations from the paper:

* The least squares are solved by Givens rotations, a triangle for each invocation and a tree of merges
  (``bmfr/solver.glsl``), not by Householder reflections: the same triangle with a handful of barriers.
* Positions are taken relative to the camera, brought to [-1, 1] in every block whatever its size, and squared after
  that. Far from the origin of the world their squares would be linear, and in small blocks the noise would drown them.
* A surface point is compared with where it was in the last frame, so that what moves keeps its history; the limit is
  given in widths of a pixel, so that it suits every scene.
* Where the sky is seen, and where there is no finite sample, a pixel takes no part in the fit.
* A rank test can take the place of the noise, or go along with it.
* Each part of a block may be fitted again around the block's fit, shrunk by its uncertainty (``bmfr/parts.glsl``):
  light that no polynomial expresses over 32 pixels is most of the paper's error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from config import Bmfr
from gl.graph import ComputePass, FragmentPass, Graph, In, Out, Prev, Tex, Uniform
from gl.passes.asvgf import LAMBDA
from gl.passes.fast_history import FastHistory
from gl.passes.temporal import Guides
from raytrace.frame import Basis, CameraStep, Vector

REPROJECTION = "xy: position in the last frame, texel units; z: mask of the 2x2 valid taps; w: history length N, frames"
SAMPLES = "rgb: accumulated irradiance, finite; a: frames in it, 0 where there is none"

COMPONENTS: Final = {"1": 1, "n": 3, "w": 3, "w2": 3, "w3": 3, "albedo": 3, "roughness": 1, "depth": 1}
"""Numbers that each feature contributes to a row."""

OFFSETS: Final = (
    *((-14, -14), (4, -6), (-8, 14), (8, 0), (-10, -8), (2, 12), (12, -12), (-10, 0)),
    *((12, 14), (-8, -16), (6, 6), (-2, -2), (6, -14), (-16, 12), (14, -4), (-6, 4)),
)
"""Where the grid of blocks of 32 pixels begins in 16 successive frames, in pixels: the cycle of the authors' code."""

SOFTWARE_THREADS: Final = 8
"""Invocations per block on a renderer that runs on the CPU: as many as a vector register holds, since each barrier is
a switch of the whole group."""

HARDWARE_THREADS: Final = 64
"""Invocations per block on a GPU, where fewer would leave its units idle."""

SHARED_MEMORY: Final = 32768
"""Bytes that a work group may share: what OpenGL 4.3 guarantees. moderngl does not tell how much more there is."""


@dataclass(frozen=True)
class View:
    """What a frame's camera and its renderer tell the filter besides textures.

    ``basis``, ``jitter``, ``pixel_size``, ``index``: as in the :class:`FramePacket`. ``threads``: invocations that work
    on a block. ``step``: how the camera has moved, where histories are to be looked for as if nothing else had.
    """

    basis: Basis
    jitter: tuple[float, float]
    pixel_size: float
    index: int
    threads: int
    step: CameraStep | None = None

    @property
    def rows(self) -> tuple[Vector, ...]:
        """Rows of the matrix that makes (x, y, 1), pixels from the image's centre, a ray of depth 1 in world space."""
        right, up, forward = self.basis
        return tuple((self.pixel_size * x, self.pixel_size * y, z) for x, y, z in zip(right, up, forward, strict=True))


class Accumulate(FragmentPass):
    """Find each surface point in the last frame by position and normal, and blend its sample with the history there.

    Of the 2x2 texels around it those count that are near enough (preprocessing); there is no search farther away.
    """

    shader = "bmfr/accumulate.frag"
    in_direct = In("irradiance")
    in_indirect = In("irradiance, to be added", optional=True)
    in_motion = In("xy: previous uv - uv; z: expected previous depth, scene units; w: object id, -1 = miss")
    in_surface = In("xyz: shading normal, world; w: depth, scene units")
    in_prev_normal = In(
        "xyz: the point's normal in the last frame, world; scenes in which something moves", optional=True
    )
    prev_color = Prev(SAMPLES)
    prev_guide = Prev("x: normal, octahedral; y: depth, scene units")
    out_color = Out("rgba16f", SAMPLES)
    out_reprojection = Out("rgba32f", REPROJECTION)
    out_guide = Out("rg32f", "x: normal, octahedral; y: depth, scene units")
    u_view = Uniform("mat3", "from pixels off the centre at depth 1, and depth, to world space")
    u_pixel_size = Uniform("float", "> 0, scene units a pixel is wide at depth 1")
    u_alpha = Uniform("float", "[0;1] smallest weight of the new sample")
    u_max_history = Uniform("float", "[1;255] frames, the longest history that is counted")
    u_position_tolerance = Uniform("float", "> 0, widths of a pixel on the surface")
    u_normal_tolerance = Uniform("float", "[0;4] squared distance of the normals")


class AccumulateAdaptive(Accumulate):
    """The same, but where light has changed the history follows it and counts for less (Schied et al. 2018)."""

    in_lambda = In(LAMBDA)


class AccumulateInPlace(Accumulate):
    """The same, but points are looked for where they are now, as the authors do: what moves finds another or none."""

    u_turn = Uniform("mat3", "from this frame's camera space to the last frame's")
    u_step = Uniform("vec3", "the same, added after that, scene units")


class AccumulateInPlaceAdaptive(AccumulateInPlace, AccumulateAdaptive):
    """Both."""


class Samples(FragmentPass):
    """This frame's samples alone, in the form in which :class:`Accumulate` hands them on."""

    shader = "bmfr/samples.frag"
    in_direct = In("irradiance")
    in_indirect = In("irradiance, to be added", optional=True)
    in_surface = In("xyz: shading normal, world; w: depth, scene units")
    out_color = Out("rgba16f", SAMPLES)


class Fit(ComputePass):
    """Replace each block by the least-squares combination of its features (feature fitting).

    A work group takes a block; the grid is shifted from frame to frame, so there is one block more on each axis.
    """

    shader = "bmfr/fit.comp"
    in_color = In(SAMPLES)
    in_surface = In("xyz: shading normal, world; w: depth, scene units")
    in_albedo = In("the surface's albedo, if it is a feature", optional=True)
    out_color = Out("rgba16f", "rgb: fitted irradiance, not negative; 0 on misses")
    u_view = Uniform("mat3", "from pixels off the centre at depth 1, and depth, to world space")
    u_jitter = Uniform("vec2", "[-0.5;0.5] where in their pixels the camera rays pass, from the centre")
    u_offset = Uniform("ivec2", "pixels that the grid is shifted by, at most half a block")
    u_seed = Uniform("uint", "of the noise, another one for each frame")
    u_noise = Uniform("float", "[0;1] largest noise added to a feature")
    u_rank_tolerance = Uniform("float", "> 0, what of a feature is neglected, root of the mean square over the block")
    u_caution = Uniform("float", ">= 0, variances that noise is expected to explain in a feature of a part")
    u_fresh_caution = Uniform("float", ">= 0, the same where the samples are means of few frames")

    def __init__(self, p: Bmfr, view: View) -> None:
        shift = OFFSETS[view.index % len(OFFSETS)]
        super().__init__(
            group=(p.block, p.block),
            defines={
                **layout(p.features),
                "THREADS": view.threads,
                "NOISE": int(p.regularization != "rank"),
                "UNIT": int(p.unit_scale),
                **({"PARTS": part_count(p), "PART": p.part_side} if p.part_side else {}),
                **({"FRESH": p.short_history} if p.part_side and p.short_history else {}),
            },
            u_view=view.rows,
            u_jitter=view.jitter,
            u_offset=tuple(pixels * p.block // 32 for pixels in shift),
            u_seed=view.index,
            u_noise=p.noise,
            u_rank_tolerance=1e-7 if p.regularization == "noise" else p.rank_tolerance,
            u_caution=p.caution,
            u_fresh_caution=p.fresh_caution,
        )

    def work_groups(self, size: tuple[int, int]) -> tuple[int, int]:
        """One more than the blocks of an unshifted grid, in x and in y."""
        x, y = super().work_groups(size)
        return x + 1, y + 1


class FitRough(Fit):
    """The same with roughness among the features."""

    in_roughness = In("a: the surface's roughness")


class AccumulateFit(FragmentPass):
    """Blend the fit with those before, by the decisions of :class:`Accumulate` (postprocessing)."""

    shader = "bmfr/accumulate_fit.frag"
    in_color = In("rgb: fitted irradiance")
    in_reprojection = In(REPROJECTION)
    prev_color = Prev("rgb: what this pass wrote in the last frame")
    out_color = Out("rgba16f", "rgb: accumulated fitted irradiance")
    u_alpha = Uniform("float", "[0;1] smallest weight of the new fit")


class AccumulateFitAdaptive(AccumulateFit):
    """The same, but where light has changed the history follows it and counts for less (Schied et al. 2018)."""

    in_lambda = In(LAMBDA)


def layout(features: str) -> dict[str, int]:
    """``FEATURES``, the length of a row, and for each feature ``X_AT``, its place there; -1 for what is not listed.

    There is no ``ROUGHNESS_AT`` without that feature, which few scenes have.
    """
    places = {f"{name.upper()}_AT": -1 for name in COMPONENTS if name not in ("1", "roughness")}
    length = 0
    for name in features.split(","):
        if name != "1":
            places[f"{name.upper()}_AT"] = length
        length += COMPONENTS[name]
    return {"FEATURES": length, **places}


def part_count(p: Bmfr) -> int:
    """Parts of a block that are fitted again; 0 if ``part`` is."""
    return (p.block // p.part_side) ** 2 if p.part_side else 0


def thread_count(features: str, software: bool, parts: int = 0) -> int:
    """Invocations per block: what suits the renderer, halved until their triangles fit into shared memory."""
    count = layout(features)["FEATURES"]
    threads = SOFTWARE_THREADS if software else HARDWARE_THREADS
    while threads > 1 and shared_bytes(count, threads, parts) > SHARED_MEMORY:
        threads //= 2
    return threads


def shared_bytes(features: int, threads: int, parts: int = 0) -> int:
    """Shared memory of ``bmfr/fit.comp``: half of the triangles and all of the parts', bounds of position, weights."""
    slots = max(threads // 2, 1) + parts
    triangle = features * (features + 7) // 2 + (2 if parts else 0)
    return 4 * triangle * slots + 2 * 16 * threads + 16 * features * (1 + parts)


def bmfr(
    g: Graph,
    signals: dict[str, Tex],
    features: dict[str, Tex],
    guides: Guides,
    p: Bmfr,
    view: View,
    name: str = "bmfr",
    change: Tex | None = None,
) -> Tex:
    """Filter the sum of ``signals`` (noisy irradiance by name: "direct" and, if it is apart, "indirect"); returns the
    clean one. Histories are named by ``name`` and by whether the signals hold the albedo.

    ``features``: textures of features that are no guides, "albedo" and where there is one "roughness". ``change``: what
    :func:`gl.passes.asvgf.change_of` knows of the light, both signals being one.
    """
    inputs = {f"in_{name}": noisy for name, noisy in signals.items()}
    names = name if p.demodulate else f"{name}.radiance"
    extra = {} if change is None else {"in_lambda": change}
    work = _ACCUMULATIONS[view.step is not None, change is not None]
    moved: dict[str, Any] = {} if view.step is None else {"u_turn": view.step[0], "u_step": view.step[1]}
    before = guides.optional if view.step is None else {}
    adaptive = {} if change is None else {"ADAPTIVE": 1}
    with g.scope(name):
        if not p.temporal:
            samples = g.add(Samples(), in_surface=guides.surface, **inputs).out_color
            return _fit(g, samples, features, guides, p, view) if p.fit else samples
        noisy, guide = g.history(f"{names}.noisy", "rgba16f"), g.history(f"{names}.guide", "rg32f")
        found = g.add(
            work(
                u_view=view.rows,
                u_pixel_size=view.pixel_size,
                u_alpha=p.alpha,
                u_max_history=float(p.max_history),
                u_position_tolerance=p.position_tolerance,
                u_normal_tolerance=p.normal_tolerance,
                defines={"ROUND_HISTORY": int(p.round_history), **adaptive, **({"IN_PLACE": 1} if moved else {})},
                **moved,
            ),
            "accumulate",
            in_motion=guides.motion,
            in_surface=guides.surface,
            prev_color=noisy,
            prev_guide=guide,
            **inputs,
            **before,
            **extra,
        )
        accumulated, fast = found.out_color, None
        if p.fast_clamp:
            fast = FastHistory(g, names, signals["direct"], signals.get("indirect"), found.out_reprojection, p)
            accumulated = fast.bound(accumulated)
        g.feed(noisy, accumulated)
        g.feed(guide, found.out_guide)
        if not p.fit:
            return accumulated
        fitted = g.history(f"{names}.fitted", "rgba16f")
        clean = g.add(
            (AccumulateFit if change is None else AccumulateFitAdaptive)(u_alpha=p.alpha_fit, defines=adaptive),
            "accumulate_fit",
            in_color=_fit(g, accumulated, features, guides, p, view),
            in_reprojection=found.out_reprojection,
            prev_color=fitted,
            **extra,
        ).out_color
        if fast is not None:
            clean = fast.bound(clean)
        g.feed(fitted, clean)
        return clean


_ACCUMULATIONS: Final[dict[tuple[bool, bool], type[Accumulate]]] = {
    (False, False): Accumulate,
    (False, True): AccumulateAdaptive,
    (True, False): AccumulateInPlace,
    (True, True): AccumulateInPlaceAdaptive,
}
"""By whether what moves is looked for where it is now, and whether light is known to have changed."""


def _fit(g: Graph, samples: Tex, features: dict[str, Tex], guides: Guides, p: Bmfr, view: View) -> Tex:
    used = {f"in_{name}": texture for name, texture in features.items() if name in p.features.split(",")}
    work = FitRough(p, view) if "in_roughness" in used else Fit(p, view)
    return g.add(work, "fit", in_color=samples, in_surface=guides.surface, **used).out_color
