"""Names of files to write: none ends as a file of another format does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final

from robotrue.errors import ConfigurationError

_NAMED: Final = {
    "a KRL program": ".src .sub",
    "a KRL point file": ".dat",
    "a Yaskawa job": ".jbi",
    "a Fanuc LS program": ".ls",
    "a RAPID module": ".mod .modx .prg",
    "a UR script": ".script .urscript",
    "a VAL3 file": ".pgx .dtx .pjx",
    "a G-code program": ".mpf .spf .arc .nc .tap .cnc .ngc",
    "a Heidenhain program": ".h",
    "APT or CL data": ".apt .cls .cl .ncl .aptsource",
    "a CSV table": ".csv",
    "JSON": ".json",
    "TOML": ".toml",
    "XML": ".xml",
    "YAML": ".yaml .yml",
    "a page": ".html .htm",
    "a PDF": ".pdf",
    "a picture": ".png .svg .jpg .jpeg",
    "a workbook": ".xlsx .xls .xlsm .ods",
    "a robotrue model": ".robotrue",
    "a robot description": ".urdf",
    "a mesh": ".stl .step .stp",
    "a UFF58 response": ".uff .unv",
    "a recording": ".tdms .mat",
    "an archive": ".zip",
}
FORMATS: Final[Mapping[str, str]] = MappingProxyType(
    {suffix: named for named, suffixes in _NAMED.items() for suffix in suffixes.split()}
)
"""What a file of each suffix holds."""


def require_suffix(output: Path, what: str, suffixes: Sequence[str], *, only: bool = False) -> None:
    """Refuses a name with the suffix of another format; other endings say none.

    Args:
        output: File to write.
        what: What is written.
        suffixes: In lower case, the usual one first.
        only: What is written has no other suffix, unknown ones neither.

    Raises:
        ConfigurationError: The name ends as a file of another format does.
    """
    suffix = output.suffix.lower()
    if suffix in suffixes or not (only or suffix in FORMATS):
        return
    ends = f"ends in {output.suffix}" if suffix else "has no suffix"
    named = f", as {FORMATS[suffix]} does" if suffix in FORMATS else ""
    raise ConfigurationError(
        f"the name {ends}{named}; {what} is written ({', '.join(suffixes)}).",
        source=output,
        hint=f"name it {output.with_suffix(suffixes[0]).name}.",
    )


def check_output(output: Path, sources: Sequence[Path], *, folder: bool = False) -> None:
    """Refuses, before any work is done, an output that is invalid or that is one of the sources.

    Args:
        output: File to be written.
        sources: What is read.
        folder: A folder that exists is allowed, too.

    Raises:
        ConfigurationError: No such folder, a folder itself, or a file that is read.
    """
    if output.is_dir() and folder:
        return
    if output.is_dir():
        raise ConfigurationError(
            "the output is a folder.", source=output, hint="a file name after -o."
        )
    if not output.parent.is_dir():
        raise ConfigurationError(
            f"cannot write: the folder {output.parent} does not exist.",
            source=output,
            hint=f"mkdir -p {output.parent}",
        )
    for source in sources:
        if output.exists() and source.exists() and output.samefile(source):
            raise ConfigurationError(
                f"the output is {source.name}, which is an input; it is not overwritten.",
                source=output,
                hint="another name after -o.",
            )
