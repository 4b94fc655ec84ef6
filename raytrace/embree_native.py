"""The Embree library inside embreex's wheel, called from compiled loops without Python in between.

Camera rays go as packets of 16, fixed blocks of 4x4 pixels, with Embree's coherent traversal; all other rays one by
one. Against ``EmbreeScene.run`` this traced camera rays 2.5 to 4.4 times and others 1.3 to 1.6 times as fast (a room of
154,000 triangles, an empty box; two cores).

Functions are bound by symbol name: compiled loops then hold no addresses and can be kept on disk. Layouts and constants
are those of Embree 4's ``rtcore_ray.h`` and ``rtcore_common.h``.
"""

from __future__ import annotations

import ctypes
import threading
from pathlib import Path
from typing import Any

import embreex
import numpy as np
from llvmlite import binding
from numba import types
from numpy.typing import NDArray

from raytrace.casting import RayCaster, meets_box
from raytrace.compilation import kernel

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]

_TRIANGLES, _INDICES, _VERTICES = 0, 0, 1  # RTC_GEOMETRY_TYPE_TRIANGLE, RTC_BUFFER_TYPE_INDEX, _VERTEX
_UINT3, _FLOAT3 = 0x5003, 0x9003  # RTC_FORMAT_*
_MEDIUM, _HIGH = 1, 2  # RTC_BUILD_QUALITY_*
_COHERENT = 1 << 16  # RTC_RAY_QUERY_FLAG_COHERENT
_NO_HIT = np.uint32(0xFFFFFFFF)

# Fields of a ray and its hit, in units of 4 bytes (of 64 in a packet of 16).
_ORIGIN, _NEAR, _DIRECTION, _TIME, _FAR, _MASK, _ID, _FLAGS = 0, 3, 4, 7, 8, 9, 10, 11
_U, _V, _PRIMITIVE, _GEOMETRY, _INSTANCE, _FIELDS = 15, 16, 17, 18, 19, 24

_INFINITY = np.float32(1e37)

_FUNCTIONS: dict[str, tuple[Any, list[Any]]] = {
    "rtcNewDevice": (ctypes.c_void_p, [ctypes.c_char_p]),
    "rtcReleaseDevice": (None, [ctypes.c_void_p]),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, [ctypes.c_void_p, ctypes.c_int]),
    "rtcGetDeviceError": (ctypes.c_int, [ctypes.c_void_p]),
    "rtcNewScene": (ctypes.c_void_p, [ctypes.c_void_p]),
    "rtcReleaseScene": (None, [ctypes.c_void_p]),
    "rtcCommitScene": (None, [ctypes.c_void_p]),
    "rtcSetSceneBuildQuality": (None, [ctypes.c_void_p, ctypes.c_int]),
    "rtcNewGeometry": (ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_int]),
    "rtcReleaseGeometry": (None, [ctypes.c_void_p]),
    "rtcCommitGeometry": (None, [ctypes.c_void_p]),
    "rtcAttachGeometryByID": (None, [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint]),
    "rtcSetNewGeometryBuffer": (
        ctypes.c_void_p,
        [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint, ctypes.c_int, ctypes.c_size_t, ctypes.c_size_t],
    ),
}
_CALLED_FROM_LOOPS = ("rtcIntersect1", "rtcOccluded1", "rtcIntersect16")

# Pointers are passed as integers of their size: the calling convention is the same, and Numba can compute with them.
_intersect_one = types.ExternalFunction("rtcIntersect1", types.void(types.uintp, types.uintp, types.uintp))
_occluded_one = types.ExternalFunction("rtcOccluded1", types.void(types.uintp, types.uintp, types.uintp))
_intersect_16 = types.ExternalFunction("rtcIntersect16", types.void(types.uintp, types.uintp, types.uintp, types.uintp))


class _Arguments(ctypes.Structure):
    """RTCIntersectArguments and RTCOccludedArguments, which begin alike."""

    _fields_ = (
        ("flags", ctypes.c_uint),
        ("feature_mask", ctypes.c_uint),
        ("context", ctypes.c_void_p),
        ("filter", ctypes.c_void_p),
        ("intersect", ctypes.c_void_p),
        ("unused", ctypes.c_uint64 * 4),
    )


def load_library() -> ctypes.CDLL | str:
    """The library with its functions declared, or the reason why it cannot be used."""
    folder = Path(embreex.__file__).resolve().parent.parent / "embreex.libs"
    threads, embree = sorted(folder.glob("libtbb*")), sorted(folder.glob("libembree4*"))
    if not embree:
        return f"no Embree library in {folder.name} of this wheel"
    try:
        for path in threads:
            ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
        library = ctypes.CDLL(str(embree[0]))
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
        for name in _CALLED_FROM_LOOPS:
            address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
            assert address is not None
            binding.add_symbol(name, address)
    except (OSError, AttributeError) as error:
        return f"{embree[0].name}: {error}"
    return library


