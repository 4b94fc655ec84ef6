"""Files that a scene file refers to: buffers, material libraries, images."""

from __future__ import annotations

import base64
import binascii
import urllib.parse
from pathlib import Path

from errors import UserError


def read_bytes(path: Path) -> bytes:
    """The whole file. Raises UserError where the system refuses."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise UserError(
            f"{path}: cannot be read ({error.strerror})", "check the path and the file's permissions"
        ) from error


def find_beside(folder: Path, reference: str) -> Path | None:
    """The file that ``reference``, written in a scene file in ``folder``, means; None where there is none.

    Backslashes, other letter case and the absolute path of somebody else's machine are forgiven: a file of that name
    in ``folder`` is taken instead.
    """
    wanted = folder / reference.strip().replace("\\", "/")
    for path in (wanted, folder / wanted.name):
        try:
            if path.is_file():
                return path
            names = sorted(path.parent.iterdir()) if path.parent.is_dir() else []
        except (OSError, ValueError):  # too long, a null byte, a folder that may not be listed: no such file
            continue
        for other in names:
            if other.name.casefold() == path.name.casefold() and other.is_file():
                return other
    return None


def read_uri(folder: Path, uri: str, where: str) -> bytes:
    """What a glTF URI stands for: embedded data, or a file relative to ``folder``.

    ``where`` names the file and the entry for messages. Raises UserError for a missing file, broken data or a remote
    address.
    """
    if uri.startswith("data:"):
        header, _, payload = uri.partition(",")
        try:
            return base64.b64decode(payload) if header.endswith(";base64") else urllib.parse.unquote_to_bytes(payload)
        except binascii.Error as error:
            raise UserError(
                f"{where}: the embedded data is not valid base64 ({error})", "export the file again"
            ) from error
    if "://" in uri:
        raise UserError(
            f"{where}: {uri} is an address on a network", "put the file beside the scene and refer to it by name"
        )
    for reference in (urllib.parse.unquote(uri), uri):
        path = find_beside(folder, reference)
        if path is not None:
            return read_bytes(path)
    raise UserError(
        f"{where}: {urllib.parse.unquote(uri)} is not there", f"put it into {folder}, or export the scene as .glb"
    )
