"""Error models in the store, with what each was made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from robotrue.calibration.model import history, identity_of, provenance_of
from robotrue.store import items
from robotrue.store.layout import copy_files
from robotrue.store.model_file import ModelFile, read_model
from robotrue.store.nouns import MODEL, ModelRecord
from robotrue.store.records import Ref, links_to
from robotrue.store.workspace import Transaction, Workspace
from robotrue.version import __version__

FILE: Final = "model"


def add(
    where: Workspace | Transaction,
    path: str | Path,
    *,
    name: str,
    data: Sequence[Ref] = (),
    cell: Ref | None = None,
    parents: Sequence[Ref] = (),
    settings: Mapping[str, object] | None = None,
    reports: Sequence[Path] = (),
    job: str = "",
    note: str = "",
    id: str | None = None,
) -> ModelRecord:
    """Returns an imported model file, linked to what it was made from.

    Args:
        where: Workspace or transaction.
        path: What :func:`robotrue.store.model_file.write_model` wrote.
        name: In the workspace.
        data: Measurement sets it was fitted to.
        cell: It was fitted in.
        parents: Models it started from.
        settings: That decided the result besides the data, JSON values.
        reports: Pages about it.
        job: That made it.
        note: Of the user.
        id: Of the model that gets this as its new version.

    Raises:
        ArchiveError: Not a model file, or damaged.
        ConfigurationError: Its source is not in the workspace.
        FormatError: A file cannot be read.
    """
    path = Path(path)
    file = read_model(path)
    summary = file.model.training_summary()
    return items.add(
        where,
        MODEL,
        name=name,
        note=note,
        id=id,
        links=links_to(data=data, cell=cell, parent=parents),
        files=[(FILE, path.name, path), *(("report", page.name, page) for page in reports)],
        detail={
            "rows": summary.rows,
            "data_sha256": summary.data_sha256,
            "history": history(file.model),
            "job": job,
            "provenance": provenance_of(file.model).to_document(),
        },
        kind=file.archive.kind,
        method=summary.method,
        robot=file.model.robot.name,
        identity=identity_of(file.model).sha256,
        made_by=__version__,
        settings=dict(settings or {}),
    )


def copy_file(workspace: Workspace, record: ModelRecord, folder: Path) -> Path:
    """Returns the model file written to a folder.

    Raises:
        ArchiveError: It is missing or was altered.
    """
    (path,) = copy_files(workspace, record, folder, FILE)
    return path


def model_of(workspace: Workspace, record: ModelRecord) -> ModelFile:
    """Returns the model and its cell.

    Raises:
        ArchiveError: The file is missing or was altered.
    """
    (file,) = record.files(FILE)
    workspace.content(file.sha256)
    return read_model(workspace.path_of(file.sha256))
