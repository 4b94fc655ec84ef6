"""A-SVGF. Schied et al. 2018, "Gradient Estimation for Real-Time Adaptive Temporal Filtering".

The tracer's temporal gradients (:mod:`raytrace.gradients`) tell where light has changed; there the history of SVGF
is cut short. What follows is SVGF as it is (:mod:`gl.passes.svgf`).

Deviations from the paper, in every preset; docs/asvgf.md has the measurements:

* λ is brought from strata to pixels by likeness of surfaces, and changes are summed before they are divided: otherwise
  surfaces narrower than a stratum go on glowing when a lamp is off.
* A sample that was carried over counts as much as λ says. Unchanged, it is in the history already.
* Direct, indirect and specular light have λ and history lengths of their own.
* A signal that is less than a thousandth of all light can change by all of it without cutting its history.

The preset ``best`` lets the history follow the light (``follow``): what was accumulated is multiplied by the factor
that the light has changed by. λ as published says which part of the light is new, a few per cent in every frame of a
moving lamp, and shortens a history of ten frames by as little. ``gain`` multiplies it; ten works, at a price in noise.

In scenes with metals and gloss there is a second image of gradients, of specular and of all light (:class:`Samples`).
"""

from __future__ import annotations

from dataclasses import dataclass

from config import Asvgf
from gl.graph import FragmentPass, Graph, In, Out, Tex, Uniform
from gl.passes.svgf import squarings, svgf
from gl.passes.temporal import Change, Guides
from raytrace.frame import STRATUM

CHANGE = "x: change of direct light; y: the larger of now and then; z: change of indirect light; w: the larger"
LAMBDA = "x: λ of direct light; y: λ of indirect light; z: factor that direct light has changed by; w: indirect light"
SURFACE = "xyz: shading normal, world; w: depth, scene units"


class Strata(FragmentPass):
    """What each stratum shows: the surface of the sample that was carried over, otherwise of its centre."""

    shader = "asvgf/strata.frag"
    in_direct = In("rgb: this frame's sample; a: 0 carried over from the last frame, 2 may be carried on, 1 neither")
    in_indirect = In("this frame's sample, demodulated irradiance", optional=True)
    in_surface = In(SURFACE)
    in_gradient = In("depth change per pixel, scene units")
    out_surface = Out("rgba32f", SURFACE, divisor=STRATUM)
    out_slope = Out("rg32f", "depth change per pixel, scene units", divisor=STRATUM)
    out_light = Out(
        "rgba32f",
        "x: mean of direct light; y: its variance; z: mean of indirect light; w: its variance",
        divisor=STRATUM,
    )


class Gradient(FragmentPass):
    """One iteration of the wavelet over the strata."""

    shader = "asvgf/gradient.frag"
    in_change = In(CHANGE)
    in_surface = In(SURFACE)
    in_slope = In("depth change per pixel, scene units")
    in_light = In("mean and variance of direct light, of indirect light", optional=True)
    out_change = Out("rgba32f", CHANGE, divisor=STRATUM)
    u_sigma_z = Uniform("float", "> 0, depth edge-stopping")
    u_sigma_n = Uniform("float", "> 0, exponent of the normals' cosine")
    u_sigma_l = Uniform("float", "> 0, luminance edge-stopping in standard deviations")
    u_pixel_size = Uniform("float", "> 0, scene units a pixel is wide at depth 1")


class Lambda(FragmentPass):
    """How much of each signal's history is void, and by which factor the light has changed, for every pixel."""

    shader = "asvgf/lambda.frag"
    in_change = In(CHANGE)
    in_strata = In(SURFACE)
    in_surface = In(SURFACE)
    in_gradient = In("depth change per pixel, scene units")
    out_lambda = Out("rgba16f", LAMBDA)
    u_gain = Uniform("float", ">= 0, λ per relative change")
    u_sigma_z = Uniform("float", "> 0, depth edge-stopping")
    u_sigma_n = Uniform("float", "> 0, exponent of the normals' cosine")
    u_pixel_size = Uniform("float", "> 0, scene units a pixel is wide at depth 1")


