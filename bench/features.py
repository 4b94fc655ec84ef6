"""What a feature costs a scene that has none of it, compiled in but unused against compiled out; and what looking
textures up costs one that has them.

``python -m bench.features [scene ...]``. All kinds of frames are traced in turns, along the same paths; medians.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from statistics import median
from time import perf_counter
from typing import Final

import assets
from console import table
from raytrace.compiled import compile_scene
from raytrace.integrator import Tracer
from raytrace.scene import Scene
from raytrace.shot import Shot
from raytrace.tables import variant_of

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
    needed = variant_of(compiled)
    lacking = [name for name in FEATURES if not getattr(needed, name)]
    more = {name: Tracer(compiled, variant=needed._replace(**{name: True})) for name in lacking}
    times = _in_turns({"": Tracer(compiled)} | more, size, rounds)
    return [Cost(name, times[""], times[name]) for name in lacking]


def lookups(scene: str, size: tuple[int, int] = SIZE, rounds: int = ROUNDS) -> tuple[float, float]:
    """Milliseconds of a frame of ``scene`` without its textures, plain colours instead, and with them."""
    textured = assets.build(scene)
    tracers = {name: Tracer(compile_scene(what)) for name, what in {"": plain(textured), "t": textured}.items()}
    times = _in_turns(tracers, size, rounds)
    return times[""], times["t"]


def plain(scene: Scene) -> Scene:
    """``scene`` without textures, but for those that cut holes."""
    materials = tuple(
        replace(m, base_texture=-1, emission_texture=-1, metallic_roughness_texture=-1, normal_texture=-1)
        if m.alpha_cutoff is None
        else m
        for m in scene.materials
    )
    return replace(scene, materials=materials)


def _in_turns(tracers: Mapping[str, Tracer], size: tuple[int, int], rounds: int) -> dict[str, float]:
    """Median milliseconds of a frame of each, after which they are closed."""
    with ExitStack() as stack:
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
    return {name: median(taken) for name, taken in times.items()}


def main(scenes: Sequence[str]) -> None:
    for scene in scenes or ("cornell", "interior"):
        rows = [
            (FEATURES[cost.feature], f"{cost.without:.1f}", f"{cost.unused:.1f}", f"{cost.saved:+.1f}")
            for cost in measure(scene)
        ]
        print(table((f"{scene}, {SIZE[0]}x{SIZE[1]}", "compiled out, ms", "in, unused", "saved"), rows))
        if assets.build(scene).textures:
            without, used = lookups(scene)
            print(f"{scene}: {without:.1f} ms without textures, {used:.1f} ms with them")
        print()


if __name__ == "__main__":
    main(sys.argv[1:])
