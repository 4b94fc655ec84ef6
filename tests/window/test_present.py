"""What surrounds the picture: its place in the window, screenshots, the title. Needs no display."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from PIL import Image

import assets
from gl.renderer import read
from raytrace.camera_path import read_camera_path
from raytrace.shot import FPS
from ui.glfw_window import first_size
from ui.present import Presenter, letterbox
from ui.screenshot import save_path, save_screenshot
from ui.title import Pace, Title


@pytest.mark.parametrize(
    ("picture", "window", "box"),
    [
        ((640, 360), (1280, 720), (0, 0, 1280, 720)),
        ((640, 360), (1280, 800), (0, 40, 1280, 720)),
        ((640, 360), (1000, 100), (411, 0, 178, 100)),
        ((640, 360), (100, 1000), (0, 472, 100, 56)),
        ((640, 360), (1, 1), (0, 0, 1, 1)),
        ((3, 1000), (200, 100), (99, 0, 1, 100)),
    ],
)
def test_the_picture_keeps_its_shape_and_its_middle(picture, window, box):
    assert letterbox(picture, window) == box


@pytest.mark.parametrize(
    ("picture", "room", "size"),
    [
        ((640, 360), (1920, 1040), (1280, 720)),
        ((640, 360), (1279, 1040), (640, 360)),
        ((3840, 2160), (1920, 1040), (1849, 1040)),
        ((640, 360), (0, 0), (640, 360)),
    ],
)
def test_the_window_begins_as_large_as_fits(picture, room, size):
    assert first_size(picture, room) == size


@pytest.fixture
def presenter(ctx):
    made = Presenter(ctx)
    yield made
    made.release()


def draw(ctx: moderngl.Context, presenter: Presenter, picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) float32 of what ``presenter`` makes of ``picture`` (h, w, 4) uint8 in a window of ``size``."""
    source = ctx.texture((picture.shape[1], picture.shape[0]), 4, picture.tobytes())
    screen = ctx.texture(size, 4)
    target = ctx.framebuffer([screen])
    presenter.draw(source, target, size)
    result = read(screen)[..., :3]
    ctx.detect_framebuffer(0).use()  # moderngl binds the current one again when it makes the next
    for item in (target, screen, source):
        item.release()
    return result


def test_whole_scales_repeat_pixels_exactly(ctx, presenter):
    picture = np.random.default_rng(1).integers(0, 256, (9, 16, 4), dtype=np.uint8)
    drawn = draw(ctx, presenter, picture, (32, 18))
    np.testing.assert_allclose(drawn, np.kron(picture[..., :3], np.ones((2, 2, 1))) / 255.0, atol=1e-6)


def test_the_border_is_dark_and_other_scales_are_smooth(ctx, presenter):
    picture = np.zeros((4, 4, 4), np.uint8)
    picture[:2] = 255  # the lower half
    drawn = draw(ctx, presenter, picture, (14, 10))
    assert drawn[:, :2].max() < 0.1
    assert drawn[:, 12:].max() < 0.1
    inside = drawn[:, 2:12, 0]
    assert inside[0].min() == 1.0, "row 0 is the bottom row"
    assert inside[9].max() == 0.0
    assert ((inside > 0.05) & (inside < 0.95)).any(axis=0).all()


def test_screenshots_never_overwrite(tmp_path):
    folder = tmp_path / "deep" / "out"
    pixels = np.zeros((2, 3, 3), np.uint8)
    pixels[0, :, 0] = 255
    assert save_screenshot(folder, pixels) == f"saved {folder / 'shot_000.png'}"
    save_screenshot(folder, pixels)
    (folder / "shot_000.png").unlink()
    (folder / "shot_0041.png").touch()
    (folder / "shot_last.png").touch()
    save_screenshot(folder, pixels)
    assert sorted(path.name for path in folder.iterdir()) == [
        "shot_001.png", "shot_0041.png", "shot_042.png", "shot_last.png",
    ]  # fmt: skip
    with Image.open(folder / "shot_042.png") as image:
        assert image.getpixel((0, 1)) == (255, 0, 0), "row 0 is the bottom row"


def test_a_screenshot_that_cannot_be_written_is_told(tmp_path, capsys):
    (tmp_path / "file").touch()
    news = save_screenshot(tmp_path / "file", np.zeros((2, 3, 3), np.uint8))
    assert "cannot be written" in news
    assert "cannot be written" in capsys.readouterr().err


def test_a_recorded_path_is_replayed_to_the_bit(tmp_path):
    """In frames that were seldom begun a thirtieth of a second apart: what counts is their number."""
    scene = assets.build("cornell")
    assert scene.flight is not None
    cameras = [scene.flight(0.37 * index) for index in range(9)]
    assert save_path(tmp_path, cameras, "cornell") == f"saved {tmp_path / 'camera_000.toml'}"
    path = read_camera_path(tmp_path / "camera_000.toml")
    assert callable(path)
    for index, camera in enumerate(cameras):
        again = path(index / FPS)
        assert again.position == camera.position
        assert np.allclose(again.forward, camera.forward, rtol=0, atol=1e-15)
        assert again.yfov == pytest.approx(camera.yfov, rel=1e-15)


def test_two_pictures_share_the_window_at_a_column(ctx, presenter):
    right = ctx.texture((8, 4), 4, np.full((4, 8, 4), 255, np.uint8).tobytes())
    left = ctx.texture((8, 4), 4, np.zeros((4, 8, 4), np.uint8).tobytes())
    screen = ctx.texture((16, 8), 4)
    target = ctx.framebuffer([screen])
    for split, dark in ((5, 5), (0, 0), (-3, 0), (99, 16)):
        presenter.draw(right, target, (16, 8), left, split)
        drawn = read(screen)[..., 0]
        assert (drawn[:, :dark] == 0.0).all()
        line = drawn[:, dark : dark + 1]
        assert 0 < split < 16 or (line == 1.0).all()
        assert (drawn[:, dark + 1 :] == 1.0).all()
    presenter.draw(right, target, (16, 8))
    assert read(screen)[..., 0].min() == 1.0, "nothing is cut off afterwards"
    ctx.detect_framebuffer(0).use()
    for item in (target, screen, left, right):
        item.release()


def test_the_title_tells_what_is_shown_and_does_not_flicker():
    title, pace = Title("llvmpipe"), Pace()
    assert title.update(98.0, "cornell", "svgf", pace, "").startswith("cornell · svgf · 0.0 fps")
    for frame in range(4):
        pace.count(99.0 + frame / 4, 12.0)
    first = title.update(100.0, "cornell", "svgf + TAA", pace, "")
    assert first == "cornell · svgf + TAA · 4.0 fps · tracing 12 ms · llvmpipe"
    assert title.update(100.1, "cornell", "svgf + TAA", pace, "") == ""
    assert title.update(100.2, "cornell", "none", pace, "history reset").startswith("history reset · cornell · none")
    assert title.update(102.0, "cornell", "none", pace, "").startswith("history reset")
    assert title.update(104.0, "cornell", "none", pace, "").startswith("cornell")
    pace.clear()
    assert pace.fps == 0.0
