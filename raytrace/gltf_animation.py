"""Animations of a glTF file: where a node is at a time. glTF 2.0, sec. 3.11 and appendix C.

All animations of a file run together, from time 0, over and over; the longest gives the cycle. Positions and rotations
move. Scales do not, since motion vectors and the second acceleration structure are those of rigid bodies.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errors import Notices
from raytrace.gltf_file import COMPONENT_BYTES, COMPONENTS, Entry, GltfFile
from raytrace.parts import F64
from raytrace.repair import counted

Track = Callable[[float], F64]
"""Value at a time in seconds: (3,) translation, or (4,) rotation, a unit quaternion x, y, z, w."""

_WIDTHS = {"translation": "VEC3", "rotation": "VEC4"}
_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}


@dataclass
class Animations:
    """``tracks``: by node number and path. ``cycle``: seconds after which all begins again, 0 where nothing moves."""

    tracks: dict[tuple[int, str], Track] = field(default_factory=dict)
    cycle: float = 0.0

    def moves(self, node: int) -> bool:
        """Whether the node has a motion of its own."""
        return any((node, path) in self.tracks for path in _WIDTHS)

    def value(self, node: int, path: str, time: float, rest: tuple[float, ...]) -> tuple[float, ...]:
        """Translation or rotation of a node at ``time``, ``rest`` where that is not animated."""
        track = self.tracks.get((node, path))
        if track is None:
            return rest
        return tuple(track(math.fmod(time, self.cycle) if self.cycle > 0.0 else 0.0).tolist())


def read_animations(file: GltfFile, notices: Notices) -> Animations:
    """Every animation of translations and rotations; what else is animated is counted in ``notices``.

    Raises UserError for keyframes that are missing, out of order or not finite.
    """
    result = Animations()
    left_out: Counter[str] = Counter()
    for number in range(file.size("animations")):
        animation = file.entry("animations", number, "the file")
        where = f"animation {str(animation.get('name', number))!r}"
        samplers = file.tables(animation, "samplers", where)
        for channel in file.tables(animation, "channels", where):
            target = file.table(channel, "target", where)
            path = str(target.get("path"))
            if "node" not in target:
                continue  # the specification asks to ignore it; an extension may mean something else
            file.entry("nodes", target["node"], where)
            key = (int(target["node"]), path)
            if path not in _WIDTHS:
                left_out[path] += 1
            elif key in result.tracks:
                left_out["second animation of one node"] += 1
            else:
                index = file.whole(channel, "sampler", -1 if "sampler" in channel else 0, where)
                if index >= len(samplers):
                    raise file.error(f"{where} refers to sampler {index}, but has {len(samplers)}")
                times, track = _read_track(file, samplers[index], path, where)
                result.tracks[key] = track
                result.cycle = max(result.cycle, float(times[-1]))
    if left_out["scale"]:
        notices.add(f"{counted(left_out.pop('scale'), 'animated scale')} left out: only rigid motion is traced")
    for what, count in left_out.items():
        if count:
            notices.add(f"animation left out: {what} ({count})")
    return result


def _read_track(file: GltfFile, sampler: Entry, path: str, where: str) -> tuple[F64, Track]:
    """Key times (n,) and the interpolation between the keys."""
    kind = str(sampler.get("interpolation", "LINEAR"))
    if kind not in ("LINEAR", "STEP", "CUBICSPLINE"):
        raise file.error(f"{where} has the interpolation {kind}")
    times = _floats(file, sampler.get("input"), "SCALAR", f"the key times of {where}")[:, 0]
    values = _floats(file, sampler.get("output"), _WIDTHS[path], f"the {path} keys of {where}")
    parts = 3 if kind == "CUBICSPLINE" else 1
    if len(times) == 0 or len(values) != parts * len(times):
        raise file.error(f"{where} has {len(times)} key times for {len(values)} values ({kind})")
    if times[0] < 0.0 or (np.diff(times) <= 0.0).any():
        raise file.error(f"the key times of {where} do not rise")
    rotates = path == "rotation"
    if rotates and (np.linalg.norm(values[parts // 2 :: parts], axis=1) < 1e-6).any():
        raise file.error(f"{where} has a rotation that is a quaternion of length 0")
    if kind == "CUBICSPLINE":
        return times, _cubic(times, values.reshape(len(times), 3, -1), rotates)
    return times, _between(times, values, rotates, steps=kind == "STEP")


def _between(times: F64, values: F64, rotates: bool, steps: bool) -> Track:
    keys = _unit(values) if rotates else values

    def at(time: float) -> F64:
        i, t, _ = _segment(times, time)
        if steps or t == 0.0:
            key: F64 = keys[i] if t < 1.0 else keys[i + 1]
            return key
        return _slerp(keys[i], keys[i + 1], t) if rotates else (1.0 - t) * keys[i] + t * keys[i + 1]

    return at


def _cubic(times: F64, values: F64, rotates: bool) -> Track:
    """Hermite splines; ``values`` (n, 3, k): tangent into each key, the key, tangent out of it. Appendix C.5."""

    def at(time: float) -> F64:
        i, t, length = _segment(times, time)
        if t == 0.0:
            result: F64 = values[i, 1]
        else:
            square, cube = t * t, t * t * t
            result = (2 * cube - 3 * square + 1) * values[i, 1] + (cube - 2 * square + t) * length * values[i, 2]
            result = result + (3 * square - 2 * cube) * values[i + 1, 1] + (cube - square) * length * values[i + 1, 0]
        return _unit(result) if rotates else result

    return at


def _segment(times: F64, time: float) -> tuple[int, float, float]:
    """The key before ``time``, the part of the way to the next in [0, 1], and the seconds between; held at the ends."""
    if len(times) == 1 or time <= times[0]:
        return 0, 0.0, 0.0
    i = min(int(np.searchsorted(times, time, side="right")) - 1, len(times) - 2)
    length = float(times[i + 1] - times[i])
    return i, min((time - float(times[i])) / length, 1.0), length


def _slerp(a: F64, b: F64, t: float) -> F64:
    """The shorter way from one rotation to another. Appendix C.4."""
    cosine = float(a @ b)
    if cosine < 0.0:
        b, cosine = -b, -cosine
    if cosine > 1.0 - 1e-9:
        return _unit((1.0 - t) * a + t * b)
    angle = math.acos(cosine)
    result: F64 = (math.sin((1.0 - t) * angle) * a + math.sin(t * angle) * b) / math.sin(angle)
    return result


def _unit(quaternions: F64) -> F64:
    result: F64 = quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)
    return result


def _floats(file: GltfFile, index: object, kind: str, user: str) -> F64:
    """All elements of an accessor, (n, k) float64; integers are fractions of their largest (sec. 3.11)."""
    entry = file.accessor(index, kind, user)
    component = int(entry["componentType"])
    size = COMPONENTS[kind] * COMPONENT_BYTES[component]
    count, start = int(entry.get("count", 0)), int(entry.get("byteOffset", 0))
    stride = int(file.entry("bufferViews", entry["bufferView"], user).get("byteStride", 0)) or size
    data = file.view(entry["bufferView"], user)
    values: NDArray[Any] = np.ndarray(
        (count, COMPONENTS[kind]), _DTYPES[component], data, start, (stride, COMPONENT_BYTES[component])
    )
    result = values.astype(np.float64)
    if values.dtype.kind in "iu":
        result = np.maximum(result / np.iinfo(values.dtype).max, -1.0)
    if not np.isfinite(result).all():
        raise file.error(f"{user} are NaN or infinite")
    return result
