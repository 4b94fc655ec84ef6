"""Pictures of high dynamic range as environments: Radiance ``.hdr`` (RGBE) and OpenEXR."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from errors import Notices, UserError, did_you_mean
from raytrace.environment import LARGEST_WIDTH, Environment
from raytrace.resources import read_bytes
from raytrace.rgbe import decode_scanlines

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]

_BRIGHTEST: Final = 1e7  # products with throughputs stay in float32, and no sun is brighter in units of its sky
_MOST_TEXELS: Final = 1 << 28
_DAMAGED: Final = "the file is damaged or was cut short: copy or download it again"

_XYZ_TO_RGB: Final = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)


def load_environment(path: str | Path, notices: Notices, strength: float = 1.0, degrees: float = 0.0) -> Environment:
    """An equirectangular picture, twice as wide as high, as an environment.

    ``strength`` multiplies it. ``degrees``: turned about the y axis, counter-clockwise seen from above. What is
    NaN or negative becomes 0, and pictures wider than LARGEST_WIDTH are scaled down; ``notices`` tells.
    Raises UserError for a file that is not there, of another kind, or damaged.
    """
    path = Path(path).expanduser()
    reader = _READERS.get(path.suffix.lower())
    if not path.is_file():
        others = [p.name for p in path.parent.iterdir() if p.suffix.lower() in _READERS] if path.parent.is_dir() else []
        raise UserError(f"{path}: there is no such file{did_you_mean(path.name, others)}", "check the path")
    if reader is None:
        raise UserError(f"{path}: is no environment", f"give an equirectangular picture ({', '.join(_READERS)})")
    pixels = reader(path, notices)
    lost = int((~np.isfinite(pixels)).any(axis=2).sum())
    if lost:
        notices.add(f"{path.name}: {lost:,} texels that are NaN or infinite mended")
    # Compression leaves values a little below 0 too.
    pixels = np.clip(np.nan_to_num(pixels, nan=0.0, posinf=_BRIGHTEST, neginf=0.0), 0.0, _BRIGHTEST)
    height, width = pixels.shape[:2]
    if not 1.8 < width / height < 2.2:
        notices.add(f"{path.name}: {width} x {height} is not twice as wide as high: stretched around the whole sphere")
    if width > LARGEST_WIDTH:
        factor = math.ceil(width / LARGEST_WIDTH)
        pixels = _shrunk(pixels, factor)
        notices.add(f"{path.name}: scaled from {width} x {height} down to {pixels.shape[1]} x {pixels.shape[0]} texels")
    pixels = np.ascontiguousarray(pixels[::-1] * np.float32(strength), dtype=np.float32)
    return Environment(path.name, pixels, degrees / 360.0)


def _shrunk(pixels: F32, factor: int) -> F32:
    """Means of ``factor`` x ``factor`` texels; the last, incomplete ones are dropped."""
    height, width = (side // factor * factor for side in pixels.shape[:2])
    cells = pixels[:height, :width].reshape(height // factor, factor, width // factor, factor, 3)
    result: F32 = cells.mean(axis=(1, 3), dtype=np.float64).astype(np.float32)
    return result


# -- OpenEXR ----------------------------------------------------------------------------------------------------------


def _read_exr(path: Path, notices: Notices) -> F32:
    """(H, W, 3) float32, top row first."""
    try:
        with OpenEXR.File(str(path), header_only=True) as file:
            low, high = (np.array(corner) for corner in file.header()["dataWindow"])
        _check_size(path, *(int(side) for side in high - low + 1))
        with OpenEXR.File(str(path)) as file:
            channels: dict[str, Any] = {name: channel.pixels for name, channel in file.channels().items()}
    except UserError:
        raise
    except Exception as error:  # the package raises RuntimeError, ValueError and more
        raise UserError(f"{path}: cannot be read as OpenEXR ({error})", _DAMAGED) from error
    for name in ("RGBA", "RGB"):
        if name in channels:
            return np.asarray(channels[name][..., :3], dtype=np.float32)
    names = ["R", "G", "B"] if "R" in channels else ["Y"] * 3
    if any(name not in channels for name in names):
        raise UserError(
            f"{path}: has no colours (channels: {', '.join(sorted(channels)) or 'none'})",
            "save the picture with channels R, G and B",
        )
    return np.stack([np.asarray(channels[name], dtype=np.float32) for name in names], axis=2)


# -- Radiance ---------------------------------------------------------------------------------------------------------


def _read_radiance(path: Path, notices: Notices) -> F32:
    """(H, W, 3) float32, top row first. Ward 1991, "Real Pixels", and the Radiance file formats reference."""
    data = read_bytes(path)
    match = re.match(rb"#\?[^\n]*\n((?:[^\n]*\n)*?)\r?\n([-+])Y (\d{1,7}) ([-+])X (\d{1,7})\r?\n", data[:65536])
    if match is None:
        known = data[:2] == b"#?"
        raise UserError(
            f"{path}: {'the header of this .hdr file cannot be read' if known else 'is not a Radiance picture'}",
            "save it again as .hdr (Radiance RGBE, rows from the top) or .exr",
        )
    header = dict(line.split("=", 1) for line in match[1].decode("ascii", "replace").splitlines() if "=" in line)
    form = header.get("FORMAT", "32-bit_rle_rgbe").strip()
    if form not in ("32-bit_rle_rgbe", "32-bit_rle_xyze"):
        raise UserError(f"{path}: FORMAT={form} is not known", "save it again as 32-bit_rle_rgbe")
    height, width = int(match[3]), int(match[5])
    _check_size(path, width, height)
    coded = np.zeros((height, width, 4), np.uint8)
    row = int(decode_scanlines(np.frombuffer(data, np.uint8, offset=match.end()), coded))
    if row < height:
        raise UserError(f"{path}: row {row} of {height} is damaged", _DAMAGED)
    pixels: F32 = np.ldexp(coded[..., :3].astype(np.float32) + np.float32(0.5), coded[..., 3:].astype(np.int32) - 136)
    pixels[coded[..., 3] == 0] = 0.0
    if match[2] == b"+":
        pixels = pixels[::-1]
    if match[4] == b"-":
        pixels = pixels[:, ::-1]
    _tell_header(path, header, notices)
    if form.endswith("xyze"):
        pixels = np.maximum(pixels @ _XYZ_TO_RGB.T, 0.0)
    exposure = [float(value) for value in re.findall(rb"^EXPOSURE\s*=\s*([\d.eE+-]+)", match[1], re.MULTILINE)]
    result: F32 = (pixels / (math.prod(exposure) or 1.0)).astype(np.float32)
    return result


def _tell_header(path: Path, header: dict[str, str], notices: Notices) -> None:
    """What the header asks for and is not done: real files have these lines with meaningless values too."""
    if header.get("GAMMA", "1").strip() not in ("1", "1.0", "1.00"):
        notices.add(f"{path.name}: GAMMA={header['GAMMA'].strip()} ignored: the picture is taken as linear")
    primaries = [float(x) for x in re.findall(r"[-+]?[\d.]+", header.get("PRIMARIES", ""))]
    standard = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    if any(primaries) and not (len(primaries) == 8 and np.allclose(primaries, standard, atol=0.01)):
        notices.add(f"{path.name}: its PRIMARIES are ignored: colours are taken as Rec. 709")


def _check_size(path: Path, width: int, height: int) -> None:
    if width < 1 or height < 1 or width * height > _MOST_TEXELS:
        raise UserError(
            f"{path}: a picture of {width:,} x {height:,} texels cannot be an environment",
            f"scale it to {LARGEST_WIDTH} x {LARGEST_WIDTH // 2} or less",
        )


_READERS: Final[dict[str, Callable[[Path, Notices], F32]]] = {".hdr": _read_radiance, ".exr": _read_exr}
EXTENSIONS: Final = tuple(_READERS)
