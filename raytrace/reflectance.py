"""What a surface of glTF's model reflects in all, split into its diffuse and its specular part, compiled.

The two parts are the divisors of the signals that filters see, and decide how often a path follows which.
"""

from __future__ import annotations

import numpy as np

from raytrace.brdf import DIELECTRIC
from raytrace.compilation import device
from raytrace.directional_albedo import look_up

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_RED, _GREEN, _BLUE = np.float32(0.2126), np.float32(0.7152), np.float32(0.0722)
_LEAST_SHARE, _LARGEST_SHARE = np.float32(0.1), np.float32(0.9)

LEAST = np.float32(1e-3)
"""Least divisor of the specular signal: what a channel reflects below it is lost in any picture."""


@device
def head_on(base, metallic):  # type: ignore[no-untyped-def]
    """F0 of one colour channel: that of a dielectric, or a metal's base colour."""
    return DIELECTRIC + metallic * (base - DIELECTRIC)


@device
def lobe_albedo(reflectance, x, y):  # type: ignore[no-untyped-def]
    """Directional albedo of a lobe of that F0; x, y: of the table."""
    return reflectance * (x - y) + y


@device
def base_share(metallic, x, y):  # type: ignore[no-untyped-def]
    """What metal, and the lobe over what is none, leave for the diffuse base."""
    return (_ONE - metallic) * (_ONE - lobe_albedo(DIELECTRIC, x, y))


@device
def albedos(table, r, g, b, metallic, roughness, cosine):  # type: ignore[no-untyped-def]
    """Diffuse (3) and specular (3) directional albedo of base colour (r, g, b) seen at ``cosine``; the latter at least
    :data:`LEAST`."""
    x, y = look_up(table, cosine, roughness)
    base = base_share(metallic, x, y)
    return (
        r * base,
        g * base,
        b * base,
        max(lobe_albedo(head_on(r, metallic), x, y), LEAST),
        max(lobe_albedo(head_on(g, metallic), x, y), LEAST),
        max(lobe_albedo(head_on(b, metallic), x, y), LEAST),
    )


@device
def lobe_probability(dr, dg, db, sr, sg, sb):  # type: ignore[no-untyped-def]
    """How often a path follows the lobe: as its part of the light reflected, between a tenth and nine tenths.

    Never 0 or 1: each signal is filtered by itself, and must not be black where its neighbours are not.
    """
    diffuse = _RED * dr + _GREEN * dg + _BLUE * db
    specular = _RED * sr + _GREEN * sg + _BLUE * sb
    return min(max(specular / (specular + diffuse), _LEAST_SHARE), _LARGEST_SHARE)
