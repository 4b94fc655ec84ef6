"""The command line: which commands and flags there are, what they mean, and what is wrong with a wrong one.

Standard library only, and nothing that compiles or opens a device: ``--help`` answers at once.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from errors import UserError, did_you_mean

ROOT = Path(__file__).resolve().parent
DENOISERS = (
    *("none", "accumulate", "svgf", "asvgf", "bmfr"),
    *("gaussian", "bilateral", "joint", "joint-separable", "atrous", "atrous-jitter", "guided"),
    "reference",
)
LARGEST_SIDE = 16384
SCENE_FILES = ".glb .gltf .obj .ply"

WINDOW = "window"
"""``Namespace.command`` where no command is named."""


class Parser(argparse.ArgumentParser):
    """Argparse with this program's error messages: a :class:`UserError` that names the nearest known flag."""

    def __init__(self, prog: str, description: str, examples: str = "") -> None:
        super().__init__(
            prog=prog,
            description=description,
            epilog=examples,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,  # a cut-off flag would otherwise mean something else as soon as there are more of them
        )

    def parse(self, argv: Sequence[str]) -> argparse.Namespace:
        """The flags in ``argv``. Raises UserError; ``--help`` prints and exits."""
        args, unknown = self.parse_known_args(argv)
        if unknown:
            self._refuse(unknown[0])
        return args

    def error(self, message: str) -> NoReturn:
        raise UserError(message.removeprefix("argument "), f"see: {self.prog} --help")

    def _refuse(self, word: str) -> NoReturn:
        if not word.startswith("-"):
            if word in COMMANDS:
                raise UserError(f"{word}: a command comes before its flags", f"as in: app.py {word} --help")
            self.error(f"{word}: flag expected, this belongs to none")
        known = [flag for action in self._actions for flag in action.option_strings if flag.startswith("--")]
        self.error(f"{word}: unknown flag{did_you_mean(word.partition('=')[0], known)}")


def size_of(text: str) -> tuple[int, int]:
    """``640x360`` to (640, 360). Raises UserError."""
    match = re.fullmatch(r"(\d{1,9})[xX×](\d{1,9})", text.strip(), re.ASCII)
    if not match:
        raise UserError(f"--size {text}: must be WIDTHxHEIGHT in pixels, as in 640x360")
    width, height = int(match[1]), int(match[2])
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        raise UserError(f"--size {text}: each side must be in [1;{LARGEST_SIDE}] pixels")
    return width, height


def whole(flag: str, lowest: int, highest: int) -> Callable[[str], int]:
    """Reads a whole number in [lowest; highest]; what it returns raises UserError."""

    def read(text: str) -> int:
        if not re.fullmatch(r"[+-]?\d{1,18}", text, re.ASCII) or not lowest <= int(text) <= highest:
            raise UserError(f"{flag} {text}: must be a whole number in [{lowest};{highest}]")
        return int(text)

    return read


def denoiser_of(*known: str) -> Callable[[str], str]:
    """Reads one of the names ``known``; what it returns raises UserError."""

    def read(text: str) -> str:
        if text not in known:
            hint = did_you_mean(text, known)
            raise UserError(f"--denoiser {text}: there is no such denoiser{hint}", f"there are: {', '.join(known)}")
        return text

    return read


def png_path(text: str) -> Path:
    """A path that ends in .png. Raises UserError."""
    if Path(text).suffix.lower() != ".png":
        raise UserError(f"--out {text}: must end in .png", "for linear radiance add --exr: written beside the PNG")
    return Path(text)


def _add_denoiser(parser: Parser, known: Sequence[str], text: str) -> None:
    kind: Any = denoiser_of(*known)
    parser.add_argument("--denoiser", type=kind, default="svgf", metavar="D", help=f"{', '.join(known)}: {text}")


