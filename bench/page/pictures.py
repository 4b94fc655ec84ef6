"""Pictures as data URIs: WebP without loss, since a report on noise must not add or remove any."""

from __future__ import annotations

import base64
import io
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bench.scores import Pictures

U8 = NDArray[np.uint8]

_MAP_QUALITY: Final = 80


def encoded(pictures: Pictures) -> dict[str, Any]:
    """``picture``, ``flip`` and ``strip`` as data URIs, row 0 on top, frame 0 on top of the strip."""
    return {
        "picture": data_uri(pictures.picture[::-1]),
        "flip": data_uri(pictures.flip[::-1], lossless=False) if pictures.flip.any() else "",
        "strip": data_uri(pictures.strip),
    }


def data_uri(pixels: U8, lossless: bool = True) -> str:
    """``pixels`` (H, W, 3) or (H, W) uint8, row 0 on top. Error maps may lose a little: nobody reads pixels in them."""
    buffer = io.BytesIO()
    image = Image.fromarray(np.ascontiguousarray(pixels)).convert("RGB")
    if lossless:
        image.save(buffer, format="WEBP", lossless=True, exact=True)
    else:
        image.save(buffer, format="WEBP", quality=_MAP_QUALITY)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
