"""How well BMFR's least squares are solved, by condition number: the table in docs/bmfr.md.

    python -m tools.conditioning

Every row of the table is a set of blocks of 32x32 pixels with a known answer. Three solvers get the same numbers in
single precision: Givens rotations in single precision as ``gl/shaders/bmfr/solver.glsl`` does them, normal equations
with a Cholesky factorisation in single precision, and QR in double precision.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

ROWS: Final = 1024
FEATURES: Final = 10
BLOCKS: Final = 16
"""Blocks per row of the table; errors are the largest of them."""

THREADS: Final = 8
TINY: Final = 1e-20
"""``rotate`` in the shader: where both elements are smaller, it leaves the rows alone."""


class Solution(NamedTuple):
    """``weights`` (B, M, 3), and how many columns were ``dropped`` in each block (B,)."""

    weights: F64
    dropped: NDArray[np.int64]


def givens(rows: F32, rank_tolerance: float, threads: int = THREADS) -> Solution:
    """The solver of the shader, step by step in its precision, for all blocks at once.

    ``rows`` (B, W, M + 3): features and colour of every pixel; W a multiple of ``threads``, which is a power of two.
    """
    blocks, count, columns = rows.shape
    features = columns - 3
    triangle = np.zeros((blocks, threads, features, columns), np.float32)
    for first in range(0, count, threads):
        fold(triangle, rows[:, first : first + threads].copy())
    while triangle.shape[1] > 1:
        half = triangle.shape[1] // 2
        lower, triangle = triangle[:, half:], triangle[:, :half]
        for k in range(features):
            fold(triangle, lower[:, :, k].copy())
    return solve(triangle[:, 0], rank_tolerance)


def fold(triangle: F32, row: F32, first: int = 0) -> None:
    """Turn ``row`` (..., M + 3) into ``triangle`` (..., M, M + 3) by one rotation for each column from ``first`` on."""
    for k in range(first, triangle.shape[-2]):
        a, b = triangle[..., k, k], row[..., k]
        square = a * a + b * b
        turn = square > TINY
        inverse = np.where(turn, np.float32(1.0) / np.sqrt(np.where(turn, square, np.float32(1.0))), np.float32(0.0))
        c, s = np.where(turn, a * inverse, np.float32(1.0))[..., None], (b * inverse)[..., None]
        upper, lower = triangle[..., k, k + 1 :].copy(), row[..., k + 1 :].copy()
        triangle[..., k, k] = square * inverse
        triangle[..., k, k + 1 :] = c * upper + s * lower
        row[..., k + 1 :] = c * lower - s * upper
        row[..., k] = 0.0


def solve(triangle: F32, rank_tolerance: float) -> Solution:
    """Rank test and back substitution of ``triangle`` (B, M, M + 3)."""
    blocks, features, _ = triangle.shape
    weights = np.zeros((blocks, features, 3), np.float32)
    dropped = np.zeros(blocks, np.int64)
    for block, r in enumerate(triangle):
        tiny = rank_tolerance * r[0, 0]
        for k in range(features):
            if not r[k, k] > tiny:
                row = r[k].copy()
                r[k] = 0.0
                fold(r, row, k + 1)
                dropped[block] += 1
        for k in reversed(range(features)):
            if r[k, k] > 0.0:
                rest = r[k, features:] - r[k, k + 1 : features] @ weights[block, k + 1 :]
                weights[block, k] = rest / r[k, k]
    return Solution(weights.astype(np.float64), dropped)


def cholesky(rows: F32) -> Solution:
    """Normal equations in single precision, as they are; NaN where the matrix is not positive definite."""
    features = rows.shape[2] - 3
    weights = np.full((len(rows), features, 3), np.nan)
    for block, values in enumerate(rows):
        matrix = values[:, :features].T @ values
        try:
            factor = np.linalg.cholesky(matrix[:, :features])
        except np.linalg.LinAlgError:
            continue
        middle = np.linalg.solve(factor, matrix[:, features:])
        weights[block] = np.linalg.solve(factor.T, middle)
    return Solution(weights, np.zeros(len(rows), np.int64))


def double(rows: F32) -> Solution:
    """QR in double precision; columns that depend on others to its precision get the smallest weights there are."""
    exact = rows.astype(np.float64)
    features = rows.shape[2] - 3
    weights = np.stack([np.linalg.lstsq(block[:, :features], block[:, features:], rcond=1e-13)[0] for block in exact])
    return Solution(weights, np.zeros(len(rows), np.int64))


def block_of(positions: F64, normals: F64) -> F64:
    """The features of ``bmfr.features = "1,n,w,w2"`` with positions (..., W, 3) brought to [-1, 1]: (..., W, 10)."""
    low, high = positions.min(axis=-2, keepdims=True), positions.max(axis=-2, keepdims=True)
    widest = (high - low).max(axis=-1, keepdims=True)
    w = (positions - (low + high) / 2) * 2 / np.maximum(np.maximum(high - low, widest / 8), 1e-30)
    return np.concatenate([np.ones_like(w[..., :1]), normals - normals[..., :1, :], w, w * w], axis=-1)


def curved(rng: np.random.Generator) -> tuple[F64, F64]:
    """Positions and normals (B, W, 3) of bumpy surfaces: no feature depends on the others."""
    y, x = np.mgrid[:32, :32].reshape(2, 1, -1) / 32.0
    wave = rng.uniform(1.0, 4.0, (BLOCKS, 6, 1))
    height = 0.3 * np.sin(wave[:, 0] * x + wave[:, 1]) * np.cos(wave[:, 2] * y + wave[:, 3])
    positions = np.stack(np.broadcast_arrays(x, y, height), axis=-1)
    normals = np.stack(
        np.broadcast_arrays(np.sin(wave[:, 4] * x * y), np.cos(wave[:, 5] * (x - y)), np.ones_like(x)), axis=-1
    )
    return positions, normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def nearly_equal(rng: np.random.Generator, distance: float) -> F64:
    """Bumpy surfaces whose second normal component is the first one, but for ``distance`` of another direction."""
    features = block_of(*curved(rng))
    features[..., 2] = features[..., 1] + distance * features[..., 2]
    return features


def plane(rng: np.random.Generator) -> F64:
    """Oblique planes: constant normals, and a position of two dimensions."""
    positions, normals = curved(rng)
    positions[..., 2] = positions[..., :2] @ rng.uniform(-1, 1, 2)
    return block_of(positions, np.broadcast_to(normals[:, :1], normals.shape))


def wall(rng: np.random.Generator) -> F64:
    """Walls across an axis: six constant columns, of which three are the normal's."""
    positions, normals = curved(rng)
    positions[..., 2] = 0.5
    return block_of(positions, np.broadcast_to(normals[:, :1], normals.shape))


