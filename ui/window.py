"""The live window: the loop that ties tracer, filters and screen together."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import moderngl
import numpy as np

import assets
from config import Config
from errors import UserError
from gl.executor import Result
from gl.renderer import count_bad, read
from raytrace.frame import FramePacket
from session import open_shot
from ui import keys
from ui.camera_control import HeldKeys
from ui.compiling_context import CompilingContext
from ui.filters import Filters
from ui.glfw_window import Cursor, DroppedFiles, Event, Exposed, Focus, Key, MouseButton, Wheel, Window
from ui.keeping import Keeper
from ui.keys import Action
from ui.live_error import LiveError
from ui.log import Log
from ui.opening import Opening
from ui.overlay import Overlay
from ui.playback import Frames, Playback
from ui.present import Presenter, letterbox
from ui.resolution import Calibration, step
from ui.screenshot import save_path, save_screenshot
from ui.source import NewRecorder, Source
from ui.stage import Stage
from ui.state import PICTURE, State
from ui.status import Status
from ui.texture_view import TextureView
from ui.title import Pace, Title

Size = tuple[int, int]

_LONGEST_WAIT: Final = 0.25  # seconds without an event after which the loop looks again whether it can be seen
_COUNT_EVERY: Final = 8  # frames: reading the counters waits for the GPU
_RIGHT: Final = 1  # mouse button


@dataclass(frozen=True)
class Wishes:
    """What the command line asks of the window.

    Attributes:
        scene: a built-in scene, or a file.
        denoiser: a key of :data:`gl.pipelines.DENOISERS` to begin with.
        camera: ``"still"``, ``"flight"``, or a camera path in JSON; the user may take over at any time.
        animate: objects move from the start, not only once Space was pressed.
        out: folder for screenshots, made when the first is taken.
        hud: the panel is shown from the start.
        calibrate: begin with as many pixels, the configured size at most, as this machine shows fluently.
        log: print what changes, a line each.
        recorder: makes what the record key writes to; None: there is no recording.
    """

    scene: str
    denoiser: str
    camera: str
    animate: bool
    out: Path
    hud: bool
    calibrate: bool
    log: bool = False
    recorder: NewRecorder | None = None


def run(config: Config, wishes: Wishes) -> None:
    """Open the window and return when it is closed; everything is released then.

    Raises:
        UserError: no window can be opened, or the scene or the camera path cannot be loaded.
    """
    with ExitStack() as stack:
        # The window comes first, hidden: where none can be opened, nobody waits for a scene to be prepared.
        window = stack.enter_context(Window(wishes.scene, (config.render.width, config.render.height)))
        shot = open_shot(wishes.scene, config, wishes.camera, animate=True)  # Space may start what rests at first
        stage = Stage(shot, wishes.camera != "still", window.wake)
        _show(window, stage, config, wishes, stack)


def play(frames: Frames, first: int, end: int, config: Config, wishes: Wishes) -> None:
    """Open the window on recorded frames, ``first`` up to ``end``, and return when it is closed.

    Raises:
        UserError: no window can be opened, or a frame cannot be read.
    """
    factor = max(1, config.render.width // frames.size[0])
    with ExitStack() as stack:
        window = stack.enter_context(Window(wishes.scene, (frames.size[0] * factor, frames.size[1] * factor)))
        _show(window, Playback(frames, first, end, window.wake), config, wishes, stack)


def _show(window: Window, source: Source, config: Config, wishes: Wishes, stack: ExitStack) -> None:
    viewer = Viewer(window, source, config, wishes)
    stack.callback(viewer.release)
    print(f"{keys.text()}\n", flush=True)
    window.show()
    viewer.loop()


class Viewer:
    """One open window. What is shown is in ``state``; keys and the panel change nothing else."""

    def __init__(self, window: Window, stage: Source, config: Config, wishes: Wishes) -> None:
        self.window, self.stage, self._wishes = window, stage, wishes
        self.state = State(config, wishes.denoiser, wishes.animate, hud=wishes.hud)
        self._base = stage.size or (config.render.width, config.render.height)
        self._size = self._base
        with ExitStack() as stack:
            stack.callback(lambda: self.stage.close())  # whichever it is by then
            self._filters = Filters(window.ctx, _second_context(stack), window.wake)
            stack.callback(self._filters.release)
            self._presenter = Presenter(window.ctx)
            stack.callback(self._presenter.release)
            self._textures = TextureView(window.ctx)
            stack.callback(self._textures.release)
            self._overlay = Overlay(window.ctx)
            stack.callback(self._overlay.release)
            self._live = LiveError(window.ctx, window.wake)
            stack.callback(self._live.release)
            self._stack = stack.pop_all()
        self._calibration: Calibration | None = None
        self._opening: Opening | None = None
        self._keeper = Keeper(wishes.recorder, wishes.out, self.state)
        self._refused = ""  # why a scene could not be opened
        self._held = HeldKeys()
        self._cursor = Cursor(0.0, 0.0)
        self._result: Result | None = None
        self._stale = False
        self._pace = Pace()
        self._last = time.perf_counter()
        renderer = str(window.ctx.info["GL_RENDERER"])
        self._title = Title(renderer)
        self._log = Log(sys.stdout if wishes.log else None)
        self.status = Status(stage.name, renderer, self._size)
        self._calibrate()

    def loop(self) -> None:
        """Until the window is closed: one frame is traced while the one before it is filtered and shown."""
        while not (self.window.closing or self.state.closing):
            for event in self.window.wait(_LONGEST_WAIT):
                self._handle(event)
            self._fulfil()
            self.window.capture(self.state.looking)
            if self.window.hidden:
                continue  # a frame under way waits in the worker; no other is begun
            packet = None if self.stage.idle else self.stage.take()
            if self.stage.idle:
                self._begin()
            if packet is not None:
                self._keeper.keep(packet, self.stage)
            fresh = packet is not None and self._filter(packet)
            if self._result is not None and (fresh or self._stale):
                self._show(self._result, fresh)

    def release(self) -> None:
        """Free everything but the window, and tell if anything was done that OpenGL refused."""
        if (error := self.window.ctx.error) != "GL_NO_ERROR":
            print(f"OpenGL reports {error}: a mistake of this program, or of the driver", file=sys.stderr)
        if self._opening is not None:
            self._opening.close()
        self._save_path()
        self._keeper.stop()
        self._stack.close()

    def _handle(self, event: Event) -> None:
        """Note what happened. Everything that the user does comes through here; the panel's widgets come first."""
        overlaid = self._overlaid
        taken = self._overlay.feed(event) if overlaid else False
        self._stale |= overlaid
        now = time.perf_counter()
        match event:
            case Key(name, pressed) if name in keys.BY_KEY:
                binding = keys.BY_KEY[name]
                if pressed and not taken and self._refused_by_source(binding.action):
                    pass
                elif binding.action is Action.FLY:
                    # A key that is let go of is let go of, whoever has the keyboard by now.
                    if not pressed:
                        self._held.release(binding.value, now)
                    elif not taken:
                        self._held.press(binding.value, now)
                elif pressed and not taken:
                    self.state.perform(binding)
                    self._stale = True
            case MouseButton(button, pressed) if button == _RIGHT:
                self.state.looking = pressed and not taken and not self._refused_by_source(Action.FLY)
            case Cursor(x, y):
                if self.state.looking:
                    self.stage.look(x - self._cursor.x, y - self._cursor.y)
                self._cursor = event
                self._stale |= self.state.split or self.state.look.zoom > 0
            case Wheel(steps) if not taken:
                self.state.news = self.stage.change_speed(steps)
                self._stale = True
            case DroppedFiles(paths):
                self.state.scene = paths[0]
            case Focus(gained=False):
                self._held.clear()
                self.state.looking = False
            case Exposed():
                self._stale = True
        if self._overlaid and not overlaid:
            self._overlay.resume(self._cursor)

    def _refused_by_source(self, action: Action) -> bool:
        """Whether what the frames come from has no use for ``action``, which is told then."""
        refusal = self.stage.refusal(action)
        if refusal:
            self.state.news, self._stale = refusal, True
        return bool(refusal)

    @property
    def _overlaid(self) -> bool:
        """Whether anything is drawn over the picture; if not, ImGui is left alone."""
        return self.state.hud or self.state.help or self.state.inspect

    @property
    def _progress(self) -> str:
        """What is being prepared in the background, "" for nothing."""
        if self._opening is not None:
            return self._opening.progress or f"opening {self._opening.name}"
        return self._filters.progress

    def _fulfil(self) -> None:
        """Do what was wished for since the last time: another resolution, another scene."""
        state = self.state
        if state.resolution:
            self._calibration = None
            rungs, state.resolution = state.resolution, 0
            self._resize(step(self._base, self._size, rungs))
        if not state.path:
            self._save_path()
        self._keeper.follow(self.stage)
        if state.recording:
            self._calibration = None  # all pictures of a recording have one size
        if state.next_scene:
            state.next_scene = False
            names = list(assets.SCENES)
            now = self._opening.name if self._opening else self.stage.name
            state.scene = names[(names.index(now) + 1) % len(names)] if now in names else names[0]
        if state.scene:
            self._open(state.scene)
            state.scene = ""
        # A frame under way is waited for, not thrown away.
        if self._opening is not None and self._opening.done and self.stage.idle:
            self._enter(self._opening)

    def _open(self, name: str) -> None:
        """Let a scene be prepared; the one shown goes on until then."""
        if self._opening is not None:
            self._opening.close()
        self._refused = ""
        self._opening = Opening(name, self.state.config, None, True, notify=self.window.wake)
        self.state.tell(f"opening {Path(name).name}")
        self._stale = True  # told at once: the key or the drop was heard

    def _enter(self, opening: Opening) -> None:
        """Show the scene that has been prepared, or tell why it cannot be."""
        self._opening = None
        self._stale = True  # what is told below is shown at once, before other news
        try:
            shot = opening.result()
        except UserError as error:
            self.state.news = str(error).partition("\n")[0]
            self._refused = str(error)
            return
        self._save_path()
        self._keeper.stop()
        self.stage.close()
        self.stage = Stage(shot, self._wishes.camera != "still", self.window.wake)
        self.status.scene, self.status.packet, self.status.result = self.stage.name, None, None
        self.state.news = "\n".join(opening.notices).partition("\n")[0] or f"opened {self.stage.name}"
        self._calibrate()

    def _save_path(self) -> None:
        """Write the cameras that were noted, if any were."""
        if path := self.stage.take_path():
            self.state.tell(save_path(self._wishes.out, path, self.stage.name))

    def _calibrate(self) -> None:
        """Look for the resolution to show this scene in."""
        if self._wishes.calibrate and self.stage.size is None:
            self._calibration = Calibration(self._base)
            self._resize(self._calibration.size)

    def _resize(self, size: Size) -> None:
        if size != self._size:
            self._keeper.stop()
            self._size = size
            self.state.tell(f"{size[0]}x{size[1]} pixels")
            self._pace.clear()

    def _begin(self) -> None:
        """Let the next frame be traced, unless its scene is about to be left."""
        if self._opening is None or not self._opening.done:
            self.stage.begin(self.state, self._size, self._held, settled=not self._filters.progress)

    def _filter(self, packet: FramePacket) -> bool:
        """Make the next picture of ``packet``; returns whether there is one."""
        result = self._filters.run(packet, self.state)
        if result is None:
            self._stale = True  # for the sake of the progress line
            return False
        self._result = result
        now = time.perf_counter()
        interval, self._last = now - self._last, now
        self._pace.count(now, packet.timings["trace"] * 1e3)
        settled = packet.size == self._size and not self._filters.progress
        if self._calibration is not None and settled and self._calibration.count(interval):
            self._resize(self._calibration.size)
        status, profile = self.status, self._filters.profile
        status.show(packet, self._result)
        status.triangles = self.stage.triangles
        status.fps, status.trace_ms = self._pace.fps, self._pace.trace_ms
        status.work = self._pace.work = self.stage.work
        status.passes = profile.rows() if profile else []
        if not self.state.hud:
            status.bad = None
        elif packet.index % _COUNT_EVERY == 0:
            status.bad = count_bad(self._result)
        status.resting = self.stage.resting
        status.errors_now = self._live.update(now, self._result, self.stage.snapshot, self.state.error_map)
        self._log.error(status.errors_now)
        status.errors = [*self._filters.errors, *filter(None, [self._refused, self._live.trouble])]
        self._log.frame(packet.index, packet.size, self._result.plan, status.errors)
        return True

    def _show(self, result: Result, fresh: bool) -> None:
        """Draw the last picture, at whatever size the window now has. ``fresh``: it has not been drawn before."""
        state, screen, size = self.state, self.window.ctx.screen, self.window.framebuffer_size
        picture = result.outputs["display"]
        if state.error_map and self._live.map is not None:
            picture = self._live.map
        scale = size[0] / max(self.window.size[0], 1)
        column, row = int(self._cursor.x * scale), size[1] - 1 - int(self._cursor.y * scale)
        self.status.cursor = _pixel(column, row, picture.size, size)
        looked_at = picture is not self._live.map and (state.view != PICTURE or state.look.zoom > 0)
        if not (looked_at and self._textures.draw(state, self.status, screen, size)):
            noisy = None if picture is self._live.map else result.outputs.get("noisy")
            self._presenter.draw(picture, screen, size, noisy, column)
        self.status.progress = self._progress
        if self._overlaid:
            self._overlay.draw(self.window.size, size, self.window.content_scale, state, self.status)
        self.window.swap()
        self._stale = False
        if state.screenshot and fresh:  # what the keys before it have changed can be seen in it
            state.screenshot = False
            state.news = save_screenshot(self._wishes.out, (read(picture)[..., :3] * 255.0 + 0.5).astype(np.uint8))
        method = f"{state.denoiser}{' + TAA' if state.anti_aliased else ''}"
        self._log.news(state.news)
        news = state.news or self._progress
        title = self._title.update(time.perf_counter(), self.stage.name, method, self._pace, news)
        state.news = ""
        if title:
            self.window.set_title(title)


def _second_context(stack: ExitStack) -> Callable[[], moderngl.Context] | None:
    """What opens a context for compiling in the background, owned by ``stack``; None where there can be no second."""
    try:
        context = CompilingContext()
    except UserError as error:
        print(f"shaders are compiled while you wait: {error}", file=sys.stderr)
        return None
    stack.callback(context.close)
    return context.open


def _pixel(column: int, row: int, picture: Size, window: Size) -> tuple[int, int] | None:
    """The texel of ``picture`` shown at a pixel of ``window``, both with row 0 at the bottom; None beside it."""
    x, y, width, height = letterbox(picture, window)
    if not (x <= column < x + width and y <= row < y + height):
        return None
    return (column - x) * picture[0] // width, (row - y) * picture[1] // height