@dataclass(frozen=True)
class Samples:
    """Noisy light whose change is wanted, and where the tracer tells of it.

    ``light``: direct and indirect light, or one signal. ``pair``: of the channels of ``image`` only these, 0 = xy or
    1 = zw; None: all.
    """

    light: tuple[Tex, ...]
    image: str = "temporal_gradient"
    pair: int | None = None

    @staticmethod
    def specular(light: Tex) -> Samples:
        """Of specular light alone."""
        return Samples((light,), "temporal_gradient_specular", 0)

    @staticmethod
    def whole(light: Tex) -> Samples:
        """Of all light where some of it is specular."""
        return Samples((light,), "temporal_gradient_specular", 1)


def change_of(g: Graph, samples: Samples, guides: Guides, p: Asvgf, pixel_size: float, joint: bool) -> Tex:
    """Add the reconstruction of the gradients; returns λ of the signals, or with ``joint`` of direct and indirect light
    together."""
    change = g.import_(f"frame.{samples.image}", "rgba32f", STRATUM)
    pair = {} if samples.pair is None else {"PAIR": samples.pair}
    strata = g.add(
        Strata(defines={"LIGHT": int(p.gradient_guided), "JOINT": int(joint)}),
        **dict(zip(("in_direct", "in_indirect"), samples.light, strict=False)),
        in_surface=guides.surface,
        in_gradient=guides.gradient,
    )
    light = {"in_light": strata.out_light} if p.gradient_guided else {}
    for i in range(p.gradient_iterations):
        iteration = Gradient(
            u_sigma_z=p.sigma_z,
            u_sigma_n=float(p.sigma_n),
            u_sigma_l=p.gradient_sigma_l,
            u_pixel_size=pixel_size,
            defines={
                "STEP": 1 << i,
                "FIRST": int(i == 0),
                "JOINT": int(joint),
                "SIGMA_N_SQUARINGS": squarings(p.sigma_n),
                **(pair if i == 0 else {}),
            },
        )
        change = g.add(
            iteration,
            f"gradient{i}",
            in_change=change,
            in_surface=strata.out_surface,
            in_slope=strata.out_slope,
            **light,
        ).out_change
    work = Lambda(
        u_gain=p.gain,
        u_sigma_z=p.sigma_z,
        u_sigma_n=float(p.sigma_n),
        u_pixel_size=pixel_size,
        defines={"WIDEN": int(p.widen), "FOLLOW": int(p.follow), "SIGMA_N_SQUARINGS": squarings(p.sigma_n)},
    )
    return g.add(
        work,
        in_change=change,
        in_strata=strata.out_surface,
        in_surface=guides.surface,
        in_gradient=guides.gradient,
    ).out_lambda


def asvgf(
    g: Graph,
    signals: dict[str, Tex],
    noisy: tuple[Tex, ...],
    guides: Guides,
    p: Asvgf,
    pixel_size: float,
    specular_albedo: Tex | None = None,
) -> dict[str, Tex]:
    """Filter ``signals`` as :func:`gl.passes.svgf.svgf` does. ``noisy``: direct and indirect samples of the frame."""
    changes: dict[str, Change] = {}
    power = p.power if p.cut == "power" else None
    if p.temporal and "both" in signals:
        with g.scope("asvgf"):
            gloss = specular_albedo is not None
            samples = Samples.whole(signals["both"]) if gloss else Samples(noisy)
            changes["both"] = Change(change_of(g, samples, guides, p, pixel_size, not gloss), 0, power)
    elif p.temporal:
        with g.scope("asvgf"):
            found = change_of(g, Samples(noisy), guides, p, pixel_size, joint=False)
            changes = {name: Change(found, i, power) for i, name in enumerate(("direct", "indirect"))}
            if "specular" in signals:
                with g.scope("specular"):
                    found = change_of(g, Samples.specular(signals["specular"]), guides, p, pixel_size, joint=False)
                changes["specular"] = Change(found, 0, power)
    return svgf(g, signals, guides, p, pixel_size, "asvgf", changes, specular_albedo)
