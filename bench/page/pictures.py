"""Pictures as data URIs.

Those of the methods are WebP without loss, since a report on noise must not add or remove any; those of variants and of
path tracing, of which there are many, nearly without: AVIF with colours as fine as brightness.
"""

from __future__ import annotations

import base64
import io
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bench.scores import Pictures

U8 = NDArray[np.uint8]

_WITHOUT_LOSS: Final = {"format": "WEBP", "lossless": True, "exact": True}
_NEARLY: Final = {"format": "AVIF", "quality": 88, "subsampling": "4:4:4", "speed": 8}
_MAP: Final = {"format": "WEBP", "quality": 75}


def encoded(pictures: Pictures, exact: bool = True) -> dict[str, Any]:
    """``picture``, ``flip`` and ``strip`` as data URIs, row 0 on top, frame 0 on top of the strip.

    ``exact``: without loss; otherwise nearly, and without a strip.
    """
    return {
        "picture": data_uri(pictures.picture[::-1], _WITHOUT_LOSS if exact else _NEARLY),
        "flip": data_uri(pictures.flip[::-1], _MAP) if pictures.flip.any() else "",
        "strip": data_uri(pictures.strip, _WITHOUT_LOSS) if exact else "",
    }


def data_uri(pixels: U8, options: dict[str, Any]) -> str:
    """``pixels`` (H, W, 3) or (H, W) uint8, row 0 on top. ``options``: of :meth:`PIL.Image.Image.save`."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).convert("RGB").save(buffer, **options)
    kind = options["format"].lower()
    return f"data:image/{kind};base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
