"""Programs in the store: as the CAM made them, and as they are cut with which model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.formats import detect
from robotrue.store import items
from robotrue.store.layout import copy_files
from robotrue.store.nouns import PROGRAM, ProgramRecord
from robotrue.store.records import Link, Ref, links_to
from robotrue.store.workspace import Transaction, Workspace

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
    stage: str = BEFORE,
    identities: Sequence[Path] = (),
    links: Sequence[Link] = (),
    detail: Mapping[str, object] | None = None,
) -> ProgramRecord:
    """Returns the imported files of one program as they are, the main one first.

    Args:
        where: Workspace or transaction.
        paths: The files, the main one first.
        name: In the workspace.
        note: Of the user.
        id: Of the program that gets this as its new version.
        stage: As the CAM made it, or compensated; :func:`add_after` adds those.
        identities: Files that identify the model of each.
        links: Its source.
        detail: Counts and predicted errors, JSON values.

    Raises:
        ConfigurationError: No files, or two of one name.
        FormatError: A file cannot be read, or the first is in no dialect.
    """
    files = [Path(path) for path in paths]
    names = [path.name.lower() for path in files]
    if not files or len(set(names)) != len(names):
        raise ConfigurationError(
            f"a program of the files {', '.join(names) or '(none)'}, expected one or more, of "
            "different names."
        )
    try:
        with files[0].open("rb") as stream:
            dialect = detect(stream.read(_LOOKED_AT), files[0].name).name
        size = sum(path.stat().st_size for path in files)
    except OSError as cause:
        raise FormatError(f"cannot read: {cause.strerror}.", source=cause.filename) from cause
    roles = [*((FILE, path) for path in files), *((IDENTITY, path) for path in identities)]
    return items.add(
        where,
        PROGRAM,
        name=name or files[0].name,
        note=note,
        detail=detail,
        links=links,
        files=[(role, path.name, path) for role, path in roles],
        id=id,
        stage=stage,
        dialect=dialect,
        file_count=len(files),
        bytes=size,
    )


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
    detail: Mapping[str, object] | None = None,
) -> ProgramRecord:
    """Returns the imported files of a compensated program, linked to what they were made from.

    Args:
        where: Workspace or transaction.
        paths: The files, the main one first.
        before: The program they were made from.
        model: They were compensated with; None: the nominal arm.
        cell: Whose frames they use, where that is not the model's.
        registration: Whose part frame they run in.
        identities: Files that identify the model of each.
        name: In the workspace.
        note: Of the user.
        job: That made it.
        detail: Counts and predicted errors, JSON values.

    Raises:
        ConfigurationError: Its source is not in the workspace, or two files of one name.
        FormatError: A file cannot be read.
    """
    return add(
        where,
        paths,
        stage=AFTER,
        identities=identities,
        name=name,
        note=note,
        links=links_to(before=before, model=model, cell=cell, registration=registration),
        detail={**(detail or {}), "job": job},
    )


def copy_program(workspace: Workspace, record: ProgramRecord, folder: Path) -> tuple[Path, ...]:
    """Returns the program's files written to a folder, the main one first.

    Raises:
        ArchiveError: A file is missing or was altered.
    """
    copy_files(workspace, record, folder, IDENTITY)
    return copy_files(workspace, record, folder, FILE)
