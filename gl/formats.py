"""Texture formats: one name, as GLSL spells it, and everything the graph, OpenGL and NumPy need to know about it.

Three-component formats are left out on purpose: OpenGL need not be able to render to them, and images cannot have them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from errors import did_you_mean


@dataclass(frozen=True, slots=True)
class Format:
    """A texture format.

    Attributes:
        name: as written in ``layout(...)`` before a GLSL image, and in every port: ``"rgba16f"``.
        components: 1, 2 or 4.
        dtype: moderngl's name of the component type: ``"f1"`` (8 bits, read as [0;1]), ``"f2"``, ``"f4"``, ``"u4"`` or
            ``"i4"``.
        numpy: NumPy's name of the component type, to read a texture back.
        kind: GLSL's prefix of samplers, images and vectors: ``""``, ``"u"`` or ``"i"``.
        bytes_per_pixel: what one texel takes, in bytes.
    """

    name: str
    components: int
    dtype: str
    numpy: str
    kind: str
    bytes_per_pixel: int

    @property
    def sampler(self) -> str:
        """GLSL type that a texture of this format is read through: ``"usampler2D"``."""
        return f"{self.kind}sampler2D"

    @property
    def image(self) -> str:
        """GLSL type that a compute shader writes a texture of this format through: ``"uimage2D"``."""
        return f"{self.kind}image2D"

    def vector(self, components: int) -> str:
        """GLSL type of a value with ``components`` components: ``"float"``, ``"uvec2"``."""
        scalar = {"": "float", "u": "uint", "i": "int"}[self.kind]
        return scalar if components == 1 else f"{self.kind}vec{components}"


def _table() -> dict[str, Format]:
    layouts = {"r": 1, "rg": 2, "rgba": 4}
    types = {
        "8": ("f1", "u1", ""),
        "16f": ("f2", "f2", ""),
        "32f": ("f4", "f4", ""),
        "32ui": ("u4", "u4", "u"),
        "32i": ("i4", "i4", "i"),
    }
    table = {}
    for suffix, (dtype, numpy, kind) in types.items():
        for layout, components in layouts.items():
            name = layout + suffix
            table[name] = Format(name, components, dtype, numpy, kind, components * int(dtype[1]))
    return table


FORMATS: Final = _table()
"""Every known format by name."""

INTEGER_FORMATS: Final = frozenset(name for name, fmt in FORMATS.items() if fmt.kind)
"""Names of the formats that are not read as ``float``."""


def lookup(name: str) -> Format:
    """The format called ``name``.

    Raises:
        ValueError: there is none; the message lists all names.
    """
    try:
        return FORMATS[name]
    except KeyError:
        raise ValueError(
            f"unknown texture format {name!r}{did_you_mean(name, FORMATS)} (known: {', '.join(FORMATS)})"
        ) from None
