"""Bytes of a text file as text, or the line where they are none."""

from __future__ import annotations

from pathlib import Path

from robotrue.errors import FormatError, RobotrueError


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
        hint: What to try where it is not UTF-8.
        error: What to raise then.

    Raises:
        FormatError: Not UTF-8, with the line; or the ``error`` asked for.
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
