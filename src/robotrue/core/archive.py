"""Long-lived archive file: a zip of ``document.json`` and ``.npy`` arrays.

No pickle. The document carries a kind, a schema version, units and a provenance hash; the arrays
are plain NumPy files (format 1.0) that any language reads.

The hash detects damage and is no signature: forged contents can have a valid one. So sizes are
bounded before memory is allocated, and contents are checked when they are read.
"""

from __future__ import annotations

import functools
import io
import json
import math
import re
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final, ParamSpec, TypeVar

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.document_decoder import REMAKE
from robotrue.core.files import read_bytes, sha256, write_atomic
from robotrue.errors import ArchiveError, RobotrueError

P = ParamSpec("P")
T = TypeVar("T")

FORMAT: Final = "robotrue-archive"
FORMAT_VERSION: Final = 1
LARGEST: Final = 512 * 2**20
"""Bytes of an unpacked archive; a model of 10,000 rows has a tenth of it."""
LARGEST_DOCUMENT: Final = 32 * 2**20
"""Bytes of its document, which takes ten times the memory once read."""
LARGEST_VALUE: Final = 1e15
"""No quantity in SI units here comes near it."""
_MOST_ENTRIES: Final = 10_000
_PREFIX: Final = 10
"""Bytes of a NumPy file before its header: magic, version, length of the header."""
_HEADER: Final = re.compile(
    rb"\x93NUMPY\x01\x00..\{'descr': '<f8', 'fortran_order': (?P<by_columns>True|False), "
    rb"'shape': \((?P<shape>(\d{1,12}(,|, \d{1,12}){0,8})?)\), \} *\n",
    re.DOTALL,
)
"""What :func:`_npy` writes. NumPy's own reader evaluates the header as Python."""
_DAMAGE: Final = (
    zipfile.BadZipFile,
    zlib.error,
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,  # also NotImplementedError and RecursionError
    TypeError,
    ValueError,
)
"""What zip, deflate, JSON, NumPy and readers of contents raise at what they cannot be."""
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
    document: Mapping[str, object]
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

    def array(self, name: str, *, finite: bool = True) -> Array:
        """Returns one array.

        Args:
            name: Of the array.
            finite: Whether NaN ("not known") and infinity mean nothing there.

        Raises:
            ArchiveError: It is not in the archive, or holds what no quantity amounts to.
        """
        try:
            array = self.arrays[name]
        except KeyError:
            raise ArchiveError(
                f"{self.kind} has no array {name!r}; it holds {sorted(self.arrays)}."
            ) from None
        values = array if finite else array[np.isfinite(array)]
        if not (np.abs(values) <= LARGEST_VALUE).all():
            raise ArchiveError(
                f"array {name!r} of {self.kind} holds NaN or values beyond {LARGEST_VALUE:g}."
            )
        return array


def archive_reader(read: Callable[P, T]) -> Callable[P, T]:
    """Returns a reader of contents that raises one :class:`ArchiveError` at an invalid one."""

    @functools.wraps(read)
    def reads(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return read(*args, **kwargs)
        except ArchiveError:
            raise
        except (*_DAMAGE, RobotrueError) as cause:
            said = cause.message if isinstance(cause, RobotrueError) else repr(cause)
            raise ArchiveError(
                f"contents are incomplete or damaged ({said[:200]}).",
                hint=REMAKE,
            ) from cause

    return reads


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
        head, arrays = _unpack(data)
        own_hash = _content_hash({k: v for k, v in head.items() if k != "content_sha256"}, arrays)
    except _DAMAGE as cause:
        raise ArchiveError(
            f"not a robotrue model file, or damaged ({str(cause)[:200] or type(cause).__name__}).",
            source=source,
            hint="calibrate again, or fetch the file from its backup.",
        ) from cause
    version = head.get("format_version", 0)
    if head.get("format") != FORMAT or not isinstance(version, int):
        raise ArchiveError("a zip file, but not a robotrue archive.", source=source)
    if version > FORMAT_VERSION:
        raise ArchiveError(
            f"archive format {version}, this robotrue reads up to {FORMAT_VERSION}.",
            source=source,
            hint="update robotrue.",
        )
    if head.get("content_sha256") != own_hash:
        raise ArchiveError(
            "content does not match its own hash: the file was altered or damaged.", source=source
        )
    kind, schema, document = (head.get(name) for name in ("kind", "schema", "document"))
    if not (isinstance(kind, str) and isinstance(schema, int) and isinstance(document, dict)):
        raise ArchiveError("kind, schema or document is missing or damaged.", source=source)
    return Archive(kind=kind, schema=schema, document=document, arrays=arrays)


def _unpack(data: bytes) -> tuple[dict[str, object], dict[str, Array]]:
    """Head and arrays; whatever is wrong with them is one of ``_DAMAGE``."""
    with zipfile.ZipFile(io.BytesIO(data)) as bundle:
        entries = bundle.infolist()
        size = sum(entry.file_size for entry in entries)
        if len(entries) > _MOST_ENTRIES or size > LARGEST:
            raise ValueError(f"{len(entries)} entries of {size} bytes")
        if bundle.getinfo("document.json").file_size > LARGEST_DOCUMENT:
            raise ValueError("a document that is too large")
        head = json.loads(bundle.read("document.json"), parse_constant=_finite, parse_float=_finite)
        if not isinstance(head, dict):
            raise ValueError("a document that is no object")
        _check_numbers(head.get("document"))
        names = [e.filename for e in entries if e.filename.startswith("arrays/")]
        arrays = {
            name[len("arrays/") : -len(".npy")]: _array(bundle.read(name))
            for name in names
            if name.endswith(".npy")
        }
    return head, arrays


def _check_numbers(value: object) -> None:
    """Refuses numbers that are no quantity, but in the summary, which nothing computes with."""
    if isinstance(value, dict):
        for key, part in value.items():
            if key != "summary":
                _check_numbers(part)
    elif isinstance(value, list):
        for part in value:
            _check_numbers(part)
    elif isinstance(value, int | float) and abs(value) > LARGEST_VALUE:
        raise ValueError(f"a number beyond {LARGEST_VALUE:g} in the document")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:30]} in the document")
    return value


def _array(data: bytes) -> Array:
    """Returns the array of a NumPy file whose header claims no more than its bytes hold."""
    size = _PREFIX + int.from_bytes(data[_PREFIX - 2 : _PREFIX], "little")
    header = _HEADER.fullmatch(data[:size])
    if header is None:
        raise ValueError("an array that is not of float64 in NumPy's format 1.0")
    shape = tuple(int(n) for n in header["shape"].replace(b",", b" ").split())
    if 8 * math.prod(shape) != len(data) - size:
        raise ValueError(f"{len(data) - size} bytes for an array of shape {shape}")
    flat = np.frombuffer(data, dtype="<f8", offset=size).astype(np.float64)
    return flat.reshape(shape, order="F" if header["by_columns"] == b"True" else "C")


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


def _content_hash(head: Mapping[str, object], arrays: Mapping[str, Array]) -> str:
    text = json.dumps(dict(head), sort_keys=True, allow_nan=False)
    parts = [text.encode()] + [n.encode() + _npy(arrays[n]) for n in sorted(arrays)]
    return sha256(b"\0".join(parts))
