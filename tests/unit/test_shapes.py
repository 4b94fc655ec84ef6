"""The mesh library and the textures of the built-in scenes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from assets import pictures, textures
from assets.shapes import Shape, block, box, cushion, join, prism, quad, rounded_box
from assets.surfaces import ball, curve, lathe, ring, rod, sheet, tube
from assets.textures import Pixels, linear, noise

HEXAGON = [(math.cos(k * math.pi / 3), math.sin(k * math.pi / 3)) for k in range(6)]
CLOTH = np.stack(np.meshgrid(np.linspace(0, 2, 9), [0.0], np.linspace(0, 1, 7), indexing="ij"), axis=-1)[:, 0]
CORE = (0.8, 0.3, 1.8)  # of a 1 x 0.5 x 2 box rounded by 0.1: its Steiner formula gives the volume
STEINER = (
    math.prod(CORE)
    + 2 * 0.1 * (CORE[0] * CORE[1] + CORE[1] * CORE[2] + CORE[2] * CORE[0])
    + math.pi * 0.1**2 * sum(CORE)
    + 4 / 3 * math.pi * 0.1**3
)
SOLIDS = [
    ("box", box((1.0, 2.0, 3.0)), 6.0, 1e-12),
    ("block", block((-1.0, 0.0, 2.0), (1.0, 0.5, 3.0)), 1.0, 1e-12),
    ("rounded box", rounded_box((1.0, 0.5, 2.0), 0.1, 8), STEINER, 2e-3),
    ("cushion", cushion((1.0, 0.2, 1.0), 0.05, 0.0), 0.2, 0.05),
    ("prism", prism(HEXAGON, 0.5), 0.75 * math.sqrt(3), 1e-12),
    ("ball", ball(1.0, 96), 4 / 3 * math.pi, 3e-3),
    ("rod", rod(0.5, 2.0, 96), 0.5 * math.pi, 1e-3),
    ("ring", ring(1.0, 0.2, 96, 48), 2 * math.pi * math.pi * 0.01, 5e-3),
    ("tube", tube(np.linspace([0, 0, 0], [1, 2, 2], 5), 0.1, 96), 0.03 * math.pi, 1e-3),
    ("sheet", sheet(CLOTH, 0.01), 0.02, 1e-9),
]


def volume(shape: Shape) -> float:
    a, b, c = (shape.vertices[shape.faces[:, k]] for k in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6)


@pytest.mark.parametrize(("shape", "expected", "tolerance"), [s[1:] for s in SOLIDS], ids=[s[0] for s in SOLIDS])
def test_solids_are_closed_and_enclose_their_volume(shape: Shape, expected: float, tolerance: float) -> None:
    assert volume(shape) == pytest.approx(expected, rel=tolerance)
    assert volume(shape.moved(10.0, -20.0, 5.0)) == pytest.approx(expected, rel=max(tolerance, 1e-6))  # only if closed
    points = shape.vertices[shape.faces]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    assert lengths.min() > 1e-9
    assert (np.einsum("fj,fkj->fk", normals, shape.normals[shape.faces]) > 0.85 * lengths[:, None]).all()


def test_a_swollen_cushion_has_the_normals_of_its_surface() -> None:
    shape = cushion((1.0, 0.2, 1.0), 0.05, 0.2, inner=60)
    points = shape.vertices[shape.faces]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    flat = (np.abs(points.mean(1)[:, 0]) < 0.4) & (np.abs(points.mean(1)[:, 2]) < 0.4)  # away from the curved margin
    mean = shape.normals[shape.faces].mean(1)
    assert np.einsum("fj,fj->f", normals, mean)[flat].min() > 0.9995


def test_stretching_keeps_normals_across_the_surface() -> None:
    shape = ball(1.0, 64).stretched(1.0, 3.0, 0.5)
    gradient = shape.vertices / np.array([1.0, 9.0, 0.25])  # of the ellipsoid x² + y²/9 + 4 z²
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    assert np.abs(shape.normals - gradient).max() < 1e-6


def test_turning_follows_the_right_hand() -> None:
    point = quad([(1, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0)])
    assert point.turned("y", 90.0).vertices[0] == pytest.approx([0.0, 0.0, -1.0])
    assert point.turned("y", 90.0).normals[0] == pytest.approx([1.0, 0.0, 0.0])
    assert point.turned("z", 90.0).vertices[0] == pytest.approx([0.0, 1.0, 0.0])
    assert point.turned("x", 90.0).normals[0] == pytest.approx([0.0, -1.0, 0.0])


def test_joining_keeps_every_triangle_in_place() -> None:
    parts = [box((1, 1, 1)), ball(1.0, 16).moved(3.0), quad([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])]
    whole = join(parts)
    expected = np.concatenate([part.vertices[part.faces] for part in parts])
    assert np.array_equal(whole.vertices[whole.faces], expected)


def test_a_picture_on_a_box_is_upright_and_not_mirrored() -> None:
    shape = box((2.0, 1.0, 1.0))
    front = shape.normals[:, 2] > 0.5
    assert shape.uvs[front] == pytest.approx(shape.vertices[front][:, :2] + [1.0, 0.5], abs=1e-6)


def test_texture_on_a_ball_runs_eastwards() -> None:
    shape = ball(1.0, 64)
    seen = shape.vertices[:, 0] < -0.9  # away from the seam; who looks at it, along +x, has +z to the right
    assert np.corrcoef(shape.vertices[seen][:, 2], shape.uvs[seen][:, 0])[0, 1] > 0.9
    assert np.corrcoef(shape.vertices[seen][:, 1], shape.uvs[seen][:, 1])[0, 1] > 0.9


def test_prism_refuses_outlines_that_it_cannot_close() -> None:
    with pytest.raises(ValueError, match="counter-clockwise"):
        prism(HEXAGON[::-1], 1.0)
    with pytest.raises(ValueError, match="star-shaped"):
        prism([(0, 0), (4, 0), (4, 3), (3.9, 3), (3.9, 0.1), (0.1, 0.1), (0.1, 3), (0, 3)], 1.0)


def test_lathe_keeps_sharp_corners_and_rounds_soft_ones() -> None:
    cylinder = rod(1.0, 1.0, 16)
    at_rim = cylinder.normals[(cylinder.vertices[:, 1] == 1.0) & (np.hypot(*cylinder.vertices[:, [0, 2]].T) > 0.99)]
    assert set(np.unique(np.round(at_rim[:, 1], 6))) == {0.0, 1.0}
    cone = lathe([(0, 0), (1, 0), (0.9, 1), (0.7, 2), (0, 2)], 16)
    at_bend = cone.normals[cone.vertices[:, 1] == 1.0]
    assert np.ptp(at_bend[:, 1]) < 1e-6


def test_curve_passes_through_its_controls() -> None:
    controls = [(0.0, 0.0), (1.0, 2.0), (3.0, 1.0), (4.0, 4.0)]
    assert curve(controls, 10)[::3] == pytest.approx(np.array(controls))


def test_linear_colour_is_the_srgb_curve() -> None:
    assert linear("#ffffff") == pytest.approx((1.0, 1.0, 1.0))
    assert linear("#80050a") == pytest.approx((0.2158605, 0.0015176, 0.0030353), abs=1e-6)


def seam(image: Pixels, axis: int) -> float:
    """Step from the last row or column to the first, relative to the largest step between neighbours elsewhere."""
    lines = image.astype(np.float64).swapaxes(0, axis)
    steps = np.abs(np.diff(lines, axis=0)).mean((1, 2))
    return float(np.abs(lines[-1] - lines[0]).mean() / steps.max())


REPEATING = [
    textures.parquet, textures.plaster, textures.brick, textures.weave, textures.wallpaper, textures.drapery,
    lambda: textures.wood("#000000", "#ffffff", 3),
]  # fmt: skip


@pytest.mark.parametrize("draw", REPEATING)
def test_wall_and_cloth_textures_repeat_without_a_seam(draw: object) -> None:
    assert callable(draw)
    image = draw()
    assert seam(image, 0) <= 1.05
    assert seam(image, 1) <= 1.05


def test_noise_repeats_and_fills_its_range() -> None:
    field = noise(np.random.default_rng(1), 64, 128, 4, 8, 3)
    assert field.shape == (64, 128)
    assert 0.0 <= field.min() < 0.3
    assert 0.7 < field.max() <= 1.0
    inside = np.abs(np.diff(field, axis=1)).max()
    assert np.abs(field[:, 0] - field[:, -1]).max() <= inside
    assert np.abs(field[0] - field[-1]).max() <= np.abs(np.diff(field, axis=0)).max()


def test_every_spine_has_a_plain_foot_for_the_boards() -> None:
    image = pictures.spines().astype(np.float64)
    cells = image.reshape(pictures.SPINE_ROWS, 256, pictures.SPINE_COLUMNS, 64, 3)[:, :24]
    assert cells.std(axis=(1, 3)).max() < 12.0  # cloth grain only
