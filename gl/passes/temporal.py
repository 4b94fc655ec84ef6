"""Temporal reprojection and accumulation. Schied et al. 2017, "Spatiotemporal Variance-Guided Filtering", sec. 4.1.

Shared by every method that keeps a history: :class:`Reproject` decides once per frame which texels of the last frame
saw the same surface, :class:`Accumulate` then blends one signal.

Deviations from the paper:

* The new sample's weight is max(1 / (N + 1), alpha), a plain running mean first, as Koskela et al. 2019 have it. With
  a constant alpha the first sample after a disocclusion keeps most of the weight for many frames.
* The expected previous depth comes with the motion vector, so that a camera or an object moving along the line of sight
  keeps its history (the "2.5D" vectors of NRD).
* The length of the history is interpolated like the colour, and shortened where only part of the footprint is valid or
  where the surface was seen at a much more grazing angle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Protocol

from gl.graph import FragmentPass, Graph, History, In, Out, Prev, Tex, Uniform

REPROJECTION = (
    "xy: position in the last frame, texel units; z: mask of valid taps, or below 0 why the history was rejected;"
    " w: history length N, frames"
)
GUIDE = "x: normal, octahedral; y: depth; z: object id; w: history length h + cosine of the view angle"

SAMPLE = "rgb: irradiance, finite; a: 1, or 0 where there is none"

CLAMP_RADIUS: Final = 3
"""Of the window whose colours bound the history's, in pixels.

One path per pixel needs a large one: with 3x3, 5x5, 7x7 pixels and without a bound SVGF leaves 0.109, 0.062, 0.058,
0.057 of the noise on the flight through the Cornell box, and 0.232, 0.196, 0.191, 0.191 in the interior, where lamps
move.
"""

REJECTIONS: Final = {
    -1: "there is no last frame to look in",
    -2: "no surface here: sky, or a guide that is not finite",
    -3: "it was out of view in the last frame",
    -4: "another object was there",
    -5: "a surface at another depth was there",
    -6: "a surface that faced elsewhere was there",
    -7: "what was there is worth less than a frame: too small a part, or seen at too grazing an angle",
}
"""What z of ``out_reprojection`` says where the history has length 0: from -4 on the test that stopped the texel of the
last frame which came farthest. The shaders that write it have a constant for each."""


class Reproject(FragmentPass):
    """Find each surface point in the last frame and test the texels there: object, depth, normal.

    A 2x2 bilinear footprint whose failing taps are dropped, else the 3x3 around it, else no history (N = 0).
    """

    shader = "temporal/reproject.frag"
    in_motion = In("xy: previous uv - uv; z: expected previous depth, scene units; w: object id, -1 = miss")
    in_surface = In("xyz: shading normal, world; w: depth, scene units")
    in_gradient = In("depth change per pixel, scene units")
    in_prev_normal = In(
        "xyz: the point's normal in the last frame, world; scenes in which something moves", optional=True
    )
    prev_guide = Prev(GUIDE)
    out_reprojection = Out("rgba32f", REPROJECTION)
    out_guide = Out("rgba32f", GUIDE)
    u_depth_tolerance = Uniform("float", "[0;1] accepted depth difference relative to depth, on top of a pixel's slope")
    u_normal_tolerance = Uniform("float", "[-1;1] smallest accepted cosine between the normals")
    u_max_history = Uniform("float", "[1;255] frames, the longest history that is counted")
    u_pixel_size = Uniform("float", "> 0, scene units a pixel is wide at depth 1")


class Accumulate(FragmentPass):
    """Blend one signal and its luminance moments with the history."""

    shader = "temporal/accumulate.frag"
    in_color = In("this frame's sample, demodulated irradiance")
    in_reprojection = In(REPROJECTION)
    prev_color = Prev("accumulated irradiance of the last frame, a unused")
    prev_moments = Prev("accumulated first and second moment of luminance")
    # A standard deviation, not a variance: radiance that half precision holds can have a variance that it does not.
    out_color = Out("rgba16f", "rgb: accumulated irradiance; a: standard deviation of one sample's luminance over time")
    out_moments = Out("rg32f", "first and second moment of luminance; a square needs single precision")
    u_alpha = Uniform("float", "[0;1] smallest weight of the new sample in the colour")
    u_alpha_moments = Uniform("float", "[0;1] smallest weight of the new sample in the moments")


class Blend(FragmentPass):
    """Blend a colour with the history, without any moments."""

    shader = "temporal/blend.frag"
    in_color = In(f"{SAMPLE}; with RAW a unused")
    in_reprojection = In(REPROJECTION)
    prev_color = Prev(SAMPLE)
    out_color = Out("rgba16f", SAMPLE)
    u_alpha = Uniform("float", "[0;1] smallest weight of the new colour")


class Neighbourhood(FragmentPass):
    """Bounds of the colours that this frame shows around each pixel: mean ± u_sigma deviations, per channel.

    After Salvi 2016, "An Excursion in Temporal Supersampling"; for :class:`AccumulateClamped`.
    """

    shader = "temporal/neighbourhood.frag"
    in_color = In("this frame's sample, demodulated irradiance")
    out_low = Out("rgba16f", "rgb: mean minus the reach")
    out_high = Out("rgba16f", "rgb: mean plus the reach")
    u_sigma = Uniform("float", "[0;10] reach in standard deviations")


class AccumulateClamped(Accumulate):
    """The same, but the history's colour is clamped to this frame's bounds first: a ghost of other light lies outside.

    Moments are not clamped: where light changes, the variance is to be high.
    """

    in_low = In("rgb: least colour accepted from the history")
    in_high = In("rgb: largest colour accepted from the history")


class AccumulateAdaptive(Accumulate):
    """The same, but where light has changed the history counts for less (Schied et al. 2018, sec. 4.4).

    Each signal then has a history length of its own, which travels with the moments.
    """

    in_lambda = In("xy: λ, [0;1] how much of each signal's history is void; zw: factors by which they have changed")
    out_moments = Out(
        "rgba32f", "xy: first and second moment of luminance; z: part of the length that is left; w: history length N"
    )
    u_power = Uniform("float", ">= 0, exponent of what λ leaves of the history's length")


class AccumulateAdaptiveClamped(AccumulateAdaptive, AccumulateClamped):
    """Both: the history's colour is clamped, and counts for less where light has changed."""


