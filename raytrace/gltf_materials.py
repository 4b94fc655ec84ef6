"""Materials and textures of a glTF file, read from its JSON, and the names of what is drawn in a simpler way."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from errors import Notices
from raytrace.gltf_file import Entry, GltfFile
from raytrace.images import decode_image
from raytrace.parts import F64
from raytrace.resources import read_uri
from raytrace.scene import Material, Texture

GREY = Material("no material", double_sided=True)
"""For triangles without a material: glTF's own default, a white metal, would as a diffuse surface absorb nothing."""

_BLEND_CUTOFF = 0.5  # of what should be blended: half there or not there at all
_TEXTURE_SOURCES = ("EXT_texture_webp",)  # extensions of a texture that name an image Pillow can decode
_LIGHT_PASSES = ("KHR_materials_transmission", "KHR_materials_diffuse_transmission")
_TREATED = {
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",
    *_LIGHT_PASSES,
}


@dataclass(frozen=True)
class UvMapping:
    """Which texture coordinate set a material reads, and the KHR_texture_transform that goes before the look-up."""

    uv_set: int = 0
    offset: tuple[float, ...] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, ...] = (1.0, 1.0)

    def apply(self, uvs: F64) -> F64:
        """Texture coordinates with glTF's origin, (V, 2), as ours, whose origin is at the lower left."""
        cos, sin = math.cos(self.rotation), math.sin(self.rotation)
        # Counterclockwise as one sees the image, whose second coordinate points down.
        result: F64 = (uvs * self.scale) @ np.array([[cos, -sin], [sin, cos]]) + self.offset
        result[:, 1] = 1.0 - result[:, 1]
        return result


@dataclass
class MaterialTable:
    """``materials`` and ``textures`` of the scene; by the file's material index (None: no material): ``numbers`` of
    materials, and ``mappings`` of those that are textured."""

    materials: list[Material] = field(default_factory=list)
    textures: list[Texture] = field(default_factory=list)
    numbers: dict[int | None, int] = field(default_factory=dict)
    mappings: dict[int | None, UvMapping] = field(default_factory=dict)


def read_materials(file: GltfFile, used: Iterable[int | None], notices: Notices) -> MaterialTable:
    """Materials with the indices ``used``, and only their textures.

    Adds one notice for each kind of simplification, with the number of materials it concerns. Raises UserError for
    images that are missing or cannot be decoded, and for values of the wrong type.
    """
    reader = _Reader(file, notices)
    for index in sorted(used, key=lambda i: -1 if i is None else i):
        reader.add(index)
    reader.report()
    return reader.table


