"""The live error in the real window: found while nothing moves, gone when something does, mapped by a key."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bench.judge import Verdict
from raytrace.camera import Camera
from raytrace.still import Snapshot, StillView
from tests.window.desktop import App, application, difference, wait_for
from tests.window.hand import Hand, watching
from ui import live_error
from ui.live_error import MAP_TOP, LiveError, colored

SIZE = (24, 16)
VIEW = StillView(Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0)), SIZE, 0.0, False)


def verdict(rmse: float = 0.02, samples: int = 64, flips: float = 0.1) -> Verdict:
    return Verdict(rmse, 31.5, 0.0321, 0.01, samples, np.full(SIZE[::-1], flips, np.float32))


def snapshot(samples: int = 64, view: StillView = VIEW) -> Snapshot:
    size = view.size[::-1]
    return Snapshot(view, samples, np.zeros((*size, 3), np.float32), np.ones(size, dtype=bool), 0.01)


# -------------------------------------------------------------------------------------------------- without a window


class FakeJudge:
    """Answers when it is told to."""

    def __init__(self, notify: object) -> None:
        self.busy, self.verdict, self.trouble, self.asked = False, None, "", 0

    def ask(self, image: np.ndarray, snapshot: Snapshot) -> None:
        assert image.shape == (*snapshot.view.size[::-1], 3)
        self.busy, self.asked = True, self.asked + 1

    def answer(self, verdict: Verdict) -> None:
        self.busy, self.verdict = False, verdict  # type: ignore[assignment]

    def close(self) -> None: ...


@pytest.fixture
def live(ctx, monkeypatch) -> Iterator[LiveError]:
    monkeypatch.setattr(live_error, "Judge", FakeJudge)
    made = LiveError(ctx, lambda: None)
    yield made
    made.release()


class Shown:
    """What a run of the filters leaves, as far as it is compared."""

    def __init__(self, ctx, size=SIZE) -> None:
        self.outputs = {"radiance": ctx.texture(size, 4, dtype="f2")}


def test_a_picture_is_compared_now_and_then(live, ctx):
    shown, judge = Shown(ctx), live._judge
    assert live.update(0.0, shown, None, False) is None
    assert live.update(0.0, shown, snapshot(live_error.LEAST - 1), False) is None
    assert judge.asked == 0, "too few paths to compare with"
    live.update(0.1, shown, snapshot(), False)
    assert judge.asked == 1
    judge.answer(verdict())
    assert live.update(0.2, shown, snapshot(), False).rmse == 0.02
    assert judge.asked == 1, "too early"
    live.update(0.2 + live_error.EVERY, shown, snapshot(), False)
    assert judge.asked == 2
    shown.outputs["radiance"].release()


def test_what_is_known_of_a_view_is_forgotten_with_it(live, ctx):
    shown, judge = Shown(ctx), live._judge
    live.update(0.0, shown, snapshot(), True)
    judge.answer(verdict())
    live.update(0.1, shown, snapshot(), True)
    assert live.map is not None
    live.update(0.2 + live_error.EVERY, shown, snapshot(), True)
    other = StillView(VIEW.camera, VIEW.size, 1.0, False)
    assert live.update(1.0, shown, snapshot(view=other), True) is None
    judge.answer(verdict())  # asked before the view changed
    assert live.update(1.1, shown, snapshot(view=other), True) is None
    assert live.map is None
    assert live.update(0.3, shown, None, True) is None
    shown.outputs["radiance"].release()


def test_the_map_is_a_picture_of_the_errors(live, ctx):
    shown, judge = Shown(ctx), live._judge
    live.update(0.0, shown, snapshot(), True)
    judge.answer(verdict(flips=MAP_TOP))
    live.update(0.1, shown, snapshot(), True)
    assert live.map is not None
    assert live.map.size == SIZE
    assert tuple(live.map.read(alignment=1)[:3]) == (252, 253, 191)
    shown.outputs["radiance"].release()


def test_a_judge_in_trouble_is_told_and_not_asked_again(live, ctx):
    shown = Shown(ctx)
    assert live.trouble == ""
    live._judge.trouble = "the other process has ended"
    live.update(0.0, shown, snapshot(), True)
    assert live._judge.asked == 0
    assert live.trouble == "the error of the picture: the other process has ended"
    shown.outputs["radiance"].release()


def test_a_picture_of_another_size_waits(live, ctx):
    shown = Shown(ctx, (12, 8))
    live.update(0.0, shown, snapshot(), True)
    assert live._judge.asked == 0
    shown.outputs["radiance"].release()


def test_colours_go_from_black_to_bright():
    colours = colored(np.linspace(0.0, 2.0 * MAP_TOP, 65)[None])[0].astype(int)
    assert tuple(colours[0]) == (0, 0, 4)
    assert tuple(colours[32]) == tuple(colours[64]) == (252, 253, 191)
    brightness = colours[:33].sum(axis=1)
    assert (np.diff(brightness) > 0).all()


@pytest.fixture
def hand(ctx, monkeypatch):
    made = Hand(ctx)
    with watching(made, monkeypatch):
        yield made
    made.release()


def test_the_panel_tells_the_error_or_why_there_is_none(hand):
    from tests.window.test_hud import result_of

    hand.status.result = result_of()
    hand.draw(2)
    assert hand.said("while nothing moves")
    hand.status.resting = True
    hand.draw()
    assert hand.said("tracing a reference")
    hand.status.errors_now = verdict()
    hand.draw()
    assert hand.said("RMSE 0.0200")
    assert hand.said("PSNR 31.5 dB  FLIP 0.0321")
    assert hand.said("reference: 64 paths, its own RMSE 0.0100")
    hand.status.errors_now = verdict(rmse=0.005)
    hand.draw()
    assert hand.said("RMSE < 0.0100"), "an error below the reference's own noise is not reported as one"


# ---------------------------------------------------------------------------------------------------- in the window


@pytest.mark.window
def test_the_error_appears_at_rest_goes_with_a_movement_and_is_mapped(display: str, tmp_path: Path) -> None:
    told = r"RMSE (0\.\d+), PSNR (\d+\.\d+) dB, FLIP (0\.\d+) against (\d+) paths, whose own RMSE is (0\.\d+)"

    def numbers(app: App) -> list[tuple[float, ...]]:
        return [tuple(map(float, found)) for found in re.findall(told, app.stdout())]

    with application(display, tmp_path, "--no-animate", "--denoiser", "svgf") as app:
        picture = app.settled()
        assert not numbers(app), "nobody looks, so nothing is traced for it"
        app.ask("m", "error map on$")
        wait_for(lambda: [row for row in numbers(app) if row[3] >= 32], "a reference of 32 paths")
        rmse, psnr, flip, _, noise = numbers(app)[-1]
        assert 0.0 < noise < 0.03
        assert 0.0 < rmse < 0.05
        assert psnr > 20.0
        assert 0.0 < flip < 0.3
        mapped = app.picture()
        assert difference(mapped, picture) > 0.05
        assert mapped[..., 1].mean() < mapped[..., 2].mean(), "magma has little green"
        app.hold("w", 0.3)
        wait_for(lambda: "no reference: something moves" in app.stdout(), "the reference to be given up")
        told_before = len(numbers(app))
        wait_for(lambda: len(numbers(app)) > told_before, "the error of the other view")
        app.ask("m", "error map off$")
        assert difference(app.settled(), mapped) > 0.05
        assert "Traceback" not in app.stderr()
