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
def lobe_albedo(base, metallic, x, y):  # type: ignore[no-untyped-def]
    """Directional albedo of the specular lobe in one channel, at least :data:`LEAST`; x, y: of the table."""
    return max(head_on(base, metallic) * (x - y) + y, LEAST)


@device
def diffuse_share(z):  # type: ignore[no-untyped-def]
    """What the Fresnel term of a dielectric leaves for its diffuse base, averaged over the light's directions."""
    return (_ONE - DIELECTRIC) * (_ONE - z)


@device
def albedos(table, r, g, b, metallic, roughness, cosine):  # type: ignore[no-untyped-def]
    """Diffuse (3) and specular (3) directional albedo of base colour (r, g, b) seen at ``cosine``."""
    x, y, z = look_up(table, cosine, roughness)
    base = diffuse_share(z) * (_ONE - metallic)
    return (
        r * base,
        g * base,
        b * base,
        lobe_albedo(r, metallic, x, y),
        lobe_albedo(g, metallic, x, y),
        lobe_albedo(b, metallic, x, y),
    )


@device
def lobe_probability(dr, dg, db, sr, sg, sb):  # type: ignore[no-untyped-def]
    """How often a path follows the lobe: as its part of the light reflected, between a tenth and nine tenths.

    Never 0 or 1: each signal is filtered by itself, and must not be black where its neighbours are not.
    """
    diffuse = _RED * dr + _GREEN * dg + _BLUE * db
    specular = _RED * sr + _GREEN * sg + _BLUE * sb
    return min(max(specular / (specular + diffuse), _LEAST_SHARE), _LARGEST_SHARE)
