"""The rule by which screenshots are compared: it must let rounding pass, and nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.screenshots.compare import check, difference, load

U8 = NDArray[np.uint8]


@pytest.fixture
def picture() -> U8:
    return np.random.default_rng(1).integers(20, 200, (90, 160, 3), np.uint8)


def test_rounding_passes(picture: U8) -> None:
    assert difference(picture, picture) == (0.0, 0.0)
    rounded = picture.copy()
    rounded[::4, ::3] += 1
    assert difference(rounded, picture).passes()
    few = picture.copy()
    few.reshape(-1, 3)[:28] += 50  # 28 of 14400 pixels: 0.19 %
    assert difference(few, picture).passes()


def test_a_changed_picture_does_not(picture: U8) -> None:
    everywhere = picture + np.uint8(1)  # a brightness that nobody would see
    assert not difference(everywhere, picture).passes()
    spots = picture.copy()
    spots.reshape(-1, 3)[:30, 0] += 3  # 0.21 % in one channel
    assert not difference(spots, picture).passes()
    assert difference(spots, picture).passes(share=0.003)
    assert not difference(everywhere, picture).passes(share=1.0)
    moved = np.roll(picture, 1, axis=1)
    assert not difference(moved, picture).passes()


def test_a_failure_leaves_three_pictures(picture: U8, tmp_path: Path) -> None:
    references, failures = tmp_path / "references", tmp_path / "failures"
    with pytest.raises(AssertionError, match=r"is missing: `make references`"):
        check("a", picture, False, references, failures)
    check("a", picture, True, references, failures)
    np.testing.assert_array_equal(load(references / "a.png"), picture)
    check("a", picture, False, references, failures)
    assert not failures.exists()
    other = picture.copy()
    other[10:40, 20:50] += 5
    with pytest.raises(AssertionError, match=r"6\.25% of the pixels are off by more than 2/255"):
        check("a", other, False, references, failures)
    np.testing.assert_array_equal(load(failures / "a.expected.png"), picture)
    np.testing.assert_array_equal(load(failures / "a.actual.png"), other)
    shown = load(failures / "a.difference.png")
    assert (shown[10:40, 20:50] == 100).all()
    assert shown.sum() == 100 * 30 * 30 * 3
    with pytest.raises(AssertionError, match="the reference is"):
        check("a", picture[:-1], False, references, failures)
