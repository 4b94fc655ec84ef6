"""What is measured: which scenes, seen from where, with what moving, and how thoroughly."""

from __future__ import annotations

from dataclasses import dataclass, replace

from config import Config
from raytrace.shot import Shot
from session import open_shot

FRAMES = 24
"""Frames of the motion that are run: 0 to 23."""

FIRST_MEASURED = 4
"""Earlier frames warm up: caches are cold, and histories short, which no later frame has again."""

SCORED_PAIRS = ((6, 7), (11, 12), (17, 18), (22, 23))
"""Consecutive frames that have a reference: their errors are averaged, their differences compared."""

SCORED = tuple(frame for pair in SCORED_PAIRS for frame in pair)

QUICK_SIZE = (160, 90)


@dataclass(frozen=True)
class Effort:
    """``samples``: paths per pixel of references; ``slice``: those traced between two saves; ``repeats`` of the
    methods' sequence and ``tracing_repeats`` of the tracer's; ``memory_frames``: length of the run that watches memory,
    0 = none. ``events``: how much is spent on what happens over time.
    """

    samples: int
    slice: int
    repeats: int
    tracing_repeats: int
    memory_frames: int
    events: EventEffort


@dataclass(frozen=True)
class EventEffort:
    """``size``: (width, height) of the pictures; ``frames``: before the event, and from it on; ``samples``: paths per
    pixel of a reference. ``stages``: variants of a method take part as well."""

    size: tuple[int, int]
    frames: tuple[int, int]
    samples: int
    stages: bool


FULL = Effort(
    1024, 64, repeats=2, tracing_repeats=2, memory_frames=1000, events=EventEffort((160, 90), (16, 40), 2048, True)
)
QUICK = Effort(64, 8, repeats=1, tracing_repeats=1, memory_frames=0, events=EventEffort((64, 36), (8, 16), 128, False))


@dataclass(frozen=True)
class Case:
    """A scene with its camera ("still" or "flight"), whether its objects move, and a divisor of the picture's sides."""

    scene: str
    camera: str = "still"
    animate: bool = False
    divisor: int = 1

    @property
    def motion(self) -> str:
        """What moves, in words."""
        moving = [word for word, moves in (("camera", self.camera == "flight"), ("objects", self.animate)) if moves]
        return f"moving {' and '.join(moving)}" if moving else "nothing moves"

    @property
    def label(self) -> str:
        return f"{self.scene}, {self.motion}"

    def open(self, config: Config) -> Shot:
        """The shot, without sub-pixel jitter: pictures and references share the pixels' centres."""
        render = config.render
        width, height = max(1, render.width // self.divisor), max(1, render.height // self.divisor)
        sized = replace(config, render=replace(render, width=width, height=height))
        return open_shot(self.scene, sized, self.camera, self.animate)


# References of a room of 180,000 triangles in which lamps move take long: half the picture's sides there.
_QUALITY = {
    "cornell": Case("cornell", "flight"),
    "interior": Case("interior", "flight", animate=True, divisor=2),
}
_TRACING = {
    "cornell": (Case("cornell", "flight"),),
    "interior": (Case("interior"), Case("interior", animate=True)),
}


def quality_case(scene: str, quick: bool) -> Case:
    """What error is measured on in ``scene``; a scene from a file stands still."""
    case = _QUALITY.get(scene, Case(scene))
    return replace(case, divisor=1) if quick else case


def tracing_cases(scene: str) -> tuple[Case, ...]:
    """What the tracer's speed is measured on in ``scene``."""
    return _TRACING.get(scene, (Case(scene),))


def quick_size(config: Config) -> Config:
    """``config`` with a picture no larger than QUICK_SIZE."""
    width, height = QUICK_SIZE
    if config.render.width * config.render.height <= width * height:
        return config
    return replace(config, render=replace(config.render, width=width, height=height))
