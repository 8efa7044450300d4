"""One file that opens in ten years: a zip of ``document.json`` and ``.npy`` arrays.

No pickle. The document carries a kind, a schema version, units and a provenance hash; the arrays
are plain NumPy files (format 1.0) that any language reads.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes, sha256, write_atomic
from robotrue.errors import ArchiveError

FORMAT: Final = "robotrue-archive"
FORMAT_VERSION: Final = 1
_EPOCH: Final = (1980, 1, 1, 0, 0, 0)  # fixed, so that equal content gives equal bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Archive:
    """A document and its arrays.

    Attributes:
        kind: What it is, e.g. ``"error-model/rigid-flexible"``; chooses the reader.
        schema: Version of that kind's content.
        document: JSON values only.
        arrays: Float64 arrays by name; units are in the kind's documentation (SI).
    """

    kind: str
    schema: int
    document: Mapping[str, Any]
    arrays: Mapping[str, Array]

    def __post_init__(self) -> None:
        """Makes both mappings read-only."""
        object.__setattr__(self, "document", MappingProxyType(dict(self.document)))
        object.__setattr__(self, "arrays", MappingProxyType(dict(self.arrays)))

    def expect(
        self, kind: str, schema: int, *, hint: str | None = None, source: str | Path | None = None
    ) -> None:
        """Checks that a reader knows the content.

        Args:
            kind: That is read.
            schema: The newest that is read.
            hint: Where such a file comes from.
            source: The file, for messages.

        Raises:
            ArchiveError: Another kind, or written by a newer robotrue.
        """
        if self.kind != kind:
            raise ArchiveError(
                f"an archive of kind {self.kind!r}, expected {kind!r}.", source=source, hint=hint
            )
        if not 1 <= self.schema <= schema:
            readable = "1" if schema == 1 else f"1 to {schema}"
            raise ArchiveError(
                f"{kind} schema {self.schema}; this robotrue reads {readable}.",
                source=source,
                hint="update robotrue.",
            )

    def array(self, name: str) -> Array:
        """Returns one array.

        Raises:
            ArchiveError: It is not in the archive.
        """
        try:
            return self.arrays[name]
        except KeyError:
            raise ArchiveError(
                f"{self.kind} has no array {name!r}; it holds {sorted(self.arrays)}."
            ) from None


def archive_bytes(archive: Archive) -> bytes:
    """Returns the archive as file content; equal archives give equal bytes."""
    head = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "kind": archive.kind,
        "schema": archive.schema,
        "units": "SI: m, rad, N, N m, kg, s, K",
        "document": dict(archive.document),
    }
    head["content_sha256"] = _content_hash(head, archive.arrays)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as bundle:
        text = json.dumps(head, indent=1, sort_keys=True, allow_nan=False)
        bundle.writestr(_entry("document.json"), text)
        for name in sorted(archive.arrays):
            bundle.writestr(_entry(f"arrays/{name}.npy"), _npy(archive.arrays[name]))
    return buffer.getvalue()


def write_archive(path: str | Path, archive: Archive) -> None:
    """Writes the archive whole or not at all.

    Raises:
        FormatError: The file cannot be written.
    """
    write_atomic(path, archive_bytes(archive))


def read_archive(path: str | Path) -> Archive:
    """Returns the archive in a file, its hash checked.

    Raises:
        ArchiveError: Not an archive, damaged, or written by a newer robotrue.
        FormatError: The file cannot be read.
    """
    return archive_from(read_bytes(path), source=path)


def archive_from(data: bytes, *, source: str | Path | None = None) -> Archive:
    """Returns the archive in the content of a file, its hash checked.

    Args:
        data: What :func:`archive_bytes` returned.
        source: The file, for messages.

    Raises:
        ArchiveError: Not an archive, damaged, or written by a newer robotrue.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as bundle:
            head = json.loads(bundle.read("document.json"))
            arrays = {
                name[len("arrays/") : -len(".npy")]: np.load(
                    io.BytesIO(bundle.read(name)), allow_pickle=False
                )
                for name in bundle.namelist()
                if name.startswith("arrays/") and name.endswith(".npy")
            }
    except (zipfile.BadZipFile, KeyError, ValueError, OSError, EOFError) as cause:
        raise ArchiveError(
            f"not a robotrue model file, or damaged ({cause}).",
            source=source,
            hint="calibrate again, or fetch the file from its backup.",
        ) from cause
    if not isinstance(head, dict) or head.get("format") != FORMAT:
        raise ArchiveError("a zip file, but not a robotrue archive.", source=source)
    if int(head.get("format_version", 0)) > FORMAT_VERSION:
        raise ArchiveError(
            f"archive format {head['format_version']}, this robotrue reads up to {FORMAT_VERSION}.",
            source=source,
            hint="update robotrue.",
        )
    stated = head.pop("content_sha256", None)
    if stated != _content_hash(head, arrays):
        raise ArchiveError(
            "content does not match its own hash: the file was altered or damaged.", source=source
        )
    return Archive(
        kind=str(head["kind"]),
        schema=int(head["schema"]),
        document=head["document"],
        arrays=arrays,
    )


def _entry(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, _EPOCH)
    info.compress_type = zipfile.ZIP_DEFLATED
    return info


def _npy(array: Array) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array(
        buffer, np.ascontiguousarray(array), version=(1, 0), allow_pickle=False
    )
    return buffer.getvalue()


def _content_hash(head: Mapping[str, Any], arrays: Mapping[str, Array]) -> str:
    text = json.dumps(dict(head), sort_keys=True, allow_nan=False)
    parts = [text.encode()] + [n.encode() + _npy(arrays[n]) for n in sorted(arrays)]
    return sha256(b"\0".join(parts))
