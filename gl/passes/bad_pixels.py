"""NaN and infinity made visible: painted over the picture, and counted.

The filters replace a bad sample by what history and neighbours say, so that it never shows. Hence both ends are tested:
the samples that come in, and the radiance that goes to the tone map.
"""

from __future__ import annotations

from typing import Final

from gl.graph import ComputePass, Graph, In, Out, Outputs, Tex

TILE: Final = 32
"""Side in pixels of what one work group looks at, with one invocation per column."""


class MarkBad(ComputePass):
    """Paint pixels bright red whose radiance is NaN or infinite, dark red where only the sample was; count both."""

    shader = "display/mark_bad.comp"
    group = (1, 1)
    in_color = In("tone-mapped colour, linear")
    in_radiance = In("linear radiance before the tone map")
    in_direct = In("noisy irradiance", optional=True)
    in_indirect = In("noisy irradiance", optional=True)
    out_count = Out("rg32ui", "pixels of the tile with x: a bad sample; y: bad radiance", divisor=TILE)
    out_color = Out("rgba16f", "the colour, red where it is bad, linear")


class MarkBadGlossy(MarkBad):
    """The same, with one noisy signal more."""

    in_specular = In("noisy specular light over its albedo")


def mark_bad(g: Graph, color: Tex, radiance: Tex, samples: dict[str, Tex]) -> Outputs:
    """Add the marks to ``color``, which must be after everything with a history, and the count.

    ``samples``: ``in_direct``, ``in_indirect`` and ``in_specular`` where there is one, or nothing for a picture that is
    not filtered from samples.
    """
    glossy = "in_specular" in samples
    work = MarkBadGlossy(defines={"TILE": TILE, "GLOSSY": 1}) if glossy else MarkBad(defines={"TILE": TILE})
    return g.add(work, "mark_bad", in_color=color, in_radiance=radiance, **samples)
