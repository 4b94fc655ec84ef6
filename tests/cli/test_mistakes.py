"""Files that are missing, broken or in the way: one message before any rendering, and what was there is not lost."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar, cast

import moderngl
import numpy as np
import pytest
from PIL import Image

import headless
import session
from errors import UserError
from gl.renderer import Renderer
from raytrace.shot import Shot
from tests.cli.runner import SMALL, App, png

QUICK = ("--frames", 1, *SMALL)


@pytest.fixture
def no_rendering(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails the test if a frame is traced."""

    def refuse(*_: object) -> None:
        raise AssertionError("a frame was traced before the mistake was found")

    monkeypatch.setattr(Shot, "frame", refuse)


def scene(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"

BROKEN: dict[str, tuple[str, str | bytes, str]] = {
    "not a model": ("a.glb", b"this is no glTF file at all", "a.glb"),
    "cut off": ("a.glb", b"glTF\x02\x00\x00\x00", "a.glb"),
    "broken json": ("a.gltf", "{", "a.gltf"),
    "unknown format": ("a.blend", "BLENDER", "a.blend: .blend files cannot be read\n  export the scene as one of .glb"),
    "no surface": ("a.obj", TRIANGLE, "there is no triangle in this file"),
    "empty": ("a.ply", "", "a.ply"),
    "nan": ("a.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "a.obj"),
    "a face out of range": ("a.obj", TRIANGLE + "f 1 2 4\n", "a.obj"),
    "no material file's texture": ("a.obj", TRIANGLE + "mtllib a.mtl\nusemtl wood\nf 1 2 3\n", "planks.jpg"),
}


@pytest.mark.usefixtures("no_rendering")
@pytest.mark.parametrize(("name", "content", "message"), BROKEN.values(), ids=BROKEN.keys())
def test_a_scene_that_cannot_be_read(app: App, tmp_path: Path, name: str, content: str | bytes, message: str) -> None:
    scene(tmp_path, "a.mtl", "newmtl wood\nmap_Kd planks.jpg\n")
    path = scene(tmp_path, name, content)
    assert message in app("render", "--scene", path, *QUICK, "--out", tmp_path / "a.png").error()
    assert not (tmp_path / "a.png").exists()


@pytest.mark.usefixtures("no_rendering")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nowhere/model.glb", "model.glb: there is no such file"),
        ("cornel", "--scene cornel: neither a built-in scene nor a file, did you mean 'cornell'?"),
        ("palace", "built in are: cornell, interior"),
        (".", "is a folder, not a scene file"),
    ],
)
def test_a_scene_that_is_not_there(app: App, tmp_path: Path, name: str, message: str) -> None:
    assert message in app("render", "--scene", name, *QUICK, "--out", tmp_path / "a.png").error()


def test_what_can_be_repaired_is_and_is_told(app: App, tmp_path: Path) -> None:
    path = scene(tmp_path, "a.obj", TRIANGLE + "f 1 2 3\nf 1 1 2\n")
    outcome = app("render", "--scene", path, *QUICK, "--animate", "--out", tmp_path / "a.png")
    assert outcome.files() == [str(tmp_path / "a.png")]
    for told in (
        "1 triangle without area dropped",
        "no light in the file",
        "no camera in the file",
        "nothing in this scene moves",
    ):
        assert told in outcome.err


