"""What a feature costs a scene that has none of it: compiled in but unused, against compiled out.

``python -m bench.features [scene ...]``. Both kinds of frames are traced in turns and take the same decisions; medians.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import Final

import assets
from console import table
from raytrace.compiled import compile_scene
from raytrace.integrator import Tracer
from raytrace.shot import Shot

SIZE: Final = (640, 360)
ROUNDS: Final = 15

FEATURES: Final = {
    "textured": "textures",
    "sky": "a constant sky",
    "environment": "light from an environment's image",
    "punctual": "lights without a surface",
    "moving": "moving objects",
    "specular": "metals and gloss: the second lobe, its signal and its albedo",
    "glossmap": "textures of roughness and metal",
    "bumps": "normal maps",
    "colored": "colours of vertices",
    "cutout": "cut-outs",
}


@dataclass(frozen=True)
class Cost:
    """Medians in milliseconds of a frame without and with a feature that the scene does not use."""

    feature: str
    without: float
    unused: float

    @property
    def saved(self) -> float:
        return self.unused - self.without


def measure(scene: str, size: tuple[int, int] = SIZE, rounds: int = ROUNDS) -> list[Cost]:
    """Every feature in :data:`FEATURES` that ``scene``, one of :mod:`assets`, lacks."""
    compiled = compile_scene(assets.build(scene))
    with ExitStack() as stack:
        tracers = {"": Tracer(compiled)}
        lacking = [name for name in FEATURES if not getattr(tracers[""].variant, name)]
        needed = tracers[""].variant
        tracers |= {name: Tracer(compiled, variant=needed._replace(**{name: True})) for name in lacking}
        shots = {}
        for name, tracer in tracers.items():
            stack.callback(tracer.close)
            tracer.warm_up()
            shots[name] = Shot(tracer.scene, tracer, size, "flight")
        times: dict[str, list[float]] = {name: [] for name in shots}
        for index in range(rounds):
            for name, shot in shots.items():
                start = perf_counter()
                shot.frame(index)
                times[name].append(1e3 * (perf_counter() - start))
    return [Cost(name, median(times[""]), median(times[name])) for name in lacking]


def main(scenes: Sequence[str]) -> None:
    for scene in scenes or ("cornell", "interior"):
        rows = [
            (FEATURES[cost.feature], f"{cost.without:.1f}", f"{cost.unused:.1f}", f"{cost.saved:+.1f}")
            for cost in measure(scene)
        ]
        print(table((f"{scene}, {SIZE[0]}x{SIZE[1]}", "compiled out, ms", "in, unused", "saved"), rows))
        print()


if __name__ == "__main__":
    main(sys.argv[1:])
