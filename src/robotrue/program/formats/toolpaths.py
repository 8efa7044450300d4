"""Tool paths by their content: APT or CL data, or CSV."""

from __future__ import annotations

from pathlib import Path

from robotrue.core.files import read_bytes
from robotrue.errors import FormatError
from robotrue.program.formats.apt import looks_like_apt, read_apt
from robotrue.program.formats.toolpath_csv import looks_like_csv, read_toolpath_csv
from robotrue.program.toolpath import Toolpath

_LOOKED_AT = 1 << 18


def read_toolpath(path: str | Path) -> Toolpath:
    """Returns the tool path of an APT or CL file or of a CSV table, recognised by their content.

    Raises:
        FormatError: The file cannot be read, is neither, or has a fault (with its line).
        ImplausibleDataError: No point, or a path larger than any part.
    """
    data = read_bytes(path)
    head = data[:_LOOKED_AT].decode("latin-1")
    if looks_like_csv(head.removeprefix("\xef\xbb\xbf")):
        return read_toolpath_csv(data, source=str(path))
    if looks_like_apt(head):
        return read_apt(data, source=str(path))
    raise FormatError(
        "neither APT or CL data (no GOTO/) nor a CSV table with x_mm, y_mm, z_mm.",
        source=path,
        line=1,
        hint="output CL data (APT source) from the CAM system.",
    )
