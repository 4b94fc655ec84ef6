"""bench/judge.py: the process that compares, and the words exchanged with it."""

from __future__ import annotations

import io
import time

import numpy as np
import pytest

from bench import judge
from bench.judge import Judge, Verdict
from bench.metrics import display_mse, psnr, rmse
from bench.metrics_visual import flip_map
from raytrace.camera import Camera
from raytrace.still import Snapshot, StillView

SIZE = (40, 30)


def pictures(seed: int = 0) -> tuple[np.ndarray, Snapshot]:
    """A picture and a reference, not square, whose upper row is no part of the linear error."""
    rng = np.random.default_rng(seed)
    image, truth = rng.uniform(0.0, 1.2, (2, SIZE[1], SIZE[0], 3)).astype(np.float32)
    mask = np.ones(SIZE[::-1], dtype=bool)
    mask[-1] = False
    view = StillView(Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0)), SIZE, 0.0, False)
    return image, Snapshot(view, 64, truth, mask, 0.01)


def wait(found: Judge) -> Verdict:
    end = time.monotonic() + 60.0
    while found.busy:
        assert time.monotonic() < end, found.trouble
        time.sleep(0.01)
    assert found.verdict is not None
    return found.verdict


def test_a_verdict_has_the_errors_of_the_bench():
    calls: list[int] = []
    court = Judge(lambda: calls.append(1))
    try:
        for seed in (0, 1):
            image, snapshot = pictures(seed)
            court.ask(image, snapshot)
            with pytest.raises(RuntimeError):
                court.ask(image, snapshot)
            found = wait(court)
            assert found.rmse == pytest.approx(rmse(image, snapshot.radiance, snapshot.mask), rel=1e-6)
            assert found.psnr == pytest.approx(psnr(display_mse(image, snapshot.radiance)), rel=1e-6)
            np.testing.assert_allclose(found.flip_map, flip_map(image, snapshot.radiance), atol=1e-5)
            assert found.flip == pytest.approx(found.flip_map.mean(), rel=1e-5)
            assert (found.samples, found.noise) == (64, 0.01)
        assert len(calls) == 2
    finally:
        court.close()
    court.close()


def test_a_judge_that_dies_is_told_and_hangs_nobody(monkeypatch):
    start = judge.start

    def fails():
        process = start()
        process.kill()
        process.wait()
        return process

    monkeypatch.setattr(judge, "start", fails)
    court = Judge()
    court.ask(*pictures())
    end = time.monotonic() + 20.0
    while not court.trouble:
        assert time.monotonic() < end
        time.sleep(0.01)
    court.close()


def test_a_judge_that_was_never_asked_starts_nothing():
    court = Judge()
    court.close()
    assert court._process is None


def test_pictures_with_nan_and_infinity_have_errors_all_the_same():
    image, snapshot = pictures()
    image[3, 4] = np.nan
    image[5, 6] = np.inf
    sent, answered = io.BytesIO(), io.BytesIO()
    sent.write(judge._REQUEST.pack(*SIZE))
    for part in (image, snapshot.radiance, snapshot.mask.astype(np.uint8)):
        sent.write(part.tobytes())
    sent.seek(0)
    judge.serve(sent, answered)
    linear, peak, flip = judge._ANSWER.unpack(answered.getvalue()[: judge._ANSWER.size])
    assert np.isfinite([linear, peak, flip]).all()
    assert linear > 100.0
