"""Headless Chromium, driven through chromedriver by the W3C WebDriver protocol: plain HTTP and JSON."""

from __future__ import annotations

import base64
import json
import os
import re
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

SECONDS = 60.0
"""For a page to be drawn, or the browser to start; reached only if something is wrong."""

OPTIONS = (
    "--headless=new",
    "--no-sandbox",  # continuous integration runs as root
    "--disable-dev-shm-usage",
    "--disable-gpu",
    "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND",  # no network: the page must bring everything along
)


def require_browser() -> None:
    """Skip the test where Chromium or its driver is missing."""
    missing = [name for name in ("chromium", "chromedriver") if shutil.which(name) is None]
    if missing:
        pytest.skip(f"{' and '.join(missing)} not installed (Debian, Ubuntu: apt install chromium chromium-driver)")


class Browser:
    """One window."""

    def __init__(self, port: int, size: tuple[int, int]) -> None:
        self._root = f"http://127.0.0.1:{port}"
        options = {"args": [*OPTIONS, f"--window-size={size[0]},{size[1]}"], "binary": shutil.which("chromium")}
        wanted = {"capabilities": {"alwaysMatch": {"browserName": "chrome", "goog:chromeOptions": options}}}
        self._session = f"{self._root}/session/{self._call('POST', f'{self._root}/session', wanted)['sessionId']}"

    def _call(self, method: str, url: str, body: dict[str, Any] | None = None) -> Any:
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(url, data, {"Content-Type": "application/json"}, method=method)
        with urllib.request.urlopen(request, timeout=SECONDS) as answer:
            return json.loads(answer.read())["value"]

    def _post(self, what: str, **body: Any) -> Any:
        return self._call("POST", f"{self._session}/{what}", body)

    def open(self, path: Path) -> None:
        """Load a file and wait until its diagrams are drawn."""
        self._post("url", url=path.resolve().as_uri())
        self.wait("document.body.dataset.ready === '1'", "the page to be drawn")

    def run(self, script: str, *arguments: Any) -> Any:
        """The value that the JavaScript ``script`` returns."""
        return self._post("execute/sync", script=script, args=list(arguments))

    def wait(self, condition: str, what: str) -> None:
        """Until the JavaScript expression is true; fails the test if it does not become so in time."""
        end = time.monotonic() + SECONDS
        while not self.run(f"return Boolean({condition})"):
            if time.monotonic() > end:
                pytest.fail(f"waited in vain for {what}")
            time.sleep(0.05)

    def resize(self, width: int, height: int) -> None:
        self._post("window/rect", width=width, height=height)

    def press(self, keys: str) -> None:
        """Press and release each character of ``keys``."""
        actions = [{"type": kind, "value": key} for key in keys for kind in ("keyDown", "keyUp")]
        self._post("actions", actions=[{"type": "key", "id": "keyboard", "actions": actions}])

    def mouse(self, *moves: tuple[int, int], button: bool = False) -> None:
        """Move to each of the points in the viewport, with the left button held from the first to the last."""
        actions: list[dict[str, Any]] = []
        for number, (x, y) in enumerate(moves):
            actions.append({"type": "pointerMove", "x": int(x), "y": int(y), "duration": 40})
            if button and number == 0:
                actions.append({"type": "pointerDown", "button": 0})
        if button:
            actions.append({"type": "pointerUp", "button": 0})
        parameters = {"pointerType": "mouse"}
        self._post(
            "actions", actions=[{"type": "pointer", "id": "mouse", "parameters": parameters, "actions": actions}]
        )

    def wheel(self, x: int, y: int, down: int) -> None:
        """Turn the wheel over a point of the viewport."""
        action = {"type": "scroll", "x": int(x), "y": int(y), "deltaX": 0, "deltaY": down, "duration": 0}
        self._post("actions", actions=[{"type": "wheel", "id": "wheel", "actions": [action]}])

    def screenshot(self, path: Path) -> None:
        """What the viewport shows, as PNG."""
        path.write_bytes(base64.b64decode(self._call("GET", f"{self._session}/screenshot")))

    def close(self) -> None:
        self._call("DELETE", self._session)


@contextmanager
def browser(folder: Path, size: tuple[int, int] = (1280, 900)) -> Iterator[Browser]:
    """A browser with a home of its own in ``folder``."""
    environment = {**os.environ, "HOME": str(folder), "TMPDIR": str(folder)}
    driver = subprocess.Popen(
        ["chromedriver", "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment
    )
    try:
        assert driver.stdout is not None
        port = next(int(found[1]) for line in driver.stdout if (found := re.search(r"on port (\d+)\.", line)))
        opened = Browser(port, size)
        try:
            yield opened
        finally:
            opened.close()
    finally:
        driver.terminate()
        driver.wait(SECONDS)
        assert driver.stdout is not None
        driver.stdout.close()


def middle(box: Sequence[float]) -> tuple[int, int]:
    """Of a rectangle (x, y, width, height)."""
    return int(box[0] + box[2] / 2), int(box[1] + box[3] / 2)
