"""What the measurements were made on and with."""

from __future__ import annotations

import platform
import re
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version
from pathlib import Path

PACKAGES = ("numpy", "numba", "embreex", "moderngl")

_CPUINFO = Path("/proc/cpuinfo")


@dataclass(frozen=True)
class Machine:
    """``renderer``, ``opengl``: as the driver names them; ``threads``: those that trace; ``date``: ISO 8601, local."""

    renderer: str
    opengl: str
    cpu: str
    threads: int
    system: str
    python: str
    packages: dict[str, str]
    date: str


def cpu_model() -> str:
    """The processor's name, as far as the system tells it."""
    text = _CPUINFO.read_text(encoding="utf-8", errors="replace") if _CPUINFO.exists() else ""
    found = re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
    return found[1].strip() if found else platform.processor() or platform.machine()


def describe(renderer_info: dict[str, object], threads: int) -> Machine:
    """``renderer_info``: ``info`` of a moderngl context."""
    return Machine(
        renderer=str(renderer_info["GL_RENDERER"]),
        opengl=str(renderer_info["GL_VERSION"]),
        cpu=cpu_model(),
        threads=threads,
        system=platform.platform(),
        python=platform.python_version(),
        packages={name: version(name) for name in PACKAGES},
        date=datetime.now().astimezone().isoformat(timespec="seconds"),
    )
