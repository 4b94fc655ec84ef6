"""A-SVGF. Schied et al. 2018, "Gradient Estimation for Real-Time Adaptive Temporal Filtering".

The tracer's temporal gradients (:mod:`raytrace.gradients`) tell where light has changed; there the history of SVGF
is cut short. What follows is SVGF as it is (:mod:`gl.passes.svgf`).

Deviations from the paper are listed in docs/asvgf.md with their reasons.
"""

from __future__ import annotations

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
    in_indirect = In("this frame's sample, demodulated irradiance")
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


def change_of(g: Graph, direct: Tex, indirect: Tex, guides: Guides, p: Asvgf, pixel_size: float, joint: bool) -> Tex:
    """Add the reconstruction of the gradients; returns λ of both signals, or of the one that they are together."""
    change = g.import_("frame.temporal_gradient", "rgba32f", STRATUM)
    strata = g.add(
        Strata(defines={"LIGHT": int(p.gradient_guided), "JOINT": int(joint)}),
        in_direct=direct,
        in_indirect=indirect,
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
    noisy: tuple[Tex, Tex],
    guides: Guides,
    p: Asvgf,
    pixel_size: float,
    specular_albedo: Tex | None = None,
) -> dict[str, Tex]:
    """Filter ``signals`` as :func:`gl.passes.svgf.svgf` does. ``noisy``: direct and indirect samples of the frame."""
    changes: dict[str, Change] = {}
    if p.temporal:
        with g.scope("asvgf"):
            joint = len(signals) == 1
            found = change_of(g, *noisy, guides, p, pixel_size, joint)
        known = [name for name in signals if name != "specular"]
        changes = {name: Change(found, i, p.power if p.cut == "power" else None) for i, name in enumerate(known)}
    return svgf(g, signals, guides, p, pixel_size, "asvgf", changes, specular_albedo)
