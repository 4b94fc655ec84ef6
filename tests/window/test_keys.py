"""Every key of the key table, pressed by xdotool in the real window: what it changes is seen in the picture, on the
screen, or in the passes that the frame runs through.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import assets
from bench.recording.sequence import open_sequence
from raytrace.camera_path import read_keyframes
from raytrace.shot import FPS
from tests.window.desktop import F32, START_SECONDS, STILL, App, application, difference, plan, roughness, wait_for
from ui.keys import BINDINGS, Binding

pytestmark = pytest.mark.window

WINDOW = 640, 360


@pytest.fixture(scope="module")
def shared(display: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    with application(display, tmp_path_factory.mktemp("keys"), "--no-animate") as app:
        app.xdotool("windowsize", app.window, *WINDOW)
        yield app


@pytest.fixture
def app(shared: App) -> Iterator[App]:
    """SVGF at rest, the camera at its beginning, everything as the program starts; to be left like that."""
    shared.press("1", "r")
    shared.ask("h", "history reset")
    shared.await_passes(plan("svgf"))
    yield shared
    assert shared.process.poll() is None, shared.stderr()
    assert shared.stderr() == ""


def on_screen(app: App) -> F32:
    """The window's part of the screen, (H, W, 3), row 0 on top."""
    return app.screen()[: WINDOW[1], : WINDOW[0]]


def method(key: str, denoiser: str) -> Callable[[App], None]:
    """``key`` shows ``denoiser``, from whichever other one."""

    def check(app: App) -> None:
        app.press("0" if denoiser == "svgf" else "1")
        app.await_title(f" {'none' if denoiser == 'svgf' else 'svgf'} ")
        app.press(key)
        app.await_title(f" {denoiser} ")
        app.await_passes(plan(denoiser))
        noisy = roughness(app.settled() if denoiser != "none" else app.picture())
        assert (noisy > 0.02) == (denoiser == "none")

    return check


def stage(key: str, *states: str, last: str = "") -> Callable[[App], None]:
    """Each press of ``key`` brings the next of ``states``, settings as ``--set`` takes them, and its passes.

    ``last``: another key that takes the change back; otherwise ``states`` go round.
    """

    def check(app: App) -> None:
        for setting in states:
            name, _, value = setting.partition("=")
            app.ask(key, f": {name} = {value}$")
            app.await_passes(plan("svgf", setting))
        if last:
            app.ask(last, " = ")
            app.await_passes(plan("svgf"))

    assert any(plan("svgf", setting) != plan("svgf") for setting in states), "passes cannot tell these settings"
    return check


def previous(app: App) -> None:
    app.press("0")
    app.await_passes(plan("none"))
    app.press("Tab")
    app.await_passes(plan("svgf"))
    app.press("Tab")
    app.await_passes(plan("none"))
    assert roughness(app.picture()) > 0.02


def look(app: App, key: str) -> str:
    """What is looked at after ``key``: the name of a texture, or "the picture"."""
    return app.ask(key, r"^frame \d+: (\w+(?:\.\w+)+|the picture)$")[1]


@contextmanager
def albedo(app: App) -> Iterator[Callable[[], F32]]:
    """Looks at the tracer's albedo, free of noise: yields what makes another frame and returns how it looks."""

    def another() -> F32:
        # What is told of a frame may be read before the screen has it: that of the frame before it is there by then.
        for _ in range(2):
            app.ask("h", "history reset")
        return on_screen(app)

    views: list[str] = []
    while not views or views[-1] != "frame.albedo":
        views.append(look(app, "b"))
        assert views[-1] != "the picture", f"no albedo among {views}"
    try:
        yield another
    finally:
        for view in [*views[-2::-1], "the picture"]:
            app.ask("v", view)


def jitter(app: App) -> None:
    """Edges lie elsewhere within the pixels in every frame, or not."""
    with albedo(app) as another:
        assert len({another().tobytes() for _ in range(3)}) > 1
        app.ask("F6", "render.jitter = off")
        assert len({another().tobytes() for _ in range(3)}) == 1
        app.ask("F6", "render.jitter = on")
        assert len({another().tobytes() for _ in range(3)}) > 1


