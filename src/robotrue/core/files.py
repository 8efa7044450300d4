"""Files that are either whole or absent, and their text with the line of a fault."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
import tomllib
import uuid
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO, Final

from robotrue.errors import ConfigurationError, FormatError, RobotrueError

DEFAULT_LANG: Final = "en"
"""Default language of texts."""


def write_atomic(path: str | Path, data: bytes) -> None:
    """Writes ``data`` to ``path`` through a neighbour file that is renamed when complete.

    A full disk or a killed process leaves the old file (or none) and never a part of the new one.

    Raises:
        FormatError: The folder cannot be written to, or the disk is full.
    """
    with atomic_stream(path) as stream:
        stream.write(data)


@contextlib.contextmanager
def atomic_stream(path: str | Path) -> Iterator[BinaryIO]:
    """Yields a stream; its bytes replace ``path`` when the block ends without an error.

    Where the system has files without a name, even a process that is killed leaves no file.

    Raises:
        FormatError: The folder cannot be written to, or the disk is full.
    """
    path = Path(path)
    temporary = None
    try:
        handle, temporary = _open_unnamed(path) or tempfile.mkstemp(
            dir=path.parent, prefix=f".{path.name}."
        )
        with os.fdopen(handle, "wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
            if not temporary:
                temporary = _name_file(stream.fileno(), path)
        os.chmod(temporary, _mode_for(path))
        os.replace(temporary, path)
    except BaseException as cause:  # also Ctrl-C: the neighbour file goes in any case
        if temporary:
            with contextlib.suppress(OSError):
                os.unlink(temporary)
        if not isinstance(cause, OSError):
            raise
        raise FormatError(
            f"cannot write: {cause.strerror}.",
            source=path,
            hint="check the folder, its permissions and the free space.",
        ) from cause


def _open_unnamed(path: Path) -> tuple[int, str] | None:
    """Returns a file without a name in the folder of ``path``, or None where there are none."""
    flag = getattr(os, "O_TMPFILE", 0)
    if not flag or not Path("/proc/self/fd").is_dir():
        return None
    try:
        return os.open(path.parent, flag | os.O_WRONLY, 0o600), ""
    except OSError:  # a file system without them
        return None


def _name_file(handle: int, path: Path) -> str:
    """Returns the new name of a file without one, next to ``path``."""
    name = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    folder = os.open(path.parent, os.O_RDONLY)
    try:  # only with a folder's handle does Python follow the link to the open file
        os.link(f"/proc/self/fd/{handle}", name.name, dst_dir_fd=folder, follow_symlinks=True)
    finally:
        os.close(folder)
    return str(name)


def _mode_for(path: Path) -> int:
    if path.exists():
        return path.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def read_bytes(path: str | Path) -> bytes:
    """Returns the bytes of a file.

    Raises:
        FormatError: The file is missing or cannot be read.
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


def sha256_of_file(path: str | Path) -> str:
    """Returns :func:`sha256` of a file of any size, read piece by piece.

    Raises:
        FormatError: The file is missing or cannot be read.
    """
    try:
        with Path(path).open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as cause:
        raise FormatError(
            f"cannot read: {cause.strerror}.", source=path, hint="check the path."
        ) from cause


def utf8_text(
    data: bytes,
    path: str | Path,
    *,
    hint: str = "save the file as UTF-8.",
    error: type[RobotrueError] = FormatError,
) -> str:
    """Returns the text, a byte order mark left out.

    Args:
        data: Content of the file.
        path: The file.
        hint: Remedy where it is not UTF-8.
        error: Exception to raise then.

    Raises:
        FormatError: Not UTF-8, with the line; or the given ``error``.
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as cause:
        raise error(
            f"byte 0x{data[cause.start]:02x} is not UTF-8.",
            source=path,
            line=data.count(b"\n", 0, cause.start) + 1,
            hint=hint,
        ) from None


def read_toml(path: str | Path, *, example: str) -> tuple[dict[str, object], str]:
    """Returns the tables of a TOML file and its text, for the lines of later faults.

    Args:
        path: The file.
        example: Where the user finds one that is right.

    Raises:
        ConfigurationError: Not UTF-8 or not TOML, with the line.
        FormatError: The file cannot be read.
    """
    return parse_toml(read_bytes(path), path, example=example)


def parse_toml(data: bytes, path: str | Path, *, example: str) -> tuple[dict[str, object], str]:
    """Returns the tables in the content of a file and its text; see :func:`read_toml`.

    Raises:
        ConfigurationError: Not UTF-8 or not TOML, with the line.
    """
    text = utf8_text(data, path, error=ConfigurationError)
    try:
        return tomllib.loads(text), text
    except (tomllib.TOMLDecodeError, RecursionError) as cause:
        head, _, place = (str(cause) or "nested too deeply").partition(" (at ")
        digits = "".join(c for c in place.partition("line ")[2].partition(",")[0] if c.isdigit())
        raise ConfigurationError(
            f"not TOML: {head}.",
            source=path,
            line=int(digits) if digits else text.count("\n") + 1,
            hint=f"compare the line with the example in {example}.",
        ) from None


def read_catalogue(paths: Iterable[Path]) -> dict[str, str]:
    """Returns all texts of some files by their dotted keys, e.g. ``"nav.cell"``."""
    texts: dict[str, str] = {}
    for path in paths:
        texts |= _flatten(tomllib.loads(path.read_text(encoding="utf-8")), "")
    return texts


def _flatten(table: Mapping[str, object], prefix: str) -> dict[str, str]:
    texts: dict[str, str] = {}
    for key, value in table.items():
        if isinstance(value, Mapping):
            texts |= _flatten(value, f"{prefix}{key}.")
        else:
            texts[f"{prefix}{key}"] = str(value)
    return texts
