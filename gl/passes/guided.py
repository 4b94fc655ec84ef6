"""Guided filter. He et al. 2010, "Guided Image Filtering"; for path tracing Bauszat et al. 2011, "Guided Image
Filtering for Interactive High-quality Global Illumination".

In every window the colour is taken for a linear function of the guide, by least squares with a penalty ``epsilon`` on
its slopes; a pixel gets the mean of what the functions of all windows say that hold it. The guide is made of normal and
depth, four numbers, so the picture has edges where these have, and is smooth in between.

Deviations from the papers:

* Depth is brought to the width of the window before the penalty, so that nothing depends on the scene's unit.
* Sums over windows are taken along rows, then along columns, of differences from the middle pixel, and put together as
  Chan et al. 1979, "Updating Formulae and a Pairwise Algorithm for Computing Sample Variances", do it. Box sums of
  squares, as in the papers, cancel in single precision.
* Pixels without a finite sample or without a surface take no part. Negative colours become 0.
* Bauszat et al. filter direct and indirect light apart, and share the windows' work between pixels that are far apart.
"""

from __future__ import annotations

from config import Guided
from gl.graph import FragmentPass, Graph, In, Out, Tex, Uniform
from gl.passes.temporal import SAMPLE as COLOR

SURFACE = "xyz: shading normal, world; w: depth, scene units"
ROW_COLOR = "rgb: mean colour of the row; a: number of its samples"
ROW_GUIDE = "mean guide of the row, relative to its middle pixel's"
VARIANCE, ACROSS = "variance of the guide's components", "their covariances xy, xz, xw, yz"
DEPTH = "covariances yw, zw"
SLOPES = "slopes of a channel of the colour with the guide"
VALUE = "rgb: what the function says at the pixel's guide; a: 1, or 0 where there is none"


class GuidedRows(FragmentPass):
    """Mean and covariances along a piece of a row."""

    shader = "spatial/guided_rows.frag"
    in_color = In(COLOR)
    in_surface = In(SURFACE)
    out_guide = Out("rgba32f", ROW_GUIDE)
    out_color = Out("rgba32f", ROW_COLOR)
    out_variance = Out("rgba32f", VARIANCE)
    out_across = Out("rgba32f", ACROSS)
    out_depth = Out("rg32f", DEPTH)
    out_red = Out("rgba32f", "covariances of the guide with red")
    out_green = Out("rgba32f", "covariances of the guide with green")
    out_blue = Out("rgba32f", "covariances of the guide with blue")
    u_radius = Uniform("int", "> 0, half the window's side, pixels")


class GuidedFit(FragmentPass):
    """The linear function of every window (He et al. 2010, eq. 5 and 6)."""

    shader = "spatial/guided_fit.frag"
    in_color = In(ROW_COLOR)
    in_guide = In(ROW_GUIDE)
    in_variance = In(VARIANCE)
    in_across = In(ACROSS)
    in_depth = In(DEPTH)
    in_red = In("covariances of the guide with red")
    in_green = In("covariances of the guide with green")
    in_blue = In("covariances of the guide with blue")
    in_surface = In(SURFACE)
    out_red = Out("rgba32f", SLOPES)
    out_green = Out("rgba32f", SLOPES)
    out_blue = Out("rgba32f", SLOPES)
    out_color = Out("rgba32f", VALUE)
    u_radius = Uniform("int", "> 0, half the window's side, pixels")
    u_epsilon = Uniform("float", "> 0, penalty on the slopes, as variance of the guide")
    u_pixel_size = Uniform("float", "> 0, scene units a pixel is wide at depth 1")


class GuidedMean(FragmentPass):
    """Mean of the functions along a column, and what it says of the pixel's guide (He et al. 2010, eq. 8)."""

    shader = "spatial/guided_mean.frag"
    in_red = In(SLOPES)
    in_green = In(SLOPES)
    in_blue = In(SLOPES)
    in_color = In("rgb: what the function says at the pixel's guide; a: number of windows")
    in_surface = In(SURFACE)
    in_sample = In("what is filtered, for pixels that no window holds", optional=True)
    out_color = Out("rgba16f", COLOR)
    u_radius = Uniform("int", "> 0, half the window's side, pixels")


class GuidedMeanRows(GuidedMean):
    """Mean of the functions along a row, with their number in alpha."""

    out_red = Out("rgba32f", SLOPES)
    out_green = Out("rgba32f", SLOPES)
    out_blue = Out("rgba32f", SLOPES)


def guided(g: Graph, color: Tex, surface: Tex, p: Guided, pixel_size: float) -> Tex:
    """Add the filter's four passes; returns the filtered colour."""
    rows = g.add(GuidedRows(u_radius=p.radius), "rows", in_color=color, in_surface=surface)
    fit = g.add(
        GuidedFit(u_radius=p.radius, u_epsilon=p.epsilon, u_pixel_size=pixel_size),
        "fit",
        in_color=rows.out_color,
        in_guide=rows.out_guide,
        in_variance=rows.out_variance,
        in_across=rows.out_across,
        in_depth=rows.out_depth,
        in_red=rows.out_red,
        in_green=rows.out_green,
        in_blue=rows.out_blue,
        in_surface=surface,
    )
    mean = g.add(
        GuidedMeanRows(u_radius=p.radius, defines={"AXIS": 1}, formats={"out_color": "rgba32f"}),
        "mean_rows",
        in_red=fit.out_red,
        in_green=fit.out_green,
        in_blue=fit.out_blue,
        in_color=fit.out_color,
        in_surface=surface,
    )
    return g.add(
        GuidedMean(u_radius=p.radius, defines={"AXIS": 2}),
        "mean",
        in_red=mean.out_red,
        in_green=mean.out_green,
        in_blue=mean.out_blue,
        in_color=mean.out_color,
        in_surface=surface,
        in_sample=color,
    ).out_color
