"""From filtered illumination to the screen: modulate, tone map, encode."""

from __future__ import annotations

from typing import Final

from config import Display
from gl.graph import FragmentPass, Graph, In, Out, Tex, Uniform

GLOSSY: Final = {"GLOSSY": 1}
"""``#define`` of programs that know of specular light; those of scenes without are compiled as if there were none."""

OPERATORS = {"none": 0, "reinhard": 1, "aces": 2}


class Combine(FragmentPass):
    """Direct plus indirect before a filter that takes them together; with the albedo if it is to see that, too."""

    shader = "display/combine.frag"
    in_direct = In("irradiance")
    in_indirect = In("irradiance", optional=True)
    in_albedo = In("divisor of the irradiance", optional=True)
    out_color = Out("rgba32f", "the sum, times albedo where that is connected")


class CombineGlossy(Combine):
    """The same with specular light, all as radiance."""

    in_specular = In("specular light over its albedo")
    in_specular_albedo = In("rgb: divisor of the specular light; a: roughness")


class Total(FragmentPass):
    """Direct, indirect and specular light as one: radiance over the whole directional albedo of the surface.

    Where that is black, the illumination of a white diffuse surface takes its place.
    """

    shader = "display/total.frag"
    in_direct = In("irradiance")
    in_indirect = In("irradiance")
    in_specular = In("specular light over its albedo")
    in_albedo = In("divisor of the irradiance")
    in_specular_albedo = In("rgb: divisor of the specular light; a: roughness")
    out_color = Out("rgba32f", "radiance over the sum of both albedos")


class Modulate(FragmentPass):
    """Full radiance: (direct + indirect) x albedo + emission. Schied et al. 2017, sec. 4."""

    shader = "display/modulate.frag"
    in_direct = In("irradiance; radiance where no albedo is connected")
    in_indirect = In("irradiance", optional=True)
    in_albedo = In("divisor of the irradiance", optional=True)
    in_emission = In("radiance emitted by the surface seen or by the sky")
    out_radiance = Out("rgba32f", "linear radiance")


class ModulateGlossy(Modulate):
    """The same with specular light: (direct + indirect) x albedo + specular x its albedo + emission.

    With a specular albedo and no specular signal ``in_direct`` is all light at once, over the sum of both albedos.
    """

    in_specular = In("specular light over its albedo; radiance where none is connected", optional=True)
    in_specular_albedo = In("rgb: divisor of the specular light; a: roughness", optional=True)


class Tonemap(FragmentPass):
    """Exposure and tone curve."""

    shader = "display/tonemap.frag"
    in_radiance = In("linear radiance")
    out_color = Out("rgba16f", "rgb: tone-mapped colour, linear; a: 0 where the radiance was NaN or infinite, else 1")
    u_scale = Uniform("float", "> 0, 2 to the exposure in EV")


class MeasuredTonemap(Tonemap):
    """The same, with an exposure that was measured on the GPU (:mod:`gl.passes.exposure`) beneath ``u_scale``."""

    in_exposure = In("exposure, EV, one texel")


class Encode(FragmentPass):
    """8-bit sRGB."""

    shader = "display/encode.frag"
    in_color = In("tone-mapped colour, linear")
    out_color = Out("rgba8", "sRGB")


def combine(g: Graph, name: str, /, **inputs: Tex) -> Tex:
    """Add :class:`Combine`, or with the ports of a specular signal :class:`CombineGlossy`."""
    if "in_specular" in inputs:
        return g.add(CombineGlossy(defines=GLOSSY), name, **inputs).out_color
    return g.add(Combine(), name, **inputs).out_color


def modulate(g: Graph, **inputs: Tex) -> Tex:
    """Add :class:`Modulate`, or with a port of specular light :class:`ModulateGlossy`."""
    if "in_specular" in inputs or "in_specular_albedo" in inputs:
        return g.add(ModulateGlossy(defines=GLOSSY), "modulate", **inputs).out_radiance
    return g.add(Modulate(), **inputs).out_radiance


def tonemap(g: Graph, radiance: Tex, p: Display, exposure: Tex | None = None) -> Tex:
    """Add exposure and tone curve; ``exposure``: the measured one, on top of which that of ``p`` comes."""
    scale, operator = 2.0**p.exposure, OPERATORS[p.tonemap]
    if exposure is None:
        return g.add(Tonemap(u_scale=scale, defines={"OPERATOR": operator}), in_radiance=radiance).out_color
    work = MeasuredTonemap(u_scale=scale, defines={"OPERATOR": operator, "MEASURED": 1})
    return g.add(work, "tonemap", in_radiance=radiance, in_exposure=exposure).out_color
