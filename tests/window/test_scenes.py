"""Other scenes in the real window: dropped on it, or the next by key, while the one before goes on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.unit.gltf_files import one_triangle
from tests.window.desktop import START_SECONDS, App, application, wait_for
from tests.window.dragging import drop

pytestmark = pytest.mark.window


@pytest.fixture(scope="module")
def shared(display: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    with application(display, tmp_path_factory.mktemp("scenes"), "--denoiser", "none", size="64x36") as app:
        yield app


@pytest.fixture
def app(shared: App) -> Iterator[App]:
    yield shared
    assert shared.process.poll() is None, shared.stderr()
    assert "Traceback" not in shared.stderr()


@pytest.fixture
def triangle(tmp_path: Path) -> Path:
    return one_triangle().write_glb(tmp_path / "my triangle.glb")  # with a blank, which an URI writes as %20


def drop_on(app: App, path: Path) -> None:
    drop(app.display, int(app.window), path)


def frame_number(app: App) -> int:
    """Number of a frame that is shown from now on."""
    return int(app.ask("h", r"^frame (\d+): history reset")[1])


def test_a_dropped_file_is_opened(app: App, triangle: Path) -> None:
    drop_on(app, triangle)
    app.await_title("· my triangle · none")
    assert frame_number(app) < frame_number(app)


def test_a_broken_file_is_one_message_and_frames_go_on(app: App, tmp_path: Path) -> None:
    before = app.title.partition(" fps")[0].split(" · ")[-3]
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"glTF, but then")
    since = len(app.stdout())
    drop_on(app, broken)
    app.hear(r"^frame \d+: (?!error|opening).*broken\.glb", since)
    app.hear(r"^frame \d+: error: .*broken\.glb", since)
    assert f"· {before} · none" in app.title
    assert frame_number(app) < frame_number(app)


def test_what_is_dropped_while_another_scene_is_opened_comes_instead_of_it(app: App, triangle: Path) -> None:
    since = len(app.stdout())
    app.go_to_scene("cornell")
    app.press("n")  # to the interior, whose preparation takes seconds
    app.await_title("interior: ")
    drop_on(app, triangle)
    app.await_title("· my triangle · none")
    app.go_to_scene("cornell")
    assert "opened interior" not in app.stdout()[since:]


def test_n_goes_round_while_frames_go_on(app: App) -> None:
    app.await_title("· cornell ·")
    app.press("n")
    frames: list[int] = []

    def opened() -> bool:
        frames.append(frame_number(app))
        return "· interior ·" in app.title

    wait_for(opened, "the next scene", START_SECONDS)
    *before, _ = frames  # the last may be one of the new scene
    assert len(before) > 2
    assert before == sorted(set(before)), "of the scene before, one after the other"
    app.go_to_scene("cornell")
