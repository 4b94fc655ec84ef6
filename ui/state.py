"""What the window shows and what it is asked to do: all that keys and the panel change. No window and no GL in here."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, Final

from config import SECTIONS, Config, apply_preset
from errors import UserError
from gl.pipelines import DENOISERS, SECTIONS_OF
from parameter import Param, Value, parameters
from ui.keys import Action, Binding

UNFILTERED: Final = ("none", "reference")
"""Methods that are shown as they are, without anti-aliasing over time."""

PICTURE: Final = ""
"""``State.view`` while the picture itself is looked at."""


_AND: Final = " · "


@dataclass
class TextureLook:
    """How the texture viewer shows a texture.

    ``channels``: the key of one of the texture's views (:mod:`ui.textures`), such as "rgb" or "a"; what it has no view
    for, such as "auto", stands for the one that suits it. ``exposure``: EV. ``low``, ``high``: values shown as black
    and white. ``automatic``: the two follow the texture's own range. ``zoom``: pixels of the magnifier per texel, 0
    without one.
    """

    channels: str = "auto"
    exposure: float = 0.0
    low: float = 0.0
    high: float = 1.0
    automatic: bool = True
    zoom: int = 0


@dataclass
class State:
    """``denoiser``: a key of :data:`gl.pipelines.DENOISERS`. ``animate``: the scene's time goes on. ``lamps``: are on.

    ``view``: name of the texture looked at, :data:`PICTURE` for none; ``look``: how it is shown; ``textures``: the
    names there are, as the last frame left them. ``split``: the noisy frame is shown to the left of the mouse.
    ``hud``: the panel is shown. ``help``: the list of keys is. ``inspect``: the numbers of the pixel under the mouse
    are. ``path``: the camera of every frame is noted. ``error_map``: what the picture differs from its reference by is
    shown instead of it, once there is one.

    Wishes, which whoever fulfils them takes back: ``reset``, why the next frame may use no history; ``home``, camera
    back to where it began; ``step``, one frame more of the animation; ``scene``, a scene to open, by name or path;
    ``next_scene``; ``resolution``, rungs of the ladder to climb; ``screenshot``; ``closing``.

    ``recording``: the frames shown are recorded. ``looking``: the mouse turns the camera. ``news``: one line about the
    last thing done, "" once it was shown.
    """

    config: Config
    denoiser: str
    animate: bool = True
    lamps: bool = True
    before: str = ""
    view: str = PICTURE
    look: TextureLook = field(default_factory=TextureLook)
    textures: tuple[str, ...] = ()
    split: bool = False
    hud: bool = False
    help: bool = False
    inspect: bool = False
    path: bool = False
    error_map: bool = False
    reset: str = ""
    home: bool = False
    step: bool = False
    scene: str = ""
    next_scene: bool = False
    resolution: int = 0
    screenshot: bool = False
    closing: bool = False
    recording: bool = False
    looking: bool = False
    news: str = ""
    _counts: dict[str, Value] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.before:
            self.before = "svgf" if self.denoiser == "none" else "none"

    @property
    def sections(self) -> tuple[str, ...]:
        """The configuration's sections that are the method's own, that with most of its parameters first."""
        return SECTIONS_OF[self.denoiser]

    @property
    def judged(self) -> bool:
        """Whether somebody looks at the error of the picture: only then a reference is traced."""
        return (self.hud or self.error_map) and self.denoiser != "reference"

    @property
    def anti_aliased(self) -> bool:
        """Whether the picture goes through TAA."""
        return self.config.taa.enabled and self.denoiser not in UNFILTERED

    @property
    def jitter(self) -> bool:
        """Whether camera rays pass pixels off their centres: pointless where no later pass averages them."""
        wish = self.config.render.jitter
        return self.anti_aliased if wish == "auto" else wish == "on"

    def show(self, denoiser: str) -> None:
        """Change the method; the one shown until now is remembered."""
        if denoiser != self.denoiser:
            self.before, self.denoiser = self.denoiser, denoiser
        self.news = DENOISERS[denoiser]

    def parameter(self, name: str) -> tuple[str, Param] | None:
        """Full name, ``section.key``, and metadata of a parameter; None if the method shown has none of that name.

        ``name``: ``section.key``, or a key of a section that is the method's own; of several, ``a/b``, the first
        that it has.
        """
        section, _, keys = name.rpartition(".")
        for place in (section,) if section else self.sections:
            known = parameters(SECTIONS[place])
            if found := next((key for key in keys.split("/") if key in known), None):
                return f"{place}.{found}", known[found]
        return None

    def value(self, name: str) -> Any:
        """Value of the parameter ``section.key``."""
        section, _, key = name.partition(".")
        return getattr(getattr(self.config, section), key)

    def set(self, name: str, value: Value) -> None:
        """Give the parameter ``section.key`` another value; a preset brings the values of its keys along.

        Raises:
            UserError: the value is out of range; nothing changes then.
        """
        section, _, key = name.partition(".")
        if key == "preset":
            self.config = apply_preset(self.config, section, str(value))
        else:
            group = dataclasses.replace(getattr(self.config, section), **{key: value})
            self.config = dataclasses.replace(self.config, **{section: group})
        self.news = f"{name} = {str(value).lower() if isinstance(value, bool) else value}"

    def tell(self, text: str) -> None:
        """Add to ``news``, so that what else was done in this frame is told as well, unless it was very much."""
        told = self.news.split(_AND)[-2:] if self.news else []
        self.news = _AND.join([*told, text])

    def perform(self, binding: Binding) -> None:
        """Do what pressing the key of ``binding`` stands for. Flying goes on while keys are held, so not here."""
        told, self.news = self.news, ""
        self._perform(binding)
        done, self.news = self.news, told
        if done:
            self.tell(done)

    def _perform(self, binding: Binding) -> None:
        match binding.action:
            case Action.SHOW:
                self.show(binding.value)
            case Action.PREVIOUS:
                self.show(self.before)
            case Action.NEXT | Action.STAGE | Action.COUNT:
                self._change(binding)
            case Action.JITTER:
                self.set("render.jitter", "off" if self.jitter else "on")
            case Action.ANIMATE:
                self.animate = not self.animate
                self.news = "animation goes on" if self.animate else "animation stopped"
            case Action.STEP:
                self.step, self.animate, self.news = True, False, "one step of the animation"
            case Action.RESET_CAMERA:
                self.home, self.news = True, "camera reset"
            case Action.RESET_HISTORY:
                self.reset, self.news = "by key", "history reset"
            case Action.NEXT_SCENE:
                self.next_scene = True
            case Action.VIEW:
                self._look_at_neighbour(int(binding.value))
            case Action.FLIP:
                value = not getattr(self, binding.value)
                setattr(self, binding.value, value)
                self.news = f"{binding.value.replace('_', ' ')} {'on' if value else 'off'}"
            case Action.RESOLUTION:
                self.resolution += int(binding.value)
            case Action.PATH:
                self.path = not self.path
                self.news = "recording the camera's path" if self.path else ""
            case Action.SCREENSHOT:
                self.screenshot = True
            case Action.RECORD:
                self.recording = not self.recording
            case Action.BACK:
                self.closing = not self.looking
                self.looking = False
            case Action.FLY:
                pass

    def _change(self, binding: Binding) -> None:
        """Another value for the parameter that ``binding`` names, if the method shown has it."""
        name, _, step = binding.value.partition(" ")
        found = self.parameter(name)
        if found is None:
            self.news = f"{self.denoiser}: has no {name.partition('/')[0].replace('_', ' ')}"
            return
        full, spec = found
        value = self.value(full)
        if binding.action is Action.STAGE:
            new = type(spec.default)(0) if value else self._counts.pop(full, spec.default)
            if value:
                self._counts[full] = value
        elif binding.action is Action.COUNT:
            assert spec.lo is not None
            assert spec.hi is not None
            new = type(spec.default)(min(max(value + float(step), spec.lo), spec.hi))
        else:
            choices = spec.choices or (False, True)
            new = choices[(choices.index(value) + 1) % len(choices)]
        try:
            self.set(full, new)
        except UserError as error:  # parameters may exclude one another
            self.news = str(error).partition("\n")[0]

    def _look_at_neighbour(self, step: int) -> None:
        views = (PICTURE, *self.textures)
        at = views.index(self.view) if self.view in views else 0
        self.view = views[(at + step) % len(views)]
        self.news = self.view or "the picture"
