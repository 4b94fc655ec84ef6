"""Path-tracing reconstruction playground: arguments in, commands out. ``app.py --help`` tells what there is."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import config as configuration
from config import Config
from errors import UserError, did_you_mean

ROOT = Path(__file__).resolve().parent
DENOISERS = ("none", "accumulate", "svgf", "reference")
LARGEST_SIDE = 16384


def parse_size(text: str) -> tuple[int, int]:
    """``640x360`` to (640, 360). Raises UserError."""
    match = re.fullmatch(r"(\d{1,9})[xX×](\d{1,9})", text.strip())
    if not match:
        raise UserError(f"--size {text}: must be WIDTHxHEIGHT, as in 640x360")
    width, height = int(match[1]), int(match[2])
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        raise UserError(f"--size {text}: each side must be in [1;{LARGEST_SIDE}] pixels")
    return width, height


def positive(text: str, flag: str, largest: int) -> int:
    """A whole number in [1; largest]. Raises UserError."""
    if not re.fullmatch(r"[+-]?\d{1,12}", text) or not 1 <= int(text) <= largest:
        raise UserError(f"{flag} {text}: must be a whole number in [1;{largest}]")
    return int(text)


class Parser(argparse.ArgumentParser):
    """Argparse whose errors look like all others, with the nearest known command or flag."""

    def error(self, message: str) -> None:  # type: ignore[override]
        known = [flag for action in self._actions for flag in action.option_strings]
        unknown = re.search(r"unrecognized arguments: (\S+)|invalid choice: '([^']*)'", message)
        hint = did_you_mean(unknown[1], known) if unknown and unknown[1] else ""
        raise UserError(f"{message}{hint}", f"see: {self.prog} --help")


def _common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--scene", default="cornell", metavar="S", help="cornell, interior, or a .glb .gltf .obj .ply file"
    )
    parser.add_argument("--size", metavar="WxH", help="pixels (default: config.toml, 640x360)")
    parser.add_argument("--seed", metavar="K", help="seed of all random numbers (default 0)")
    _settings(parser)


def _settings(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--config", type=Path, default=ROOT / "config.toml", metavar="FILE", help="parameters (config.toml)"
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="S.K=V", help="one parameter, as in svgf.iterations=3; repeatable"
    )


def build_parser() -> Parser:
    parser = Parser(
        prog="app.py",
        description="One path per pixel from Embree, reconstructed on the GPU. Without a command: the window.",
    )
    parser.add_argument("--denoiser", choices=DENOISERS[:3], default="svgf", help="what the window starts with")
    parser.add_argument("--camera", default="still", metavar="C", help="window: still or flight")
    parser.add_argument("--no-animate", action="store_true", help="window: objects rest until Space is pressed")
    parser.add_argument("--out", type=Path, default=Path("out"), metavar="DIR", help="screenshots and the demo go here")
    _common(parser)
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=Parser)

    render = commands.add_parser("render", help="render one picture without a window")
    _common(render)
    render.add_argument("--denoiser", choices=DENOISERS, default="svgf", help="reconstruction (default svgf)")
    render.add_argument(
        "--frames", default="32", metavar="N", help="render frames 0 to N-1, write the last (default 32)"
    )
    render.add_argument("--spp", metavar="M", help="paths per pixel of --denoiser reference (default: --frames)")
    render.add_argument(
        "--camera", default="still", metavar="C", help="still, flight, or a camera path in JSON (default still)"
    )
    render.add_argument("--animate", action="store_true", help="let objects and lamps move")
    render.add_argument("--jitter", action="store_true", help="sub-pixel camera jitter")
    render.add_argument("--out", type=Path, default=Path("out/shot.png"), metavar="PNG", help="default out/shot.png")
    render.add_argument(
        "--exr", action="store_true", help="linear radiance as EXR beside it, before anti-aliasing and tone map"
    )
    render.add_argument(
        "--show", default="", metavar="NAME", help="write this texture of the graph instead of the picture"
    )

    graph = commands.add_parser("graph", help="print the passes of one frame")
    graph.add_argument("--denoiser", choices=DENOISERS, default="svgf")
    graph.add_argument("--dot", action="store_true", help="as Graphviz: app.py graph --dot | dot -Tsvg -o graph.svg")
    graph.add_argument("--animate", action="store_true", help="as in a scene in which something moves")
    _settings(graph)

    bench = commands.add_parser("bench", help="measure time and error of the methods on the same frames")
    bench.add_argument("--table", action="store_true", help="print the table (default)")
    bench.add_argument("--scene", action="append", metavar="S", help="repeatable (default: cornell and interior)")
    bench.add_argument(
        "--quick", action="store_true", help="smaller pictures, fewer samples: does it run, not how fast"
    )
    bench.add_argument(
        "--out", type=Path, default=Path("out/bench.json"), metavar="JSON", help="default out/bench.json"
    )
    bench.add_argument("--size", metavar="WxH", help="pixels (default 640x360)")
    _settings(bench)

    commands.add_parser("scenes", help="list the scenes that come with the program")
    commands.add_parser("doctor", help="what is there, what is missing, what to do")
    return parser


def load_config(args: argparse.Namespace) -> Config:
    config = configuration.load(args.config, args.set)
    changes: dict[str, int] = {}
    if getattr(args, "size", None):
        changes["width"], changes["height"] = parse_size(args.size)
    if getattr(args, "seed", None) is not None:
        if not re.fullmatch(r"\d{1,10}", args.seed) or int(args.seed) >= 2**31:
            raise UserError(f"--seed {args.seed}: must be a whole number in [0;2147483647]")
        changes["seed"] = int(args.seed)
    return replace(config, render=replace(config.render, **changes))


def has_display() -> bool:
    return sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def run(argv: Sequence[str]) -> int:
    """Parse and dispatch; the exit code. Commands import what they need: ``--help`` must not wait for a compiler."""
    args = build_parser().parse_args(argv)
    if args.command == "doctor":
        import doctor

        text, healthy = doctor.report()
        print(text)
        return 0 if healthy else 2
    if args.command == "scenes":
        import assets

        for name, info in assets.SCENES.items():
            print(f"{name:12s} {info.description}")
        return 0
    config = load_config(args)
    if args.command == "graph":
        import headless

        headless.print_graph(config, args.denoiser, args.dot, args.animate)
    elif args.command == "render":
        import headless

        frames = positive(args.frames, "--frames", 1_000_000)
        samples = positive(args.spp, "--spp", 10_000_000) if args.spp is not None else frames
        jitter = args.jitter or config.render.jitter == "on"
        headless.render(
            headless.RenderJob(
                args.scene,
                args.denoiser,
                frames,
                samples,
                args.camera,
                args.animate,
                jitter,
                args.out,
                args.exr,
                args.show,
            ),
            config,
        )
    elif args.command == "bench":
        from bench import command

        command.run(config, tuple(args.scene or ("cornell", "interior")), args.quick, args.out)
    elif has_display():
        from ui import window

        window.run(config, args.scene, args.denoiser, args.camera, not args.no_animate, args.out)
    else:
        import headless

        print("no display: rendering a demo flight instead (see app.py render --help)")
        headless.demo(config, args.scene, args.out)
    return 0


def main() -> int:
    try:
        return run(sys.argv[1:])
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
