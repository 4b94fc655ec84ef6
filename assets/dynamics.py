"""Cornell boxes in which something changes: what filters that accumulate over time are tested on.

Time is in seconds, a frame is 1/30 s. None of them is in the list of scenes; the benchmark opens them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from assets import cornell
from assets.motion import slide, spin
from assets.shapes import block
from raytrace.scene import Mesh, Scene

FPS = 30.0
FLICKER, OFF, ON = (10, 26), (32, 44), 44
"""Frames in which the lamp of :func:`switching` flickers, in which it is off, and from which on it is on again."""

_FLICKER = (1.0, 0.55, 0.8, 0.35, 0.95, 0.6, 0.25, 0.7)
"""Shares of full power, two frames each; made up."""


def still() -> Scene:
    """Nothing moves."""
    return replace(cornell.build(), name="still")


def moving() -> Scene:
    """The lamp slides and the tall block swings, both back after 60 frames."""
    return replace(cornell.build(animate=True), name="moving")


def lamp_power(time: float) -> float:
    """Of the lamp in :func:`switching`: it flickers, goes on, is switched off and on again."""
    frame = round(time * FPS)
    if FLICKER[0] <= frame < FLICKER[1]:
        return _FLICKER[(frame - FLICKER[0]) // 2]
    return 0.0 if OFF[0] <= frame < OFF[1] else 1.0


def switching() -> Scene:
    """The lamp flickers, then is switched off and on."""
    return replace(dimmed(cornell.build(), lamp_power), name="switching")


def dimmed(scene: Scene, power: Callable[[float], float]) -> Scene:
    """``scene`` with lamps that give the share ``power`` of their light at each time."""
    materials = tuple(replace(m, dimmer=power) if m.emits else m for m in scene.materials)
    return replace(scene, materials=materials)


def off_in_frame_12(time: float) -> float:
    """Share of a lamp's light."""
    return float(round(time * FPS) < 12)


def swaying(time: float) -> float:
    """Share of a lamp's light: full, a fifth and full again in 24 frames."""
    return 0.6 + 0.4 * math.cos(2.0 * math.pi * time * FPS / 24)


def crossing() -> Scene:
    """A block crosses the picture in front of the others, to and fro in 60 frames, and its shadow with it."""
    scene = cornell.build()
    shape = block((-0.45, 0.01, -0.15), (0.45, 1.4, 0.15))
    white = next(i for i, m in enumerate(scene.materials) if m.name == "white")
    materials = np.full(len(shape.faces), white, np.int32)
    motion = slide((2.78, 0.0, 0.3), (1.8, 0.0, 0.0), 2.0)
    crosser = Mesh("crossing block", shape.vertices, shape.faces, materials, shape.normals, shape.uvs, motion)
    return replace(scene, name="crossing", meshes=(*scene.meshes, crosser))


def rotating() -> Scene:
    """The tall block turns once in 60 frames."""
    scene = cornell.build(animate=True)

    def resting(mesh: Mesh) -> Mesh:
        if mesh.motion is None:
            return mesh
        place = mesh.motion(0.0)
        x, y, z = (float(c) for c in place[:3, 3])
        if mesh.name == "tall block":
            return replace(mesh, motion=spin((x, y, z), 2.0))
        return replace(mesh, vertices=mesh.vertices @ place[:3, :3].T + place[:3, 3], motion=None)

    return replace(scene, name="rotating", meshes=tuple(resting(mesh) for mesh in scene.meshes))