@pytest.mark.usefixtures("no_rendering")
@pytest.mark.parametrize(
    ("camera", "content", "message"),
    [
        ("path.json", None, "path.json: cannot be read (No such file"),
        ("path.json", "{", "path.json: is not a camera path"),
        ("path.json", "[]", 'expected {"frames": [{"camera_to_world_gl"'),
        ("path.json", '{"frames": []}', "there is no frame"),
        ("path.json", '{"frames": [{"camera_to_world_gl": [[1]], "yfov_deg": 45}]}', "frame 0 is no camera"),
        ("path.json", '{"frames": [{"yfov_deg": 45}]}', "camera_to_world_gl"),
        ("path.json", b"\xff\xfe\x00", "is not a camera path"),
        ("flihgt", None, "--camera flihgt: no camera of cornell, and no file, did you mean 'flight'?"),
    ],
)
def test_a_camera_path_that_cannot_be_read(
    app: App, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, camera: str, content: str | bytes | None, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    if content is not None:
        scene(tmp_path, camera, content)
    assert message in app("render", "--camera", camera, *QUICK, "--out", tmp_path / "a.png").error()


@pytest.mark.usefixtures("no_rendering")
def test_a_flight_that_the_scene_does_not_have(app: App, tmp_path: Path) -> None:
    path = scene(tmp_path, "hut.obj", TRIANGLE + "f 1 2 3\n")
    outcome = app("render", "--scene", path, "--camera", "flight", *QUICK, "--out", tmp_path / "a.png")
    assert outcome.code == 2
    assert "error: --camera flight: hut has no flight\n  use --camera still" in outcome.err


@pytest.mark.usefixtures("no_rendering")
@pytest.mark.parametrize("denoiser", ["none", "accumulate", "svgf", "reference"])
def test_a_texture_that_the_graph_does_not_have(app: App, tmp_path: Path, denoiser: str) -> None:
    flags = ("--denoiser", denoiser, *QUICK, "--out", tmp_path / "a.png")
    error = app("render", "--show", "encode.out_colour", *flags).error()
    assert f"--show encode.out_colour: {denoiser} has no such texture, did you mean 'encode.out_color'?" in error
    assert "\n    encode.out_color\n" in error, "all are listed"
    assert app("render", "--show", "", *flags[:-2], "--spp", 0).code == 2


@pytest.mark.usefixtures("no_rendering")
def test_a_place_that_cannot_be_written_to(app: App, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("kept")
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "shot.exr").mkdir()
    for out, reason in (("file/a.png", "cannot be written"), ("folder.png", "is a folder")):
        error = app("render", *QUICK, "--out", tmp_path / out).error()
        assert f"{tmp_path / out}: {reason}" in error
    assert "shot.exr: is a folder" in app("render", *QUICK, "--exr", "--out", tmp_path / "shot.png").error()
    assert (tmp_path / "file").read_text() == "kept"
    demo = app(*SMALL, "--out", tmp_path / "file")
    assert demo.code == 2
    assert demo.err.startswith(f"error: {tmp_path / 'file' / 'demo.png'}: cannot be written")


@pytest.mark.usefixtures("no_rendering")
@pytest.mark.skipif(sys.platform != "linux", reason="a folder that not even root may write to")
def test_a_folder_of_the_system(app: App) -> None:
    assert "/proc/pictures/a.png: cannot be written" in app("render", *QUICK, "--out", "/proc/pictures/a.png").error()


@pytest.mark.usefixtures("no_rendering")
@pytest.mark.skipif(os.geteuid() == 0, reason="root may read and write everywhere")
def test_folders_without_permission(app: App, tmp_path: Path) -> None:
    """Once one that may be looked into but not written to, once one that may not even be looked into."""
    closed, locked = tmp_path / "closed", tmp_path / "locked"
    closed.mkdir(0o555)
    locked.mkdir()
    path = scene(locked, "a.obj", TRIANGLE + "f 1 2 3\n")
    locked.chmod(0o000)
    out = ("--out", tmp_path / "a.png")
    try:
        errors = [app("render", *QUICK, "--out", folder / "a.png").error() for folder in (closed, locked)]
        errors.append(app("render", *QUICK, "--camera", locked / "path.json", *out).error())
        errors.append(app("render", *QUICK, "--scene", path, *out).error())
        errors.append(app("graph", "--config", locked / "config.toml").error())
    finally:
        locked.chmod(0o700)
    assert f"{closed / 'a.png'}: cannot be written (Permission denied)" in errors[0]
    assert all("Permission denied" in error and str(locked) in error for error in errors[1:])


def test_a_refusal_of_the_system_that_nobody_foresaw(app: App, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    look = Path.exists

    def refuse(path: Path) -> bool:
        if path.name == "room":
            raise PermissionError(13, "Permission denied", str(path))
        return look(path)

    monkeypatch.setattr(Path, "exists", refuse)
    error = app("render", "--scene", "private/room", *QUICK, "--out", tmp_path / "a.png").error()
    assert error == "error: private/room: Permission denied\n"


def failing_scene(app: App, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    app("render", "--scene", "nowhere.glb", *QUICK, "--out", out).error()


def failing_context(app: App, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_opengl() -> None:
        raise UserError("no headless OpenGL: a test")

    monkeypatch.setattr(headless, "create_headless", no_opengl)
    app("render", *QUICK, "--out", out).error()


def failing_disk(app: App, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    assert "No space left on device" in app("render", *QUICK, "--out", out).error()


def interrupted(app: App, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Shot, "frame", interrupt)
    outcome = app("render", *QUICK, "--out", out)
    assert (outcome.code, outcome.out, outcome.err) == (130, "", "interrupted\n")


@pytest.mark.parametrize("fail", [failing_scene, failing_context, failing_disk, interrupted])
def test_a_failure_leaves_the_picture_that_was_there(
    app: App, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fail: Callable[[App, Path, pytest.MonkeyPatch], None]
) -> None:
    out = tmp_path / "shot.png"
    app("render", *QUICK, "--out", out).files()
    before = out.read_bytes()
    fail(app, out, monkeypatch)
    assert out.read_bytes() == before
    assert os.listdir(tmp_path) == ["shot.png"]


# --------------------------------------------------------------------------------------------------------------- memory


@pytest.mark.usefixtures("no_rendering")
def test_a_picture_larger_than_memory_is_refused(app: App, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session, "_free_memory", lambda: 1_000_000_000)
    error = app("render", "--size", "2000x2000", "--out", tmp_path / "a.png").error()
    assert "2000x2000 pixels need about 2.4 GB of memory, 1.0 GB are free\n  choose a smaller --size" in error
    session.require_memory((1280, 720))
    monkeypatch.setattr(session, "_free_memory", lambda: None)
    session.require_memory((16384, 16384))


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_free_memory_is_known() -> None:
    free = session._free_memory()
    assert free is not None
    assert 10**8 < free < 10**14


def test_lack_of_memory_while_tracing_is_no_traceback(
    app: App, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lack(*_: object) -> None:
        np.empty((2**20, 2**20, 2**10), np.float64)

    monkeypatch.setattr(Shot, "frame", lack)
    error = app("render", *QUICK, "--out", tmp_path / "a.png").error()
    assert error.startswith("error: out of memory (Unable to allocate")
    assert "choose a smaller --size" in error


class Context:
    """An OpenGL context as far as is needed to be full."""

    info: ClassVar[dict[str, object]] = {"GL_MAX_TEXTURE_SIZE": 4096, "GL_RENDERER": "some card"}
    screen = None

    def __init__(self, error: str = "GL_OUT_OF_MEMORY") -> None:
        self.error = error

    def texture(self, *_: object, **__: object) -> Context:
        return self

    def release(self) -> None:
        pass

    def detect_framebuffer(self, _: int) -> None:
        pass


@pytest.mark.usefixtures("no_rendering")
def test_a_graphics_card_without_room_is_told(app: App, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(headless, "create_headless", Context)
    out = ("--out", tmp_path / "a.png")
    assert "32x18 pixels: some card has not enough memory for them" in app("render", *QUICK, *out).error()
    assert "4097x1 pixels: some card can draw 4096x4096 at most" in app("render", "--size", "4097x1", *out).error()


def test_other_failures_of_opengl_are_not_taken_for_lack_of_memory() -> None:
    sound, full = (Renderer(cast(moderngl.Context, Context(error))) for error in ("GL_NO_ERROR", "GL_OUT_OF_MEMORY"))
    with pytest.raises(ZeroDivisionError), headless.telling_of_memory(sound, (1, 1)):
        raise ZeroDivisionError
    with pytest.raises(UserError, match="not enough memory") as told, headless.telling_of_memory(full, (1, 1)):
        raise ZeroDivisionError
    assert isinstance(told.value.__cause__, ZeroDivisionError)


def test_the_picture_is_written_whole(app: App, tmp_path: Path) -> None:
    app("render", *QUICK, "--out", tmp_path / "a.png").files()
    assert png(tmp_path / "a.png").any()
    assert (tmp_path / "a.png").stat().st_mode & 0o777 == 0o644