def _aligned(shape: tuple[int, ...]) -> F32:
    """Zeros, float32, aligned to 64 bytes as packets of 16 need it."""
    count = int(np.prod(shape))
    store = np.zeros(count + 16, np.float32)
    start = (-store.ctypes.data // 4) % 16
    return store[start : start + count].reshape(shape)


@kernel
def _single(  # type: ignore[no-untyped-def]
    static, moving, box, arguments, buffer, bits, address, origins, directions, first_moving, triangle, u, v
):
    """Nearest hits of single rays. ``buffer`` (24,) float32, its ``bits`` as uint32, and its ``address``."""
    for i in range(origins.shape[0]):
        for k in range(3):
            buffer[_ORIGIN + k] = origins[i, k]
            buffer[_DIRECTION + k] = directions[i, k]
        buffer[_FAR] = _INFINITY
        bits[_GEOMETRY] = _NO_HIT
        if static != 0:
            _intersect_one(static, address, arguments)
        if moving != 0 and meets_box(origins, directions, i, buffer[_FAR], box):
            # The same ray goes on: it is now as long as its nearest hit, and a nearer one overwrites it.
            _intersect_one(moving, address, arguments)
        if bits[_GEOMETRY] == _NO_HIT:
            triangle[i] = -1
            u[i] = np.float32(0.0)
            v[i] = np.float32(0.0)
        else:
            triangle[i] = np.int32(bits[_PRIMITIVE]) + (first_moving if bits[_GEOMETRY] == np.uint32(1) else 0)
            u[i] = buffer[_U]
            v[i] = buffer[_V]


@kernel
def _packets(  # type: ignore[no-untyped-def]
    static, moving, arguments, buffer, bits, address, valid, valid_address, origins, directions, width, first_moving,
    triangle, u, v,
):  # fmt: skip
    """Nearest hits of rays that stand in rows of ``width``, by blocks of 4x4. ``buffer`` (24, 16) float32."""
    rows = origins.shape[0] // width
    for by in range(0, rows, 4):
        for bx in range(0, width, 4):
            for lane in range(16):
                x, y = bx + (lane & 3), by + (lane >> 2)
                inside = x < width and y < rows
                valid[lane] = -1 if inside else 0
                i = y * width + x if inside else by * width + bx
                for k in range(3):
                    buffer[_ORIGIN + k, lane] = origins[i, k]
                    buffer[_DIRECTION + k, lane] = directions[i, k]
                buffer[_FAR, lane] = _INFINITY
                bits[_GEOMETRY, lane] = _NO_HIT
            if static != 0:
                _intersect_16(valid_address, static, address, arguments)
            if moving != 0:
                _intersect_16(valid_address, moving, address, arguments)
            for lane in range(16):
                if valid[lane] == 0:
                    continue
                i = (by + (lane >> 2)) * width + bx + (lane & 3)
                if bits[_GEOMETRY, lane] == _NO_HIT:
                    triangle[i] = -1
                    u[i] = np.float32(0.0)
                    v[i] = np.float32(0.0)
                else:
                    moved = bits[_GEOMETRY, lane] == np.uint32(1)
                    triangle[i] = np.int32(bits[_PRIMITIVE, lane]) + (first_moving if moved else 0)
                    u[i] = buffer[_U, lane]
                    v[i] = buffer[_V, lane]


@kernel
def _shadow(  # type: ignore[no-untyped-def]
    static, moving, box, arguments, buffer, bits, address, origins, directions, limits, blocked
):
    """Occlusion of single rays: 0 where something is in the way, -1 where not."""
    for i in range(origins.shape[0]):
        for k in range(3):
            buffer[_ORIGIN + k] = origins[i, k]
            buffer[_DIRECTION + k] = directions[i, k]
        buffer[_FAR] = limits[i]
        if moving != 0 and meets_box(origins, directions, i, limits[i], box):
            _occluded_one(moving, address, arguments)
        if static != 0 and buffer[_FAR] >= np.float32(0.0):
            _occluded_one(static, address, arguments)
        # Embree sets the end of a blocked ray to -infinity.
        blocked[i] = 0 if buffer[_FAR] < np.float32(0.0) else -1


class _Scene:
    """Triangles in an Embree scene of their own. ``geometry``: the id that its hits carry."""

    def __init__(self, library: ctypes.CDLL, device: int, corners: F32, geometry: int, quality: int) -> None:
        """``corners`` (T, 9) float32. ``quality``: high is built in five times the time, with triangles split where
        that helps: 6 % less time for a frame of a room of 161,000 triangles, 0.2 s more to build it."""
        self._library = library
        count = len(corners)
        shape = library.rtcNewGeometry(device, _TRIANGLES)
        target = library.rtcSetNewGeometryBuffer(shape, _VERTICES, 0, _FLOAT3, 12, count * 3)
        values = np.ascontiguousarray(corners, dtype=np.float32)
        ctypes.memmove(target, values.ctypes.data, values.nbytes)
        target = library.rtcSetNewGeometryBuffer(shape, _INDICES, 0, _UINT3, 12, count)
        order = np.arange(count * 3, dtype=np.uint32)
        ctypes.memmove(target, order.ctypes.data, order.nbytes)
        library.rtcCommitGeometry(shape)
        self.handle: int = library.rtcNewScene(device)
        library.rtcSetSceneBuildQuality(self.handle, quality)
        library.rtcAttachGeometryByID(self.handle, shape, geometry)
        library.rtcReleaseGeometry(shape)
        library.rtcCommitScene(self.handle)
        if code := library.rtcGetDeviceError(device):
            raise RuntimeError(f"Embree could not build a scene of {count} triangles (error {code})")

    def release(self) -> None:
        if self.handle:
            self._library.rtcReleaseScene(self.handle)
            self.handle = 0


class _Buffers(threading.local):
    """Ray structures of one thread.

    What Embree only reads and no ray changes (nearest distance, time, mask, id, flags) is set here once.
    """

    def __init__(self) -> None:
        self.ray, self.packet = _aligned((_FIELDS,)), _aligned((_FIELDS, 16))
        self.valid = _aligned((16,)).view(np.int32)
        self.ray_bits, self.packet_bits = self.ray.view(np.uint32), self.packet.view(np.uint32)
        for bits in (self.ray_bits, self.packet_bits):
            bits[_MASK] = _NO_HIT
            bits[_PRIMITIVE:] = _NO_HIT


class NativeCaster(RayCaster):
    """``triangles`` (T, >= 9) float32: corners in the first nine columns; the first ``static_count`` never move."""

    name = "Embree's library, packets of 16 for camera rays"

    def __init__(self, library: ctypes.CDLL, triangles: F32, static_count: int) -> None:
        super().__init__()
        self._library = library
        self._device: int = library.rtcNewDevice(None)
        self._static_count = static_count
        self._static = _Scene(library, self._device, triangles[:static_count, :9], 0, _HIGH) if static_count else None
        self._moving: _Scene | None = None
        self._box = np.zeros((2, 3), np.float32)
        self._buffers = _Buffers()
        # Every feature allowed: a mask of less would have to follow what the scene holds.
        self._single_arguments = _Arguments(0, 0xFFFFFFFF)
        self._packet_arguments = _Arguments(_COHERENT, 0xFFFFFFFF)

    def move(self, triangles: F32, box: F32) -> None:
        if self._moving is not None:
            self._moving.release()
        self._moving = _Scene(self._library, self._device, triangles[self._static_count :, :9], 1, _MEDIUM)
        self._box = box

    def _handles(self) -> tuple[int, int]:
        return self._static.handle if self._static else 0, self._moving.handle if self._moving else 0

    def intersect(self, origins: F32, directions: F32) -> tuple[I32, F32, F32]:
        triangle, u, v = _results(len(origins))
        b = self._buffers
        with self.clock.running():
            _single(
                *self._handles(), self._box, ctypes.addressof(self._single_arguments), b.ray, b.ray_bits,
                b.ray.ctypes.data, origins, directions, self._static_count, triangle, u, v,
            )  # fmt: skip
        return triangle, u, v

    def intersect_rows(self, origins: F32, directions: F32, width: int) -> tuple[I32, F32, F32]:
        triangle, u, v = _results(len(origins))
        b = self._buffers
        with self.clock.running():
            _packets(
                *self._handles(), ctypes.addressof(self._packet_arguments), b.packet, b.packet_bits,
                b.packet.ctypes.data, b.valid, b.valid.ctypes.data, origins, directions, width, self._static_count,
                triangle, u, v,
            )  # fmt: skip
        return triangle, u, v

    def occluded(self, origins: F32, directions: F32, limits: F32) -> I32:
        blocked = np.empty(len(origins), np.int32)
        b = self._buffers
        with self.clock.running():
            _shadow(
                *self._handles(), self._box, ctypes.addressof(self._single_arguments), b.ray, b.ray_bits,
                b.ray.ctypes.data, origins, directions, limits, blocked,
            )  # fmt: skip
        return blocked

    def close(self) -> None:
        for scene in (self._static, self._moving):
            if scene is not None:
                scene.release()
        if self._device:
            self._library.rtcReleaseDevice(self._device)
            self._device = 0


def _results(count: int) -> tuple[I32, F32, F32]:
    return np.empty(count, np.int32), np.empty(count, np.float32), np.empty(count, np.float32)
