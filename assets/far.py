"""The interior, 10^5 m from the origin: what a node's transform in a file may do to a scene.

There because single precision has 8 mm to spare at that distance: positions, motion vectors and histories must come out
as they do at home.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from assets import interior
from assets.motion import Point
from raytrace.camera import Camera
from raytrace.scene import F64, Mesh, Motion, Scene

OFFSET: Point = (1e5, -1e5, 1e5)


def build(*, animate: bool = False) -> Scene:
    """As :func:`assets.interior.build`."""
    home = interior.build(animate=animate)
    assert home.flight is not None
    flight = home.flight
    return replace(
        home,
        name="far",
        meshes=tuple(_moved(mesh) for mesh in home.meshes),
        camera=_seen_from(home.camera),
        flight=lambda time: _seen_from(flight(time)),
    )


def _moved(mesh: Mesh) -> Mesh:
    if mesh.motion is None:
        return replace(mesh, vertices=mesh.vertices + np.array(OFFSET))
    return replace(mesh, motion=_carried(mesh.motion))


def _carried(motion: Motion) -> Motion:
    def at(time: float) -> F64:
        matrix = motion(time).copy()
        matrix[:3, 3] += OFFSET
        return matrix

    return at


def _seen_from(camera: Camera) -> Camera:
    x, y, z = (float(c) for c in np.array(camera.position) + OFFSET)
    return replace(camera, position=(x, y, z))
