"""A screen of its own (Xvfb) and someone at the keyboard (xdotool) for tests of the real window."""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageGrab, features

from config import load
from gl.pipelines import FrameTraits, build

F32 = NDArray[np.float32]
T = TypeVar("T")

ROOT = Path(__file__).resolve().parents[2]
START_SECONDS = 180.0  # the first start ever compiles the tracer's kernels
SECONDS = 90.0  # for anything else; reached only if something is wrong, however busy the machine

STILL = 0.004
"""Mean difference of two filtered pictures of the same view: what noise is left. Measured: 0.0006 to 0.0024."""


def require_tools() -> None:
    """Skip the test where Xvfb or xdotool is missing."""
    missing = [name for name in ("Xvfb", "xdotool") if shutil.which(name) is None]
    if missing:
        pytest.skip(f"{' and '.join(missing)} not installed (Debian, Ubuntu: apt install xvfb xdotool)")
    if not features.check("xcb"):
        pytest.skip("this Pillow cannot read an X screen (built without XCB)")


def wait_for(condition: Callable[[], T | None], what: str, seconds: float = SECONDS) -> T:
    """The first true value of ``condition``; fails the test if there is none in time."""
    end = time.monotonic() + seconds
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > end:
            pytest.fail(f"waited {seconds:.0f} s in vain for {what}")
        time.sleep(0.05)


def plan(denoiser: str, *settings: str) -> list[str]:
    """The passes of a frame of the Cornell box, whose objects move, by their names."""
    built = build(load(None, settings), denoiser, FrameTraits(moving=True))
    return [node.name for node in built.compile().passes]


def difference(one: F32, other: F32) -> float:
    """Mean absolute difference of two pictures of the same size."""
    return float(np.abs(one - other).mean())


def roughness(picture: F32) -> float:
    """Mean difference between a pixel and the mean of its four neighbours: noise is rough, a filtered wall is not."""
    inner = picture[1:-1, 1:-1]
    around = picture[:-2, 1:-1] + picture[2:, 1:-1] + picture[1:-1, :-2] + picture[1:-1, 2:]
    return float(np.abs(inner - around / 4).mean())


@contextmanager
def screen(*options: str) -> Iterator[str]:
    """An X server without window manager, 1280x800, on a free display, whose name it yields."""
    read_end, write_end = os.pipe()
    # Without -noreset the server starts anew, deaf for a moment, whenever its last client has left.
    fixed = ("-screen", "0", "1280x800x24", "-nolisten", "tcp", "-noreset")
    command = ["Xvfb", "-displayfd", str(write_end), *fixed, *options]
    server = subprocess.Popen(command, pass_fds=(write_end,), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(write_end)
    try:
        with os.fdopen(read_end) as answer:
            number = answer.readline().strip()  # ends without a line if the server does
        assert number, "Xvfb did not start"
        yield f":{number}"
    finally:
        server.terminate()
        server.wait(SECONDS)


def environment(display: str) -> dict[str, str]:
    """This process's, but with ``display`` and no other screen."""
    kept = {k: v for k, v in os.environ.items() if k not in ("WAYLAND_DISPLAY", "XDG_SESSION_TYPE")}
    return {**kept, "DISPLAY": display}


@dataclass
class App:
    """A running program with a window, and what a person can do with it."""

    process: subprocess.Popen[bytes]
    display: str
    folder: Path
    window: str = ""

    def xdotool(self, *words: object) -> str:
        command = ["xdotool", *map(str, words)]
        done = subprocess.run(
            command, env=environment(self.display), capture_output=True, text=True, timeout=SECONDS, check=False
        )
        return done.stdout.strip()

    def find_window(self) -> str:
        """X's number of this program's visible window whose title tells a frame rate, "" without one."""
        return self.xdotool("search", "--all", "--onlyvisible", "--pid", self.process.pid, "--name", " fps ")

    def await_picture(self) -> None:
        """Until the window shows its first frame, which is when its title tells the frame rate."""

        def visible() -> bool:
            assert self.process.poll() is None, f"ended too early: {self.stderr()}"
            self.window = self.find_window()
            return bool(self.window)

        wait_for(visible, "the window", START_SECONDS)

    def press(self, *keys: str) -> None:
        """Press and release each of ``keys``, X's names of them."""
        self.xdotool("windowfocus", self.window, "key", *keys)

    def hold(self, key: str, seconds: float) -> None:
        self.xdotool("windowfocus", self.window, "keydown", key, "sleep", seconds, "keyup", key)

    @property
    def title(self) -> str:
        return self.xdotool("getwindowname", self.window)

    def await_title(self, pattern: str) -> None:
        wait_for(lambda: re.search(pattern, self.title), f"a title with {pattern!r}")

    def close_button(self) -> None:
        """What a window manager does when someone clicks the cross in the window's frame: it sends WM_DELETE_WINDOW."""
        send_delete(self.display, int(self.window))

    def picture(self, *keys: str) -> F32:
        """What is shown now, (H, W, 3) in [0, 1], row 0 on top: a screenshot by F12, directly after ``keys``."""
        shots = self.folder / "out"
        before = set(shots.glob("shot_*.png"))
        self.press(*keys, "F12")
        new = wait_for(lambda: set(shots.glob("shot_*.png")) - before, "a screenshot")
        assert len(new) == 1
        with Image.open(new.pop()) as image:
            return np.asarray(image, dtype=np.float32) / 255.0

    def settled(self) -> F32:
        """The picture once enough frames have gone into it that it no longer changes."""
        pictures = [self.picture() for _ in range(3)]

        def calm() -> bool:
            pictures.append(self.picture())
            return difference(pictures[-4], pictures[-1]) < STILL / 2

        wait_for(calm, "a picture that stands still")
        return pictures[-1]

    def screen(self) -> F32:
        """The same of the whole X screen."""
        image = ImageGrab.grab(xdisplay=self.display).convert("RGB")
        return np.asarray(image, dtype=np.float32) / 255.0

    def hear(self, pattern: str, since: int = 0, seconds: float = SECONDS) -> re.Match[str]:
        """Where ``pattern`` matches what was printed after the first ``since`` characters; waits for it."""

        def found() -> re.Match[str] | None:
            assert self.process.poll() is None, self.stderr()
            return re.compile(pattern, re.MULTILINE).search(self.stdout(), since)

        return wait_for(found, repr(pattern), seconds)

    def ask(self, key: str, pattern: str) -> re.Match[str]:
        """Press ``key`` and wait until a line is printed that ``pattern`` matches."""
        since = len(self.stdout())
        self.press(key)
        return self.hear(pattern, since)

    def go_to_scene(self, name: str) -> None:
        """Press N until scene ``name`` is being opened, those on the way are given up, and wait until it is shown."""
        while (heard := self.ask("n", r"^frame \d+: (?:.* · )?opening (\w+)$"))[1] != name:
            pass
        self.hear(f"opened {name}", heard.end(), START_SECONDS)

    def click(self, button: int, pattern: str) -> re.Match[str]:
        """The same for a button of the mouse; 4 and 5 are the wheel, away from the hand and back."""
        since = len(self.stdout())
        self.xdotool("click", button)
        return self.hear(pattern, since)

    def mouse(self) -> tuple[int, int]:
        """Where the mouse is on the screen, from the top left."""
        place = dict(word.split(":") for word in self.xdotool("getmouselocation").split())
        return int(place["x"]), int(place["y"])

    def passes(self) -> list[str]:
        """The passes of the frame shown, as ``--log`` last told them."""
        last: str = re.findall(r"pass(?:es)?: (.*)", self.stdout())[-1]
        return last.split()

    def await_passes(self, expected: list[str]) -> None:
        """Until frames run through exactly these passes, which may have to be compiled first."""
        wait_for(lambda: self.passes() == expected, f"the passes {' '.join(expected)}")

    def processor_seconds(self) -> float:
        """What the program has used so far, all threads together."""
        after_name = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(after_name[11]) + int(after_name[12])) / os.sysconf("SC_CLK_TCK")

    def megabytes(self) -> float:
        """Memory that the program holds."""
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    def stderr(self) -> str:
        return (self.folder / "stderr.txt").read_text()

    def stdout(self) -> str:
        return (self.folder / "stdout.txt").read_text()