class _Reader:
    def __init__(self, file: GltfFile, notices: Notices) -> None:
        self.file, self.notices = file, notices
        self.table = MaterialTable()
        self.simplified: Counter[str] = Counter()
        self._images: dict[tuple[int, bool, bool], int] = {}

    def add(self, index: int | None) -> None:
        self.table.numbers[index] = len(self.table.materials)
        if index is None:
            self.table.materials.append(GREY)
            return
        file, entry = self.file, self.file.entry("materials", index, "a primitive")
        name = str(entry.get("name", f"material {index}"))
        where = f"material {name!r}"
        base, base_info, gloss, gloss_info = self._base(entry, where)
        strength = file.extension(entry, "KHR_materials_emissive_strength", where) or {}
        factor = file.number(strength, "emissiveStrength", 1.0, where)
        emission = [max(0.0, e * factor) for e in file.numbers(entry, "emissiveFactor", (0.0, 0.0, 0.0), where)]
        emission_info = file.table(entry, "emissiveTexture", where) if max(emission) > 0.0 else {}
        normal_info = file.table(entry, "normalTexture", where)
        cutoff = self._cutoff(entry, where)
        self._choose_mapping(index, where, base_info, gloss_info, normal_info, emission_info)
        self._count(entry, where)
        self.table.materials.append(
            Material(
                name=name,
                base_color=(base[0], base[1], base[2]),
                base_texture=self._texture(base_info, where, alpha=cutoff is not None),
                emission=(emission[0], emission[1], emission[2]),
                emission_texture=self._texture(emission_info, where),
                double_sided=entry.get("doubleSided") is True,
                specular=gloss is not None,
                metallic=0.0 if gloss is None else gloss[0],
                roughness=1.0 if gloss is None else gloss[1],
                metallic_roughness_texture=self._texture(gloss_info, where, linear=True),
                normal_texture=self._texture(normal_info, where, linear=True),
                normal_scale=file.number(normal_info, "scale", 1.0, where),
                alpha=base[3],
                alpha_cutoff=cutoff,
            )
        )

    def _cutoff(self, entry: Entry, where: str) -> float | None:
        mode = entry.get("alphaMode", "OPAQUE")
        if mode == "BLEND":
            return _BLEND_CUTOFF
        return self.file.number(entry, "alphaCutoff", 0.5, where) if mode == "MASK" else None

    def _base(self, entry: Entry, where: str) -> tuple[list[float], Entry, tuple[float, float] | None, Entry]:
        """Base colour and alpha in [0, 1] with the texture that belongs to them; metallic and roughness with theirs.

        Instead of these two None for what is diffuse. That includes roughness 1 without any metal: it is what exporters
        write for a diffuse surface, and glTF's lobe reflects a fortieth of the light there.
        """
        gloss: tuple[float, float] | None = None
        gloss_info: Entry = {}
        old = self.file.extension(entry, "KHR_materials_pbrSpecularGlossiness", where)
        if old is not None:
            color = self.file.numbers(old, "diffuseFactor", (1.0, 1.0, 1.0, 1.0), where)
            info = self.file.table(old, "diffuseTexture", where)
        else:
            pbr = self.file.table(entry, "pbrMetallicRoughness", where)
            color = self.file.numbers(pbr, "baseColorFactor", (1.0, 1.0, 1.0, 1.0), where)
            info = self.file.table(pbr, "baseColorTexture", where)
            metallic = self.file.number(pbr, "metallicFactor", 1.0, where)
            roughness = self.file.number(pbr, "roughnessFactor", 1.0, where)
            gloss_info = self.file.table(pbr, "metallicRoughnessTexture", where)
            if metallic > 0.0 or roughness < 1.0 or "index" in gloss_info:
                gloss = min(max(metallic, 0.0), 1.0), min(max(roughness, 0.0), 1.0)
            if "KHR_materials_unlit" in self.file.table(entry, "extensions", where):
                gloss, gloss_info = None, {}
        if not all(0.0 <= c <= 1.0 for c in color[:3]):
            self.simplified["material{s} with a base colour outside [0, 1]: clamped"] += 1
        return [min(max(c, 0.0), 1.0) for c in color], info, gloss, gloss_info

    def _texture(self, info: Entry, where: str, linear: bool = False, alpha: bool = False) -> int:
        """Index of the decoded texture, -1 for none."""
        if "index" not in info:
            return -1
        texture = self.file.entry("textures", info["index"], where)
        source = texture.get("source")
        for extension in _TEXTURE_SOURCES:
            other = self.file.extension(texture, extension, where)
            source = source if other is None else other.get("source", source)
        if source is None:
            names = ", ".join(self.file.table(texture, "extensions", where)) or "no image at all"
            raise self.file.error(
                f"a texture of {where} has no PNG, JPEG or WebP image ({names})",
                "export the file with PNG or JPEG textures",
            )
        image = self.file.entry("images", source, where)
        key = source, linear, alpha
        if key not in self._images:
            self._images[key] = len(self.table.textures)
            self.table.textures.append(self._decode(source, image, where, linear, alpha))
        return self._images[key]

    def _decode(self, source: int, image: Entry, where: str, linear: bool, alpha: bool) -> Texture:
        user = f"{where} in {self.file.path}"
        uri = str(image.get("uri", ""))
        if uri:
            label = f"image {source}" if uri.startswith("data:") else uri
            data = read_uri(self.file.path.parent, uri, f"{self.file.path}: texture of {where}")
        else:
            label = str(image.get("name", f"image {source}"))
            data = bytes(self.file.view(image.get("bufferView"), f"texture of {where}"))
        return decode_image(data, label, user, self.notices, linear, alpha)

    def _choose_mapping(self, index: int, where: str, *infos: Entry) -> None:
        """One mapping per material: the base colour's, or that of the first other texture where it has none."""
        mappings = [self._mapping(info, where) for info in infos if "index" in info]
        if mappings:
            self.table.mappings[index] = mappings[0]
        if len(set(mappings)) > 1:
            self.simplified["material{s} with textures laid out differently: base colour's layout used for all"] += 1

    def _mapping(self, info: Entry, where: str) -> UvMapping:
        file = self.file
        transform = file.extension(info, "KHR_texture_transform", where) or {}
        return UvMapping(
            uv_set=file.whole(transform, "texCoord", file.whole(info, "texCoord", 0, where), where),
            offset=file.numbers(transform, "offset", (0.0, 0.0), where),
            rotation=file.number(transform, "rotation", 0.0, where),
            scale=file.numbers(transform, "scale", (1.0, 1.0), where),
        )

    def _count(self, entry: Entry, where: str) -> None:
        """Note what this material has that is not drawn."""
        extensions = self.file.table(entry, "extensions", where)
        old = "KHR_materials_pbrSpecularGlossiness" in extensions
        unlit = "KHR_materials_unlit" in extensions
        passes = any(name in extensions for name in _LIGHT_PASSES)
        others = sorted(name for name in extensions if name not in _TREATED)
        facts = {
            "material{s} with specular and glossiness, an old model: drawn as diffuse": old and not unlit,
            "material{s} with an occlusion map: left out, the tracer finds occlusion itself": "occlusionTexture"
            in entry,
            "blended material{s} (alphaMode): cut out where less than half there": entry.get("alphaMode") == "BLEND",
            "see-through material{s} (transmission): drawn opaque": passes,
            "unlit material{s}: lit like all others": unlit,
        }
        facts |= {f"material{{s}} with {name}: drawn without it": True for name in others}
        for text, true in facts.items():
            self.simplified[text] += true

    def report(self) -> None:
        for text, count in self.simplified.items():
            if count:
                self.notices.add(f"{count} {text.format(s='' if count == 1 else 's')}")
