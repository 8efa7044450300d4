"""Provenance of data: simulated or measured, by which instrument, from which files.

Every measurement carries a :class:`Provenance`; everything made of measurements carries the merge
of theirs. File names decide nothing: what our simulators write carries a mark *in* the file, and a
file without one is measured. :func:`simulation_mark` is the only place that turns a provenance into
the mark shown by commands, reports, exports and pages.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from robotrue.core.files import sha256_of_file
from robotrue.errors import ArchiveError

MARK: Final = "SIMULATED"
MOST_FILES: Final = 64
"""Files named in one provenance; those beyond are counted."""
_LONGEST: Final = 200
"""Characters of an instrument's name that a provenance keeps."""
_HEAD: Final = 1 << 16
"""Bytes of a file in which its mark is looked for."""
_COMMENT: Final = re.compile(rb"^#[^\r\n]*", re.MULTILINE)
_LINE: Final = re.compile(rf"#\s*robotrue {MARK}(?::([^,;\t]*))?[,;\t\s]*", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceFile:
    """One file by its name and the SHA-256 of its bytes."""

    name: str
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """Provenance of data.

    Attributes:
        simulated: Whether any of it was simulated.
        instrument: What measured it; "" where unknown.
        files: It was read from, each once, at most ``MOST_FILES``.
        more_files: Files that are not named because there are too many.
    """

    simulated: bool = False
    instrument: str = ""
    files: tuple[SourceFile, ...] = ()
    more_files: int = 0

    def __post_init__(self) -> None:
        """Removes duplicate file names and bounds their number."""
        files = tuple(dict.fromkeys(self.files))
        object.__setattr__(self, "instrument", " ".join(self.instrument.split())[:_LONGEST])
        object.__setattr__(self, "files", files[:MOST_FILES])
        object.__setattr__(self, "more_files", self.more_files + len(files[MOST_FILES:]))

    def to_document(self) -> dict[str, object]:
        """Returns JSON values for archives, stores and ``--json``."""
        return {**asdict(self), "files": [asdict(file) for file in self.files]}


MEASURED: Final = Provenance()
"""Of data without a statement: measured, by an unknown instrument."""


def merge(parts: Iterable[Provenance]) -> Provenance:
    """Returns the provenance of what is made of several things; simulated if any of them is."""
    given = tuple(parts)
    names = dict.fromkeys(part.instrument for part in given if part.instrument)
    return Provenance(
        simulated=any(part.simulated for part in given),
        instrument="; ".join(names),
        files=tuple(file for part in given for file in part.files),
        more_files=sum(part.more_files for part in given),
    )


def provenance_from(document: object, *, before: Iterable[object] = ()) -> Provenance:
    """Returns the provenance that :meth:`Provenance.to_document` wrote.

    Args:
        document: The JSON values; None where an older robotrue wrote none.
        before: Names of sources that the older robotrue recorded instead. Its rule applies to them
            alone, so that the mark of a stored simulation survives the update.

    Raises:
        ArchiveError: Values of another type.
    """
    if document is None:
        return Provenance(simulated=any("simulated" in str(name).lower() for name in before))
    if not isinstance(document, Mapping) or not isinstance(document.get("simulated"), bool):
        raise ArchiveError("a provenance without simulated = true or false.")
    try:
        return Provenance(
            simulated=document["simulated"],
            instrument=str(document["instrument"]),
            files=tuple(
                SourceFile(name=str(file["name"]), sha256=str(file["sha256"]))
                for file in document["files"]
            ),
            more_files=int(document["more_files"]),
        )
    except (KeyError, TypeError, ValueError) as cause:
        raise ArchiveError(f"a damaged provenance ({cause!r}).") from cause


def simulation_mark(provenance: Provenance | bool | None, word: str = MARK) -> str:
    """Returns the mark of a result: ``word`` if anything it rests on was simulated, else "".

    Args:
        provenance: Of the result, or its ``simulated``; None for one that rests on no data.
        word: The mark in the language and length of the place that shows it.
    """
    simulated = provenance.simulated if isinstance(provenance, Provenance) else provenance
    return word if simulated else ""


def mark_sentence(provenance: Provenance | bool | None) -> str:
    """Returns the line that marks a result as simulated, or ""."""
    return simulation_mark(provenance, f"{MARK}: no real robot was measured for this result")


def mark_title(title: str, provenance: Provenance | None) -> str:
    """Returns a title with the mark in front, ``"SIMULATED: ..."``, or as it is."""
    mark = simulation_mark(provenance)
    return f"{mark}: {title}" if mark and mark not in title else title


def marked_document(
    document: Mapping[str, object], provenance: Provenance | None
) -> dict[str, object]:
    """Returns the JSON values of a result with ``simulated`` and ``provenance`` in front."""
    if provenance is None:
        return dict(document)
    stated = {"simulated": bool(simulation_mark(provenance))}
    return {**stated, "provenance": provenance.to_document(), **document}


def mark_line(provenance: Provenance | None) -> str:
    """Returns the comment line that marks a text file as simulated, with its line end, or "".

    It has no comma, semicolon, tab or quotation mark, so that it survives a spreadsheet.
    """
    if provenance is None:
        return ""
    instrument = re.sub(r"[,;\t\"']+", " ", provenance.instrument)
    name = f": {' '.join(instrument.split())}" if instrument.strip() else ""
    return simulation_mark(provenance, f"# robotrue {MARK}{name}\n")


def provenance_of_lines(lines: Iterable[str]) -> Provenance:
    """Returns what the comment lines of a text file state; measured, if none states anything."""
    for line in lines:
        found = _LINE.fullmatch(line.strip())
        if found:
            return Provenance(simulated=True, instrument=(found[1] or "").strip())
    return MEASURED


def file_provenance(name: str, sha256: str, stated: Provenance = MEASURED) -> Provenance:
    """Returns the provenance of one file.

    Args:
        name: Of the file, without its folder.
        sha256: Of its bytes.
        stated: What the file states of itself.
    """
    return merge([stated, Provenance(files=(SourceFile(name=name, sha256=sha256),))])


def read_provenance(path: str | Path) -> Provenance:
    """Returns the provenance of a file: its name, its hash, and the mark among its first lines.

    Raises:
        FormatError: The file cannot be read.
    """
    digest = sha256_of_file(path)
    with Path(path).open("rb") as stream:
        head = _COMMENT.findall(stream.read(_HEAD))
    stated = provenance_of_lines(line.decode("utf-8", errors="replace") for line in head)
    return file_provenance(Path(path).name, digest, stated)
