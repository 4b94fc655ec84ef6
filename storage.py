"""Files that are either whole or not there."""

from __future__ import annotations

import os
import signal
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from errors import UserError


def replace_file(path: Path, save: Callable[[Path], object]) -> None:
    """Let ``save`` write a temporary neighbour of ``path``, then move it into place.

    Missing folders are created. An interruption or an error leaves the file that was there before. Raises UserError
    where the system refuses.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}.", suffix=path.suffix, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            save(temporary)
            temporary.chmod(0o644)
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise UserError(
            f"{path}: cannot be written ({error.strerror or error})", "choose another place with --out"
        ) from error


def require_writable(path: Path) -> None:
    """Raises UserError unless a file can be written at ``path``: to be asked before the work, not after it."""
    try:
        if path.is_dir():
            raise UserError(f"{path}: is a folder", "name a file")
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise UserError(
            f"{path}: cannot be written ({error.strerror or error})", "choose another place with --out"
        ) from error


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Ctrl-C counts after the ``with``, not within it, where files are written that belong together.

    On other threads than the main one, which Python does not interrupt, this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard: list[int] = []

    def hear(number: int, _: FrameType | None) -> None:
        heard.append(number)

    before = signal.signal(signal.SIGINT, hear)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if heard:
        raise KeyboardInterrupt
