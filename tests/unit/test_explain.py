"""The report of `app.py explain`, section by section, against the objects that it is about."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import pytest

import assets
from config import load
from explain import (
    WORDS,
    Subject,
    image_section,
    memory_section,
    pass_section,
    report,
    scene_section,
    switch_section,
    tracer_section,
)
from gl.pipelines import DENOISERS
from raytrace.camera import Camera, NamedCamera
from raytrace.compiled import compile_scene
from raytrace.features import compiled_in
from raytrace.integrator import Settings, Tracer
from raytrace.punctual import PunctualLight
from raytrace.scene import Scene
from tests.tracer.scenes import everything, glossy
from tests.tracer.test_features import DARK

SIZE = ("render.width=64", "render.height=36")
PIXELS = 64 * 36


@pytest.fixture(autouse=True)
def _nothing_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """No frame is traced: that is what compiles kernels."""

    def refuse(*_: object) -> None:
        raise AssertionError("a frame was traced")

    monkeypatch.setattr(Tracer, "for_each_tile", refuse)


class Subjects:
    def __init__(self) -> None:
        self.tracers: list[Tracer] = []

    def __call__(self, scene: Scene, denoiser: str = "svgf", *settings: str, jitter: bool = False) -> Subject:
        compiled = compile_scene(scene)
        tracer = Tracer(compiled, Settings(threads=1))
        self.tracers.append(tracer)
        return Subject(load(None, (*SIZE, *settings)), denoiser, compiled, tracer, jitter=jitter)


@pytest.fixture
def subject() -> Iterator[Subjects]:
    subjects = Subjects()
    yield subjects
    for tracer in subjects.tracers:
        tracer.close()


def row(lines: list[str], *start: str) -> str:
    """The one line that begins with these words."""
    pattern = r"\s+".join(map(re.escape, start))
    (line,) = [line for line in lines if re.match(rf"\s*{pattern}(\s|$)", line)]
    return line


@pytest.mark.parametrize("denoiser", DENOISERS)
@pytest.mark.parametrize(
    "scene", [assets.build("cornell"), everything(), DARK, glossy()], ids=["cornell", "everything", "dark", "glossy"]
)
def test_every_scene_and_denoiser_is_explained(subject: Subjects, scene: Scene, denoiser: str) -> None:
    text = report(subject(scene, denoiser))
    assert text.startswith(f"scene {scene.name}\n")
    assert len(text.split("\n\n")) in (6, 7)  # seven where there are passes that could be switched on
    assert max(map(len, text.splitlines())) <= 120
    assert not re.search(r"[ \t]$", text, re.MULTILINE)


def test_the_tracer_does_what_the_scene_needs(subject: Subjects) -> None:
    lines = tracer_section(subject(everything()))
    assert lines[0] == f"tracer: up to 4 rays per path, {4 * PIXELS:,} per frame of 64x36"
    assert "guides with a sky, moving objects, textures; without" in " ".join(" ".join(lines).split())
    assert "two scenes" in row(lines, "Embree")

    lines = tracer_section(subject(DARK))
    assert lines[0].startswith("tracer: up to 2 rays per path")
    for kind in ("shadow at hit 1", "shadow at hit 2"):
        assert row(lines, "ray", kind).endswith("left out: there is no light")
    told = " ".join(" ".join(lines).split()).partition("kernel second_hit ")[2]
    assert re.match(r"without (\w[^,]*, )*an environment, a sky, lamps, lights without a surface, textures", told)
    assert "one scene" in row(lines, "Embree")

    shining = " ".join(" ".join(tracer_section(subject(glossy()))).split())
    assert re.search(r"guides with [^;]*a sky, [^;]*metals and gloss, [^;]*textures; without", shining)
    assert re.search(r"first_hit with [^;]*a sky, lamps, [^;]*textures; without", shining)


def test_lights_and_cameras_that_move_are_told(subject: Subjects) -> None:
    eye = Camera.look_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0))
    still = PunctualLight("a", "point")
    moved = replace(still, name="b", motion=lambda time: ((time, 0.0, 0.0), (0.0, 0.0, -1.0)))
    cameras = (NamedCamera("front", eye), NamedCamera("round", eye, lambda time: eye))
    lines = scene_section(subject(replace(DARK, lights=(still, moved), cameras=cameras, flight=lambda time: eye)))
    assert row(lines, "lights").endswith("2 point without a surface; 1 of them moves")
    assert row(lines, "camera").endswith("'front', 'round' (moves); a flight")
    assert row(scene_section(subject(DARK)), "camera").endswith("no flight")


def test_there_are_words_for_every_switch_of_a_kernel(subject: Subjects) -> None:
    tracer = subject(DARK).tracer
    kernels = (*tracer.kernels, *subject(glossy()).tracer.kernels)
    switches = {name for kernel in kernels for name in compiled_in(kernel)}
    assert switches | set(tracer.variant._fields) == set(WORDS)


@pytest.mark.parametrize(
    ("settings", "flag", "headless", "window"),
    [
        ((), False, 'off: render.jitter = "auto"', "on: "),
        ((), True, "on: --jitter", "on: "),
        (("taa.enabled=false",), False, 'off: render.jitter = "auto"', "off: "),
        (("render.jitter=on",), False, 'on: render.jitter = "on"', "on: "),
        (("render.jitter=off",), False, 'off: render.jitter = "off"', "off: "),
    ],
)
def test_jitter(subject: Subjects, settings: tuple[str, ...], flag: bool, headless: str, window: str) -> None:
    lines = tracer_section(subject(DARK, "svgf", *settings, jitter=flag))
    assert row(lines, "jitter", "app.py render").endswith(headless)
    assert window in row(lines, "jitter", "window")


def test_images_are_made_and_uploaded_for_a_reason(subject: Subjects) -> None:
    of = subject(DARK)
    still = image_section(of)
    assert still[0] == f"images of a frame: 7 uploaded, {PIXELS * (6 * 16 + 8):,} bytes per frame"
    assert row(still, "prev_normal").endswith("not made: the scene has no moving objects")
    assert row(still, "position").endswith("not made: no method asks for it")
    readers = sum("in_surface" in node.reads for node in of.plan.passes)
    assert row(still, "surface").endswith(f"read by {readers} passes")
    assert row(still, "motion").endswith("read by svgf.reproject, taa")
    assert row(still, "gradient").split()[1:6] == ["rg32f", "64x36", f"{PIXELS * 8:,}", "uploaded;", "read"]

    assert row(still, "specular").endswith("not made: the scene has no metals and gloss")
    shining = image_section(subject(glossy()))
    assert row(shining, "specular").endswith("uploaded; read by svgf.specular.accumulate")
    assert "rgba32f 64x36" in row(shining, "specular_albedo")
    change = "temporal_gradient_specular"
    assert row(shining, change).endswith("not made: no method asks for it")
    assert row(image_section(subject(glossy(), "asvgf")), change).endswith("read by asvgf.specular.gradient0")
    assert row(image_section(subject(DARK, "asvgf")), change).endswith("not made: the scene has no metals and gloss")

    moving = image_section(subject(everything()))
    assert row(moving, "prev_normal").endswith("uploaded; read by svgf.reproject")

    noisy = image_section(subject(everything(), "none"))
    assert row(noisy, "motion").endswith("made, not uploaded: no pass reads it")
    assert row(noisy, "direct").endswith("uploaded; read by modulate")

    reference = image_section(subject(DARK, "reference"))
    assert row(reference, "reference").endswith("uploaded, given beside the frame; read by tonemap")


def test_passes_are_on_and_off_for_a_reason(subject: Subjects) -> None:
    lines = pass_section(subject(DARK, "svgf", "svgf.iterations=3"))
    assert row(lines, "taa").endswith("  taa.enabled = true")
    assert row(lines, "svgf.direct.atrous2").endswith("svgf.iterations = 3 (off at 2)")
    assert row(lines, "encode").endswith("  every picture has it")
    assert row(lines, "modulate").endswith("  --denoiser svgf (not reference)")
    assert lines[lines.index("  svgf.iterations = 4") + 1] == "      svgf.direct.atrous3, svgf.indirect.atrous3"

    lines = pass_section(subject(DARK, "svgf", "svgf.separate=false"))
    assert row(lines, "combine").endswith("  svgf.separate = false, frame.specular = false")
    assert row(lines, "svgf.both.variance").endswith("svgf.separate = false, svgf.variance_guided = true")
    assert row(pass_section(subject(DARK, "accumulate")), "accumulate.reproject").endswith("--denoiser accumulate")


def test_memory_adds_up(subject: Subjects) -> None:
    of = subject(DARK)
    lines = memory_section(of)
    total = sum(entry.bytes for entry in of.plan.memory(of.size))
    assert lines[0].startswith(f"GPU memory: {total:,} bytes (")
    told = [int(found[1].replace(",", "")) for line in lines[1:] if (found := re.search(r"\dx\d+\s+([\d,]+) ", line))]
    assert sum(told) == total
    assert len(told) == len(of.plan.imports) + len(of.plan.slots) + len(of.plan.feeds)
    assert "(output display)" in "\n".join(lines)
    saved = of.unshared - of.plan.bytes(of.size)
    assert saved > 0
    assert lines[-1] == f"  sharing slots saves {saved:,} bytes"


def test_what_another_value_would_change(subject: Subjects) -> None:
    of = subject(DARK)
    lines = switch_section(of)
    moments = 16 * PIXELS  # the two halves of a history
    assert row(lines, "taa.enabled = false").split()[-4:] == ["-1", "1", f"-{moments:,}", "0"]
    assert row(lines, "frame.moving = true").split()[-4:] == ["0", "1", f"+{16 * PIXELS:,}", f"+{16 * PIXELS:,}"]
    assert row(lines, "frame.specular = true").split()[-4:-2] == ["+5", "4"]
    assert row(lines, "svgf.iterations = 4").split()[-4] == "+2"
    assert not [line for line in lines if "svgf.sigma_l" in line]
