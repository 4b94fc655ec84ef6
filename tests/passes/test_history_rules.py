"""When a method may look back: one test for each cause that forbids it, and one for each that does not.

``why`` says what the executor told the shaders, ``lengths`` what came of it: the histories' lengths N in the pixels.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from itertools import permutations
from typing import Any

import moderngl
import numpy as np
import pytest

from config import SECTIONS, Config, Display, Svgf, Taa
from gl.executor import Result
from gl.graph import GraphError
from gl.renderer import Renderer, read
from parameter import Param, parameters
from raytrace.frame import FramePacket
from tests.passes.harness import frame, noise

SIZE = (18, 12)
METHODS = {
    "accumulate": "accumulate.reproject.out_reprojection",
    "svgf": "svgf.reproject.out_reprojection",
    "bmfr": "bmfr.accumulate.out_reprojection",
}
"""Methods with a history; the texture whose w is its length."""
DEFAULT = Config()


class Sequence:
    """Frames through one renderer, numbered from 0."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self.renderer = Renderer(ctx)
        self.index = 0

    def frame(self, size: tuple[int, int] = SIZE, **changes: Any) -> FramePacket:
        light = noise(size, self.index)
        packet = frame(size, direct=light, indirect=0.5, albedo=0.5, previous_normal=(0.0, 0.0, 1.0))
        return replace(packet, **{"index": self.index, "scene_id": 1, "cut": self.index == 0, **changes})

    def run(
        self, denoiser: str = "svgf", config: Config = DEFAULT, packet: FramePacket | None = None, **options: Any
    ) -> Result:
        packet = packet or self.frame()
        keep = [METHODS[denoiser]] if denoiser in METHODS else []
        result = self.renderer.run(packet, config, denoiser, keep=[*keep, *options.pop("keep", [])], **options)
        self.index = packet.index + 1
        return result


@pytest.fixture
def sequence(ctx: moderngl.Context) -> Iterator[Sequence]:
    sequence = Sequence(ctx)
    yield sequence
    sequence.renderer.release()


def why(result: Result) -> str:
    """What all histories of the frame give as reason."""
    reasons = set(result.histories.values())
    assert len(reasons) == 1, result.histories
    return reasons.pop()


def lengths(result: Result, denoiser: str = "svgf") -> set[float]:
    """N in every pixel."""
    return set(np.unique(read(result.texture(METHODS[denoiser]))[..., 3]).tolist())


def filters(result: Result) -> dict[str, str]:
    """The reasons of the filter's histories, without those of the display."""
    return {name: why for name, why in result.histories.items() if not name.startswith(("taa.", "exposure"))}


# -------------------------------------------------------------------------------------------------- what ends a history


@pytest.mark.parametrize("denoiser", METHODS)
def test_every_frame_that_continues_the_one_before_adds_to_the_length(sequence: Sequence, denoiser: str) -> None:
    assert why(sequence.run(denoiser)) == "first use"
    for length in range(1, 5):
        result = sequence.run(denoiser)
        assert (why(result), lengths(result, denoiser)) == ("valid", {length})


@pytest.mark.parametrize("denoiser", METHODS)
@pytest.mark.parametrize(
    ("changes", "options", "reason"),
    [
        ({"cut": True}, {}, "reset: camera cut"),
        ({"scene_id": 2}, {}, "reset: another scene"),
        ({}, {"reset": "by key"}, "reset: by key"),
        ({"size": (19, 12)}, {}, "resized"),
        ({"size": (12, 18)}, {}, "resized"),
        ({"index": 5}, {}, "reset: frame skipped"),
        ({"index": 1}, {}, "reset: frame skipped"),
    ],
    ids=["cut", "scene", "key", "wider", "turned", "skipped", "back in time"],
)
def test_a_frame_that_continues_nothing_begins_with_length_0(
    sequence: Sequence, denoiser: str, changes: dict[str, Any], options: dict[str, Any], reason: str
) -> None:
    for _ in range(4):
        sequence.run(denoiser)
    packet = sequence.frame(**changes)
    result = sequence.run(denoiser, packet=packet, **options)
    assert (why(result), lengths(result, denoiser)) == (reason, {0})
    packet = sequence.frame(**{key: value for key, value in changes.items() if key in ("scene_id", "size")})
    result = sequence.run(denoiser, packet=packet)
    assert (why(result), lengths(result, denoiser)) == ("valid", {1})


def test_back_to_the_old_size_or_scene_is_a_change_as_well(sequence: Sequence) -> None:
    sequence.run()
    sequence.run(packet=sequence.frame((19, 12)))
    result = sequence.run()
    assert (why(result), lengths(result)) == ("resized", {0})
    sequence.run(packet=sequence.frame(scene_id=2))
    result = sequence.run()
    assert (why(result), lengths(result)) == ("reset: another scene", {0})


def test_a_frame_that_could_not_be_built_is_skipped(sequence: Sequence) -> None:
    """Its motion vectors led to the frame before it, and the next one's lead to it."""
    sequence.run()
    with pytest.raises(GraphError):
        sequence.run(keep=["no such texture"])
    sequence.index += 1
    result = sequence.run()
    assert (why(result), lengths(result)) == ("reset: frame skipped", {0})


def test_a_frame_that_is_filtered_again_continues_itself(sequence: Sequence) -> None:
    sequence.run()
    packet = sequence.frame()
    sequence.run(packet=packet)
    assert lengths(sequence.run(packet=packet)) == {2}


# ------------------------------------------------------------------------------------- histories belong to their method


