"""Uploads: written to disk as they arrive, kept until a request uses them."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import re
import shutil
import time
import uuid
import zipfile
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from robotrue.errors import FormatError
from robotrue.store.workspace import Workspace
from robotrue.web.problems import MissingError

FOLDER: Final = "incoming"
LONGEST_NAME: Final = 120
KEPT: Final = 24 * 3600.0
"""s after which an unused file is removed."""
FLAT: Final = 64 * 1024
"""Bytes that count for an upload besides its content: many empty ones fill a disk, too."""
UNPACKED: Final = 1_000_000_000
"""Bytes of all files in an archive together."""
_ODD: Final = re.compile(r"[^\w .()+=@#&$-]")
_ID: Final = re.compile(r"[0-9a-f]{32}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Upload:
    """A file that came in.

    Attributes:
        id: To name it in what comes next.
        name: The name it came with, without folders.
        size: Bytes.
        sha256: Of its content.
    """

    id: str
    name: str
    size: int
    sha256: str


class Quota:
    """Bytes that all uploads of a workspace may take together."""

    def __init__(self, workspace: Workspace, limit: int) -> None:
        """Makes it.

        Args:
            workspace: Whose uploads count.
            limit: Bytes.
        """
        self._workspace, self._limit = workspace, limit
        self._taken = limit  # never less than what is there; measured when it reaches the limit

    async def take(self, size: int) -> None:
        """Counts bytes that are about to be written.

        Raises:
            FormatError: They are too many, even without uploads that are old enough to go.
        """
        if self._taken + size > self._limit:
            self._taken = await asyncio.to_thread(self._measure)
        if self._taken + size > self._limit:
            raise FormatError(
                f"unused uploads take {self._taken / 1e6:,.0f} MB, at most "
                f"{self._limit / 1e6:,.0f} MB are saved.",
                hint="use or remove some; after a day they go by themselves.",
            )
        self._taken += size

    def _measure(self) -> int:
        forget_old(self._workspace)
        folder = self._workspace.folder / FOLDER
        total = 0
        for place in folder.iterdir() if folder.is_dir() else ():
            with contextlib.suppress(OSError):  # it is removed at this moment
                total += FLAT + sum(each.stat().st_size for each in place.iterdir())
        return total


async def take_in(
    workspace: Workspace, name: str, chunks: AsyncIterator[bytes], quota: Quota
) -> Upload:
    """Returns the upload of a stream, which never is in memory as a whole.

    Raises:
        FormatError: It is empty, the quota is used up, or the disk is full.
    """
    key, size, digest = uuid.uuid4().hex, 0, hashlib.sha256()
    place = workspace.folder / FOLDER / key
    path = place / safe_name(name)
    try:
        await quota.take(FLAT)
        place.mkdir(parents=True)
        with path.open("xb") as file:
            async for chunk in chunks:
                size += len(chunk)
                digest.update(chunk)
                await quota.take(len(chunk))
                await asyncio.to_thread(file.write, chunk)
        if not size:
            raise FormatError("an empty file.", source=path.name, hint="export it again.")
        await asyncio.to_thread(_require_modest, path)
    except BaseException as cause:  # also a browser that went away
        shutil.rmtree(place, ignore_errors=True)
        if isinstance(cause, OSError):
            raise FormatError(f"cannot be kept: {cause.strerror}.", source=path.name) from cause
        raise
    return Upload(id=key, name=path.name, size=size, sha256=digest.hexdigest())


def _require_modest(path: Path) -> None:
    """Refuses a workbook or archive that would fill the memory once it is unpacked."""
    if not zipfile.is_zipfile(path):
        return
    with zipfile.ZipFile(path) as bundle:
        size = sum(each.file_size for each in bundle.infolist())
    if size > UNPACKED:
        raise FormatError(
            f"{size / 1e6:,.0f} MB when unpacked, at most {UNPACKED / 1e6:,.0f} MB are.",
            source=path.name,
            hint="export it as CSV.",
        )


def find_upload(workspace: Workspace, key: str) -> Path:
    """Returns where an upload lies.

    Raises:
        MissingError: There is none of that id, or it was kept long enough.
    """
    place = workspace.folder / FOLDER / key
    found = sorted(place.iterdir()) if _ID.fullmatch(key) and place.is_dir() else []
    if len(found) != 1:
        raise MissingError(f"there is no upload {key[:32]!r}.", hint="send the file again.")
    return found[0]


def forget(workspace: Workspace, key: str) -> None:
    """Removes an upload of which something was made."""
    if _ID.fullmatch(key):
        shutil.rmtree(workspace.folder / FOLDER / key, ignore_errors=True)


def forget_old(workspace: Workspace) -> None:
    """Removes uploads that were not used for a day."""
    place = workspace.folder / FOLDER
    for each in place.iterdir() if place.is_dir() else ():
        with contextlib.suppress(OSError):  # another request has just removed it
            if each.stat().st_mtime < time.time() - KEPT:
                shutil.rmtree(each, ignore_errors=True)


def safe_name(name: str) -> str:
    """Returns a file name without folders and without what a file system or a shell may misread."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    plain = _ODD.sub("_", last).strip(" .")
    if len(plain) > LONGEST_NAME:
        stem, dot, end = plain.rpartition(".")
        plain = (stem or end)[: LONGEST_NAME - 12] + dot + end[:11] if dot else plain[:LONGEST_NAME]
    return plain or "file"