def halved(rng: np.random.Generator) -> F64:
    """Half of the block is outside of the picture and repeats the other half."""
    features = block_of(*curved(rng))
    features[:, ROWS // 2 :] = features[:, ROWS // 2 - 1 :: -1]
    return features


def squared_first(rng: np.random.Generator) -> F64:
    """A surface one unit wide, a hundred units from the origin, whose squares are taken before scaling."""
    positions, normals = curved(rng)
    features = block_of(positions, normals)
    squares = (positions + 100.0) ** 2
    low, high = squares.min(axis=-2, keepdims=True), squares.max(axis=-2, keepdims=True)
    features[..., 7:] = (2 * squares - low - high) / (high - low)
    return features


def far_away(rng: np.random.Generator, extent: float) -> F64:
    """Surfaces ``extent`` wide, a million units from the origin, where single precision has steps of 1/16."""
    positions, normals = curved(rng)
    return block_of((1e6 + extent * positions).astype(np.float32).astype(np.float64), normals)


CASES: Final[dict[str, Callable[[np.random.Generator], F64]]] = {
    "bumpy surface": lambda rng: block_of(*curved(rng)),
    **{
        f"two features equal but for 1e-{digits}": lambda rng, d=digits: nearly_equal(rng, 10.0**-d)  # type: ignore[misc]
        for digits in range(1, 8)
    },
    "two equal features": lambda rng: nearly_equal(rng, 0.0),
    "half of it mirrored": halved,
    "oblique plane": plane,
    "wall across an axis": wall,
    "1 wide at 100, squared before it is scaled": squared_first,
    "1000 wide at 1e6": lambda rng: far_away(rng, 1e3),
    "0.001 wide at 1e6": lambda rng: far_away(rng, 1e-3),
}


def polynomial(features: F64, rng: np.random.Generator) -> F32:
    """Rows (B, W, M + 3) in single precision whose colours are combinations of ``features`` (B, W, M)."""
    weights = rng.uniform(-1.0, 1.0, (len(features), features.shape[-1], 3))
    rounded = features.astype(np.float32)
    return np.concatenate([rounded, (rounded.astype(np.float64) @ weights).astype(np.float32)], axis=-1)


def error(rows: F32, solution: Solution) -> float:
    """Largest difference of fit and colour over all blocks, in the largest colour of the block; infinite for NaN."""
    features = rows.shape[2] - 3
    exact = rows.astype(np.float64)
    with np.errstate(invalid="ignore"):
        difference = np.abs(exact[..., :features] @ solution.weights - exact[..., features:]).max(axis=(1, 2))
    worst = float((difference / np.abs(exact[..., features:]).max(axis=(1, 2))).max())
    return worst if np.isfinite(worst) else np.inf


def condition(rows: F32) -> float:
    """Median condition number of the features."""
    features = rows[..., : rows.shape[2] - 3].astype(np.float64)
    values = np.linalg.svd(features, compute_uv=False)
    return float(np.median(values[:, 0] / np.maximum(values[:, -1], 1e-300)))


def table(rank_tolerance: float = 1e-4) -> list[str]:
    """Lines of the table in Markdown."""
    lines = [
        "| block | condition | Givens, float32 | with rank test | dropped | Cholesky, float32 | QR, float64 |",
        "| --- | --: | --: | --: | --: | --: | --: |",
    ]
    for name, make in CASES.items():
        rng = np.random.default_rng(1)
        rows = polynomial(make(rng), rng)
        number = condition(rows)
        tested = givens(rows, rank_tolerance)
        errors = [error(rows, s) for s in (givens(rows, 1e-7), tested, cholesky(rows), double(rows))]
        cells = ["fails" if np.isinf(value) else f"{value:.0e}" for value in errors]
        shown = f"{number:.0e}" if number < 1e9 else "infinite"
        dropped = f"{tested.dropped.mean():.0f}"
        lines.append(f"| {name} | {shown} | {cells[0]} | {cells[1]} | {dropped} | {cells[2]} | {cells[3]} |")
    return lines


def main() -> None:
    print("\n".join(table()))


if __name__ == "__main__":
    main()
