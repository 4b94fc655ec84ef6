"""Path-tracing reconstruction playground: arguments in, commands out. ``app.py --help`` tells what there is."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import cli
import config as configuration
from config import Config, Surroundings
from errors import UserError

if TYPE_CHECKING:
    from bench.recording.replay import ReplayJob


def load_config(args: argparse.Namespace) -> Config:
    """Parameters from the file, then ``--set``, then the flags that are parameters. Raises UserError."""
    config = configuration.load(args.config, args.set)
    changes: dict[str, Any] = {}
    if getattr(args, "size", None) is not None:
        changes["width"], changes["height"] = args.size
    if getattr(args, "seed", None) is not None:
        changes["seed"] = args.seed
    surroundings = config.surroundings
    if getattr(args, "environment", None) is not None:
        surroundings = Surroundings(args.environment, args.environment_strength, args.environment_rotation)
    return replace(config, render=replace(config.render, **changes), surroundings=surroundings)


def has_display() -> bool:
    return sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def run(argv: Sequence[str]) -> int:
    """Parse and dispatch; the exit code. Commands import what they need: ``--help`` must not wait for a compiler."""
    args = cli.parse(argv)
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

        headless.print_graph(config, args.denoiser, args.dot, args.animate, args.scene)
    elif args.command == "explain":
        import explain

        explain.run(config, args.scene, args.denoiser, args.animate, args.jitter)
    elif args.command == "render":
        import headless

        headless.render(headless.RenderJob.of(args, config), config)
    elif args.command == "bench":
        if args.hard:
            from bench.hard import cases

            cases.run(args.out)
            return 0
        from bench import command

        command.run(config, tuple(args.scene or ("cornell", "interior")), args.quick, args.out, args.html)
    elif args.command == "record":
        from bench.recording import record

        record.run(record.RecordJob.of(args, config), config)
    elif args.command == "replay":
        from bench.recording import replay

        job = replay.ReplayJob.of(args)
        if args.window:
            play(job, config)
        else:
            replay.run(job, config)
    elif has_display():
        from bench.recording import live
        from ui import window

        window.run(
            config,
            window.Wishes(
                scene=args.scene,
                denoiser=args.denoiser,
                camera=args.camera or "still",
                animate=not args.no_animate,
                out=args.out,
                hud=not args.no_hud,
                calibrate=args.size is None,
                log=args.log,
                recorder=live.new_recorder,
            ),
        )
    else:
        import demo

        print("no display, hence no window: a demo is rendered instead (pictures of your own: app.py render --help)")
        demo.run(config, args.scene, args.camera, args.out)
    return 0


def play(job: ReplayJob, config: Config) -> None:
    """Recorded frames in the window. Raises UserError where they or a window cannot be had."""
    if not has_display():
        raise UserError("--window: there is no display to open a window on", "without --window it writes files")
    from bench.recording import live, replay
    from ui import window

    sequence, frames, config = replay.prepare(job, config)
    wishes = window.Wishes(
        scene=sequence.name,
        denoiser=job.denoiser,
        camera="still",
        animate=True,
        out=job.out,
        hud=True,
        calibrate=False,
        log=job.log,
        recorder=live.new_recorder,
    )
    window.play(sequence, frames[0], frames[-1] + 1, config, wishes)


def main() -> int:
    """Exit codes: 0 done; 2 something for the user to mend, told in one message; 130 interrupted."""
    try:
        code = run(sys.argv[1:])
        sys.stdout.flush()
        return code
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except PermissionError as error:  # merely asking whether a file is there may be refused
        print(f"error: {error.filename}: {error.strerror}", file=sys.stderr)
        return 2
    except MemoryError as error:
        print(f"error: out of memory ({error})\n  choose a smaller --size, or close other programs", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # whoever read the output, such as head, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or the interpreter's own flush would fail
        return 141


if __name__ == "__main__":
    sys.exit(main())
