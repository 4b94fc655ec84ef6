"""Frame packets to the images of a recorded frame, and back.

What the files do not hold is derived: motion vectors, and depth where it is not there, from positions and matrices,
slopes of depth from depths and normals.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bench.recording.layout import FPS, IMAGES
from bench.recording.view import View, slopes
from raytrace.frame import MISS, FramePacket

F32 = NDArray[np.float32]

SKY_DISTANCE: Final = 100.0
"""Of the position written where a ray leaves the scene, in diameters of the scene."""

MISS_BELOW: Final = 0.25
"""Squared length of normals up to which a pixel is a miss, which has none."""

_UNIT: Final = 1e-5  # of a squared normal: nearer to 1 it counts as a unit vector and keeps its bits
_ONE: Final = np.float32(1.0)


def images_of(packet: FramePacket, eye: NDArray[np.float64], extent: float) -> dict[str, F32]:
    """The images of ``packet`` by their names in :data:`IMAGES`, (H, W, 3 or 1) float32, row 0 at the bottom.

    ``eye`` (3,): the camera's place, relative to the scene's origin; ``extent``: the scene's diameter. Positions are
    relative to the origin. The packet must have them: raises ValueError otherwise.
    """
    if packet.position is None or packet.prev_position is None:
        raise ValueError("a frame without positions cannot be recorded")
    missed = (packet.motion[..., 3] < 0.0)[..., None]
    sky = _sky(packet, eye, SKY_DISTANCE * extent)
    found = {
        "color": packet.direct[..., :3] + packet.indirect[..., :3],
        "albedo": np.where(missed, _ONE, packet.albedo[..., :3]),
        "shading_normal": packet.surface[..., :3],
        "world_position": np.where(missed, sky, packet.position[..., :3]),
        "object_id": packet.motion[..., 3:4],
        "depth": np.concatenate([packet.surface[..., 3:4], packet.gradient], axis=2),
    }
    if packet.prev_normal is not None:  # something moves
        found["prev_position"] = np.where(missed, sky, packet.prev_position[..., :3])
    if packet.specular_albedo is not None:
        found["roughness"] = packet.specular_albedo[..., 3:4]
    if packet.temporal_gradient is not None:
        found["carried"] = packet.direct[..., 3:4]
    for name, image in IMAGES.items():
        values = getattr(packet, image.field) if image.field else None
        if values is not None:
            found[name] = values[..., : image.channels]
    return found


def _sky(packet: FramePacket, eye: NDArray[np.float64], distance: float) -> F32:
    """The point at ``distance`` along the ray of each pixel."""
    width, height = packet.size
    right, up, forward = (np.array(axis) * packet.pixel_size for axis in packet.basis)
    x = np.arange(width) + 0.5 + packet.jitter[0] - width / 2
    y = np.arange(height) + 0.5 + packet.jitter[1] - height / 2
    rays = forward / packet.pixel_size + x[None, :, None] * right + y[:, None, None] * up
    rays *= distance / np.linalg.norm(rays, axis=2, keepdims=True)
    return np.asarray(eye + rays, dtype=np.float32)


def packet_of(
    index: int, images: Mapping[str, F32], view: View, before: View, cut: bool, scene: str, scene_id: int
) -> FramePacket:
    """The frame packet of recorded ``images``; ``view`` and ``before``: this frame's camera and that of the last."""
    normal = images["shading_normal"]
    squared = np.square(normal).sum(axis=2)
    hit = squared > MISS_BELOW
    if "object_id" in images:
        hit &= images["object_id"][..., 0] >= 0.0
    off = hit & (np.abs(squared - 1.0) > _UNIT)  # rounded to half precision, say
    if off.any():
        normal = np.where(off[..., None], normal / np.sqrt(np.where(hit, squared, 1.0))[..., None], normal)
    position = images["world_position"]
    objects = images["object_id"][..., 0] if "object_id" in images else np.zeros(hit.shape, np.float32)
    surface = np.zeros((*hit.shape, 4), np.float32)
    surface[hit, :3] = normal[hit]
    with np.errstate(all="ignore"):  # a miss may have any position
        depth = images["depth"][..., 0] if "depth" in images else view.project(position)[2]
        surface[hit, 3] = depth[hit]
        motion = _motion(view, before, position, images.get("prev_position", position), hit)
        given = images["depth"][..., 1:] * hit[..., None] if "depth" in images else None
        gradient = slopes(view, depth, surface[..., :3], hit) if given is None else given
    motion[..., 3] = np.where(hit, objects, np.float32(MISS))
    fields = _fields(images, hit)
    if "direct" not in images or "indirect" not in images:
        fields["direct"] = _with_alpha(images["color"], 1.0)
        fields["indirect"] = _with_alpha(np.zeros_like(images["color"]), 1.0)
    if "roughness" in images:
        fields["specular_albedo"][..., 3] = images["roughness"][..., 0]
    if "carried" in images:
        for signal in ("direct", "indirect", "specular"):
            if signal in fields:
                fields[signal][..., 3] = images["carried"][..., 0]
    fields.setdefault("emission", np.zeros((*hit.shape, 4), np.float32))
    albedo = np.where(hit[..., None], images["albedo"], np.float32(0.0))
    return FramePacket(
        index=index,
        time=index / FPS,
        albedo=_with_alpha(albedo, hit),
        surface=surface,
        gradient=gradient,
        motion=motion,
        scene=scene,
        scene_id=scene_id,
        cut=cut,
        pixel_size=view.pixel_size,
        basis=view.basis,
        jitter=view.jitter,
        **fields,
    )


def _fields(images: Mapping[str, F32], hit: NDArray[np.bool_]) -> dict[str, Any]:
    """The images that are fields of a packet as they stand."""
    found: dict[str, Any] = {}
    for name, values in images.items():
        image = IMAGES[name]
        if image.field:
            alpha = hit if image.alpha is None else image.alpha
            found[image.field] = _with_alpha(values, alpha) if image.channels == 3 else values
    return found


def _with_alpha(rgb: F32, alpha: NDArray[np.bool_] | float) -> F32:
    out = np.empty((*rgb.shape[:2], 4), np.float32)
    out[..., :3] = rgb
    out[..., 3] = alpha
    return out


def _motion(view: View, before: View, position: F32, previous: F32, hit: NDArray[np.bool_]) -> F32:
    """Previous uv minus uv, and the depth expected there; w is left 0. See :class:`raytrace.frame.FramePacket`."""
    half, out_of_view = np.float32(0.5), np.float32(2.0)
    out = np.zeros((*hit.shape, 4), np.float32)
    ax, ay, aw = view.project(position)
    bx, by, bw = before.project(previous)
    if not hit.all():
        rays = view.rays()
        sky = view.project(rays, at_infinity=True), before.project(rays, at_infinity=True)
        (ax, ay, aw), (bx, by, bw) = (
            tuple(np.where(hit, near, far) for near, far in zip(these, those, strict=True))
            for these, those in (((ax, ay, aw), sky[0]), ((bx, by, bw), sky[1]))
        )
    seen = (bw > 0.0) & (aw > 0.0)
    out[..., 0] = np.where(seen, half * (bx / bw - ax / aw), out_of_view)
    out[..., 1] = np.where(seen, half * (by / bw - ay / aw), out_of_view)
    out[..., 2] = np.where(hit, bw, np.float32(0.0))
    return out