@dataclass(frozen=True)
class Change:
    """What is known of a signal's change of light. ``texture``: λ, the signal's in channel number ``channel``.

    ``power``: the history's length N becomes N (1 - λ)^power; None: the one that goes with the sample's weight.
    """

    texture: Tex
    channel: int
    power: float | None


class BlendClamped(Blend):
    """The same with bounds of the history's colour."""

    in_low = In("rgb: least colour accepted from the history")
    in_high = In("rgb: largest colour accepted from the history")


class ReprojectionSettings(Protocol):
    """The parameters of the search in the last frame."""

    @property
    def max_history(self) -> int: ...
    @property
    def depth_tolerance(self) -> float: ...
    @property
    def normal_tolerance(self) -> float: ...


class TemporalSettings(ReprojectionSettings, Protocol):
    """And those of accumulation with moments."""

    @property
    def alpha(self) -> float: ...
    @property
    def alpha_moments(self) -> float: ...


class Guides:
    """Handles of the noise-free inputs that the filters share."""

    def __init__(self, g: Graph, moving: bool) -> None:
        self.motion = g.import_("frame.motion", "rgba32f")
        self.surface = g.import_("frame.surface", "rgba32f")
        self.gradient = g.import_("frame.gradient", "rg32f")
        self.optional = {"in_prev_normal": g.import_("frame.prev_normal", "rgba32f")} if moving else {}


def _bounds(g: Graph, color: Tex, clamp: float | None) -> dict[str, Tex]:
    """Add the bounds of the history's colour; nothing where ``clamp`` is None."""
    if clamp is None:
        return {}
    around = g.add(Neighbourhood(u_sigma=clamp, defines={"RADIUS": CLAMP_RADIUS}), in_color=color)
    return {"in_low": around.out_low, "in_high": around.out_high}


