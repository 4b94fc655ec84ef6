"""From frame packet to textures: what resets histories, what the uploads are, what can be read back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import moderngl
import numpy as np
import pytest

from config import Asvgf, Config
from gl.graph import GraphError
from gl.profiler import Profiler
from gl.renderer import Renderer, read
from tests.passes.harness import frame, noise

SIZE = (18, 12)
PACKET = replace(frame(SIZE, direct=noise(SIZE, 1), indirect=0.5), scene_id=1, cut=False)


@pytest.fixture
def renderer(ctx: moderngl.Context) -> Iterator[Renderer]:
    renderer = Renderer(ctx)
    yield renderer
    renderer.release()


def why(renderer: Renderer, **changes: object) -> str:
    """The one reason, or "valid", that all histories of the next frame give."""
    packet = replace(PACKET, **changes)  # type: ignore[arg-type]
    (reason,) = set(renderer.run(packet, Config(), "svgf").histories.values())
    return reason


def test_what_empties_the_histories(renderer: Renderer) -> None:
    assert why(renderer) == "first use"
    assert why(renderer) == "valid"
    assert why(renderer, time=9.0) == "valid"  # times say nothing
    assert why(renderer, cut=True) == "reset: camera cut"
    assert why(renderer) == "valid"
    assert why(renderer, scene="renamed") == "valid"
    assert why(renderer, scene_id=2) == "reset: another scene"  # of the same name
    assert why(renderer, scene_id=2) == "valid"
    assert why(renderer) == "reset: another scene"
    packet = replace(frame((19, 12)), scene_id=1)
    assert set(renderer.run(packet, Config(), "svgf").histories.values()) == {"resized"}
    assert why(renderer) == "resized"
    assert set(renderer.run(PACKET, Config(), "svgf", reset="key").histories.values()) == {"reset: key"}


def test_a_cut_shows_the_frame_as_if_it_were_the_first(renderer: Renderer) -> None:
    first = read(renderer.run(PACKET, Config(), "svgf").outputs["display"])
    for index in range(3):
        other = replace(PACKET, direct=frame(SIZE, direct=noise(SIZE, 5 + index, 9.0)).direct)
        assert not np.array_equal(read(renderer.run(other, Config(), "svgf").outputs["display"]), first)
    after = read(renderer.run(replace(PACKET, cut=True), Config(), "svgf").outputs["display"])
    np.testing.assert_array_equal(after, first)


def test_a_frame_that_is_filtered_again_is_not_followed_again(renderer: Renderer) -> None:
    """Half of the light went with it: the histories are halved once, however often it is shown."""
    half = np.tile(np.array([-0.5, 1, -0.5, 1], np.float32), (4, 6, 1))
    config = Config(asvgf=Asvgf(gain=0.0, alpha=0.0))
    lit = replace(frame(SIZE, direct=1.0), scene_id=1)
    dimmed = replace(lit, index=1, direct=frame(SIZE, direct=0.5).direct, temporal_gradient=half)
    renderer.run(lit, config, "asvgf")
    for packet in (dimmed, dimmed, dimmed, replace(dimmed, index=2, temporal_gradient=None)):
        radiance = read(renderer.run(packet, config, "asvgf").outputs["radiance"])
        np.testing.assert_allclose(radiance[..., :3], 0.5, rtol=2e-3)


def test_equal_frames_give_equal_pictures(ctx: moderngl.Context) -> None:
    pictures = []
    for _ in range(2):
        renderer = Renderer(ctx)
        for index in range(4):
            packet = replace(PACKET, direct=frame(SIZE, direct=noise(SIZE, index)).direct)
            result = renderer.run(packet, Config(), "svgf")
        pictures.append(read(result.outputs["radiance"]))
        renderer.release()
    np.testing.assert_array_equal(pictures[0], pictures[1])


def test_a_frame_in_which_something_moves_brings_its_previous_normals(renderer: Renderer) -> None:
    moving = replace(PACKET, prev_normal=PACKET.surface)
    assert "frame.prev_normal" in {tex.name for tex in renderer.run(moving, Config(), "svgf").plan.imports}
    assert "frame.prev_normal" not in {tex.name for tex in renderer.run(PACKET, Config(), "svgf").plan.imports}


def test_textures_by_name(renderer: Renderer) -> None:
    names = ("frame.motion", "svgf.direct.variance.out_color", "svgf.direct.accumulate.out_moments")
    result = renderer.run(PACKET, Config(), "svgf", keep=names)
    np.testing.assert_array_equal(read(result.texture(names[0])), PACKET.motion)
    assert read(result.texture(names[1])).shape == (12, 18, 4)
    assert read(result.texture(names[2])).shape == (12, 18, 2)
    with pytest.raises(GraphError, match="did you mean"):
        renderer.run(PACKET, Config(), "svgf", keep=["svgf.direct.varianc.out_color"])


def test_the_reference_is_the_picture_given(renderer: Renderer) -> None:
    reference = np.random.default_rng(0).random((12, 18, 4), np.float32)
    result = renderer.run(PACKET, Config(), "reference", reference)
    np.testing.assert_array_equal(read(result.outputs["radiance"]), reference)


def test_every_pass_is_measured_and_the_upload_as_well(renderer: Renderer) -> None:
    profiler = Profiler(renderer.ctx)
    for _ in range(2):
        result = renderer.run(PACKET, Config(), "svgf", profiler=profiler)
    assert {row.name for row in profiler.rows()} == {"upload", *(node.name for node in result.plan.passes)}
