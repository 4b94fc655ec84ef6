"""What the window shows and what it is asked to do: all that keys change. No window and no GL in here."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Final

from config import Config
from gl.pipelines import DENOISERS
from ui.keys import Action, Binding

UNFILTERED: Final = ("none", "reference")
"""Methods that are shown as they are, without anti-aliasing over time."""


@dataclass
class State:
    """``denoiser``: a key of :data:`gl.pipelines.DENOISERS`. ``animate``: the scene's time goes on.

    Wishes, which whoever fulfils them takes back: ``reset``, why the next frame may use no history; ``home``, camera
    back to where it began; ``screenshot``; ``closing``.

    ``looking``: the mouse turns the camera. ``news``: one line about the last thing done, "" once it was shown.
    """

    config: Config
    denoiser: str
    animate: bool = True
    before: str = ""
    reset: str = ""
    home: bool = False
    screenshot: bool = False
    closing: bool = False
    looking: bool = False
    news: str = ""

    def __post_init__(self) -> None:
        if not self.before:
            self.before = "svgf" if self.denoiser == "none" else "none"

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

    def toggle(self, name: str) -> None:
        """Change a switch, ``section.key``, of the configuration."""
        section, _, key = name.partition(".")
        group = getattr(self.config, section)
        value = not getattr(group, key)
        self.config = dataclasses.replace(self.config, **{section: dataclasses.replace(group, **{key: value})})
        self.news = f"{name} = {str(value).lower()}"

    def perform(self, binding: Binding) -> None:
        """Do what pressing the key of ``binding`` stands for. Flying goes on while keys are held, so not here."""
        match binding.action:
            case Action.SHOW:
                self.show(binding.value)
            case Action.PREVIOUS:
                self.show(self.before)
            case Action.TOGGLE:
                self.toggle(binding.value)
            case Action.ANIMATE:
                self.animate = not self.animate
                self.news = "animation goes on" if self.animate else "animation stopped"
            case Action.RESET_CAMERA:
                self.home, self.news = True, "camera reset"
            case Action.RESET_HISTORY:
                self.reset, self.news = "by key", "history reset"
            case Action.SCREENSHOT:
                self.screenshot = True
            case Action.BACK:
                self.closing = not self.looking
                self.looking = False
            case Action.FLY:
                pass
