"""Programs in the store: as the CAM made them, and as they are cut with which model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.formats import detect
from robotrue.store import items
from robotrue.store.layout import attached, laid_out
from robotrue.store.nouns import PROGRAM
from robotrue.store.records import Link, ProgramRecord, Ref
from robotrue.store.workspace import Transaction, Workspace, transaction

FILE: Final = "program"
IDENTITY: Final = "identity"
BEFORE: Final = "before"
AFTER: Final = "after"
_LOOKED_AT: Final = 1 << 20


def add(
    where: Workspace | Transaction,
    paths: Sequence[str | Path],
    *,
    name: str | None = None,
    note: str = "",
    id: str | None = None,
) -> ProgramRecord:
    """Returns the files of one program taken in as they stand, the main one first.

    Raises:
        ConfigurationError: No files, or two of one name.
        FormatError: A file cannot be read, or the first is in no dialect.
    """
    return _taken(where, [Path(path) for path in paths], name, note, id=id)


def add_after(
    where: Workspace | Transaction,
    paths: Sequence[str | Path],
    *,
    before: Ref,
    model: Ref | None,
    cell: Ref | None = None,
    registration: Ref | None = None,
    identities: Sequence[Path] = (),
    name: str | None = None,
    note: str = "",
    job: str = "",
    detail: Mapping[str, Any] | None = None,
) -> ProgramRecord:
    """Returns the files of a compensated program taken in, tied to what they were made from.

    Args:
        where: Workspace or transaction.
        paths: The files, the main one first.
        before: The program they were made from.
        model: They were compensated with; None: the nominal arm.
        cell: Whose frames they use, where that is not the model's.
        registration: Whose part frame they run in.
        identities: Files that say with which model each was made.
        name: In the workspace.
        note: Of the user.
        job: That made it.
        detail: Counts and predicted errors, JSON values.

    Raises:
        ConfigurationError: What it was made from is not in the workspace, or two files of one name.
        FormatError: A file cannot be read.
    """
    links = [
        Link(role="before", to=before),
        *([Link(role="model", to=model)] if model is not None else []),
        *([Link(role="cell", to=cell)] if cell is not None else []),
        *([Link(role="registration", to=registration)] if registration is not None else []),
    ]
    kept = {**(detail or {}), "job": job}
    return _taken(
        where, [Path(path) for path in paths], name, note,
        stage=AFTER, links=links, identities=identities, detail=kept,
    )  # fmt: skip


def laid(workspace: Workspace, record: ProgramRecord, folder: Path) -> tuple[Path, ...]:
    """Returns the program's files written to a folder, the main one first.

    Raises:
        ArchiveError: A file is missing or was altered.
    """
    laid_out(workspace, record, folder, IDENTITY)
    return laid_out(workspace, record, folder, FILE)


def _taken(
    where: Workspace | Transaction,
    paths: list[Path],
    name: str | None,
    note: str,
    *,
    stage: str = BEFORE,
    links: Sequence[Link] = (),
    identities: Sequence[Path] = (),
    detail: Mapping[str, Any] | None = None,
    id: str | None = None,
) -> ProgramRecord:
    names = [path.name.lower() for path in paths]
    if not paths or len(set(names)) != len(names):
        raise ConfigurationError(
            f"a program of the files {', '.join(names) or '(none)'}, expected one or more, of "
            "different names."
        )
    language, size = _language(paths[0]), sum(_size(path) for path in paths)
    with transaction(where) as into:
        attachments = attached(
            into,
            [
                *((FILE, path.name, path) for path in paths),
                *((IDENTITY, path.name, path) for path in identities),
            ],
        )
        columns = {
            "name": name or paths[0].name,
            "note": note,
            "detail": dict(detail or {}),
            "stage": stage,
            "dialect": language,
            "file_count": len(paths),
            "bytes": size,
        }
        return items.insert(into, PROGRAM, columns, links=links, attachments=attachments, id=id)


def _language(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            return detect(stream.read(_LOOKED_AT), path.name).name
    except OSError as cause:
        raise FormatError(f"cannot read: {cause.strerror}.", source=path) from cause


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError as cause:
        raise FormatError(f"cannot read: {cause.strerror}.", source=path) from cause