def tone_curve(app: App) -> None:
    app.ask("F9", "display.tonemap = none")
    linear = app.settled()
    assert linear.max() == 1.0
    app.ask("F9", "display.tonemap = reinhard")
    wait_for(lambda: app.picture().max() < 1.0, "the lamp to be a little below white")
    app.ask("F9", "display.tonemap = aces")
    wait_for(lambda: app.picture().max() == 1.0, "the lamp to be white")
    assert difference(linear, app.settled()) > 3 * STILL


def exposure(key: str, back: str, sign: int) -> Callable[[App], None]:
    def check(app: App) -> None:
        before = app.settled().mean()
        app.ask(key, f"display.exposure = {0.5 * sign}$")
        assert sign * (app.settled().mean() - before) > 5 * STILL
        app.ask(back, r"display.exposure = 0.0")
        assert abs(app.settled().mean() - before) < STILL

    return check


def animation(app: App) -> None:
    rest = app.settled()
    app.ask("space", "animation goes on")
    wait_for(lambda: difference(rest, app.picture()) > 2 * STILL, "block and lamp to move")
    app.ask("space", "animation stopped")
    stopped = app.settled()
    assert difference(stopped, app.settled()) < STILL


def lamps(app: App) -> None:
    """A-SVGF shows the dark at once, SVGF fades: three pictures after the key tell them apart."""
    shares = {}
    for key, denoiser in (("1", "svgf"), ("3", "asvgf")):
        app.press(key)
        app.await_passes(plan(denoiser))
        before = app.settled().mean()
        app.ask("o", "lamps off")
        shares[denoiser] = [app.picture().mean() / before for _ in range(3)]
        app.ask("o", "lamps on")
        assert abs(app.settled().mean() / before - 1.0) < 0.05
    assert shares["asvgf"][-1] < 0.05 < shares["svgf"][-1] < 0.95, shares


def single_step(app: App) -> None:
    app.ask("F6", "render.jitter = off")
    with albedo(app) as another:
        before = another()
        for step in range(20):  # where the block turns round, steps are too small to be seen
            app.ask("period", "one step of the animation")
            another()  # the tracer is a frame ahead of what is shown
            after = another()
            assert np.array_equal(after, another()), "it stops there"
            if step > 1 and not np.array_equal(before, after):
                break
        else:
            raise AssertionError("twenty steps, and nothing has moved")
    app.ask("F6", "render.jitter = on")


def next_scene(app: App) -> None:
    """The second scene, and round all others back to the first."""
    first, second, *_ = assets.SCENES
    heard = app.ask("n", f"opening {second}")
    app.hear(f"opened {second}", heard.end(), START_SECONDS)
    app.await_title(f"· {second} · svgf")
    app.go_to_scene(first)
    app.await_title(f"· {first} · svgf")


def camera_home(app: App) -> None:
    before = app.settled()
    app.hold("d", 0.3)
    assert difference(before, app.settled()) > 2 * STILL
    app.ask("r", "camera reset")
    assert difference(before, app.settled()) < STILL


def history(app: App) -> None:
    before = app.settled()
    assert difference(before, app.picture()) < STILL / 2
    assert difference(before, app.picture("h")) > STILL, "noisier with fewer frames in it"


def next_texture(app: App) -> None:
    app.settled()
    before = on_screen(app)
    name = look(app, "b")
    wait_for(lambda: difference(before, on_screen(app)) > 10 * STILL, f"{name} on the screen")
    app.ask("v", "the picture")
    wait_for(lambda: difference(before, on_screen(app)) < 2 * STILL, "the picture on the screen")


def texture_before(app: App) -> None:
    there = [look(app, "b") for _ in range(3)]
    back = [look(app, "v") for _ in range(4)]
    assert back[:3] == [*there[1::-1], "the picture"]
    assert back[3] not in there, "before the first comes the last"
    app.ask("b", "the picture")