def _add_scene(parser: Parser) -> None:
    parser.add_argument(
        "--scene",
        default="cornell",
        metavar="S",
        help=f"one of app.py scenes, or a file: {SCENE_FILES} (default cornell)",
    )
    _add_environment(parser)


def number(flag: str, lowest: float, highest: float) -> Callable[[str], float]:
    """Reads a finite number in [lowest; highest]; what it returns raises UserError."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not lowest <= value <= highest:
            raise UserError(f"{flag} {text}: must be a number in [{lowest:g};{highest:g}]")
        return value

    return read


def _add_environment(parser: Parser) -> None:
    parser.add_argument(
        "--environment",
        type=Path,
        metavar="FILE",
        help="light from all around: an equirectangular picture, .hdr or .exr, instead of the scene's sky",
    )
    parser.add_argument(
        "--environment-strength",
        type=number("--environment-strength", 0.0, 1e6),
        default=1.0,
        metavar="X",
        help="what it is multiplied by (default 1)",
    )
    parser.add_argument(
        "--environment-rotation",
        type=number("--environment-rotation", -360.0, 360.0),
        default=0.0,
        metavar="DEG",
        help="degrees by which it is turned about the y axis, counter-clockwise seen from above (default 0)",
    )


def _add_size(parser: Parser) -> None:
    parser.add_argument("--size", type=size_of, metavar="WxH", help="size in pixels (default: config.toml's, 640x360)")


def _add_seed(parser: Parser) -> None:
    parser.add_argument(
        "--seed",
        type=whole("--seed", 0, 2**31 - 1),
        metavar="K",
        help="seed of all random numbers; the same one gives the same picture, to the bit (default: config.toml's, 0)",
    )


def _add_settings(parser: Parser) -> None:
    parser.add_argument(
        "--config", type=Path, default=ROOT / "config.toml", metavar="FILE", help="parameters (default: config.toml)"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="S.K=V",
        help="one parameter instead of the file's, as in svgf.iterations=3; repeatable. All are listed in config.toml",
    )


def window_parser() -> Parser:
    parser = Parser(
        "app.py",
        "Path tracing in real time: one path per pixel by Embree, the noise removed on the GPU.\n"
        "Without a command it opens a window; without a display it renders a demo to out/ instead.\n\n"
        "commands, each with its own --help:\n"
        + "\n".join(f"  {name:8s} {text}" for name, (text, _) in COMMANDS.items()),
        "examples:\n"
        "  app.py                                           the Cornell box in a window; it tells its keys\n"
        "  app.py --scene interior --camera flight          fly through a furnished room\n"
        "  app.py --scene model.glb --size 1280x720         your own scene\n"
        "  app.py render --frames 32 --out out/shot.png     a picture without a window\n"
        "  env -u DISPLAY -u WAYLAND_DISPLAY app.py         the demo, although there is a display\n"
        "app.py stands for .venv/bin/python app.py; make run ARGS='--scene interior' passes flags on as well.",
    )
    parser.usage = "app.py [FLAGS], or app.py COMMAND [FLAGS]"
    _add_scene(parser)
    _add_size(parser)
    _add_denoiser(parser, DENOISERS[:-1], "what the window begins with (default svgf)")
    parser.add_argument(
        "--camera",
        metavar="C",
        help="still, flight (if the scene has one), one of the file's cameras by name, or the file of a camera path; "
        "see app.py render --help. "
        "Default: still in the window, flight in the demo",
    )
    parser.add_argument("--no-hud", action="store_true", help="begin without the panel over the picture; G shows it")
    parser.add_argument(
        "--no-animate", action="store_true", help="objects and lamps of the window's scene rest until Space is pressed"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="folder of screenshots and the demo (default out)"
    )
    parser.add_argument(
        "--log", action="store_true", help="print what changes in the window: settings, passes of a frame, errors"
    )
    _add_seed(parser)
    _add_settings(parser)
    return parser


def render_parser() -> Parser:
    parser = Parser(
        "app.py render",
        "Render frames 0 to N-1 of a shot and write the last as PNG; prints the name of each file written.\n"
        "The picture is after anti-aliasing and tone mapping. Scene time advances by 1/30 s per frame.",
        "A camera path is TOML, keyframes with a smooth curve between them, such as the window records with C:\n"
        "  [[key]]\n"
        "  time = 0.0                     # seconds\n"
        "  position = [2.25, 1.5, 2.0]\n"
        "  target = [-0.4, 1.0, -1.1]     # or forward = [x, y, z], a direction\n"
        "  yfov = 45.0                    # degrees from bottom to top; may be left out, as may up = [x, y, z]\n"
        "or JSON, a camera for each frame; its last camera stays to the end:\n"
        '  {"frames": [{"camera_to_world_gl": [[..4..], [..4..], [..4..], [..4..]], "yfov_deg": 45}, ...]}\n'
        "The matrix acts on column vectors and has OpenGL's axes: x right, y up, looking along -z.\n\n"
        "examples:\n"
        "  app.py render                                               out/shot.png, frame 31 by SVGF\n"
        "  app.py render --scene interior --camera flight --animate    with everything in motion\n"
        "  app.py render --denoiser none --frames 1                    one path per pixel, as traced\n"
        "  app.py render --denoiser reference --frames 32 --spp 256    what frame 31 should look like\n"
        "  app.py render --exr --set svgf.preset=paper                 also out/shot.exr, other parameters\n"
        "  app.py render --show svgf.direct.accumulate.out_color       look inside the filter",
    )
    _add_scene(parser)
    _add_size(parser)
    _add_denoiser(
        parser,
        DENOISERS,
        "one path per pixel as it is, its mean over time, the full filter, or many paths (default svgf)",
    )
    parser.add_argument(
        "--frames",
        type=whole("--frames", 1, 1_000_000),
        default=32,
        metavar="N",
        help="show frame N-1 of the motion, whatever the denoiser (default 32)",
    )
    parser.add_argument(
        "--spp",
        type=whole("--spp", 1, 10_000_000),
        metavar="M",
        help="paths per pixel of --denoiser reference: a plain mean, camera and time held (default: N of --frames)",
    )
    parser.add_argument(
        "--camera",
        default="still",
        metavar="C",
        help="still, flight (if the scene has one), one of the file's cameras by name, or the file of a camera path, "
        "see below (default still)",
    )
    parser.add_argument("--animate", action="store_true", help="objects and lamps move, where the scene has such")
    parser.add_argument(
        "--jitter", action="store_true", help="shift the camera within the pixel from frame to frame (default: not)"
    )
    parser.add_argument(
        "--out",
        type=png_path,
        default=Path("out/shot.png"),
        metavar="PNG",
        help="file to write; missing folders are created (default out/shot.png)",
    )
    parser.add_argument(
        "--exr",
        action="store_true",
        help="also write OUT with suffix .exr: linear radiance before anti-aliasing and tone mapping",
    )
    parser.add_argument(
        "--show",
        default="",
        metavar="NAME",
        help="write this texture of the graph instead, scaled to be seen (with --exr also its values); "
        "app.py graph lists the names",
    )
    _add_seed(parser)
    _add_settings(parser)
    return parser


def graph_parser() -> Parser:
    parser = Parser(
        "app.py graph",
        "Print the passes of one frame in order, what each reads and writes, and which textures share memory.\n"
        "Needs no GPU. The names are those of app.py render --show.",
        "examples:\n"
        "  app.py graph\n"
        "  app.py graph --set svgf.iterations=3 --set svgf.separate=false\n"
        "  app.py graph --dot | dot -Tsvg -o graph.svg",
    )
    _add_denoiser(parser, DENOISERS, "whose passes (default svgf)")
    parser.add_argument("--dot", action="store_true", help="as Graphviz instead of text")
    parser.add_argument("--scene", metavar="S", help="as for this scene, whose objects move only with --animate")
    parser.add_argument("--animate", action="store_true", help="as in a scene in which objects move")
    _add_settings(parser)
    return parser


def explain_parser() -> Parser:
    parser = Parser(
        "app.py explain",
        "Print what a scene and a denoiser need, and why: the tracer's kernels and rays, images made and uploaded,\n"
        "passes that are on and off with the settings that decide on them, bytes of every texture. Needs no GPU.",
        "examples:\n"
        "  app.py explain --scene interior --animate\n"
        "  app.py explain --denoiser none\n"
        "  app.py explain --size 1920x1080 --set svgf.separate=false",
    )
    _add_scene(parser)
    _add_size(parser)
    _add_denoiser(parser, DENOISERS, "whose passes (default svgf)")
    parser.add_argument("--animate", action="store_true", help="objects and lamps move, where the scene has such")
    parser.add_argument("--jitter", action="store_true", help="as with app.py render --jitter")
    _add_settings(parser)
    return parser


def bench_parser() -> Parser:
    parser = Parser(
        "app.py bench",
        "Measure every denoiser on the same traced frames: time, and error and flicker against references of 1024\n"
        "paths per pixel; path tracing in the same time; and the tracer's time. Prints tables, writes JSON and CSV.\n"
        "References are kept in .cache/: only the first run takes long.",
        "examples:\n  app.py bench --quick\n  app.py bench --html --size 320x180\n"
        "  app.py bench --scene cornell --out out/cornell.json\n"
        "  app.py bench --hard --out out/hard.json                     inputs on which formulas as printed fail",
    )
    parser.add_argument("--scene", action="append", metavar="S", help="repeatable (default: cornell and interior)")
    _add_environment(parser)
    parser.add_argument("--quick", action="store_true", help="small pictures, few samples: does it run, not how fast")
    parser.add_argument(
        "--hard",
        action="store_true",
        help="measure the hard cases instead (see docs/hard_cases.md): exact answer, error, what no care would give",
    )
    parser.add_argument("--table", action="store_true", help="print tables: the default, for those who say so")
    parser.add_argument(
        "--html", action="store_true", help="also write a page with diagrams and pictures, OUT with suffix .html"
    )
    _add_size(parser)
    parser.add_argument(
        "--out", type=Path, default=Path("out/bench.json"), metavar="JSON", help="default out/bench.json"
    )
    _add_settings(parser)
    return parser


def frame_range(text: str) -> tuple[int | None, int | None]:
    """``10:20`` to (10, 20); either may be left out. Raises UserError."""
    match = re.fullmatch(r"(\d{1,9})?:(\d{1,9})?", text.strip(), re.ASCII)
    if not match:
        raise UserError(f"--frames {text}: must be A:B, from frame A up to frame B - 1, as in 10:20, 10: or :20")
    first, end = (None if number is None else int(number) for number in match.groups())
    return first, end


def record_parser() -> Parser:
    parser = Parser(
        "app.py record",
        "Record frames 0 to N-1 of a shot, and with --reference-spp converged references of them, to a folder in the\n"
        "layout of the BMFR data set: noisy illumination, guides and camera matrices. app.py replay filters them.\n"
        "Interrupted, it keeps what there is; the same command goes on. More --frames or paths continue as well.",
        "examples:\n"
        "  app.py record --frames 60 --out out/cornell\n"
        "  app.py record --scene interior --animate --frames 24 --size 320x180 --reference-spp 1024 --out out/interior",
    )
    _add_scene(parser)
    _add_size(parser)
    parser.add_argument(
        "--frames", type=whole("--frames", 1, 1_000_000), default=60, metavar="N", help="how many (default 60)"
    )
    parser.add_argument(
        "--camera",
        metavar="C",
        help="still, flight, or the file of a camera path, see app.py render --help "
        "(default: the scene's flight, still if it has none)",
    )
    parser.add_argument("--animate", action="store_true", help="objects and lamps move, where the scene has such")
    parser.add_argument(
        "--jitter", action="store_true", help="shift the camera within the pixel from frame to frame (default: not)"
    )
    parser.add_argument(
        "--gradients",
        action="store_true",
        help="with temporal gradients, for replay --denoiser asvgf; a ninth of the samples then repeat earlier paths",
    )
    parser.add_argument(
        "--reference-spp",
        type=whole("--reference-spp", 1, 10_000_000),
        default=0,
        metavar="M",
        help="paths per pixel of a reference for each frame (default: no references)",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out/recording"), metavar="DIR", help="folder (default out/recording)"
    )
    _add_seed(parser)
    _add_settings(parser)
    return parser


def replay_parser() -> Parser:
    parser = Parser(
        "app.py replay",
        "Filter recorded frames, without any scene: those of app.py record, or any in the layout of the BMFR data set\n"
        "(docs/recording.md). Writes denoised{i}.exr (linear radiance), display{i}.png, timings.json and, where there\n"
        "are references, metrics.json.",
        "examples:\n"
        "  app.py replay out/cornell\n"
        "  app.py replay out/cornell --denoiser bmfr --frames 10:20 --out out/bmfr\n"
        "  app.py replay out/cornell --window",
    )
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of the recording")
    _add_denoiser(parser, DENOISERS[:-1], "what to filter with (default svgf)")
    parser.add_argument(
        "--frames", type=frame_range, default=(None, None), metavar="A:B", help="from A up to B - 1 (default: all)"
    )
    parser.add_argument("--out", type=Path, default=Path("out/replay"), metavar="DIR", help="default out/replay")
    parser.add_argument(
        "--window", action="store_true", help="play them in the window, again and again; writes nothing"
    )
    parser.add_argument("--log", action="store_true", help="with --window: print what changes in it")
    _add_settings(parser)
    return parser


def scenes_parser() -> Parser:
    return Parser(
        "app.py scenes",
        "List the scenes that come with the program, by the names that --scene takes.\n"
        f"--scene also takes the path of a file: {SCENE_FILES}",
    )


def doctor_parser() -> Parser:
    return Parser(
        "app.py doctor",
        "Try everything the program needs (Python packages, EGL, OpenGL, Embree, compiler, display) and report\n"
        "what is there, what is missing and what to do about it. Exit code 0 if all is there, else 2.",
    )


COMMANDS: dict[str, tuple[str, Callable[[], Parser]]] = {
    "render": ("render a picture without a window", render_parser),
    "graph": ("print the passes of one frame, as text or Graphviz", graph_parser),
    "explain": ("say what a scene and a denoiser need, what it costs, and why", explain_parser),
    "bench": ("measure time and error of the denoisers", bench_parser),
    "record": ("record frames and references to a folder", record_parser),
    "replay": ("filter recorded frames, of this program or of others", replay_parser),
    "scenes": ("list the scenes that come with the program", scenes_parser),
    "doctor": ("say what is missing on this machine, and what to do", doctor_parser),
}
"""Name -> what it does, and what makes its parser."""


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """``argv`` without the program's name; ``command`` is a key of :data:`COMMANDS`, or :data:`WINDOW`.

    Raises UserError for unknown commands and flags and for values that cannot be. ``--help`` prints and exits.
    """
    if argv and argv[0] and not argv[0].startswith("-"):
        command, rest = argv[0], argv[1:]
        if command not in COMMANDS:
            hint = did_you_mean(command, COMMANDS)
            raise UserError(f"{command}: there is no such command{hint}", f"there are: {', '.join(COMMANDS)}")
        parser = COMMANDS[command][1]()
    else:
        command, rest, parser = WINDOW, argv, window_parser()
    args = parser.parse(rest)
    args.command = command
    return args