@pytest.mark.parametrize("between", ["none", "accumulate", "bmfr", "reference"])
def test_a_method_that_comes_back_begins_anew(sequence: Sequence, between: str) -> None:
    for _ in range(3):
        sequence.run()
    reference = np.ones((SIZE[1], SIZE[0], 4), np.float32)
    sequence.run(between, reference=reference if between == "reference" else None)
    result = sequence.run()
    assert (why(result), lengths(result)) == ("not fed last frame", {0})


@pytest.mark.parametrize(("first", "second"), list(permutations(METHODS, 2)))
def test_a_method_takes_over_nothing_from_another(sequence: Sequence, first: str, second: str) -> None:
    for _ in range(3):
        sequence.run(first)
    result = sequence.run(second)
    assert (why(result), lengths(result, second)) == ("first use", {0})


def test_what_is_exposed_stays_the_same_light_under_another_method(sequence: Sequence) -> None:
    config = Config(display=Display(auto_exposure=True))
    for denoiser in ("svgf", "accumulate", "none"):
        histories = sequence.run(denoiser, config).histories
    assert histories == {"exposure": "valid"}


@pytest.mark.parametrize("switch", ["separate", "demodulate", "temporal"])
def test_a_switch_that_changes_what_is_accumulated_begins_anew(sequence: Sequence, switch: str) -> None:
    """One signal or two, with the albedo or without: the pixels would mean something else."""
    off = Config(svgf=replace(Svgf(), **{switch: False}))  # type: ignore[arg-type]
    for config in (DEFAULT, DEFAULT, off):
        result = sequence.renderer.run(sequence.frame(index=sequence.index), config, "svgf")
        sequence.index += 1
    assert "valid" not in filters(result).values()
    result = sequence.run()
    assert set(filters(result).values()) == {"not fed last frame"}
    assert lengths(result) == {0}


# ------------------------------------------------------------------------------------------------- what keeps a history


def another(spec: Param) -> object:
    """A value that the parameter does not have."""
    if spec.choices:
        return next(choice for choice in spec.choices if choice != spec.default)
    if isinstance(spec.default, bool):
        return not spec.default
    assert spec.lo is not None
    assert spec.hi is not None
    value = type(spec.default)((spec.lo + spec.hi) / 2)
    return value if value != spec.default else type(spec.default)(spec.lo)


KEPT = [
    (section, name)
    for section in ("svgf", "bmfr", "taa", "display")
    for name, spec in parameters(SECTIONS[section]).items()
    if section in ("taa", "display") or not spec.structural
]
STRUCTURAL = {
    "iterations": 2,
    "feedback_level": 1,
    "accumulated_variance": False,
    "variance_guided": False,
}
"""Switches of the filter that leave what is accumulated as it is."""


@pytest.mark.parametrize("denoiser", METHODS)
@pytest.mark.parametrize(("section", "name"), KEPT, ids=[".".join(key) for key in KEPT])
def test_a_parameter_keeps_the_filter_s_histories(sequence: Sequence, denoiser: str, section: str, name: str) -> None:
    changed = change(section, name, another(parameters(SECTIONS[section])[name]))
    for _ in range(3):
        sequence.run(denoiser)
    for length, config in ((3, changed), (4, changed), (5, DEFAULT)):
        result = sequence.run(denoiser, config)
        assert set(filters(result).values()) == {"valid"}
        assert lengths(result, denoiser) == {length}
        if section == "taa" and name != "enabled":
            assert result.histories[f"taa.{denoiser}"] == "valid"


def change(section: str, name: str, value: object) -> Config:
    assert name in {item.name for item in fields(getattr(DEFAULT, section))}
    return replace(DEFAULT, **{section: replace(getattr(DEFAULT, section), **{name: value})})


@pytest.mark.parametrize(("name", "value"), STRUCTURAL.items(), ids=STRUCTURAL)
def test_a_stage_that_goes_and_comes_keeps_the_filter_s_histories(sequence: Sequence, name: str, value: object) -> None:
    for length, config in enumerate((DEFAULT, DEFAULT, change("svgf", name, value), DEFAULT)):
        result = sequence.run("svgf", config)
        assert lengths(result) == {length}
        assert set(filters(result).values()) == {"valid" if length else "first use"}


@pytest.mark.parametrize("denoiser", METHODS)
def test_the_display_s_passes_keep_the_filter_s_histories(sequence: Sequence, denoiser: str) -> None:
    """The light itself, not only the flag: the radiance is that of a run in which nothing was switched."""
    everything = Config(
        taa=Taa(enabled=False),
        display=Display(exposure=2.0, tonemap="none", auto_exposure=True, adaptation=0.5, mark_bad="on"),
    )
    plain = [read(sequence.run(denoiser).outputs["radiance"]) for _ in range(6)]
    sequence.index = 0
    keep = [METHODS[denoiser].replace("out_reprojection", "out_guide")]
    switched = []
    for number in range(6):
        config, split, looked_at = (everything, True, keep) if number in (2, 4) else (DEFAULT, False, [])
        result = sequence.run(denoiser, config, split=split, keep=looked_at)
        assert lengths(result, denoiser) == {number}
        switched.append(read(result.outputs["radiance"]))
    np.testing.assert_array_equal(switched, plain)


def test_anti_aliasing_begins_anew_when_it_comes_back(sequence: Sequence) -> None:
    off = Config(taa=Taa(enabled=False))
    found = [sequence.run("svgf", config).histories.get("taa.svgf") for config in (DEFAULT, DEFAULT, off, DEFAULT)]
    assert found == ["first use", "valid", None, "not fed last frame"]
