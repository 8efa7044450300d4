"""The file of an export as a stranger's: opened, its members checked against its manifest.

Names other than those an export writes, sizes or hashes other than the manifest's, more than the
disk holds: refused before anything is read into a workspace.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
import shutil
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any, Final, cast

from robotrue.errors import ArchiveError
from robotrue.store.blobs import CHUNK
from robotrue.store.exchange import FORMAT, FORMAT_VERSION, MANIFEST
from robotrue.store.migrate import require_known

MOST: Final = 64 << 30
"""Bytes a project may have."""
EXPANSION: Final = 200
"""Times its own size a file may expand to, from ``SMALL`` on."""
SMALL: Final = 100 << 20
_MANIFEST_MOST: Final = 256 << 20
_MANIFEST_SMALL: Final = 1 << 20
_MANIFEST_EXPANSION: Final = 20
"""Times its packed size a manifest may expand to, beyond ``_MANIFEST_SMALL``; hashes do not pack to
less than a quarter, and the objects that JSON makes of it take many times its size."""
_LINE_MOST: Final = 64 << 20
_MEMBER: Final = re.compile(r"tables/[a-z_]{1,40}\.jsonl|(blobs|samples)/[0-9a-f]{64}")
BROKEN: Final = (
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    struct.error,
    OSError,
    EOFError,
    RuntimeError,  # encrypted
    NotImplementedError,
    UnicodeDecodeError,
)
"""What a damaged zip makes of its reader."""
_SCHEMA: Final = re.compile(r"[0-9]{4}")


def manifest_of(bundle: zipfile.ZipFile, source: str) -> dict[str, Any]:
    """Returns the manifest.

    Raises:
        ArchiveError: There is none, it is damaged, or of a newer robotrue.
    """
    try:
        info = bundle.getinfo(MANIFEST)
        packed = max(_MANIFEST_SMALL, _MANIFEST_EXPANSION * info.compress_size)
        if info.file_size > min(_MANIFEST_MOST, packed):
            raise damaged(source, "its manifest is too long")
        stated = json.loads(bundle.read(MANIFEST))
        if stated.get("format") != FORMAT:
            raise ArchiveError("a zip file, but not an export of robotrue.", source=source)
        version, schema, members = stated["format_version"], stated["schema"], stated["members"]
        if int(version) > FORMAT_VERSION:
            raise ArchiveError(
                f"an export of format {version}, this robotrue reads up to {FORMAT_VERSION}.",
                source=source,
                hint="update robotrue.",
            )
        if not _SCHEMA.fullmatch(schema) or not isinstance(members, dict):
            raise ValueError("schema or members")
        require_known(schema)
        for entry in members.values():
            if not re.fullmatch("[0-9a-f]{64}", entry["sha256"]) or not 0 <= int(entry["size"]):
                raise ValueError("a member's hash or size")
    except (KeyError, ValueError, TypeError, AttributeError, RecursionError) as cause:
        raise damaged(source, f"its manifest is none ({cause})") from cause
    return cast(dict[str, Any], stated)


def require_members(
    bundle: zipfile.ZipFile, members: Mapping[str, Any], source: str, most: int, folder: Path
) -> None:
    """Passes if the members are those of the manifest, and no more than may be.

    Raises:
        ArchiveError: They are not; or they expand to more than is allowed or the disk holds.
    """
    names = [info.filename for info in bundle.infolist()]
    if len(names) != len(set(names)) or set(names) != {MANIFEST, *members}:
        raise damaged(source, "its members are not those of its manifest")
    for info in bundle.infolist():
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise damaged(source, f"{info.filename[:60]} is packed in a way no export is")
        if info.filename == MANIFEST:
            continue
        if not _MEMBER.fullmatch(info.filename):
            raise damaged(source, f"a member is called {info.filename[:60]!r}")
        if info.file_size != members[info.filename]["size"]:
            raise damaged(source, f"{info.filename} is not as long as the manifest says")
        name = info.filename.partition("/")[2]
        if not info.filename.startswith("tables/") and members[info.filename]["sha256"] != name:
            raise damaged(source, f"{info.filename} is not named by its hash")
    expanded = sum(info.file_size for info in bundle.infolist())
    packed = sum(info.compress_size for info in bundle.infolist())
    allowed = min(most, shutil.disk_usage(folder).free, max(SMALL, EXPANSION * packed))
    if expanded > allowed:
        raise ArchiveError(
            f"expands to {expanded / 2**20:.0f} MiB, allowed are {allowed / 2**20:.0f} MiB.",
            source=source,
            hint="see where the file came from, and the free space.",
        )


class Checked:
    """A member that is read no further than it should be, and whose hash is what it should be."""

    def __init__(self, stream: IO[bytes], name: str, entry: Mapping[str, Any], source: str) -> None:
        self._stream, self._name, self._entry, self._source = stream, name, entry, source
        self._digest, self._size = hashlib.sha256(), 0

    def read(self, size: int = CHUNK) -> bytes:
        """Returns the next bytes; at the end the hash must agree."""
        piece = self._stream.read(size)
        return self._seen(piece)

    def readline(self) -> bytes:
        """Returns the next line."""
        line = self._stream.readline(_LINE_MOST)
        return self._seen(line)

    def _seen(self, piece: bytes) -> bytes:
        self._digest.update(piece)
        self._size += len(piece)
        whole = self._size == self._entry["size"]
        if self._size > self._entry["size"] or (not piece and not whole):
            raise damaged(self._source, f"{self._name} is not as long as the manifest says")
        if whole and self._digest.hexdigest() != self._entry["sha256"]:
            raise damaged(self._source, f"{self._name} does not match its hash")
        return piece


@contextlib.contextmanager
def member(
    bundle: zipfile.ZipFile, name: str, entry: Mapping[str, Any], source: str
) -> Iterator[Checked]:
    """Gives a member to read.

    Raises:
        ArchiveError: It is not what the manifest says.
    """
    try:
        with bundle.open(name) as stream:
            yield Checked(stream, name, entry, source)
    except BROKEN as cause:
        raise damaged(source, str(cause)) from cause


def damaged(source: str, what: str) -> ArchiveError:
    """Returns the error for a file that no export wrote as it is."""
    return ArchiveError(
        f"not an export of robotrue, or damaged: {what}.",
        source=source,
        hint="export it again, or fetch it from its backup.",
    )
