"""Files that belong together are written together, whoever presses Ctrl-C."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from storage import uninterrupted


def interrupt() -> None:
    os.kill(os.getpid(), signal.SIGINT)


def test_an_interruption_waits_until_the_end() -> None:
    done = []

    def work() -> None:
        with uninterrupted():
            interrupt()
            interrupt()
            done.append("written")
        done.append("went on")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == ["written"]


def test_it_is_heard_again_afterwards() -> None:
    with uninterrupted():
        pass
    with pytest.raises(KeyboardInterrupt):
        interrupt()


def test_errors_pass() -> None:
    with pytest.raises(OSError, match="full"), uninterrupted():
        raise OSError("full")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_other_threads_are_never_interrupted() -> None:
    failed: list[BaseException] = []

    def work() -> None:
        try:
            with uninterrupted():
                pass
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert failed == []
