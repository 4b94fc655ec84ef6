"""Progress lines and tables."""

from __future__ import annotations

import io

import pytest

import console
from console import Progress, table


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    result = Clock()
    monkeypatch.setattr(console, "time", result)
    return result


def test_short_work_prints_nothing(clock: Clock) -> None:
    for stream in (Terminal(), io.StringIO()):
        with Progress("tracing", stream) as progress:
            clock.now += 0.4
            progress.update(0.5)
        assert stream.getvalue() == ""


def test_a_log_gets_one_line_at_the_end(clock: Clock) -> None:
    log = io.StringIO()
    with Progress("tracing", log) as progress:
        for step in range(10):
            clock.now += 1.0
            progress.update(step / 10)
    assert log.getvalue() == "tracing: 10.0 s\n"


def test_a_terminal_shows_share_and_time_left_on_one_line(clock: Clock) -> None:
    terminal = Terminal()
    with Progress("tracing", terminal) as progress:
        clock.now += 2.0
        progress.update(0.25)
        assert terminal.getvalue() == "\rtracing [######..................]  25%, 6 s left \x1b[K"
        clock.now += 2.0
        progress.update(1.0)
        assert "[########################] 100%, 0 s left" in terminal.getvalue()
    text = terminal.getvalue()
    assert text.endswith("\r\x1b[Ktracing: 4.0 s\n")
    assert text.count("\n") == 1


def test_updates_are_shown_five_times_a_second_at_most(clock: Clock) -> None:
    terminal = Terminal()
    with Progress("tracing", terminal) as progress:
        for step in range(100):
            clock.now += 0.02
            progress.update(step / 100)
        assert 5 <= terminal.getvalue().count("\rtracing") <= 10


def test_no_share_yet_is_no_division_by_zero(clock: Clock) -> None:
    terminal = Terminal()
    with Progress("tracing", terminal) as progress:
        clock.now += 1.0
        progress.update(0.0)
    assert "  0%, 0 s left" in terminal.getvalue()


def fail(clock: Clock, stream: io.StringIO) -> None:
    with Progress("tracing", stream) as progress:
        clock.now += 1.0
        progress.update(0.5)
        raise KeyError


def test_a_failure_clears_the_line_and_claims_no_end(clock: Clock) -> None:
    terminal, log = Terminal(), io.StringIO()
    for stream in (terminal, log):
        with pytest.raises(KeyError):
            fail(clock, stream)
    assert terminal.getvalue().endswith("\r\x1b[K")
    assert "tracing:" not in terminal.getvalue()
    assert log.getvalue() == ""


def test_progress_goes_to_stderr(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    with Progress("tracing"):
        clock.now += 1.0
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "tracing: 1.0 s\n")


def test_tables_align_names_left_and_numbers_right() -> None:
    assert table(["pass", "ms"], [["temporal", "1.5"], ["blur", "12.25"]]).splitlines() == [
        "pass         ms",
        "--------  -----",
        "temporal    1.5",
        "blur      12.25",
    ]


def test_a_table_without_rows_is_its_header() -> None:
    assert table(["pass", "ms"], []).splitlines() == ["pass  ms", "----  --"]


def test_rows_of_another_length_are_a_bug() -> None:
    with pytest.raises((ValueError, IndexError)):
        table(["a", "b"], [["1"]])
