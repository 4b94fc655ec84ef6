"""The table of texture formats."""

from __future__ import annotations

import numpy as np
import pytest

from gl.formats import FORMATS, INTEGER_FORMATS, lookup


@pytest.mark.parametrize(
    ("name", "components", "dtype", "size", "sampler", "image"),
    [
        ("r8", 1, "f1", 1, "sampler2D", "image2D"),
        ("rgba8", 4, "f1", 4, "sampler2D", "image2D"),
        ("rg16f", 2, "f2", 4, "sampler2D", "image2D"),
        ("rgba16f", 4, "f2", 8, "sampler2D", "image2D"),
        ("rg32f", 2, "f4", 8, "sampler2D", "image2D"),
        ("rgba32f", 4, "f4", 16, "sampler2D", "image2D"),
        ("r32ui", 1, "u4", 4, "usampler2D", "uimage2D"),
        ("rgba32i", 4, "i4", 16, "isampler2D", "iimage2D"),
    ],
)
def test_known_formats(name: str, components: int, dtype: str, size: int, sampler: str, image: str) -> None:
    fmt = lookup(name)
    assert (fmt.name, fmt.components, fmt.dtype, fmt.bytes_per_pixel) == (name, components, dtype, size)
    assert (fmt.sampler, fmt.image) == (sampler, image)


def test_bytes_agree_with_numpy() -> None:
    for fmt in FORMATS.values():
        assert fmt.bytes_per_pixel == fmt.components * np.dtype(fmt.numpy).itemsize


def test_vectors() -> None:
    assert [lookup("rg16f").vector(n) for n in (1, 2, 4)] == ["float", "vec2", "vec4"]
    assert [lookup("r32ui").vector(n) for n in (1, 4)] == ["uint", "uvec4"]
    assert [lookup("r32i").vector(n) for n in (1, 3)] == ["int", "ivec3"]


def test_integer_formats_are_those_without_float_samplers() -> None:
    assert {"r32ui", "rg32ui", "rgba32ui", "r32i", "rg32i", "rgba32i"} == INTEGER_FORMATS


def test_unknown_format_names_the_nearest_and_all() -> None:
    with pytest.raises(ValueError, match=r"unknown texture format 'rgb16f', did you mean 'rgba?16f'\?.*rgba32ui"):
        lookup("rgb16f")
