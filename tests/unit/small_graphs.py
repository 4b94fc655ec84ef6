"""Passes and graphs that the tests of the graph and of its plans share."""

from __future__ import annotations

from gl.graph import ComputePass, FragmentPass, Graph, In, Out, Prev, Tex, Uniform

COLOR = "rgba16f"


class Source(FragmentPass):
    shader = "t/source.frag"
    out_color = Out(COLOR, "c")


class Blur(FragmentPass):
    shader = "t/blur.frag"
    in_color = In("colour to blur")
    out_color = Out(COLOR, "c")
    u_step = Uniform("int", "[1;] distance of the taps in pixels")


class Temporal(FragmentPass):
    shader = "t/temporal.frag"
    in_color = In("c")
    in_mask = In("m", optional=True)
    prev_color = Prev("accumulated colour")
    out_color = Out(COLOR, "c")
    out_moments = Out("rg32f", "m")


class Tiles(ComputePass):
    shader = "t/tiles.comp"
    in_color = In("c")
    out_small = Out("r32f", "s", divisor=3)


class Show(FragmentPass):
    shader = "t/show.frag"
    in_color = In("c")
    out_color = Out("rgba8", "d")


def blur(g: Graph, tex: Tex, name: str | None = None) -> Tex:
    return g.add(Blur(u_step=1), name, in_color=tex).out_color


def example(history_read: bool = True) -> Graph:
    """import -> temporal (history fed by the first blur) -> 3 blurs -> show; one pass that nobody needs."""
    g = Graph()
    noisy = g.import_("noisy", "rgba32f")
    with g.scope("svgf"):
        if history_read:
            history = g.history("svgf.color", COLOR)
            x = g.add(Temporal(), in_color=noisy, prev_color=history).out_color
            for i in range(3):
                x = blur(g, x)
                if i == 0:
                    g.feed(history, x)
        else:
            x = blur(g, noisy)
    blur(g, x, "debug")
    g.output("display", g.add(Show(), in_color=x).out_color)
    return g
