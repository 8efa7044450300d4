"""Files next to the database, each under the SHA-256 of its content and never altered.

A file is written to the folder of its transaction, synced, and moved to its place before the row
that names it is committed: a row never names a file that is missing. Files left by a killed process
are removed later, when no process writes, unless a row names them by then.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, Final

from robotrue.errors import ArchiveError, FormatError

BLOBS: Final = "blobs"
SAMPLES: Final = "samples"
PLACES: Final = (BLOBS, SAMPLES)
STAGED: Final = "staged"
CHUNK: Final = 1 << 20


def stored_path(folder: Path, place: str, digest: str) -> Path:
    """Returns the path of a file with this content."""
    if place == SAMPLES:
        return folder / SAMPLES / f"{digest}.parquet"
    return folder / BLOBS / digest[:2] / digest


def file_hash(path: Path) -> str:
    """Returns the SHA-256 of a file, read piece by piece.

    Raises:
        FormatError: It cannot be read.
    """
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as cause:
        raise FormatError(f"cannot read: {cause.strerror}.", source=path) from cause


class Staging:
    """The files of one transaction on their way to their places."""

    def __init__(self, folder: Path, name: str) -> None:
        self._folder = folder
        self._staged = folder / STAGED / name
        self._count = 0

    def keep(self, source: bytes | Path | BinaryIO, place: str) -> tuple[str, int]:
        """Copies a file to its place, synced to disk; returns its SHA-256 and size.

        Raises:
            FormatError: The source cannot be read, or the folder not be written to.
        """
        try:
            self._staged.mkdir(parents=True, exist_ok=True)
            self._count += 1
            written = self._staged / f"{self._count}.part"
            digest, size = _copy(source, written)
            return self._move(written, place, digest), size
        except OSError as cause:
            raise FormatError(
                f"cannot be imported into the workspace: {cause.strerror}.",
                source=source if isinstance(source, Path) else self._folder,
                hint="check the folder, its permissions and the free space.",
            ) from cause

    def _move(self, written: Path, place: str, digest: str) -> str:
        target = stored_path(self._folder, place, digest)
        if target.is_file() and file_hash(target) == digest:
            written.unlink()
            return digest
        # The sweep finds here which files may exist without a row.
        (self._staged / f"{place}-{digest}").touch()
        target.parent.mkdir(parents=True, exist_ok=True)
        os.chmod(written, 0o444)
        os.replace(written, target)
        _sync_folder(target.parent)
        return digest

    def clear(self) -> None:
        """Forgets what was staged: rows name it now."""
        if self._count:
            shutil.rmtree(self._staged, ignore_errors=True)


def _copy(source: bytes | Path | BinaryIO, target: Path) -> tuple[str, int]:
    digest, size = hashlib.sha256(), 0
    with contextlib.ExitStack() as stack:
        out = stack.enter_context(target.open("xb"))
        if isinstance(source, bytes):
            pieces = iter([source])
        else:
            read = stack.enter_context(source.open("rb")) if isinstance(source, Path) else source
            pieces = iter(lambda: read.read(CHUNK), b"")
        for piece in pieces:
            digest.update(piece)
            out.write(piece)
            size += len(piece)
        out.flush()
        os.fsync(out.fileno())
    return digest.hexdigest(), size


def _sync_folder(folder: Path) -> None:
    with contextlib.suppress(OSError):  # systems that do not open folders need no sync of them
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def sweep(folder: Path, named: Callable[[str], bool]) -> int:
    """Returns the number of removed files of killed processes.

    Args:
        folder: Of the workspace; the caller holds its lock alone.
        named: Whether a row names a SHA-256.
    """
    removed = 0
    for left in list((folder / STAGED).iterdir()) if (folder / STAGED).is_dir() else []:
        for each in left.iterdir() if left.is_dir() else ():
            place, _, digest = each.name.partition("-")
            target = stored_path(folder, place, digest)
            if place in PLACES and target.is_file() and not named(digest):
                target.unlink()
                removed += 1
            removed += each.name.endswith(".part")
        shutil.rmtree(left, ignore_errors=True)
    return removed


def require_whole(path: Path, digest: str) -> None:
    """Checks that the file exists and has this SHA-256.

    Raises:
        ArchiveError: Missing or altered.
    """
    if not path.is_file():
        raise ArchiveError(
            f"the file {digest[:12]} is missing.", source=path, hint="fetch it from a backup."
        )
    found = file_hash(path)
    if found != digest:
        raise ArchiveError(
            f"the file was altered or damaged: its SHA-256 is {found[:12]}.",
            source=path,
            hint="fetch it from a backup.",
        )
