"""The live window: the loop that ties tracer, filters and screen together."""

from __future__ import annotations

import re
import sys
import time
from collections import deque
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import numpy as np

from config import Config
from errors import UserError
from gl.executor import Result
from gl.profiler import Profiler
from gl.renderer import Renderer, read
from images import write_png
from raytrace.frame import FramePacket
from raytrace.shot import FPS, Shot
from raytrace.worker import Request, Worker
from session import open_shot
from ui import keys
from ui.camera_control import CameraControl, HeldKeys
from ui.glfw_window import Cursor, Event, Exposed, FocusLost, Key, LookButton, Wheel, Window
from ui.keys import Action
from ui.present import Presenter
from ui.state import State

_LONGEST_WAIT: Final = 0.25  # seconds without an event after which the loop looks again whether it can be seen
_TITLE_EVERY: Final = 0.5  # seconds
_NEWS_FOR: Final = 3.0  # seconds


def run(config: Config, scene: str, denoiser: str, camera: str, animate: bool, out: Path) -> None:
    """Open the window and return when it is closed; everything is released then.

    Args:
        scene: a built-in scene, or a file.
        denoiser: a key of :data:`gl.pipelines.DENOISERS` to begin with.
        camera: ``"still"``, ``"flight"``, or a camera path in JSON; the user may take over at any time.
        animate: objects move from the start, not only once Space was pressed.
        out: folder for screenshots, made when the first is taken.

    Raises:
        UserError: no window can be opened, or the scene or the camera path cannot be loaded.
    """
    with ExitStack() as stack:
        # The window comes first, hidden: where none can be opened, nobody waits for a scene to be prepared.
        window = stack.enter_context(Window(scene, (config.render.width, config.render.height)))
        shot = open_shot(scene, config, camera, animate=True)  # Space may start what rests at first
        stack.enter_context(shot.tracer)
        renderer = Renderer(window.ctx)
        stack.callback(renderer.release)
        presenter = Presenter(window.ctx)
        stack.callback(presenter.release)
        worker = stack.enter_context(Worker(shot.tracer, window.wake))
        control = CameraControl(shot.camera, camera != "still", shot.scene.extent)
        print(f"{keys.text()}\n", flush=True)
        window.show()
        Viewer(window, shot, worker, renderer, presenter, control, State(config, denoiser, animate), out).loop()


