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
    NEXT = auto()
    """A parameter takes its next value, a switch the other one [section.key, or a key of the method's own section]."""
    STAGE = auto()
    """A count becomes 0 or what it was, a switch off or on [keys of the method's own section: of a/b the first]."""
    COUNT = auto()
    """A number of the configuration goes up or down [key and step, such as ``iterations +1``]."""
    JITTER = auto()
    """Sub-pixel camera jitter on or off, whatever it is now."""
    ANIMATE = auto()
    STEP = auto()
    """One frame further in the scene's time, and stop there."""
    RESET_CAMERA = auto()
    RESET_HISTORY = auto()
    NEXT_SCENE = auto()
    VIEW = auto()
    """Look at another texture of the graph [+1 or -1: the next or the one before]."""
    FLIP = auto()
    """Show or hide, or switch, something that is no parameter of the picture [a switch of :class:`ui.state.State`]."""
    RESOLUTION = auto()
    """Render at the next size of the ladder [+1 or -1]."""
    PATH = auto()
    """Note the camera of every frame from now on, or stop and write what was noted."""
    SCREENSHOT = auto()
    RECORD = auto()
    """Record the frames shown, or stop recording."""
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
        return _LABELS.get(self.key, self.key.replace("_", " ").title())


_LABELS: Final = {"ESCAPE": "Esc", "EQUAL": "+", "MINUS": "-", "PERIOD": "."}

BINDINGS: Final = (
    Binding("0", Action.SHOW, "off: one path per pixel as it is", "none"),
    Binding("1", Action.SHOW, "SVGF, spatiotemporal variance-guided filtering", "svgf"),
    Binding("2", Action.SHOW, "BMFR, blockwise multi-order feature regression", "bmfr"),
    Binding("3", Action.SHOW, "A-SVGF, adaptive SVGF: forgets light that has changed", "asvgf"),
    Binding("TAB", Action.PREVIOUS, "back to the method shown before, and forth again"),
    Binding("P", Action.NEXT, "next preset of the method's parameters", "preset"),
    Binding("F1", Action.NEXT, "accumulation over time on or off", "temporal"),
    Binding("F2", Action.NEXT, "guidance by the variance on or off", "variance_guided"),
    Binding("F3", Action.STAGE, "the à-trous wavelet, or BMFR's regression, on or off", "iterations/fit"),
    Binding("LEFT", Action.COUNT, "one wavelet iteration less", "iterations -1"),
    Binding("RIGHT", Action.COUNT, "one wavelet iteration more", "iterations +1"),
    Binding("F4", Action.NEXT, "filtering without the surfaces' albedo (demodulation) on or off", "demodulate"),
    Binding("F5", Action.NEXT, "anti-aliasing over time (TAA) on or off", "taa.enabled"),
    Binding("F6", Action.JITTER, "sub-pixel camera jitter on or off"),
    Binding("F7", Action.NEXT, "firefly rejection: off, clamp, variance", "firefly.mode"),
    Binding("F8", Action.NEXT, "direct and indirect light filtered apart or together", "separate"),
    Binding("F9", Action.NEXT, "tone curve: none, Reinhard, ACES", "display.tonemap"),
    Binding("UP", Action.COUNT, "half a stop brighter", "display.exposure +0.5"),
    Binding("DOWN", Action.COUNT, "half a stop darker", "display.exposure -0.5"),
    Binding("L", Action.NEXT, "exposure by itself (light meter) on or off", "display.auto_exposure"),
    Binding("SPACE", Action.ANIMATE, "moving objects and lamps stop or go on"),
    Binding("O", Action.FLIP, "lamps off or on", "lamps"),
    Binding("PERIOD", Action.STEP, "one step of the animation, then stop"),
    Binding("N", Action.NEXT_SCENE, "next of the scenes that come with the program"),
    Binding("R", Action.RESET_CAMERA, "camera back to where it began"),
    Binding("C", Action.PATH, "record the camera's path; once more: save it as camera_NNN.toml, for --camera"),
    Binding("H", Action.RESET_HISTORY, "forget what was accumulated over time"),
    Binding("B", Action.VIEW, "look at the next texture of the graph, after the last at the picture again", "+1"),
    Binding("V", Action.VIEW, "look at the texture before", "-1"),
    Binding("X", Action.FLIP, "split view: noisy to the left of the mouse, denoised to the right", "split"),
    Binding(
        "I", Action.FLIP, "numbers of the pixel under the mouse: channels, history, why it was rejected", "inspect"
    ),
    Binding("M", Action.FLIP, "error map against a reference that is traced while nothing moves", "error_map"),
    Binding("EQUAL", Action.RESOLUTION, "render more pixels", "+1"),
    Binding("MINUS", Action.RESOLUTION, "render fewer pixels", "-1"),
    Binding("G", Action.FLIP, "show or hide the panel with numbers and sliders", "hud"),
    Binding("K", Action.FLIP, "show or hide this list of keys", "help"),
    Binding("F11", Action.RECORD, "record the frames to a folder recording_NNN; once more: stop"),
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
    ("a file dropped", "opens as a scene"),
)

METHODS_ON_KEYS: Final = tuple(binding.value for binding in BINDINGS if binding.action is Action.SHOW)

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
