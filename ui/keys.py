"""The key table: what each key does, once. The window acts by it; the README's table and the help are made from it."""

from __future__ import annotations

from enum import Enum, auto
from typing import Final, NamedTuple


class Action(Enum):
    """What a key makes the window do. In brackets: what the binding's ``value`` says."""

    SHOW = auto()
    """Show another method [its name in :data:`gl.pipelines.DENOISERS`]."""
    PREVIOUS = auto()
    """Show the method that was shown before."""
    TOGGLE = auto()
    """Switch a parameter of the configuration on or off [section.key]."""
    ANIMATE = auto()
    RESET_CAMERA = auto()
    RESET_HISTORY = auto()
    SCREENSHOT = auto()
    BACK = auto()
    """Let go of the mouse or, if it is free, close the window."""
    FLY = auto()
    """While the key is held [a name in :data:`ui.camera_control.DIRECTIONS`, or "fast"]."""


class Binding(NamedTuple):
    """One line of the table. ``key``: glfw's name of the key on an American keyboard, without ``KEY_``; keys that are
    there twice, left and right, go by one name."""

    key: str
    action: Action
    help: str
    value: str = ""

    @property
    def label(self) -> str:
        """The key as people call it."""
        return "Esc" if self.key == "ESCAPE" else self.key.title()


BINDINGS: Final = (
    Binding("0", Action.SHOW, "off: one path per pixel as it is", "none"),
    Binding("1", Action.SHOW, "SVGF, spatiotemporal variance-guided filtering", "svgf"),
    Binding("TAB", Action.PREVIOUS, "back to the method shown before, and forth again"),
    Binding("F5", Action.TOGGLE, "anti-aliasing over time (TAA) on or off", "taa.enabled"),
    Binding("SPACE", Action.ANIMATE, "moving objects and lamps stop or go on"),
    Binding("R", Action.RESET_CAMERA, "camera back to where it began"),
    Binding("H", Action.RESET_HISTORY, "forget what was accumulated over time"),
    Binding("F12", Action.SCREENSHOT, "save the picture as shot_NNN.png"),
    Binding("ESCAPE", Action.BACK, "let go of the mouse; otherwise quit"),
    Binding("W", Action.FLY, "fly forward", "forward"),
    Binding("S", Action.FLY, "fly back", "back"),
    Binding("A", Action.FLY, "fly left", "left"),
    Binding("D", Action.FLY, "fly right", "right"),
    Binding("Q", Action.FLY, "fly down", "down"),
    Binding("E", Action.FLY, "fly up", "up"),
    Binding("SHIFT", Action.FLY, "held while flying: four times as fast", "fast"),
)

MOUSE: Final = (
    ("right button", "held: look around"),
    ("wheel", "fly faster or slower"),
)

BY_KEY: Final = {binding.key: binding for binding in BINDINGS}


def rows() -> list[tuple[str, str]]:
    """(key or mouse gesture, what it does), in the order in which to read them."""
    return [*((binding.label, binding.help) for binding in BINDINGS), *MOUSE]


def markdown() -> str:
    """The table of the README."""
    lines = [f"| {key} | {does} |" for key, does in rows()]
    return "\n".join(["| key | what it does |", "| --- | --- |", *lines])


def text() -> str:
    """The table for a terminal."""
    width = max(len(key) for key, _ in rows())
    return "\n".join(f"  {key:<{width}}  {does}" for key, does in rows())
