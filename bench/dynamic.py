"""Methods on sequences in which light or objects change: error, flicker, and how long light that is gone lingers.

The frames that a method filters have temporal gradients only if it wants them, so that every method gets what it would
get in use.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assets import dynamics, metals, mirrorish
from bench.methods import Method, NewRenderer
from bench.metrics import Mask, pooled, rmse, temporal_difference
from bench.references import Reference, ReferenceCache
from config import Config
from console import Progress
from gl.pipelines import remembered
from gl.renderer import read
from raytrace.frame import FramePacket
from raytrace.scene import Scene
from raytrace.shot import Shot
from session import open_tracer

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class Film:
    """A sequence: its scene, its camera ("still" or "flight"), its length, and the frames that have a reference.

    Errors are means over ``scored``; flicker is measured between two of these that follow one another.
    """

    name: str
    build: Callable[[], Scene]
    frames: int
    scored: tuple[int, ...]
    camera: str = "still"

    def first(self, frames: int) -> Film:
        """The film's beginning, all of it if it is no longer."""
        return replace(self, frames=min(frames, self.frames), scored=tuple(i for i in self.scored if i < frames))

    def open(self, config: Config, size: tuple[int, int]) -> Shot:
        """The shot in pictures of ``size``. Its tracer is the caller's to close."""
        sized = replace(config, render=replace(config.render, width=size[0], height=size[1]))
        compiled, tracer = open_tracer(self.build(), sized)
        return Shot(compiled, tracer, size, self.camera, animate=True)


_CYCLE = tuple(frame for start in (24, 31, 39, 46, 54, 61, 69, 76) for frame in (start, start + 1))
"""Eight pairs all over a cycle of 60 frames, the first of them once histories are long."""

FILMS = {
    film.name: film
    for film in (
        Film("moving", dynamics.moving, 78, _CYCLE),
        Film("switching", dynamics.switching, 56, (9, 12, 13, 20, 21, 31, 32, 33, 34, 43, 44, 45, 46, 54, 55)),
        Film("crossing", dynamics.crossing, 78, _CYCLE),
        Film("rotating", dynamics.rotating, 78, _CYCLE),
        Film("flying", dynamics.moving, 78, _CYCLE, "flight"),
        Film("still", dynamics.still, 56, (24, 25, 39, 40, 54, 55)),
    )
}


def _glossy(name: str, build: Callable[[], Scene]) -> tuple[Film, ...]:
    def off() -> Scene:
        return dynamics.dimmed(build(), dynamics.off_in_frame_12)

    def sway() -> Scene:
        return dynamics.dimmed(build(), dynamics.swaying)

    return (
        Film(f"{name}, still", build, 24, (22, 23)),
        Film(f"{name}, off", off, 16, (11, 12, 13, 14, 15)),
        Film(f"{name}, sway", sway, 24, (14, 15, 20, 21, 22, 23)),
        Film(f"{name}, flight", build, 24, (14, 15, 22, 23), "flight"),
        Film(f"{name}, flight, sway", sway, 24, (14, 15, 22, 23), "flight"),
    )


GLOSSY = (*_glossy("metals", metals.build), *_glossy("mirrorish", mirrorish.build))
"""Films of specular light, in which lamps and the camera move."""


@dataclass(frozen=True)
class Outcome:
    """One method on one film. ``errors``: RMSE by scored frame; ``means``: mean radiance by scored frame, of what it
    made; ``temporal``: mean difference error. The ratios divide by the noisy frames' own, pooled."""

    name: str
    errors: dict[int, float]
    means: dict[int, float]
    temporal: float
    rmse_ratio: float
    temporal_ratio: float

    @property
    def rmse(self) -> float:
        return pooled(list(self.errors.values()))


class Footage:
    """The frames of a film, with and without gradients, and the references of those that are scored."""

    def __init__(self, film: Film, shot: Shot, references: Mapping[int, Reference]) -> None:
        self.film, self.shot = film, shot
        self._frames: dict[str, list[FramePacket]] = {}
        packets = self.frames("")
        self.truth = {i: references[i].radiance(packets[i]) for i in film.scored}
        self.masks: dict[int, Mask] = {i: packets[i].emission[..., :3].max(axis=2) == 0.0 for i in film.scored}

    def frames(self, remember: str) -> list[FramePacket]:
        """All frames, traced once for each rule of :data:`raytrace.gradients.RULES` and for none."""
        if remember not in self._frames:
            self.shot.remember = remember
            with Progress(f"{self.film.name}: {self.film.frames} frames") as progress:
                frames = self._frames[remember] = []
                for index in range(self.film.frames):
                    frames.append(self.shot.frame(index))
                    progress.update((index + 1) / self.film.frames)
        return self._frames[remember]

    def mean(self, index: int) -> float:
        """Mean radiance of the reference of a scored frame, without light sources."""
        return float(self.truth[index][self.masks[index]].mean())


def shoot(film: Film, config: Config, size: tuple[int, int], samples: int, cache: ReferenceCache) -> Footage:
    """Open ``film`` and complete its references to ``samples`` paths per pixel.

    The tracer, ``footage.shot.tracer``, is the caller's to close.
    """
    shot = film.open(config, size)
    try:
        references, _ = cache.fill(shot, film.scored, samples, 64)
    except BaseException:
        shot.tracer.close()
        raise
    return Footage(film, shot, references)


def play(
    footage: Footage,
    method: Method,
    config: Config,
    new_renderer: NewRenderer,
    look: Callable[[int, F32], None] | None = None,
) -> Outcome:
    """Filter the film by ``method``. ``look`` is shown the radiance of every frame, (H, W, 3)."""
    config = method.configure(config)
    renderer = new_renderer()
    errors: dict[int, float] = {}
    means: dict[int, float] = {}
    temporal: list[float] = []
    last: F32 | None = None
    try:
        for index, packet in enumerate(footage.frames(remembered(config, method.denoiser))):
            result = renderer.run(packet, config, method.denoiser)
            if index not in footage.truth and look is None:
                continue
            image = read(result.outputs["radiance"])[..., :3]
            if look is not None:
                look(index, image)
            if index in footage.truth:
                mask, truth = footage.masks[index], footage.truth
                errors[index] = rmse(image, truth[index], mask)
                means[index] = float(image[mask].mean())
                if index - 1 in truth and last is not None:
                    both = mask & footage.masks[index - 1]
                    temporal.append(temporal_difference(image, last, truth[index], truth[index - 1], both))
                last = image
    finally:
        renderer.release()
    return Outcome(method.name, errors, means, float(np.mean(temporal)), np.nan, np.nan)


def compare(
    footage: Footage, methods: Sequence[tuple[Method, Config]], new_renderer: NewRenderer
) -> tuple[Outcome, ...]:
    """All ``methods``, each with its parameters; the first must be the noisy frame itself, the ratios are to it."""
    outcomes = [play(footage, method, config, new_renderer) for method, config in methods]
    noisy = outcomes[0]
    return tuple(
        replace(o, rmse_ratio=o.rmse / noisy.rmse, temporal_ratio=o.temporal / noisy.temporal) for o in outcomes
    )
