"""Image files as textures, decoded by Pillow."""

from __future__ import annotations

import io
import warnings

import numpy as np
from PIL import Image

from errors import Notices, UserError
from raytrace.scene import Texture

MAX_SIDE = 8192
"""Longest side of a texture in pixels; larger images are scaled down."""

_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF", "GIF", "PPM")  # none that starts another program, as EPS does


def decode_image(
    data: bytes, name: str, used_by: str, notices: Notices, linear: bool = False, alpha: bool = False
) -> Texture:
    """Decode an image file to 8-bit RGB, bottom row first; palettes and 16-bit greys are converted.

    ``name`` is what people call the image, ``used_by`` the material that wants it. ``linear``: its numbers are no sRGB
    codes. ``alpha``: its coverage is wanted as well; else, and where all of it is opaque, it is dropped. Raises
    UserError for something that is not an image, is cut short, or would fill the memory when decoded (Pillow's limit
    for decompression bombs).
    """
    where = f"texture {name!r} of {used_by}"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            image: Image.Image = Image.open(io.BytesIO(data), formats=_FORMATS)
            image.load()
            if image.mode != "F":
                image = _to_rgb(image, alpha)
                size = image.size
                image.thumbnail((MAX_SIDE, MAX_SIDE), Image.Resampling.BOX)
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise UserError(
            f"{where} is too large to decode: {error}", f"shrink it to {MAX_SIDE} pixels a side or less"
        ) from error
    except Exception as error:  # Pillow's decoders raise OSError, SyntaxError, ValueError, struct.error and more
        raise UserError(
            f"{where} cannot be decoded: {error}", f"save it again as PNG or JPEG (readable: {', '.join(_FORMATS)})"
        ) from error
    if image.mode == "F":
        raise UserError(f"{where} has floating-point pixels", "save it as an 8-bit PNG or JPEG")
    if image.size != size:
        notices.add(f"{where}: scaled from {size[0]} x {size[1]} down to {image.width} x {image.height} pixels")
    pixels = np.asarray(image, dtype=np.uint8)[::-1]
    coverage = np.ascontiguousarray(pixels[..., 3]) if pixels.shape[-1] == 4 and pixels[..., 3].min() < 255 else None
    return Texture(name, np.ascontiguousarray(pixels[..., :3]), linear, coverage)


def _to_rgb(image: Image.Image, alpha: bool) -> Image.Image:
    """In mode RGB, or RGBA where ``alpha`` is wanted and there is any."""
    if image.mode == "I" or image.mode.startswith("I;16"):  # convert() would clip at 255
        codes = np.clip(np.asarray(image).astype(np.int64), 0, 65535)
        image = Image.fromarray(((codes * 255 + 32767) // 65535).astype(np.uint8))
    if "transparency" in image.info:  # a palette's transparency must go through RGBA
        image = image.convert("RGBA")
    if alpha and image.has_transparency_data:
        return image.convert("RGBA")
    return image if image.mode == "RGB" else image.convert("RGB")
