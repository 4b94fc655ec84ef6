"""bmfr/solver.glsl against double precision: random blocks, and all that is hard about least squares."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from gl.executor import SHADER_ROOT, Executor
from gl.graph import ComputePass, Graph, In, Out, Uniform
from gl.renderer import read
from tools.conditioning import CASES, ROWS, block_of, curved, givens, halved, polynomial

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
RANK_TOLERANCE = 1e-4
SHADER = """
layout(local_size_x = THREADS) in;
#include "bmfr/solver.glsl"
uniform sampler2D in_rows;
uniform float u_tolerance;
layout(rgba32f, binding = 0) writeonly uniform image2D out_weights;
void main() {
    int thread = int(gl_LocalInvocationID.x), block = int(gl_WorkGroupID.x);
    clear_triangle();
    for (int i = thread; i < textureSize(in_rows, 0).y; i += THREADS) {
        for (int j = 0; j < COLUMNS; ++j) row[j] = texelFetch(in_rows, ivec2(block * COLUMNS + j, i), 0).x;
        fold_row();
    }
    merge_triangles(thread);
    if (thread != 0) return;
    solve(u_tolerance);
    for (int k = 0; k < FEATURES; ++k) imageStore(out_weights, ivec2(block * COLUMNS + k, 0), vec4(s_weights[k], 0.0));
}
"""


class Solve(ComputePass):
    """Weights of many blocks at once. Block b has its rows in the columns from b (M + 3) on, its weights in row 0."""

    shader = "test/solve.comp"
    in_rows = In("features and colour")
    out_weights = Out("rgba32f", "weights")
    u_tolerance = Uniform("float", "> 0, rank test")

    def __init__(self, features: int, threads: int, tolerance: float) -> None:
        super().__init__(
            group=(features + 3, 1 << 20), defines={"FEATURES": features, "THREADS": threads}, u_tolerance=tolerance
        )


class Solver:
    def __init__(self, ctx: moderngl.Context, root: Path) -> None:
        shutil.copytree(SHADER_ROOT, root, dirs_exist_ok=True)
        (root / "test").mkdir()
        (root / "test/solve.comp").write_text(SHADER)
        self._ctx, self.executor = ctx, Executor(ctx, root)

    def __call__(self, rows: F32, threads: int = 8, rank_tolerance: float = RANK_TOLERANCE) -> F64:
        """Weights (B, M, 3) of ``rows`` (B, W, M + 3)."""
        blocks, count, columns = rows.shape
        image = np.ascontiguousarray(rows.transpose(1, 0, 2).reshape(count, blocks * columns))
        texture = self._ctx.texture((blocks * columns, count), 1, image.tobytes(), dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        g = Graph()
        work = Solve(columns - 3, threads, rank_tolerance)
        g.output("weights", g.add(work, in_rows=g.import_("rows", "r32f")).out_weights)
        result = self.executor.run(g.compile(), (blocks * columns, count), {"rows": texture})
        weights = read(result.outputs["weights"])[0, :, :3].reshape(blocks, columns, 3)[:, :-3]
        texture.release()
        return weights.astype(np.float64)


@pytest.fixture(scope="module")
def _module_solver(_session_context: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Solver]:
    with _session_context:
        solver = Solver(_session_context, tmp_path_factory.mktemp("solver"))
        yield solver
        solver.executor.release()


@pytest.fixture
def solver(ctx: moderngl.Context, _module_solver: Solver) -> Solver:
    return _module_solver


def fit_error(rows: F32, weights: F64) -> float:
    """Largest difference to the best fit in double precision, in the largest colour of its block."""
    exact = rows.astype(np.float64)
    worst = 0.0
    for block, found in zip(exact, weights, strict=True):
        features, colors = block[:, :-3], block[:, -3:]
        best = features @ np.linalg.lstsq(features, colors, rcond=RANK_TOLERANCE / 2)[0]
        scale = max(float(np.abs(colors).max()), 1e-30)
        worst = max(worst, float(np.abs(features @ found - best).max()) / scale)
    return worst


def noisy(features: F64, scale: float = 1.0, seed: int = 5) -> F32:
    """Rows (B, W, M + 3) with colours of one path per pixel."""
    colors = np.random.default_rng(seed).exponential(scale, (*features.shape[:-1], 3))
    return np.concatenate([features, colors], axis=-1).astype(np.float32)


@pytest.mark.parametrize("threads", [1, 2, 8, 16, 32])
def test_random_blocks_are_fitted_as_in_double_precision(solver: Solver, threads: int) -> None:
    rng = np.random.default_rng(0)
    features = rng.uniform(-1, 1, (4, ROWS, 10))
    features[..., 0] = 1.0
    rows = noisy(features)
    assert fit_error(rows, solver(rows, threads)) < 2e-6


@pytest.mark.parametrize("count", [1, 3, 4, 7, 13, 17])
def test_any_number_of_features_will_do(solver: Solver, count: int) -> None:
    rows = noisy(np.random.default_rng(1).uniform(-1, 1, (2, ROWS, count)))
    assert fit_error(rows, solver(rows)) < 2e-6


@pytest.mark.parametrize("case", CASES)
def test_polynomials_are_reproduced(solver: Solver, case: str) -> None:
    """By the rank test alone, to 1e-4; what is dropped is found again in the features that stay."""
    rng = np.random.default_rng(1)
    rows = polynomial(CASES[case](rng), rng)
    colors = rows[..., -3:].astype(np.float64)
    error = np.abs(rows[..., :-3].astype(np.float64) @ solver(rows) - colors).max() / np.abs(colors).max()
    assert error < (1e-4 if "squared before" not in case else 1e-3)


def test_the_table_in_the_docs_has_every_case() -> None:
    text = (ROOT / "docs" / "bmfr.md").read_text(encoding="utf-8")
    assert [name for name in CASES if f"| {name} |" not in text] == []


@pytest.mark.parametrize("case", CASES)
def test_the_table_in_the_docs_is_about_this_shader(solver: Solver, case: str) -> None:
    """tools.conditioning's own Givens rotations give the same fit."""
    rng = np.random.default_rng(2)
    rows = noisy(CASES[case](rng)[:3])
    features = rows[..., :-3].astype(np.float64)
    expected = features @ givens(rows, RANK_TOLERANCE).weights
    np.testing.assert_allclose(features @ solver(rows), expected, atol=2e-3 if "squared before" in case else 1e-4)


