"""Makes the picture at the top of the README: one frame noisy, filtered and converged, side by side.

python -m tools.readme_picture [--spp M]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from images import side_by_side, write_png

ROOT: Final = Path(__file__).resolve().parent.parent
PICTURE: Final = ROOT / "docs" / "images" / "interior.png"

METHODS: Final = ("none", "svgf", "reference")
COLUMNS: Final = slice(200, 576)
"""What is shown of 640 columns: noise does not compress, and the picture is downloaded with every visit."""


def render(denoiser: str, samples: int, out: Path) -> NDArray[np.uint8]:
    """Frame 31 of the interior at 640x360 as ``app.py render`` writes it, (H, W, 3), row 0 = bottom."""
    shot = ["--scene", "interior", "--size", "640x360", "--camera", "still", "--frames", "32"]
    method = ["--denoiser", denoiser, "--spp", str(samples), "--out", str(out)]
    subprocess.run([sys.executable, "app.py", "render", *shot, *method], cwd=ROOT, check=True)
    with Image.open(out) as picture:
        return np.asarray(picture.convert("RGB"))[::-1]


def build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="readme_picture", description="Render docs/images/interior.png anew.")
    parser.add_argument("--spp", type=int, default=512, metavar="M", help="paths per pixel of the reference (512)")
    return parser


def main() -> None:
    samples = build_parser().parse_args().spp
    with tempfile.TemporaryDirectory() as folder:
        pictures = [render(name, samples, Path(folder) / f"{name}.png")[:, COLUMNS] for name in METHODS]
    write_png(PICTURE, side_by_side(pictures))
    print(PICTURE.relative_to(ROOT))


if __name__ == "__main__":
    main()
