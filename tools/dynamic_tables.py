"""``python -m tools.dynamic_tables``: methods in changing light, the tables of docs/asvgf.md.

References are kept in ``.cache/references/`` as the benchmark's are.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence

from assets import dynamics
from bench.dynamic import FILMS, GLOSSY, Film, Footage, Outcome, compare, shoot
from bench.methods import NOISY, Method, NewRenderer
from bench.references import ReferenceCache
from cli import size_of
from config import Config, load
from gl.context import create_headless
from gl.renderer import Renderer

Size = tuple[int, int]

METHODS: dict[str, tuple[str, tuple[str, ...]]] = {
    "SVGF": ("svgf", ()),
    "SVGF, `alpha` 0.6": ("svgf", ("svgf.alpha=0.6",)),
    "SVGF, `fast_clamp`": ("svgf", ("svgf.fast_clamp=true", "svgf.fast_frames=2")),
    "A-SVGF, `paper`": ("asvgf", ("asvgf.preset=paper",)),
    "A-SVGF, `reference`": ("asvgf", ("asvgf.preset=reference",)),
    "A-SVGF, `gain` 10 instead of `follow`": ("asvgf", ("asvgf.follow=false", "asvgf.gain=10")),
    "A-SVGF, `best`": ("asvgf", ()),
    "BMFR": ("bmfr", ()),
    "BMFR, `fast_clamp`": ("bmfr", ("bmfr.fast_clamp=true", "bmfr.fast_frames=3", "bmfr.fast_sigma=1")),
    "BMFR, `adaptive`": ("bmfr", ("bmfr.adaptive=true",)),
}
"""Name -> denoiser, settings."""


def methods() -> list[tuple[Method, Config]]:
    """The noisy frame, then :data:`METHODS`."""
    return [(NOISY, Config()), *((Method(name, d), load(None, sets)) for name, (d, sets) in METHODS.items())]


def errors(new_renderer: NewRenderer, films: Sequence[Film], size: Size, samples: int, cache: ReferenceCache) -> None:
    """Print RMSE and temporal error of every method on every film, in parts of the noisy frames' own."""
    rows: dict[str, list[Outcome]] = {}
    for film in films:
        footage = shoot(film, Config(), size, samples, cache)
        try:
            for outcome in compare(footage, methods(), new_renderer):
                rows.setdefault(outcome.name, []).append(outcome)
            if film.name == "switching":
                _print_switch(footage, [outcomes[-1] for outcomes in rows.values()])
        finally:
            footage.shot.tracer.close()
    print(f"\n| method | {' | '.join(f'`{film.name}`' for film in films)} |")
    print(f"| --- |{' --: |' * len(films)}")
    for method, outcomes in rows.items():
        cells = (f"{o.rmse_ratio:.3f}, {o.temporal_ratio:.3f}" for o in outcomes)
        print(f"| {method} | {' | '.join(cells)} |", flush=True)


def _print_switch(footage: Footage, outcomes: Sequence[Outcome]) -> None:
    """What is left of the light some frames after it was switched off, and what there is of it after on."""
    off, on = dynamics.OFF[0], dynamics.ON
    full = footage.mean(off - 1)
    frames = [i for i in footage.film.scored if off <= i < off + 3 or on <= i < on + 3]
    heads = (f"off, frame {i - off + 1}" if i < on else f"on, frame {i - on + 1}" for i in frames)
    print(f"\n| mean, of that before | {' | '.join(heads)} |")
    print(f"| --- |{' --: |' * len(frames)}")
    for outcome in outcomes:
        print(f"| {outcome.name} | {' | '.join(f'{outcome.means[i] / full:.3f}' for i in frames)} |", flush=True)


def times(new_renderer: NewRenderer, size: Size, frames: int = 24) -> None:
    """Print medians of processor time: tracing with gradients and without, and the filters, all in turns."""
    film = FILMS["moving"]
    shot = film.open(Config(), size)
    plain: list[float] = []
    carried: list[float] = []
    for repeat in range(4):
        for remember, kept in (("", plain), ("random", carried)):
            shot.remember = remember
            for index in range(frames):
                start = time.process_time()
                shot.frame(index)
                if index > 3 or repeat:
                    kept.append(time.process_time() - start)
    base, with_gradients = (statistics.median(kept) * 1e3 for kept in (plain, carried))
    print(f"tracing {base:.1f} ms, with gradients {with_gradients:.1f} ms ({with_gradients / base - 1:+.1%})")
    chosen = [
        (method, config)
        for method, config in methods()
        if method.name in ("SVGF", "A-SVGF, `best`", "BMFR", "BMFR, `adaptive`")
    ]
    renderers = {method.name: new_renderer() for method, _ in chosen}
    spent: dict[str, list[float]] = {name: [] for name in renderers}
    shot.remember = "random"
    for index in range(frames):
        packet = shot.frame(index)
        for method, config in chosen:
            start = time.process_time()
            renderer = renderers[method.name]
            renderer.run(packet, config, method.denoiser)
            renderer.ctx.finish()
            if index > 3:
                spent[method.name].append(time.process_time() - start)
    for name, values in spent.items():
        renderers[name].release()
        print(f"{name}: {statistics.median(values) * 1e3:.1f} ms")
    shot.tracer.close()


def build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="dynamic_tables", description="Print tables of methods in changing light.")
    parser.add_argument("films", nargs="*", help=f"of {', '.join(FILMS)} (default: all)")
    parser.add_argument("--size", default="320x180", metavar="WxH", help="size in pixels (default 320x180)")
    parser.add_argument("--samples", type=int, default=512, help="paths per pixel of references (default 512)")
    parser.add_argument("--frames", type=int, default=48, help="of each film, 78 at most (default 48)")
    parser.add_argument("--glossy", action="store_true", help="films of specular light instead")
    parser.add_argument("--times", action="store_true", help="times only")
    return parser


def main() -> None:
    args = build_parser().parse_args()
    ctx = create_headless()
    size = size_of(args.size)
    if args.times:
        times(lambda: Renderer(ctx), size)
    else:
        chosen = GLOSSY if args.glossy else [FILMS[name] for name in args.films or FILMS]
        films = [film.first(args.frames) for film in chosen]
        errors(lambda: Renderer(ctx), films, size, args.samples, ReferenceCache())
    ctx.release()


if __name__ == "__main__":
    main()