class Viewer:
    """One open window on one shot. What is shown is in ``state``; keys change nothing else."""

    def __init__(
        self,
        window: Window,
        shot: Shot,
        worker: Worker,
        renderer: Renderer,
        presenter: Presenter,
        control: CameraControl,
        state: State,
        out: Path,
    ) -> None:
        self.window, self.shot, self.worker, self.state = window, shot, worker, state
        self._renderer, self._presenter, self._control, self._out = renderer, presenter, control, out
        self._profiler = Profiler(window.ctx)
        self._held = HeldKeys()
        self._cursor = Cursor(0.0, 0.0)
        self._look = (0.0, 0.0)
        self._animation_frame = 0
        self._result: Result | None = None
        self._exposed = False
        self._title = Title(f"{shot.scene.scene.name}", str(window.ctx.info["GL_RENDERER"]))

    def loop(self) -> None:
        """Until the window is closed: one frame is traced while the one before it is filtered and shown."""
        while not (self.window.closing or self.state.closing):
            for event in self.window.wait(_LONGEST_WAIT):
                self._handle(event)
            self.window.capture(self.state.looking)
            if self.window.hidden:
                continue  # a frame under way waits in the worker; no other is begun
            if not self.worker.busy:
                self.worker.submit(self._request())
            packet = self.worker.take()
            if packet is not None:
                self.worker.submit(self._request())
                self._filter(packet)
            if self._result is not None and (packet is not None or self._exposed):
                self._show(self._result)

    def _handle(self, event: Event) -> None:
        """Note what happened. Everything that the user does comes through here."""
        now = time.perf_counter()
        match event:
            case Key(name, pressed) if name in keys.BY_KEY:
                binding = keys.BY_KEY[name]
                if binding.action is Action.FLY:
                    (self._held.press if pressed else self._held.release)(binding.value, now)
                elif pressed:
                    self.state.perform(binding)
            case LookButton(pressed):
                self.state.looking = pressed
            case Cursor(x, y):
                if self.state.looking:
                    self._look = (self._look[0] + x - self._cursor.x, self._look[1] + y - self._cursor.y)
                self._cursor = event
            case Wheel(steps):
                self._control.change_speed(steps)
            case FocusLost():
                self._held.clear()
                self.state.looking = False
            case Exposed():
                self._exposed = True

    def _request(self) -> Request:
        """The next frame to trace: one step of the scene's time and of the camera."""
        state, control = self.state, self._control
        cut, state.home = state.home, False
        if cut:
            control.home()
        held, look = self._held.drain(time.perf_counter()), self._look
        self._look = (0.0, 0.0)
        camera = control.next(held, look)
        now = self._animation_frame / FPS
        if state.animate:
            self._animation_frame += 1
        return Request(camera, self.shot.size, now, state.jitter, cut)

    def _filter(self, packet: FramePacket) -> None:
        state = self.state
        reset, state.reset = state.reset, ""
        self._result = self._renderer.run(packet, state.config, state.denoiser, reset=reset, profiler=self._profiler)
        self._title.count(time.perf_counter(), packet.timings["trace"] * 1e3)

    def _show(self, result: Result) -> None:
        """Draw the last picture, at whatever size the window now has."""
        picture = result.outputs["display"]
        self._presenter.draw(picture, self.window.ctx.screen, self.window.framebuffer_size)
        self.window.swap()
        self._exposed = False
        if self.state.screenshot:
            self.state.screenshot = False
            self.state.news = save_screenshot(self._out, (read(picture)[..., :3] * 255.0 + 0.5).astype(np.uint8))
        method = f"{self.state.denoiser}{' + TAA' if self.state.anti_aliased else ''}"
        filter_ms = sum(row.milliseconds for row in self._profiler.rows())
        title = self._title.update(time.perf_counter(), method, filter_ms, self.state.news)
        self.state.news = ""
        if title:
            self.window.set_title(title)


class Title:
    """The window's title: scene, method, frames per second, milliseconds; for a while also what was just done."""

    def __init__(self, scene: str, renderer: str) -> None:
        self._scene, self._renderer = scene, renderer
        self._news, self._news_until = "", 0.0
        self._changed = -_TITLE_EVERY
        self._shown: deque[float] = deque(maxlen=32)
        self._trace_ms: deque[float] = deque(maxlen=32)

    def count(self, now: float, trace_ms: float) -> None:
        """One more frame was shown; it took so long to trace. ``now``: seconds, of the clock :meth:`update` uses."""
        self._shown.append(now)
        self._trace_ms.append(trace_ms)

    def update(self, now: float, method: str, filter_ms: float, news: str) -> str:
        """A new title, or "" while the old one is fresh enough."""
        if news:
            self._news, self._news_until = news, now + _NEWS_FOR
        elif now - self._changed < _TITLE_EVERY:
            return ""
        self._changed = now
        span = self._shown[-1] - self._shown[0] if self._shown else 0.0
        rate = (len(self._shown) - 1) / span if span > 0.0 else 0.0
        parts = [self._news] if now < self._news_until else []
        parts += [self._scene, method, f"{rate:.1f} fps"]
        parts += [f"tracing {float(np.median(self._trace_ms)):.0f} ms", f"filtering {filter_ms:.0f} ms", self._renderer]
        return " · ".join(parts)


def save_screenshot(folder: Path, pixels: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> str:
    """Write ``pixels`` (H, W, 3), row 0 = bottom, to ``shot_NNN.png``, NNN not used yet; returns what to tell the user.

    A folder that cannot be written to is told as well, but closes no window.
    """
    taken = [int(found[1]) for path in folder.glob("shot_*.png") if (found := re.fullmatch(r"shot_(\d+)", path.stem))]
    path = folder / f"shot_{max(taken, default=-1) + 1:03d}.png"
    try:
        write_png(path, pixels)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return str(error).partition("\n")[0]
    print(path, flush=True)
    return f"saved {path}"