def split(app: App) -> None:
    app.xdotool("mousemove", "--window", app.window, WINDOW[0] // 2, 20)
    smooth = roughness(app.settled())
    app.ask("x", "split on")

    def halves() -> bool:
        left, right = np.split(on_screen(app)[::4, ::4], 2, axis=1)
        return roughness(left) > 3 * smooth and roughness(right[:, 2:]) < 2 * smooth

    wait_for(halves, "noise to the left of the mouse only")
    app.ask("x", "split off")
    wait_for(lambda: roughness(on_screen(app)[::4, ::4]) < 2 * smooth, "no noise at all")


def overlay(key: str, name: str) -> Callable[[App], None]:
    """``key`` draws text over the picture, and takes it away."""

    def check(app: App) -> None:
        app.xdotool("mousemove", "--window", app.window, WINDOW[0] // 2, WINDOW[1] // 2)
        app.settled()
        before = on_screen(app)

        def changed() -> int:
            """How many pixels are quite another colour now."""
            return int((np.abs(on_screen(app) - before).max(axis=2) > 0.2).sum())

        app.ask(key, f"{name} on")
        wait_for(lambda: changed() > 1000, f"{name} over the picture")
        app.ask(key, f"{name} off")
        wait_for(lambda: changed() < 100, "the picture alone")

    return check


def resolution(key: str, back: str, size: tuple[int, int]) -> Callable[[App], None]:
    def check(app: App) -> None:
        app.ask(key, f"^frame \\d+: {size[0]}x{size[1]}, ")
        app.await_title(f"{size[0]}x{size[1]} pixels")
        assert app.picture().shape == (size[1], size[0], 3)
        app.ask(back, r"^frame \d+: 160x90, ")
        assert app.picture().shape == (90, 160, 3)

    return check


def screenshot(app: App) -> None:
    name = app.ask("F12", r"^frame \d+: saved (.*shot_\d+\.png)$")[1]
    assert name in {str(path) for path in app.folder.glob("out/shot_*.png")}
    assert f"\n{name}\n" in app.stdout()


def camera_path(app: App) -> None:
    app.ask("c", "recording the camera's path")
    app.hold("d", 0.4)
    name = app.ask("c", r"^frame \d+: saved (.*camera_\d+\.toml)$")[1]
    keys, _ = read_keyframes(Path(name))
    assert len(keys) >= 2
    assert [key.time for key in keys] == [index / FPS for index in range(len(keys))]
    first, last = keys[0].camera, keys[-1].camera
    assert first == assets.build("cornell").camera
    way = np.array(last.position) - first.position
    assert way @ first.basis()[0] > 0.1
    assert f"\n{name}\n" in app.stdout()


def let_go(app: App) -> None:
    """While the mouse turns the camera; a later test has the other meaning of Escape."""
    app.xdotool("mousemove", "--window", app.window, 320, 100, "mousedown", 3, "sleep", 0.3)
    app.press("Escape")
    before = app.settled()
    app.xdotool("mousemove_relative", 60, 10, "mouseup", 3)
    assert difference(before, app.settled()) < STILL


def place(picture: F32) -> tuple[float, float, float]:
    """Where the light of a picture is: mean column, mean row from the top, and how far from there on the average."""
    light = picture.sum(axis=2, dtype=np.float64)
    rows, columns = np.indices(light.shape)
    x, y = ((light * at).sum() / light.sum() for at in (columns, rows))
    return x, y, float((light * np.hypot(columns - x, rows - y)).sum() / light.sum())


def flight(key: str, moved: int, sign: int) -> Callable[[App], None]:
    """While ``key`` is held, component ``moved`` of :func:`place` grows or, with ``sign`` -1, shrinks."""

    def check(app: App) -> None:
        before = place(app.settled())[moved]
        app.hold(key, 0.4)
        assert sign * (place(app.settled())[moved] - before) > 0.5

    return check


def fast(app: App) -> None:
    start = place(app.settled())[0]
    app.hold("d", 0.4)
    slow = start - place(app.settled())[0]
    app.ask("r", "camera reset")
    app.xdotool("windowfocus", app.window, "keydown", "Shift_L", "keydown", "d", "sleep", 0.4, "keyup", "d")
    app.xdotool("keyup", "Shift_L")
    assert start - place(app.settled())[0] > 1.5 * slow > 0.0


def recording(app: App) -> None:
    """The frames shown, in their size and in order, from the key to the key."""
    folder = Path(app.ask("F11", r"recording to (\S+)$")[1])
    wait_for(lambda: (folder / "world_position3.exr").exists(), "four recorded frames")
    told = app.ask("F11", r"recorded (\d+) frames to (\S+)$")
    app.hear(rf"^{re.escape(str(folder))}$")
    sequence = open_sequence(folder)
    assert (sequence.frames, str(folder)) == (int(told[1]), told[2])
    assert sequence.size == (160, 90)
    assert sequence.notes["about"]["scene"] == "cornell"
    first, last = sequence.packet(0), sequence.packet(sequence.frames - 1)
    assert not np.array_equal(first.direct, last.direct)
    assert (last.motion[..., :2] == 0.0).all()  # the camera is at rest
    assert first.jitter != last.jitter  # but for what the anti-aliasing wants
    since = len(app.stdout())
    app.press("0")
    app.hear("noisy frame", since)
    assert not (folder / f"color{sequence.frames}.exr").exists()


def error_map(app: App) -> None:
    before = app.settled()
    app.ask("m", "error map on$")
    wait_for(lambda: difference(before, app.picture()) > 0.05, "the map of the errors instead of the picture")
    app.ask("m", "error map off$")
    wait_for(lambda: difference(before, app.picture()) < 2 * STILL, "the picture again")


CHECKS: dict[str, Callable[[App], None]] = {
    "0": method("0", "none"),
    "1": method("1", "svgf"),
    "2": method("2", "bmfr"),
    "3": method("3", "asvgf"),
    "TAB": previous,
    "P": stage("p", "svgf.preset=paper", "svgf.preset=reference", "svgf.preset=best"),
    "F1": stage("F1", "svgf.temporal=false", "svgf.temporal=true"),
    "F2": stage("F2", "svgf.variance_guided=false", "svgf.variance_guided=true"),
    "F3": stage("F3", "svgf.iterations=0", "svgf.iterations=3"),
    "LEFT": stage("Left", "svgf.iterations=2", last="Right"),
    "RIGHT": stage("Right", "svgf.iterations=4", last="Left"),
    "F4": stage("F4", "svgf.demodulate=false", "svgf.demodulate=true"),
    "F5": stage("F5", "taa.enabled=false", "taa.enabled=true"),
    "F6": jitter,
    "F7": stage("F7", "firefly.mode=clamp", "firefly.mode=variance", "firefly.mode=off"),
    "F8": stage("F8", "svgf.separate=false", "svgf.separate=true"),
    "F9": tone_curve,
    "UP": exposure("Up", "Down", +1),
    "DOWN": exposure("Down", "Up", -1),
    "L": stage("l", "display.auto_exposure=true", "display.auto_exposure=false"),
    "SPACE": animation,
    "O": lamps,
    "PERIOD": single_step,
    "N": next_scene,
    "R": camera_home,
    "C": camera_path,
    "H": history,
    "B": next_texture,
    "V": texture_before,
    "X": split,
    "I": overlay("i", "inspect"),
    "M": error_map,
    "EQUAL": resolution("equal", "minus", (213, 120)),
    "MINUS": resolution("minus", "equal", (120, 68)),
    "G": overlay("g", "hud"),
    "K": overlay("k", "help"),
    "F11": recording,
    "F12": screenshot,
    "ESCAPE": let_go,
    "W": flight("w", moved=2, sign=1),
    "S": flight("s", moved=2, sign=-1),
    "A": flight("a", moved=0, sign=1),
    "D": flight("d", moved=0, sign=-1),
    "Q": flight("q", moved=1, sign=-1),
    "E": flight("e", moved=1, sign=1),
    "SHIFT": fast,
}


@pytest.mark.parametrize("binding", BINDINGS, ids=lambda binding: binding.key)
def test_every_key_does_what_the_table_says(app: App, binding: Binding) -> None:
    assert binding.key in CHECKS, "a key that nobody has tried"
    CHECKS[binding.key](app)


def test_the_stages_of_bmfr_are_on_keys_too(app: App) -> None:
    app.press("2")
    app.await_passes(plan("bmfr"))
    for key, setting in {"F1": "bmfr.temporal", "F3": "bmfr.fit", "F4": "bmfr.demodulate"}.items():
        for value in ("false", "true"):
            app.ask(key, f": {setting} = {value}$")
            app.await_passes(plan("bmfr", f"{setting}={value}"))
    app.press("1")


def test_every_check_is_of_a_key_there_is() -> None:
    assert list(CHECKS) == [binding.key for binding in BINDINGS]


def test_escape_quits(shared: App) -> None:
    shared.press("Escape")
    assert shared.process.wait(10.0) == 0
    assert shared.stderr() == ""
