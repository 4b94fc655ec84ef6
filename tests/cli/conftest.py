"""The command line in this process."""

from __future__ import annotations

import sys

import pytest

import app as program
from tests.cli.runner import App, Outcome


@pytest.fixture
def app(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> App:
    """Runs ``app.py`` from its own ``main`` on, without a display."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)

    def run(*words: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["app.py", *map(str, words)])
        capsys.readouterr()
        code = program.main()
        captured = capsys.readouterr()
        return Outcome(code, captured.out, captured.err)

    return run
