"""bench/references.py: sums, their noise, and files that survive interruptions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import assets
from bench.references import Reference, ReferenceCache, load, save, temporal_noise
from errors import UserError
from raytrace.compiled import compile_scene
from raytrace.frame import FramePacket
from raytrace.integrator import Settings, Tracer
from raytrace.shot import Shot

SIZE = (16, 9)


def open_shot(
    animate: bool = False, size: tuple[int, int] = SIZE, camera: str = "flight", settings: Settings | None = None
) -> Shot:
    scene = compile_scene(assets.build("cornell", animate))
    return Shot(scene, Tracer(scene, settings or Settings(threads=1)), size, camera, animate)


@pytest.fixture
def shot() -> Iterator[Shot]:
    shot = open_shot()
    with shot.tracer:
        yield shot


def packet(height: int, width: int, albedo: float = 1.0, emission: float = 0.0) -> FramePacket:
    def image(value: float) -> np.ndarray:
        return np.full((height, width, 4), value, np.float32)

    zero = image(0.0)
    return FramePacket(0, 0.0, zero, zero, image(albedo), image(emission), zero, zero[..., :2], zero)


def sampled(rng: np.random.Generator, sigma: float, slices: list[int], size: tuple[int, int] = (100, 80)) -> Reference:
    """A reference of value 0.5 whose single paths have standard deviation ``sigma``."""
    reference = Reference.empty(size)
    for count in slices:
        noise = rng.normal(0.0, sigma / np.sqrt(count), (size[1], size[0], 3))
        reference = reference.plus(0.5 + noise, count)
    return reference


def test_paths_go_to_the_smaller_half():
    reference = Reference.empty((2, 1))
    for count, halves in ((4, (4, 0)), (3, (4, 3)), (3, (4, 6)), (2, (6, 6))):
        reference = reference.plus(np.ones((1, 2, 3)), count)
        assert reference.counts == halves
    assert reference.samples == 12


def test_the_mean_weighs_every_path_alike():
    reference = Reference.empty((1, 1)).plus(np.full((1, 1, 3), 1.0), 30).plus(np.full((1, 1, 3), 5.0), 10)
    np.testing.assert_allclose(reference.radiance(packet(1, 1)), 2.0)
    np.testing.assert_allclose(reference.radiance(packet(1, 1, albedo=0.5, emission=3.0)), 4.0)


@pytest.mark.parametrize("slices", [[64, 64], [64, 64, 64], [8, 8, 8, 8, 8], [100, 4]])
def test_the_noise_is_that_of_the_mean_of_all_paths(slices):
    sigma = 0.8
    reference = sampled(np.random.default_rng(1), sigma, slices)
    frame, mask = packet(80, 100, albedo=0.5, emission=1.0), np.ones((80, 100), dtype=bool)
    expected = 0.5 * sigma / np.sqrt(sum(slices))
    assert reference.noise(frame, mask) == pytest.approx(expected, rel=0.03)
    # Not only expected but true: the value is known.
    truth = np.full((80, 100, 3), 0.5 * 0.5 + 1.0)
    actual = np.sqrt(np.mean((reference.radiance(frame) - truth) ** 2))
    assert reference.noise(frame, mask) == pytest.approx(actual, rel=0.05)


@pytest.mark.parametrize("slices", [[64, 64], [64, 64, 64]])
def test_the_temporal_noise_is_that_of_two_references(slices):
    rng = np.random.default_rng(2)
    sigma, frame, mask = 0.2, packet(80, 100), np.ones((80, 100), dtype=bool)
    now, before = sampled(rng, sigma, slices), sampled(rng, sigma, slices)
    slope = (1 / 2.2) * 0.5 ** (1 / 2.2 - 1)
    expected = np.sqrt(2 / np.pi) * np.sqrt(2.0) * slope * sigma / np.sqrt(sum(slices))
    assert temporal_noise((now, frame), (before, frame), mask) == pytest.approx(expected, rel=0.05)


def test_a_single_slice_cannot_tell_its_noise():
    reference = Reference.empty((1, 1)).plus(np.ones((1, 1, 3)), 4)
    with pytest.raises(ValueError, match="single slice"):
        reference.noise(packet(1, 1), np.ones((1, 1), dtype=bool))


def test_files_return_what_was_saved(tmp_path):
    reference = sampled(np.random.default_rng(3), 1.0, [5, 3], SIZE)
    path = tmp_path / "deeper" / "some.npz"
    save(path, reference)
    again = load(path, SIZE)
    np.testing.assert_array_equal(again.sums, reference.sums)
    assert again.counts == (5, 3)
    assert [item.name for item in path.parent.iterdir()] == ["some.npz"]


def test_a_missing_file_is_an_empty_reference(tmp_path, capsys):
    assert load(tmp_path / "none.npz", SIZE).samples == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("damage", ["cut", "text", "empty", "shape", "nan", "keys"])
def test_a_damaged_file_is_reported_and_started_anew(tmp_path, capsys, damage):
    path = tmp_path / "some.npz"
    reference = sampled(np.random.default_rng(3), 1.0, [5, 3], SIZE)
    if damage == "shape":
        reference = Reference.empty((4, 4))
    if damage == "nan":
        reference.sums[0, 0, 0, 0] = np.nan
    save(path, reference)
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:-200])
    elif damage == "text":
        path.write_text("not an archive")
    elif damage == "empty":
        path.write_bytes(b"")
    elif damage == "keys":
        np.savez(path, other=np.zeros(3))
    assert load(path, SIZE).samples == 0
    assert str(path) in capsys.readouterr().err


def test_references_are_the_plain_mean_of_their_paths(shot, tmp_path):
    found, _ = ReferenceCache(tmp_path).fill(shot, [3], 7, 3)
    assert found[3].samples == 7
    frame = shot.frame(3)
    direct, indirect = shot.reference(3, 7)
    expected = (direct + indirect) * frame.albedo[..., :3] + frame.emission[..., :3]
    np.testing.assert_allclose(found[3].radiance(frame), expected, rtol=1e-6, atol=1e-9)


def test_an_interruption_costs_one_slice_and_changes_nothing(shot, tmp_path, monkeypatch):
    whole, _ = ReferenceCache(tmp_path / "whole").fill(shot, [1, 2], 8, 2)

    cache, trace = ReferenceCache(tmp_path / "broken"), shot.tracer.reference
    traced: list[object] = []
    paths = [cache.path(shot, index) for index in (1, 2)]
    monkeypatch.setattr(cache, "path", lambda shot, index: paths[index - 1])

    def interrupted(*arguments, **options):
        if len(traced) == 5:
            raise KeyboardInterrupt
        traced.append(arguments)
        return trace(*arguments, **options)

    monkeypatch.setattr(shot.tracer, "reference", interrupted)
    with pytest.raises(KeyboardInterrupt):
        cache.fill(shot, [1, 2], 8, 2)
    assert [load(path, SIZE).samples for path in paths] == [8, 2]

    traced.clear()
    resumed, _ = cache.fill(shot, [1, 2], 8, 2)
    assert len(traced) == 3
    for index in (1, 2):
        np.testing.assert_array_equal(resumed[index].sums, whole[index].sums)

    traced.clear()
    cache.fill(shot, [1, 2], 8, 2)
    assert traced == []


def test_more_paths_refine_what_is_there(shot, tmp_path):
    cache = ReferenceCache(tmp_path)
    cache.fill(shot, [0], 4, 2)
    refined, _ = cache.fill(shot, [0], 10, 2)
    at_once, _ = ReferenceCache(tmp_path / "other").fill(shot, [0], 10, 2)
    np.testing.assert_array_equal(refined[0].sums, at_once[0].sums)


def test_fewer_paths_than_there_are_keep_all(shot, tmp_path):
    cache = ReferenceCache(tmp_path)
    cache.fill(shot, [0], 6, 2)
    assert cache.fill(shot, [0], 2, 2)[0][0].samples == 6


def test_a_folder_that_cannot_be_written_is_one_message(shot, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        ReferenceCache(tmp_path / "file").fill(shot, [0], 2, 2)


def name(shot: Shot, index: int = 3) -> str:
    with shot.tracer:
        return ReferenceCache(Path("somewhere")).path(shot, index).name


def test_names_do_not_depend_on_how_the_work_is_cut():
    usual = name(open_shot())
    assert usual == name(open_shot())
    assert usual == name(open_shot(settings=Settings(threads=2, tile=256)))
    assert usual.startswith("cornell-16x9-frame0003-")


def test_names_depend_on_all_that_the_picture_does():
    shots = {
        "usual": open_shot(),
        "size": open_shot(size=(16, 10)),
        "camera": open_shot(camera="still"),
        "seed": open_shot(settings=Settings(seed=1, threads=1)),
        "moving": open_shot(animate=True),
    }
    names = {what: name(shot) for what, shot in shots.items()}
    names["frame"] = name(open_shot(), 4)
    # The camera rests and yet the picture changes: the time is what makes the difference.
    names["moving, at rest"] = name(open_shot(animate=True, camera="still"))
    names["moving, later"] = name(open_shot(animate=True, camera="still"), 5).replace("frame0005", "frame0003")
    assert len(set(names.values())) == len(names), names


def test_names_depend_on_the_scene():
    usual = open_shot()
    other = assets.build("cornell")
    painted = [replace(other.materials[0], base_color=(0.1, 0.1, 0.1)), *other.materials[1:]]
    compiled = compile_scene(replace(other, materials=tuple(painted)))
    shot = Shot(compiled, Tracer(compiled, Settings(threads=1)), SIZE, "flight")
    assert name(usual) != name(shot)


def test_names_depend_on_what_the_tracer_makes_of_the_scene(monkeypatch):
    usual = name(open_shot())
    changed = open_shot()
    trace = changed.tracer.reference
    monkeypatch.setattr(changed.tracer, "reference", lambda *a, **k: tuple(1.5 * image for image in trace(*a, **k)))
    assert name(changed) != usual