def reproject(g: Graph, guides: Guides, name: str, p: ReprojectionSettings, pixel_size: float) -> Tex:
    """Add the reprojection of the frame with its own history, ``name.guide``; returns the ``REPROJECTION`` texture."""
    history = g.history(f"{name}.guide", "rgba32f")
    found = g.add(
        Reproject(
            u_depth_tolerance=p.depth_tolerance,
            u_normal_tolerance=p.normal_tolerance,
            u_max_history=float(p.max_history),
            u_pixel_size=pixel_size,
        ),
        in_motion=guides.motion,
        in_surface=guides.surface,
        in_gradient=guides.gradient,
        prev_guide=history,
        **guides.optional,
    )
    g.feed(history, found.out_guide)
    return found.out_reprojection


def accumulate(
    g: Graph,
    color: Tex,
    reprojection: Tex,
    history: History,
    p: TemporalSettings,
    fmt: str = "rgba16f",
    clamp: float | None = None,
    change: Change | None = None,
    alpha_moments: float | None = None,
    variance: Mapping[str, int] = MappingProxyType({}),
) -> tuple[Tex, Tex]:
    """Add the accumulation of one signal into ``history``, which the caller feeds; returns colour and moments.

    ``clamp``: standard deviations of this frame's colours around a pixel by which the history's colour may differ from
    their mean; None: by any. ``change``: then the moments have the length of the signal's history with them.
    ``alpha_moments``: instead of that of ``p``. ``variance``: how the shader is compiled for another estimate of it
    (:mod:`gl.passes.variance`); the moments have a history of their own then.
    """
    kind = "centred" if "CENTRED" in variance else "moments"
    moments = g.history(f"{history.name}.{kind}", "rg32f" if change is None else "rgba32f")
    extra = _bounds(g, color, clamp)
    defines: dict[str, int] = {"HALF": int(fmt == "rgba16f"), **({"CLAMPED": 1} if extra else {}), **variance}
    uniforms: dict[str, float] = {}
    if change is not None:
        extra["in_lambda"] = change.texture
        defines |= {"ADAPTIVE": 1, "SIGNAL": change.channel, "POWER": int(change.power is not None)}
        uniforms["u_power"] = change.power or 0.0
    work = _ACCUMULATIONS[clamp is not None, change is not None]
    blended = g.add(
        work(
            u_alpha=p.alpha,
            u_alpha_moments=p.alpha_moments if alpha_moments is None else alpha_moments,
            formats={"out_color": fmt},
            defines=defines,
            **uniforms,
        ),
        "accumulate",
        in_color=color,
        in_reprojection=reprojection,
        prev_color=history,
        prev_moments=moments,
        **extra,
    )
    g.feed(moments, blended.out_moments)
    return blended.out_color, blended.out_moments


_ACCUMULATIONS: Final[dict[tuple[bool, bool], type[Accumulate]]] = {
    (False, False): Accumulate,
    (True, False): AccumulateClamped,
    (False, True): AccumulateAdaptive,
    (True, True): AccumulateAdaptiveClamped,
}
"""By whether the colour is clamped and whether light is known to have changed."""


def blend(
    g: Graph,
    color: Tex,
    reprojection: Tex,
    history: History,
    alpha: float,
    clamp: float | None = None,
    raw: bool = False,
) -> Tex:
    """Add the blend of a colour with ``history``, which the caller feeds, without moments; returns the blended colour.

    ``alpha``: smallest share of the new colour. ``clamp``: as for :func:`accumulate`. ``raw``: ``color`` is a sample
    that no pass has looked at yet; otherwise its alpha says whether there is any.
    """
    bounds = _bounds(g, color, clamp)
    work = BlendClamped if bounds else Blend
    defines = ({"RAW": 1} if raw else {}) | ({"CLAMPED": 1} if bounds else {})
    return g.add(
        work(u_alpha=alpha, defines=defines),
        "blend",
        in_color=color,
        in_reprojection=reprojection,
        prev_color=history,
        **bounds,
    ).out_color
