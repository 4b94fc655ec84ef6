"""Small glTF files for the loader's tests, written byte by byte."""

from __future__ import annotations

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

COMPONENT_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TRIANGLE = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def png(pixels: ArrayLike, mode: str | None = None) -> bytes:
    """PNG bytes of ``pixels``, top row first as image files have it."""
    out = io.BytesIO()
    image = Image.fromarray(np.asarray(pixels))
    (image if mode is None else image.convert(mode)).save(out, "PNG")
    return out.getvalue()


class GltfBuilder:
    """Collects entries and bytes; ``json`` may be changed at will before writing."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}}
        self.binary = bytearray()

    def add(self, kind: str, entry: dict[str, Any]) -> int:
        self.json.setdefault(kind, []).append(entry)
        return len(self.json[kind]) - 1

    def view(self, data: bytes, **extra: Any) -> int:
        self.binary.extend(bytes(-len(self.binary) % 4))
        start = len(self.binary)
        self.binary.extend(data)
        return self.add("bufferViews", {"buffer": 0, "byteOffset": start, "byteLength": len(data), **extra})

    def accessor(self, values: ArrayLike, dtype: str = "f4", **extra: Any) -> int:
        array = np.asarray(values).astype("<" + dtype)
        kind = "SCALAR" if array.ndim == 1 else f"VEC{array.shape[1]}"
        entry = {
            "bufferView": self.view(array.tobytes()),
            "componentType": COMPONENT_TYPES[dtype],
            "count": len(array),
            "type": kind,
        }
        return self.add("accessors", entry | extra)

    def primitive(
        self,
        positions: ArrayLike = TRIANGLE,
        indices: ArrayLike | None = None,
        normals: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
        **extra: Any,
    ) -> dict[str, Any]:
        attributes = {"POSITION": self.accessor(positions)}
        if normals is not None:
            attributes["NORMAL"] = self.accessor(normals)
        if uvs is not None:
            attributes["TEXCOORD_0"] = self.accessor(uvs)
        result: dict[str, Any] = {"attributes": attributes}
        if indices is not None:
            result["indices"] = self.accessor(indices, "u2")
        return result | extra

    def mesh(self, *primitives: dict[str, Any], **extra: Any) -> int:
        return self.add("meshes", {"primitives": list(primitives), **extra})

    def node(self, **entry: Any) -> int:
        """A node; unless it becomes a child, it is a root, for no scene is written."""
        return self.add("nodes", entry)

    def texture(self, image: bytes) -> int:
        source = self.add("images", {"bufferView": self.view(image), "mimeType": "image/png"})
        return self.add("textures", {"source": source})

    def write_glb(self, path: Path) -> Path:
        self.json["buffers"] = [{"byteLength": len(self.binary)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        binary = bytes(self.binary) + bytes(-len(self.binary) % 4)
        chunks = struct.pack("<2I", len(text), 0x4E4F534A) + text + struct.pack("<2I", len(binary), 0x004E4942) + binary
        path.write_bytes(struct.pack("<4s2I", b"glTF", 2, 12 + len(chunks)) + chunks)
        return path

    def write_gltf(self, path: Path, embedded: bool = False) -> Path:
        """JSON, with the bytes embedded or in a ``.bin`` beside it."""
        uri = "my data.bin"
        if embedded:
            uri = "data:application/octet-stream;base64," + base64.b64encode(self.binary).decode()
        else:
            (path.parent / uri).write_bytes(self.binary)
        self.json["buffers"] = [{"byteLength": len(self.binary), "uri": uri.replace("my data", "my%20data")}]
        path.write_text(json.dumps(self.json))
        return path


def one_triangle(**primitive: Any) -> GltfBuilder:
    """One node that shows one mesh of one primitive."""
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(**primitive)))
    return builder
