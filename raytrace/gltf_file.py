"""The container of glTF 2.0: the JSON, the buffers, and look-ups in them that fail with a message."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

from errors import UserError
from raytrace.resources import read_bytes, read_uri

Entry = dict[str, Any]
"""One JSON object of the file. Its values are checked where they are read."""

COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}

_HUGE = 1e30  # beyond it a number is nonsense, and products of some such numbers overflow
_MAGIC, _JSON_CHUNK, _BINARY_CHUNK = b"glTF", 0x4E4F534A, 0x004E4942

_COMPRESSIONS = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
_REQUIRED_AND_KNOWN = {
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
}
_APPROXIMATED = "KHR_materials_"  # every extension of materials: what it adds is named and left out

_DECOMPRESS = (
    "write it again without compression: `npx @gltf-transform/cli copy in.glb out.glb` does it "
    "(gltfpack: leave out -c and -cc; Blender: export with Compression off)"
)


class GltfFile:
    """A ``.gltf`` or ``.glb`` file, told apart by content. ``json`` is the root object.

    Raises UserError for files that are cut short, are not glTF 2.0, or need an extension that is not known here.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        text, self._binary = self._split(read_bytes(path))
        self.json = self._parse(text)
        self._buffers: dict[int, bytes] = {}
        self._check_version()
        self._check_extensions()

    def error(
        self, message: str, hint: str = "export the file again; the program that made it wrote invalid glTF"
    ) -> UserError:
        return UserError(f"{self.path}: {message}", hint)

    # -- the container ------------------------------------------------------------------------------------------------

    def _split(self, data: bytes) -> tuple[bytes, bytes | None]:
        """JSON text and binary chunk. glTF 2.0, sec. 4."""
        if data[:4] != _MAGIC:
            return data, None
        again = "the file was cut short: copy or download it again"
        if len(data) < 20:
            raise self.error(f"a .glb file of {len(data)} bytes cannot hold a scene", again)
        version, length, size, kind = struct.unpack_from("<4I", data, 4)
        if version != 2:
            raise self.error(f"is binary glTF {version}; only version 2 can be read", "export it as glTF 2.0")
        if length > len(data):
            raise self.error(f"is truncated: {len(data):,} bytes are there, its header promises {length:,}", again)
        if kind != _JSON_CHUNK or 20 + size > length:
            raise self.error("the JSON part of this .glb file is damaged", again)
        text, start = data[20 : 20 + size], 20 + size
        while start + 8 <= length:
            size, kind = struct.unpack_from("<2I", data, start)
            if start + 8 + size > length:
                raise self.error("is truncated inside a chunk", again)
            if kind == _BINARY_CHUNK:
                return text, data[start + 8 : start + 8 + size]
            start += 8 + size
        return text, None

    def _parse(self, text: bytes) -> Entry:
        try:
            root = json.loads(text)
        except json.JSONDecodeError as error:
            raise self.error(
                f"the JSON is broken at line {error.lineno}, column {error.colno} ({error.msg})",
                "the file was cut short or is not glTF: copy it again",
            ) from error
        except (UnicodeDecodeError, RecursionError) as error:
            raise self.error(f"is not a glTF file ({error})", "is the file's ending right?") from error
        if not isinstance(root, dict):
            raise self.error("is JSON, but not glTF", "is it the right file?")
        return root

    def _check_version(self) -> None:
        if "asset" not in self.json:
            raise self.error("is JSON, but not glTF: it has no 'asset'", "is it the right file?")
        version = str(self.table(self.json, "asset", "the file").get("version", "missing"))
        if version.split(".")[0] != "2":
            raise self.error(f"is glTF {version}; only version 2 can be read", "export it as glTF 2.0")

    def _check_extensions(self) -> None:
        for name in self.names("extensionsRequired"):
            if name in _COMPRESSIONS:
                raise self.compression_error(name)
            if name not in _REQUIRED_AND_KNOWN and not name.startswith(_APPROXIMATED):
                raise self.error(
                    f"needs the extension {name}, which this program does not know",
                    "export the file without it; `npx @gltf-transform/cli inspect FILE` tells what uses it",
                )

    def compression_error(self, name: str) -> UserError:
        return self.error(f"is compressed with {name}, which cannot be read", _DECOMPRESS)

    # -- look-ups -----------------------------------------------------------------------------------------------------

    def names(self, kind: str) -> list[str]:
        """A list of strings of the root object, empty where it is absent."""
        found = self.json.get(kind, [])
        if not isinstance(found, list):
            raise self.error(f"'{kind}' is not a list")
        return [str(name) for name in found]

    def size(self, kind: str) -> int:
        """How many entries the root's list ``kind`` has."""
        found = self.json.get(kind, [])
        if not isinstance(found, list):
            raise self.error(f"'{kind}' is not a list")
        return len(found)

    def entry(self, kind: str, index: object, user: str) -> Entry:
        """``json[kind][index]``; ``user`` says who refers to it."""
        count = self.size(kind)
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < count:
            raise self.error(f"{user} refers to {kind}[{index}], but the file has {count}")
        found = self.json[kind][index]
        if not isinstance(found, dict):
            raise self.error(f"{kind}[{index}] is not an object")
        return found

    def table(self, parent: Entry, key: str, where: str) -> Entry:
        """The object ``parent[key]``, empty where it is absent."""
        found = parent.get(key, {})
        if not isinstance(found, dict):
            raise self.error(f"'{key}' of {where} is not an object")
        return found

    def tables(self, parent: Entry, key: str, where: str) -> list[Entry]:
        """The list of objects ``parent[key]``, empty where it is absent."""
        found = parent.get(key, [])
        if not isinstance(found, list) or not all(isinstance(item, dict) for item in found):
            raise self.error(f"'{key}' of {where} is not a list of objects")
        return found

    def extension(self, parent: Entry, name: str, where: str) -> Entry | None:
        """Extension ``name`` of ``parent``, None where it is absent."""
        extensions = self.table(parent, "extensions", where)
        return self.table(extensions, name, where) if name in extensions else None

    def numbers(self, parent: Entry, key: str, default: tuple[float, ...], where: str) -> tuple[float, ...]:
        """A list of finite numbers as long as ``default``, which is taken where the key is absent."""
        found = parent.get(key, default)
        good = isinstance(found, (list, tuple)) and len(found) == len(default)
        if not good or not all(_is_number(value) for value in found):
            raise self.error(f"'{key}' of {where} is {_shown(found)} instead of {len(default)} finite numbers")
        return tuple(float(value) for value in found)

    def number(self, parent: Entry, key: str, default: float, where: str) -> float:
        """A finite number, ``default`` where the key is absent."""
        found = parent.get(key, default)
        if not _is_number(found):
            raise self.error(f"'{key}' of {where} is {_shown(found)} instead of a finite number")
        return float(found)

    def whole(self, parent: Entry, key: str, default: int, where: str) -> int:
        """A whole number of at least 0, ``default`` where the key is absent."""
        found = parent.get(key, default)
        if not isinstance(found, int) or isinstance(found, bool) or found < 0:
            raise self.error(f"'{key}' of {where} is {_shown(found)} instead of a whole number")
        return found

    # -- binary data --------------------------------------------------------------------------------------------------

    def buffer(self, index: int) -> bytes:
        """Bytes of a buffer: the binary chunk, embedded, or a file beside this one."""
        if index not in self._buffers:
            where = f"buffers[{index}]"
            entry = self.entry("buffers", index, "a buffer view")
            if "uri" in entry:
                data = read_uri(self.path.parent, str(entry["uri"]), f"{self.path}: {where}")
            elif index == 0 and self._binary is not None:
                data = self._binary
            else:
                for name in _COMPRESSIONS:
                    if self.extension(entry, name, where) is not None:
                        raise self.compression_error(name)
                raise self.error(
                    f"{where} has no data", "a .gltf needs its .bin file, a .glb its binary part: copy it again"
                )
            promised = self.whole(entry, "byteLength", 0, where)
            if len(data) < promised:
                raise self.error(
                    f"{where} is truncated: {len(data):,} bytes are there, {promised:,} are promised",
                    "copy or export the file again",
                )
            self._buffers[index] = data
        return self._buffers[index]

    def view(self, index: object, user: str) -> memoryview:
        """Bytes of a buffer view."""
        entry = self.entry("bufferViews", index, user)
        where = f"bufferViews[{index}]"
        for name in _COMPRESSIONS:
            if self.extension(entry, name, where) is not None:
                raise self.compression_error(name)
        data = self.buffer(self.whole(entry, "buffer", 0, where))
        start, length = self.whole(entry, "byteOffset", 0, where), self.whole(entry, "byteLength", 0, where)
        if start + length > len(data):
            raise self.error(
                f"{where} ends {start + length - len(data):,} bytes after its buffer", "copy the file again"
            )
        return memoryview(data)[start : start + length]

    def accessor(self, index: object, kind: str, user: str) -> Entry:
        """The accessor's own JSON object, after a check that all of its elements, of type ``kind``, are in the file."""
        entry = self.entry("accessors", index, user)
        where = f"accessors[{index}]"
        if "sparse" in entry:
            raise self.error(
                f"{user} is stored as sparse differences, which cannot be read",
                "export it again without sparse accessors",
            )
        if "bufferView" not in entry:
            for name in _COMPRESSIONS:
                if name in self.names("extensionsUsed"):
                    raise self.compression_error(name)
            raise self.error(f"{where} has no data")
        component = entry.get("componentType")
        if entry.get("type") != kind or not isinstance(component, int) or component not in COMPONENT_BYTES:
            raise self.error(f"{user} is of type {entry.get('type')}, {component}; {kind} is expected")
        size = COMPONENTS[kind] * COMPONENT_BYTES[component]
        view = self.entry("bufferViews", entry["bufferView"], where)
        stride = self.whole(view, "byteStride", size, where) or size
        if "count" not in entry:
            raise self.error(f"{where} does not say how many elements it has")
        count, start = self.whole(entry, "count", 0, where), self.whole(entry, "byteOffset", 0, where)
        if stride < size:
            raise self.error(f"{user} has a stride of {stride} bytes for elements of {size}")
        missing = start + (count - 1) * stride + size - len(self.view(entry["bufferView"], where))
        if count > 0 and missing > 0:
            raise self.error(f"{user} reaches {missing:,} bytes beyond its data", "the file is damaged: copy it again")
        return entry


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and -_HUGE < value < _HUGE


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
