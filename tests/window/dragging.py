"""A hand that drags files over a window and lets go of them: the source's half of the protocol XDND, by Xlib.

https://freedesktop.org/wiki/Specifications/XDND/
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Sequence
from pathlib import Path

from tests.window.desktop import SECONDS, ClientMessage, xlib

_VERSION = 5
_CLIENT_MESSAGE, _SELECTION_REQUEST, _SELECTION_NOTIFY = 33, 30, 31


class _SelectionRequest(ctypes.Structure):
    """Xlib's XSelectionRequestEvent."""

    _fields_ = (
        ("type", ctypes.c_int),
        ("serial", ctypes.c_ulong),
        ("send_event", ctypes.c_int),
        ("display", ctypes.c_void_p),
        ("owner", ctypes.c_ulong),
        ("requestor", ctypes.c_ulong),
        ("selection", ctypes.c_ulong),
        ("target", ctypes.c_ulong),
        ("property", ctypes.c_ulong),
        ("time", ctypes.c_ulong),
    )


class _Selection(ctypes.Structure):
    """Xlib's XSelectionEvent."""

    _fields_ = (
        ("type", ctypes.c_int),
        ("serial", ctypes.c_ulong),
        ("send_event", ctypes.c_int),
        ("display", ctypes.c_void_p),
        ("requestor", ctypes.c_ulong),
        ("selection", ctypes.c_ulong),
        ("target", ctypes.c_ulong),
        ("property", ctypes.c_ulong),
        ("time", ctypes.c_ulong),
    )


class _Event(ctypes.Union):
    """Xlib's XEvent."""

    _fields_ = (
        ("type", ctypes.c_int),
        ("message", ClientMessage),
        ("request", _SelectionRequest),
        ("selection", _Selection),
        ("padding", ctypes.c_long * 24),
    )


class _Source:
    """The window that files are dragged from; nobody sees it."""

    def __init__(self, display: str, files: Sequence[Path]) -> None:
        self._x = xlib()
        self._connection = ctypes.c_void_p(self._x.XOpenDisplay(display.encode()))
        self._root = ctypes.c_ulong(self._x.XDefaultRootWindow(self._connection))
        self._window = self._x.XCreateSimpleWindow(self._connection, self._root, 0, 0, 1, 1, 0, 0, 0)
        self._files = "".join(f"{path.as_uri()}\r\n" for path in files).encode()
        owner = ctypes.c_ulong(self._window)
        self._x.XSetSelectionOwner(self._connection, self._atom("XdndSelection"), owner, ctypes.c_ulong(0))

    def drop(self, target: int) -> None:
        """Enter ``target``, wait until it will take the files, let go of them, hand them over when asked."""
        self._send(target, "XdndEnter", _VERSION << 24, self._atom("text/uri-list").value)
        self._send(target, "XdndPosition", 0, 10 << 16 | 10, 0, self._atom("XdndActionCopy").value)
        assert self._await("XdndStatus").data[1] & 1, "the window takes no files"
        self._send(target, "XdndDrop")
        # The protocol has one bit for success; glfw writes the number of bytes that it was given.
        assert self._await("XdndFinished").data[1] != 0, "the window did not take the files"

    def close(self) -> None:
        self._x.XCloseDisplay(self._connection)

    def _atom(self, name: str) -> ctypes.c_ulong:
        return ctypes.c_ulong(self._x.XInternAtom(self._connection, name.encode(), 0))

    def _send(self, target: int, kind: str, *data: int) -> None:
        message = ClientMessage(type=_CLIENT_MESSAGE, window=target, message_type=self._atom(kind).value, format=32)
        for index, value in enumerate((self._window, *data)):
            message.data[index] = value
        self._post(target, _Event(message=message))

    def _post(self, target: int, event: _Event) -> None:
        self._x.XSendEvent(self._connection, ctypes.c_ulong(target), 0, ctypes.c_long(0), ctypes.byref(event))
        self._x.XFlush(self._connection)

    def _await(self, kind: str) -> ClientMessage:
        """The next message of this kind; answers whoever asks for the files meanwhile."""
        end, event = time.monotonic() + SECONDS, _Event()
        while time.monotonic() < end:
            if not self._x.XPending(self._connection):
                time.sleep(0.01)
                continue
            self._x.XNextEvent(self._connection, ctypes.byref(event))
            if event.type == _SELECTION_REQUEST:
                self._hand_over(event.request)
            elif event.type == _CLIENT_MESSAGE and event.message.message_type == self._atom(kind).value:
                return ClientMessage.from_buffer_copy(event.message)
        raise AssertionError(f"waited {SECONDS:.0f} s in vain for {kind}")

    def _hand_over(self, request: _SelectionRequest) -> None:
        where = (ctypes.c_ulong(request.requestor), ctypes.c_ulong(request.property), ctypes.c_ulong(request.target))
        replace, bits = 0, 8
        self._x.XChangeProperty(self._connection, *where, bits, replace, self._files, len(self._files))
        answer = _Selection(
            type=_SELECTION_NOTIFY,
            requestor=request.requestor,
            selection=request.selection,
            target=request.target,
            property=request.property,
            time=request.time,
        )
        self._post(request.requestor, _Event(selection=answer))


def drop(display: str, window: int, *files: Path) -> None:
    """Let go of ``files`` over ``window``, which must be one that takes files."""
    source = _Source(display, files)
    try:
        source.drop(window)
    finally:
        source.close()
