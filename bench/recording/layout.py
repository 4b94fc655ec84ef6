"""Which images a recorded frame consists of, and what their files are called.

The layout is that of the data set published with BMFR (Koskela et al. 2019), so that its sequences can be replayed here
and ours by its tools: for frame i, without zero padding, ``color{i}.exr`` and so on, beside ``camera_matrices.h``
(:mod:`bench.recording.header`). In files row 0 is the top row.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

HEADER: Final = "camera_matrices.h"

NOTES: Final = "recording.json"
"""What this program remembers of a recording of its own; nothing that a replay needs."""

FPS: Final = 30.0
"""Frames per second of a sequence."""


@dataclass(frozen=True)
class Image:
    """One kind of image.

    Attributes:
        name: of its files: ``color`` for ``color0.exr``.
        channels: 3 (R, G, B), 4 (A as well) or 1 (of any name; ``Y`` where we write it).
        meaning: for people.
        required: every sequence has it.
        sparse: frames may lack it even where others have it; any other image is there for all frames or for none.
        field: the image of a :class:`raytrace.frame.FramePacket` that it holds, written wherever the packet has it and
            read back as it is; "" where code says how (:mod:`bench.recording.packets`).
        alpha: what the fourth channel of that image is, if the file has three: a constant, or None for 1 on surfaces
            and 0 on misses.
        divisor: pixels of the picture, in x and in y, for one of the image.
    """

    name: str
    channels: int
    meaning: str
    required: bool = False
    sparse: bool = False
    field: str = ""
    alpha: float | None = 1.0
    divisor: int = 1

    def size(self, picture: tuple[int, int]) -> tuple[int, int]:
        """Width and height for a picture of a size; what is left over makes a pixel of its own."""
        return -(-picture[0] // self.divisor), -(-picture[1] // self.divisor)

    def path(self, folder: Path, index: int) -> Path:
        return folder / f"{self.name}{index}.exr"


IMAGES: Final = {
    image.name: image
    for image in (
        Image("color", 3, "noisy illumination, direct + indirect, divided by the albedo", required=True),
        Image("albedo", 3, "what the illumination was divided by; 1 on misses", required=True),
        Image("shading_normal", 3, "unit, world space, towards the camera; 0 on misses", required=True),
        Image("world_position", 3, "the surface point; on misses a point far along the ray", required=True),
        Image("emission", 3, "radiance of the surface itself, or of the sky", field="emission", alpha=None),
        Image("direct", 3, "the part of color that came over no bounce", field="direct"),
        Image("indirect", 3, "the part of color that came over one bounce or more", field="indirect"),
        Image("prev_position", 3, "where the surface point was one frame ago; without it nothing moves"),
        Image("prev_normal", 3, "its normal one frame ago; without it the normal now", field="prev_normal", alpha=0.0),
        Image("object_id", 1, "number of the object, -1 on misses"),
        Image("depth", 3, "R: along the camera's forward axis; G, B: its change per pixel to the right and upwards"),
        Image("specular", 3, "what metal and gloss reflect, divided by specular_albedo", field="specular"),
        Image("specular_albedo", 3, "what specular was divided by; 0 on diffuse surfaces", field="specular_albedo"),
        Image("roughness", 1, "of metal and gloss, in [0, 1]; 1 on diffuse surfaces"),
        Image("gradient", 4, "A-SVGF: change of light, a pixel for 3x3", field="temporal_gradient", divisor=3),
        Image(
            "gradient_specular",
            4,
            "where there are gradient and specular: the same of specular and of all light",
            field="temporal_gradient_specular",
            divisor=3,
        ),
        Image("carried", 1, "with gradient: 0 where the sample was carried over, 2 where it may be carried on, else 1"),
        Image("reference", 3, "converged radiance of all that is above", sparse=True),
    )
}
"""Name -> image. What is neither required nor sparse may be left out of a whole sequence. To add one that is an image
of the frame packet as it stands, add a line."""

REQUIRED: Final = tuple(name for name, image in IMAGES.items() if image.required)


TOGETHER: Final = (("specular", "specular_albedo", "roughness"), ("gradient", "carried"))
"""Images of which a sequence has all or none."""


def span(numbers: Iterable[int]) -> str:
    """Ascending numbers in few words: ``"3 to 5, 9"``."""
    parts: list[list[int]] = []
    for number in numbers:
        if parts and number == parts[-1][-1] + 1:
            parts[-1].append(number)
        else:
            parts.append([number])
    shown = [f"{part[0]} to {part[-1]}" if len(part) > 1 else str(part[0]) for part in parts[:4]]
    return ", ".join(shown) + (" ..." if len(parts) > 4 else "")
