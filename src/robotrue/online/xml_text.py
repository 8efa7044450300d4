"""XML that came from elsewhere, parsed without what makes XML dangerous."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

from robotrue.errors import FormatError

_DECLARATION: Final = re.compile(rb"^\s*<\?xml[^>]*\?>")


def parse_xml(data: bytes, what: str, source: str | Path | None = None) -> ElementTree.Element:
    """Returns the root element of a document in UTF-8, or Latin-1 where it is not UTF-8.

    Raises:
        FormatError: Not XML, or with a document type: entities can grow without bound.
    """
    body = _DECLARATION.sub(b"", data.removeprefix(b"\xef\xbb\xbf"), count=1)
    if b"<!DOCTYPE" in body or b"<!ENTITY" in body:
        raise FormatError(f"{what} declares a document type, expected none.", source=source)
    try:
        text = body.decode("utf-8")
    except UnicodeDecodeError:
        text = body.decode("latin-1")
    try:
        return ElementTree.fromstring(text)  # noqa: S314 (no entities without a document type)
    except (ElementTree.ParseError, ValueError) as cause:
        raise FormatError(
            f"{what} is not XML: {cause}.", source=source, hint="send it whole, as it was made."
        ) from cause
