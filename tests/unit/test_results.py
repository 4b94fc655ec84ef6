"""bench/results.py, claims.py and report.py: fronts, equal time, what is claimed, and how it is told."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from bench import report
from bench.claims import claims
from bench.methods import APART, BMFR, BMFR_TAA, METHODS, NOISY
from bench.results import contenders, equal_samples
from bench.running import MethodResult
from tests.page import sample

ACCUMULATION = next(method for method in METHODS if method.denoiser == "accumulate")
OIDN_FAST = next(method for method in METHODS if method.quality == "fast")


def by_name(result=None):
    return {contender.name: contender for contender in contenders(result or sample.quality())}


def test_equal_time_is_what_fits_and_never_more():
    """Tracing 30 ms, each path more 10 ms, display 2 ms."""
    result = sample.quality()
    counts = {m.name: equal_samples(result, m) for m in result.methods}
    assert counts[NOISY.name] == 1
    assert counts[BMFR.name] == 1 + 18 // 10
    assert counts[APART.name] == 1 + 58 // 10
    assert equal_samples(replace(result, sample_milliseconds=0.0), result.methods[1]) == 1


def test_times_are_of_tracing_and_filtering():
    found = by_name()
    assert found[BMFR.name].milliseconds == 30.0 + 20.0
    assert found["3 paths"].milliseconds == 30.0 + 2 * 10.0 + 2.0
    assert found[BMFR.name].equal is not None
    assert found[BMFR.name].equal.samples == 2
    assert found["3 paths"].equal is None


def test_the_front_has_no_dominated_setting_and_none_that_does_not_compete():
    found = by_name()
    on_front = {name for name, contender in found.items() if contender.best_rmse}
    assert on_front == {NOISY.name, "2 paths", BMFR.name}  # 32, 42 and 50 ms
    assert not found[APART.name].best_rmse, "slower and worse than BMFR"
    assert not found[BMFR_TAA.name].competes
    assert not found[BMFR_TAA.name].best_rmse


def test_without_tracing_times_there_is_nothing_to_compare():
    assert contenders(replace(sample.quality(), trace=None)) == ()


def with_methods(*more: MethodResult):
    result = sample.quality()
    return replace(result, methods=(*result.methods, *more))


def test_claims_are_judged_by_what_was_measured():
    result = with_methods(sample.result(ACCUMULATION, 5.0, 0.03, 60), sample.result(OIDN_FAST, 40.0, 0.012, 60))
    found = {(claim.method, claim.what): claim for claim in claims(result)}
    front = found[BMFR.name, "on the Pareto front"]
    assert (front.value, front.holds) == ("RMSE, FLIP", True)
    accumulated = found[BMFR.name, "RMSE of accumulation alone / its own"]
    assert (accumulated.value, accumulated.limit, accumulated.holds) == ("3.00", "2", True)
    assert not found[APART.name, "RMSE of accumulation alone / its own"].holds  # 1.5
    traced = found[BMFR.name, "FLIP of 2 paths in the same time / its own"]
    assert traced.value == f"{0.1 / math.sqrt(2) / 0.01:.2f}"
    assert found[BMFR.name, f"time of {OIDN_FAST.name} / its own"].value == "2.00"
    assert found[BMFR.name, f"temporal error of {OIDN_FAST.name} / its own"].holds
    assert not found[APART.name, f"temporal error of {OIDN_FAST.name} / its own"].holds


def test_scenes_have_claims_of_their_own():
    what = {claim.what.partition(" ")[0] for claim in claims(replace(sample.quality(), scene="interior"))}
    assert what == {"on", "FLIP", "relMSE"}


@pytest.mark.parametrize(("value", "text"), [(0.0049, "< 0.0050"), (0.0051, "0.0051"), (0.005, "0.0050")])
def test_an_error_below_the_noise_of_the_reference_is_not_reported_as_one(value, text):
    assert report.above(value, 0.005) == text
    assert report.above(value, None) == f"{value:.4f}"


def test_the_table_of_errors_has_all_in_order_of_time():
    lines = report.error_table(sample.quality()).splitlines()
    names = [line.split("  ")[0] for line in lines[2:]]
    assert names[0] == NOISY.name
    assert names[-1] == "the reference's own noise"
    times = [float(line[len(lines[1].split("  ")[0]) :].split()[0]) for line in lines[2:-1]]
    assert times == sorted(times)
    (bmfr,) = [line for line in lines if line.startswith("BMFR  ")]
    assert "RMSE FLIP" in bmfr
    assert report.error_table(replace(sample.quality(), trace=None)) == ""


def test_the_table_of_events_has_frames_and_steady_errors():
    events = sample.report().events
    assert events is not None
    lines = report.events_table(events).splitlines()
    assert "frames after light switched" in lines[0]
    assert lines[2].split()[-4:] == ["8", "0.0100", "8", "0.0100"]
