"""Temporal anti-aliasing. Karis 2014, "High Quality Temporal Supersampling" (SIGGRAPH, Advances in Real-Time
Rendering).

Runs on tone-mapped colour, as Schied et al. 2017 and Koskela et al. 2019 place it.

Deviations from the talk: the history is clipped towards the neighbourhood's mean rather than towards the box's centre,
and the motion vector is taken from the nearest surface of the diagonal cross only.
"""

from __future__ import annotations

from config import Taa
from gl.graph import FragmentPass, Graph, In, Out, Prev, Tex, Uniform
from gl.passes.temporal import Guides


class Resolve(FragmentPass):
    """Blend with the reprojected history, held inside the colours of the 3x3 neighbourhood."""

    shader = "taa/resolve.frag"
    in_color = In("rgb: tone-mapped colour, linear; a: 0 where there is none, and the history is all that is shown")
    in_motion = In("xy: previous uv - uv")
    in_surface = In("w: depth, scene units; 0 = sky")
    prev_color = Prev("what this pass wrote in the last frame")
    out_color = Out("rgba16f", "anti-aliased colour, linear")
    u_alpha = Uniform("float", "[0.01;1] weight of the new frame")


def taa(g: Graph, color: Tex, guides: Guides, p: Taa, name: str) -> Tex:
    """Add the resolve; ``name`` of what is displayed: its history starts anew when another method is shown."""
    history = g.history(f"taa.{name}", "rgba16f")
    resolved = g.add(
        Resolve(u_alpha=p.alpha, defines={"CLIP": int(p.clip)}),
        "taa",
        in_color=color,
        in_motion=guides.motion,
        in_surface=guides.surface,
        prev_color=history,
    )
    g.feed(history, resolved.out_color)
    return resolved.out_color
