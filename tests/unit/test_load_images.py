"""Textures: every pixel format becomes 8-bit RGB, bottom row first."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from errors import Notices, UserError
from raytrace import images
from raytrace.images import decode_image

GREY = np.array([[0, 64], [128, 255]], np.uint8)  # top row first, as image files have it


def _encoded(image: Image.Image, kind: str = "PNG", **options: object) -> bytes:
    out = io.BytesIO()
    image.save(out, kind, **options)
    return out.getvalue()


def _decode(data: bytes) -> np.ndarray:
    return decode_image(data, "wood.png", "material 'oak'", Notices()).pixels


def _grey16() -> Image.Image:
    return Image.fromarray(GREY.astype(np.uint16) * 257)


def _palette(transparent: bool) -> bytes:
    image = Image.fromarray(GREY // 64)
    image.putpalette([0, 0, 0, 64, 64, 64, 128, 128, 128, 255, 255, 255])
    return _encoded(image, transparency=bytes([255, 0, 128, 255])) if transparent else _encoded(image)


@pytest.mark.parametrize(
    "data",
    [
        _encoded(Image.fromarray(GREY)),
        _encoded(Image.merge("RGB", [Image.fromarray(GREY)] * 3)),
        _encoded(Image.merge("RGBA", [Image.fromarray(GREY)] * 3 + [Image.new("L", (2, 2), 7)])),
        _encoded(Image.merge("LA", [Image.fromarray(GREY), Image.new("L", (2, 2), 0)])),
        _encoded(_grey16()),
        _encoded(_grey16().convert("I"), "TIFF"),
        _palette(transparent=False),
        _palette(transparent=True),
        _encoded(Image.merge("RGB", [Image.fromarray(GREY)] * 3), "WEBP", lossless=True),
        _encoded(Image.merge("RGB", [Image.fromarray(GREY)] * 3), "BMP"),
        _encoded(Image.merge("RGB", [Image.fromarray(GREY)] * 3), "TGA"),
    ],
    ids=["L", "RGB", "RGBA", "LA", "I;16", "I", "P", "P with transparency", "WebP", "BMP", "TGA"],
)
def test_every_format_is_the_same_picture(data: bytes):
    pixels = _decode(data)
    assert pixels.dtype == np.uint8
    assert pixels.flags.c_contiguous
    expected = np.repeat(GREY[::-1, :, None], 3, axis=2).astype(int)
    np.testing.assert_array_equal(pixels, expected)


def test_jpeg_and_cmyk():
    flat = Image.new("RGB", (16, 16), (200, 100, 50))
    for image in (flat, flat.convert("CMYK")):
        np.testing.assert_allclose(_decode(_encoded(image, "JPEG", quality=95))[8, 8], (200, 100, 50), atol=4)


def test_bilevel():
    assert _decode(_encoded(Image.fromarray(GREY > 100))).tolist() == [[[255] * 3] * 2, [[0] * 3] * 2]


def test_large_images_are_scaled_down_with_a_notice(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(images, "MAX_SIDE", 16)
    notices = Notices()
    data = _encoded(Image.linear_gradient("L").resize((64, 20)))
    texture = decode_image(data, "wood.png", "material 'oak'", notices)
    assert texture.pixels.shape == (5, 16, 3)
    assert texture.pixels[0].mean() > texture.pixels[-1].mean() + 100
    assert "64 x 20 down to 16 x 5" in notices.lines[0]


def test_largest_side_is_left_alone(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(images, "MAX_SIDE", 16)
    notices = Notices()
    assert decode_image(_encoded(Image.new("L", (16, 16))), "a", "b", notices).pixels.shape == (16, 16, 3)
    assert notices.lines == []


@pytest.mark.parametrize("factor", [1, 3])
def test_decompression_bombs_are_refused(monkeypatch: pytest.MonkeyPatch, factor: int):
    """Pillow warns above its limit and raises at twice the limit; both are refused here."""
    data = _encoded(Image.new("L", (100, 100 * factor)))
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 9_000)
    with pytest.raises(UserError, match=r"wood\.png.*oak.*too large"):
        _decode(data)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", "cannot be decoded"),
        (b"%PDF-1.4", "cannot be decoded"),
        (_encoded(Image.linear_gradient("L"))[:-300], "cannot be decoded"),
        (_encoded(Image.new("F", (2, 2)), "TIFF"), "floating-point"),
    ],
)
def test_errors(data: bytes, expected: str):
    with pytest.raises(UserError, match=expected) as caught:
        _decode(data)
    assert "wood.png" in str(caught.value)
    assert "oak" in str(caught.value)
