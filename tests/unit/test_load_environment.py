"""Environments from files: Radiance pictures of every layout and OpenEXR, and what is wrong with those that fail."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from errors import Notices, UserError
from raytrace.environment import LARGEST_WIDTH
from raytrace.hdr import load_environment
from tests.unit.radiance_files import HEADER, run_lengths, written

U8 = NDArray[np.uint8]


def texels(width: int = 16, height: int = 8) -> U8:
    """RGBE with runs, top row first."""
    coded = np.random.default_rng(1).integers(0, 256, (height, width, 4), dtype=np.uint8)
    coded[..., 3] = 120 + np.arange(width) // 3
    coded[1] = coded[1, 0]
    coded[-1, 4:9] = 7
    return coded


def decoded(coded: U8) -> NDArray[np.float64]:
    """Ward 1991: (mantissa + 1/2) / 256 times 2 to the exponent less 128; row 0 at the bottom."""
    scale = 2.0 ** (coded[::-1, :, 3:].astype(np.float64) - 136)
    return np.where(coded[::-1, :, 3:] == 0, 0.0, (coded[::-1, :, :3] + 0.5) * scale)


def test_run_lengths_and_plain_texels_are_the_same_picture(tmp_path: Path) -> None:
    coded = texels()
    for name, body in (("runs", run_lengths(coded)), ("plain", coded.tobytes())):
        notices = Notices()
        got = load_environment(written(tmp_path / f"{name}.hdr", coded, body), notices)
        np.testing.assert_allclose(got.pixels, decoded(coded), rtol=1e-6)
        assert got.name == f"{name}.hdr"
        assert notices.lines == []


def test_old_runs_repeat_the_texel_before(tmp_path: Path) -> None:
    coded = texels(6, 3)  # too narrow for the newer layout
    coded[1, 1:5] = coded[1, 0]
    body = coded[0].tobytes() + coded[1, 0].tobytes() + bytes((1, 1, 1, 4)) + coded[1, 5].tobytes() + coded[2].tobytes()
    got = load_environment(written(tmp_path / "a.hdr", coded, body), Notices())
    np.testing.assert_allclose(got.pixels, decoded(coded), rtol=1e-6)


def test_strength_rotation_exposure_and_orientation(tmp_path: Path) -> None:
    coded = texels()
    path = written(tmp_path / "a.hdr", coded, coded.tobytes(), HEADER[:-1] + b"EXPOSURE=4\n\n", b"+Y %d -X %d\n")
    got = load_environment(path, Notices(), strength=3.0, degrees=90.0)
    np.testing.assert_allclose(got.pixels, decoded(coded)[::-1, ::-1] * 3.0 / 4.0, rtol=1e-6)
    assert got.turn == 0.25


def test_what_a_header_asks_for_in_vain_is_told(tmp_path: Path) -> None:
    coded, notices = texels(), Notices()
    header = b"#?RGBE\nGAMMA=2.2\nPRIMARIES=0.7 0.3 0.2 0.7 0.1 0.1 0.33 0.33\n\n"
    load_environment(written(tmp_path / "a.hdr", coded, coded.tobytes(), header), notices)
    assert ["GAMMA=2.2" in notices.lines[0], "PRIMARIES" in notices.lines[1]] == [True, True]


def test_xyz_is_brought_to_rgb(tmp_path: Path) -> None:
    white = np.array([0.95047, 1.0, 1.08883])
    coded = np.zeros((8, 16, 4), np.uint8)
    coded[..., :3], coded[..., 3] = np.rint(white / 2 * 256 - 0.5), 129
    path = written(tmp_path / "a.hdr", coded, coded.tobytes(), b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n")
    np.testing.assert_allclose(load_environment(path, Notices()).pixels, 1.0, atol=0.02)


@pytest.mark.parametrize("channels", ["RGB", "RGBA", "separate", "Y", "half"])
def test_exr_with_grouped_and_single_channels(tmp_path: Path, channels: str) -> None:
    colors: NDArray[Any] = (
        np.random.default_rng(2).random((8, 16, 3)).astype(np.float16 if channels == "half" else np.float32)
    )
    images: dict[str, NDArray[Any]] = {"RGB": colors}
    if channels == "RGBA":
        images = {"RGBA": np.concatenate([colors, np.zeros_like(colors[..., :1])], axis=2)}
    elif channels == "separate":
        images = {name: np.ascontiguousarray(colors[..., k]) for k, name in enumerate("RGB")} | {"Z": colors[..., 0]}
    elif channels == "Y":
        colors[..., 1:] = colors[..., :1]
        images = {"Y": np.ascontiguousarray(colors[..., 0])}
    np.testing.assert_allclose(
        load_environment(exr(tmp_path / "a.exr", images), Notices()).pixels, colors[::-1], rtol=1e-6
    )


def exr(path: Path, images: dict[str, NDArray[Any]]) -> Path:
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, images) as file:
        file.write(str(path))
    return path


def test_broken_texels_are_mended_and_told(tmp_path: Path) -> None:
    colors, notices = np.ones((8, 16, 3), np.float32), Notices()
    colors[1, 2], colors[3, 4, 0], colors[5, 6, 1] = math.nan, math.inf, -0.5
    pixels = load_environment(exr(tmp_path / "a.exr", {"RGB": colors}), notices).pixels[::-1]
    assert np.isfinite(pixels).all()
    assert (pixels[1, 2].tolist(), pixels[5, 6].tolist()) == ([0.0, 0.0, 0.0], [1.0, 0.0, 1.0])
    assert pixels[3, 4, 0] > 1e6
    assert notices.lines == ["a.exr: 2 texels that are NaN or infinite mended"]


def test_wide_pictures_are_scaled_down_and_odd_ones_told(tmp_path: Path) -> None:
    colors, notices = np.ones((4, 2 * LARGEST_WIDTH, 3), np.float32), Notices()
    colors[:, 1::2] = 3.0
    pixels = load_environment(exr(tmp_path / "a.exr", {"RGB": colors}), notices).pixels
    assert pixels.shape == (2, LARGEST_WIDTH, 3)
    assert (pixels == 2.0).all()
    assert ["twice as wide" in notices.lines[0], "scaled from" in notices.lines[1]] == [True, True]


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.hdr", b"", "is not a Radiance picture"),
        ("a.hdr", b"GIF89a", "is not a Radiance picture"),
        ("a.hdr", b"#?RADIANCE\n\n+X 4 +Y 4\n", "header of this .hdr file cannot be read"),
        ("a.hdr", HEADER.replace(b"rle_rgbe", b"float") + b"-Y 8 +X 16\n", "FORMAT=32-bit_float is not known"),
        ("a.hdr", HEADER + b"-Y 8 +X 0\n", "16|0 x 8 texels cannot be an environment"),
        ("a.hdr", HEADER + b"-Y 200000 +X 400000\n", "400,000 x 200,000 texels"),
        ("a.hdr", HEADER + b"-Y 8 +X 16\n" + run_lengths(texels())[:-30], "row 7 of 8 is damaged"),
        ("a.exr", b"", "cannot be read as OpenEXR"),
        ("a.exr", b"v/1\x01" + bytes(50), "cannot be read as OpenEXR"),
        ("a.png", b"", "is no environment"),
    ],
)
def test_files_that_are_no_environment(tmp_path: Path, name: str, content: bytes, expected: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(UserError, match=expected) as caught:
        load_environment(path, Notices())
    assert str(caught.value).startswith(str(path))


def test_a_missing_file_names_its_neighbour(tmp_path: Path) -> None:
    written(tmp_path / "park.hdr", texels(), texels().tobytes())
    with pytest.raises(UserError, match=r"did you mean 'park\.hdr'"):
        load_environment(tmp_path / "parc.hdr", Notices())
    exr(tmp_path / "depth.exr", {"Z": np.ones((4, 8), np.float32)})
    with pytest.raises(UserError, match=r"has no colours \(channels: Z\)"):
        load_environment(tmp_path / "depth.exr", Notices())


@settings(derandomize=True, max_examples=60, deadline=None)
@given(at=st.integers(0, 1 << 16), value=st.integers(0, 255), cut=st.integers(0, 40))
def test_a_damaged_picture_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, at: int, value: int, cut: int
) -> None:
    body = bytearray(HEADER + b"-Y 8 +X 16\n" + run_lengths(texels()))
    body[at % len(body)] = value
    path = tmp_path_factory.getbasetemp() / "fuzzed.hdr"
    path.write_bytes(body[: len(body) - cut])
    try:
        pixels = load_environment(path, Notices()).pixels
    except UserError:
        return
    assert np.isfinite(pixels).all()
    assert (pixels >= 0.0).all()