def flat(rng: np.random.Generator) -> F64:
    positions, normals = curved(rng)
    return block_of(positions, np.broadcast_to(normals[:, :1], normals.shape))


def constant(rng: np.random.Generator) -> F64:
    features = np.zeros((2, ROWS, 10))
    features[..., 0] = 1.0
    return features


def uncentred(rng: np.random.Generator) -> F64:
    """Constant features that are not 0: they depend on the constant one."""
    features = flat(rng)
    features[..., 1:4] = (0.6, 0.0, 0.8)
    return features


def axis_aligned(rng: np.random.Generator) -> F64:
    """A wall across an axis: six constant columns."""
    features = uncentred(rng)
    features[..., [6, 9]] = 0.0
    return features


def equal(rng: np.random.Generator) -> F64:
    features = block_of(*curved(rng))
    features[..., 5] = features[..., 3] = features[..., 1]
    return features


def few(rng: np.random.Generator) -> F64:
    """Fewer pixels than features; all others are sky."""
    features = block_of(*curved(rng))
    features[:, np.arange(ROWS) % 300 != 7] = 0.0
    return features


HARD = {f.__name__: f for f in (flat, constant, uncentred, halved, axis_aligned, equal, few)}


@pytest.mark.parametrize("case", HARD)
@pytest.mark.parametrize("scale", [1.0, 6e4, 1e-6])
def test_hard_blocks_get_the_best_fit_there_is(solver: Solver, case: str, scale: float) -> None:
    rows = noisy(HARD[case](np.random.default_rng(3)), scale)
    rows[..., -3:] *= (np.abs(rows[..., :-3]).max(axis=-1) > 0)[..., None]  # sky has no colour
    weights = solver(rows)
    assert np.isfinite(weights).all()
    assert fit_error(rows, weights) < 1e-5


def test_a_feature_that_differs_in_its_last_bits_is_dropped(solver: Solver) -> None:
    features = block_of(*curved(np.random.default_rng(4)))
    features[..., 2] = features[..., 1] * (1 + 1e-7)
    rows = noisy(features)
    weights = solver(rows)
    assert (weights[:, 2] == 0.0).all()
    assert np.abs(weights).max() < 100.0
    assert fit_error(rows, weights) < 1e-5


def test_what_a_dropped_column_knows_of_later_ones_is_kept(solver: Solver) -> None:
    """The difference of two equal columns is a third one: dropping the second must not take the third with it."""
    features = block_of(*curved(np.random.default_rng(6)))[..., [0, 1, 2, 3]]
    features[..., 2] = features[..., 1] + 1e-5 * features[..., 3]
    rows = polynomial(features, np.random.default_rng(7))
    weights = solver(rows)
    assert (weights[:, 2] == 0.0).all()
    colors = rows[..., -3:].astype(np.float64)
    assert np.abs(rows[..., :-3].astype(np.float64) @ weights - colors).max() / np.abs(colors).max() < 1e-4


def test_a_block_without_rows_gets_no_weights(solver: Solver) -> None:
    assert (solver(np.zeros((2, ROWS, 13), np.float32)) == 0.0).all()


def test_a_block_without_features_gets_no_weights(solver: Solver) -> None:
    """Colours and nothing that explains them."""
    rows = noisy(np.zeros((1, ROWS, 10)), 6e4)
    assert (solver(rows, rank_tolerance=1e-7) == 0.0).all()