class ClientMessage(ctypes.Structure):
    """Xlib's XClientMessageEvent."""

    _fields_ = (
        ("type", ctypes.c_int),
        ("serial", ctypes.c_ulong),
        ("send_event", ctypes.c_int),
        ("display", ctypes.c_void_p),
        ("window", ctypes.c_ulong),
        ("message_type", ctypes.c_ulong),
        ("format", ctypes.c_int),
        ("data", ctypes.c_long * 5),
        ("padding", ctypes.c_long * 24),  # an XEvent is larger than this kind of it
    )


def xlib() -> ctypes.CDLL:
    """Xlib, its functions declared as far as their results are no int."""
    x = ctypes.CDLL("libX11.so.6")
    x.XOpenDisplay.restype = ctypes.c_void_p
    for function in (x.XInternAtom, x.XDefaultRootWindow, x.XCreateSimpleWindow):
        function.restype = ctypes.c_ulong
    return x


def send_delete(display: str, window: int) -> None:
    """Ask ``window`` to close itself (ICCCM 4.2.8.1)."""
    x = xlib()
    connection = ctypes.c_void_p(x.XOpenDisplay(display.encode()))
    protocols, delete = (x.XInternAtom(connection, name, 0) for name in (b"WM_PROTOCOLS", b"WM_DELETE_WINDOW"))
    message = ClientMessage(type=33, window=window, message_type=protocols, format=32)
    message.data[0] = delete
    x.XSendEvent(connection, ctypes.c_ulong(window), 0, ctypes.c_long(0), ctypes.byref(message))
    x.XCloseDisplay(connection)


@contextmanager
def running(display: str, folder: Path, *command: str) -> Iterator[App]:
    """``command`` after the interpreter's name, started on ``display``; killed if it is still there at the end."""
    with open(folder / "stdout.txt", "wb") as out, open(folder / "stderr.txt", "wb") as err:
        process = subprocess.Popen(
            [sys.executable, *command], cwd=ROOT, env=environment(display), stdout=out, stderr=err
        )
    try:
        yield App(process, display, folder)
    finally:
        if process.poll() is None:
            process.kill()
        process.wait(SECONDS)


@contextmanager
def application(display: str, folder: Path, *flags: str, size: str = "160x90") -> Iterator[App]:
    """``app.py`` with its window on ``display``, without panel; screenshots and what it tells go to ``folder``.

    ``size``: of the picture; "": the program finds one that is shown fluently.
    """
    sized = ("--size", size) if size else ()
    command = ("app.py", *sized, "--no-hud", "--log", "--out", str(folder / "out"), *flags)
    with running(display, folder, *command) as app:
        app.await_picture()
        yield app
