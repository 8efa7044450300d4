"""Files that are either whole or not there."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from pathlib import Path

from robotrue.errors import FormatError


def write_atomic(path: str | Path, data: bytes) -> None:
    """Writes ``data`` to ``path`` through a neighbour file that is renamed when complete.

    A full disk or a killed process leaves the old file (or none) and never a part of the new one.

    Raises:
        FormatError: The folder cannot be written to, or the disk is full.
    """
    path = Path(path)
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, _mode_for(path))
        os.replace(temporary, path)
    except BaseException as cause:  # also Ctrl-C: the neighbour file goes in any case
        if temporary is not None:
            with contextlib.suppress(OSError):
                os.unlink(temporary)
        if not isinstance(cause, OSError):
            raise
        raise FormatError(
            f"cannot write: {cause.strerror}.",
            source=path,
            hint="check the folder, its permissions and the free space.",
        ) from cause


def _mode_for(path: Path) -> int:
    if path.exists():
        return path.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def read_bytes(path: str | Path) -> bytes:
    """Returns the bytes of a file.

    Raises:
        FormatError: The file is not there or cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except OSError as cause:
        raise FormatError(
            f"cannot read: {cause.strerror}.", source=path, hint="check the path."
        ) from cause


def sha256(data: bytes) -> str:
    """Returns the SHA-256 of ``data`` in hexadecimal: the provenance mark used everywhere."""
    return hashlib.sha256(data).hexdigest()
