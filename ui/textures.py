"""What there is to look at in a frame: its textures, what their channels mean, and how that is best shown.

What a texture holds is told by the ``doc`` of its port, in parts such as ``"xyz: shading normal, world; w: depth"``.
Pure Python, no OpenGL and no ImGui.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, NamedTuple

from gl.formats import lookup
from gl.plan import Node, Plan, Tex
from ui.state import PICTURE

Color = tuple[float, float, float]

AUTOMATIC: Final = "auto"
"""``TextureLook.channels`` for what suits the texture."""

REPROJECTION_PORT: Final = "out_reprojection"
"""The port of every pass that looks for the last frame's history: z says why there is none, w how long it is."""

RAMP: Final[tuple[Color, ...]] = (
    (0.11, 0.10, 0.36),
    (0.13, 0.33, 0.62),
    (0.10, 0.58, 0.62),
    (0.45, 0.81, 0.62),
    (0.95, 0.98, 0.90),
)
"""sRGB colours of history lengths from 1 to :data:`RAMP_END` frames, evenly spaced on a logarithmic scale."""

RAMP_END: Final = 256

REJECTION_COLORS: Final[dict[int, Color]] = {
    -1: (0.30, 0.30, 0.30),
    -2: (0.07, 0.07, 0.07),
    -3: (0.98, 0.60, 0.14),
    -4: (0.85, 0.13, 0.13),
    -5: (0.93, 0.36, 0.63),
    -6: (0.58, 0.26, 0.80),
    -7: (0.97, 0.89, 0.25),
}
"""sRGB colour of each key of :data:`gl.passes.temporal.REJECTIONS`."""

NAN_COLOR: Final[Color] = (1.0, 0.0, 1.0)
INFINITE_COLOR: Final[Color] = (1.0, 0.0, 0.0)
NEGATIVE_INFINITE_COLOR: Final[Color] = (0.0, 1.0, 1.0)
"""sRGB colours of what is no number, in every view."""

FULL_MOTION: Final = 16
"""Pixels per frame that are shown as the brightest motion, at exposure 0."""


class View(NamedTuple):
    """A way to show a texture.

    ``key``: the value of ``TextureLook.channels`` that asks for it. ``mode``: how ``texture_view.frag`` decodes; the
    range and the exposure are for mode ``RANGE``, of the others only ``MOTION`` has an exposure. ``swizzle``: the
    channels it decodes, in GLSL; ``reason``: the one that says why a history was rejected, "" without.
    """

    key: str
    label: str
    mode: str
    swizzle: str
    reason: str = ""


class Part(NamedTuple):
    """What some channels of a texture mean. ``channels``: of "rgba", also where the documentation writes xyzw."""

    channels: str
    meaning: str


_PART = re.compile(r"(?:^|(?<=[;:] ))([xyzw]{1,4}|[rgba]{1,4}): ([^;]+)")
_TO_RGBA = str.maketrans("xyzw", "rgba")

# Mode, label, number of channels that are decoded at once, and what the documentation of these says.
_DECODERS: Final = (
    ("OCTAHEDRAL", "normal", 1, "normal, octahedral"),
    ("NORMAL", "normal", 3, "normal"),
    ("MOTION", "motion", 2, "previous uv"),
    ("HISTORY", "history", 1, "history length"),
    ("IDENTITY", "object", 1, "object id"),
)
_REASON: Final = "why the history was rejected"


def parts(doc: str) -> tuple[Part, ...]:
    """The parts of a port's ``doc`` that name channels; none if they all mean one thing."""
    return tuple(Part(channels.translate(_TO_RGBA), meaning.strip()) for channels, meaning in _PART.findall(doc))


@dataclass(frozen=True)
class Subject:
    """One texture of a frame. ``writer``: name of the pass that writes it, "" if it is uploaded."""

    tex: Tex
    doc: str
    writer: str
    shader: str

    @property
    def views(self) -> tuple[View, ...]:
        """All ways to show it: together as a colour, each channel as grey, and what its documentation knows of."""
        count = lookup(self.tex.fmt).components
        colors = (View("rgb", "colour", "RANGE", "rgb"),) if count > 1 else ()
        greys = tuple(View(c, _name_of(c, self.doc), "RANGE", c * 3) for c in "rgba"[:count])
        return (*colors, *greys, *self._decoded())

    def view(self, channels: str) -> View:
        """The view that ``TextureLook.channels`` asks for, or where this texture has none of that key, what suits it.

        A colour, if the documentation begins with one; otherwise the first thing it knows how to decode.
        """
        by_key = {view.key: view for view in self.views}
        if channels in by_key:
            return by_key[channels]
        described = parts(self.doc)
        decoded = self._decoded()
        first = described[0].channels if described else "rgb"
        if decoded and (first not in ("rgb", "rgba") or decoded[0].swizzle == first):
            return decoded[0]
        return self.views[0]

    def _decoded(self) -> tuple[View, ...]:
        described = parts(self.doc)
        reason = next((part.channels for part in described if _REASON in part.meaning), "")
        found: dict[str, View] = {}
        for part in described:
            for mode, key, count, words in _DECODERS:
                if words in part.meaning and len(part.channels) == count:
                    view = View(key, f"{key}, decoded ({part.channels})", mode, part.channels, reason)
                    found.setdefault(key, view)
                    break
        return tuple(found.values())


def _name_of(channel: str, doc: str) -> str:
    meaning = next((part.meaning for part in parts(doc) if part.channels == channel), "")
    return f"{channel}: {meaning}" if meaning else channel


def find_subject(plan: Plan, name: str) -> Subject | None:
    """The texture of that name, the picture itself for :data:`ui.state.PICTURE`; None if the frame has none."""
    if name == PICTURE:
        name = plan.outputs["display"].name
    for node in plan.passes:
        for port, tex in node.writes.items():
            if tex.name == name:
                return Subject(tex, node.work.ports.outs[port].doc, node.name, node.work.shader)
    upload = next((tex for tex in plan.imports if tex.name == name), None)
    if upload is None:
        return None
    # An upload has no port of its own; of those that read it the one that knows most of its channels describes it.
    docs = [
        node.work.ports.ins[port].doc for node in plan.passes for port, read in node.reads.items() if read is upload
    ]
    return Subject(upload, max(docs, key=lambda doc: len(parts(doc)), default=""), "", "")


def reprojection_of(plan: Plan) -> Node | None:
    """The pass that finds each pixel's history, whichever method's; None if nothing is accumulated."""
    return next((node for node in plan.passes if REPROJECTION_PORT in node.writes), None)
