"""Journals of ``robotrue drill run``: those in the workspace's folder, which are followed."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from pydantic import BaseModel

from robotrue.drilling.journal_lines import whole_lines
from robotrue.errors import ConfigurationError
from robotrue.store.workspace import Workspace
from robotrue.web.problems import MissingError

FOLDER: Final = "drilling"
MOST: Final = 2 * 1024 * 1024
"""Bytes read at once; a further request returns more."""
_NAME: Final = re.compile(r"[\w-][\w.-]{0,100}\.jsonl")


class Entries(BaseModel):
    """Some lines of a journal.

    Attributes:
        entries: As the session wrote them.
        next: Next byte to request.
        size: Of the file in bytes.
        anew: The file is another one than before: forget what was read of it.
    """

    entries: list[dict[str, object]]
    next: int
    size: int
    anew: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalFile:
    """A journal in the folder.

    Attributes:
        name: Of the file.
        written: When a line was last added.
        size: Bytes.
    """

    name: str
    written: datetime
    size: int


def folder_of(workspace: Workspace) -> Path:
    """Returns the folder that is looked at; created if missing."""
    place = workspace.folder / FOLDER
    place.mkdir(exist_ok=True)
    return place


def journals(workspace: Workspace) -> list[JournalFile]:
    """Returns the journals in the folder, the one written last first."""
    found = []
    for path in folder_of(workspace).iterdir():
        if _NAME.fullmatch(path.name) and path.is_file() and not path.is_symlink():
            state = path.stat()
            at = datetime.fromtimestamp(state.st_mtime, UTC)
            found.append(JournalFile(name=path.name, written=at, size=state.st_size))
    return sorted(found, key=lambda each: each.written, reverse=True)


def journal_path(workspace: Workspace, name: str) -> Path:
    """Returns where a journal of the folder lies.

    Raises:
        MissingError: There is none of that name.
    """
    path = workspace.folder / FOLDER / name
    if not _NAME.fullmatch(name) or path.is_symlink() or not path.is_file():
        raise MissingError(f"there is no journal {name[:60]!r} in the folder {FOLDER}.")
    return path


def entries_after(path: Path, after: int, *, name: str) -> Entries:
    """Returns entries of a journal from a byte on; of a shorter file, all entries.

    Raises:
        ConfigurationError: The byte is not the beginning of a line.
        FormatError: A line that is not of a journal.
    """
    with path.open("rb") as file:
        size = file.seek(0, 2)
        anew = after > size
        start = 0 if anew else after
        file.seek(max(start - 1, 0))
        if start and file.read(1) != b"\n":
            raise ConfigurationError(
                f"byte {start} of {name} is not the beginning of a line.",
                hint="0, or the next of the answer before.",
            )
        file.seek(start)
        found, taken = whole_lines(file.read(MOST), source=name)
    return Entries(
        entries=[dict(entry.document) for entry in found], next=start + taken, size=size, anew=anew
    )
