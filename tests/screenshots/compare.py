"""Pictures against reference pictures, with a tolerance for other processors but not for other pictures."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from images import write_png

U8 = NDArray[np.uint8]

REFERENCES = Path(__file__).parent / "references"
FAILURES = Path(__file__).parents[2] / "out" / "test-failures"

LEVEL = 2
"""Steps of 1/255 that any number of pixels may be off in a channel: vector width and fused products differ."""
SHARE = 0.002
"""Share of the pixels that may be off by more: where rounding sends a path or a history another way."""
MEAN = 0.2
"""Mean difference over all channels, in 1/255, that must not be reached."""
GAIN = 20
"""How much the picture of the difference is amplified."""


class Difference(NamedTuple):
    """``share``: of pixels off by more than LEVEL in any channel; ``mean``: over all channels, in 1/255."""

    share: float
    mean: float

    def passes(self, share: float = SHARE) -> bool:
        return self.share <= share and self.mean < MEAN


def difference(picture: U8, reference: U8) -> Difference:
    """Of two (H, W, 3) pictures of one size."""
    off = np.abs(picture.astype(np.int16) - reference)
    return Difference(float((off.max(axis=2) > LEVEL).mean()), float(off.mean()))


def load(path: Path) -> U8:
    """(H, W, 3), row 0 = bottom."""
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))[::-1]


def check(
    name: str,
    picture: U8,
    regenerate: bool,
    references: Path = REFERENCES,
    failures: Path = FAILURES,
    share: float = SHARE,
) -> None:
    """Fail if ``picture`` (H, W, 3), row 0 = bottom, is not that of ``references``; or write it there.

    ``share``: in place of SHARE, where a picture has reason to vary more. A failure leaves what was expected, what
    there is, and the amplified difference in ``failures``.
    """
    path = references / f"{name}.png"
    if regenerate:
        write_png(path, picture)
        return
    assert path.is_file(), f"{path} is missing: `make references` writes it, then look at it"
    reference = load(path)
    assert picture.shape == reference.shape, f"{name}: {picture.shape}, the reference is {reference.shape}"
    found = difference(picture, reference)
    if not found.passes(share):
        amplified = np.abs(picture.astype(np.int16) - reference) * GAIN
        write_png(failures / f"{name}.expected.png", reference)
        write_png(failures / f"{name}.actual.png", picture)
        write_png(failures / f"{name}.difference.png", np.clip(amplified, 0, 255).astype(np.uint8))
    assert found.passes(share), (
        f"{name}: {found.share:.2%} of the pixels are off by more than {LEVEL}/255 (at most {share:.1%}), "
        f"{found.mean:.3f}/255 on average (less than {MEAN}); see {failures}"
    )
