"""What a job takes from its workspace, and the document it leaves there."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.cli.console import stderr
from robotrue.cli.inputs import joined
from robotrue.cli.job_parameters import Parameters
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.store import cells, documents, measurements
from robotrue.store.jobs_work import Publish, Work
from robotrue.store.provenance import provenance_of_record
from robotrue.store.records import CellRecord, Link, MeasurementRecord, Record, Ref
from robotrue.store.workspace import Transaction

NAMED: Final = ("name", "note")
"""Parameters that every kind of job takes."""


def asked_of(work: Work, *known: str) -> Parameters:
    """Returns the parameters of a job; ``name`` and ``note`` are always among them."""
    return Parameters(work.workspace, work.parameters, (*known, *NAMED))


def cell_of(work: Work, record: CellRecord) -> Cell:
    """Returns a cell of the workspace; its doubts become remarks."""
    folder = work.folder / "cell"
    folder.mkdir()
    cell = read_cell(cells.laid(work.workspace, record, folder))
    for doubt in cell.doubts:
        work.remark(doubt)
    return cell


def rows_of(
    work: Work, cell: Cell, sets: Sequence[MeasurementRecord], *, minimum: int = 6
) -> MeasurementSet:
    """Returns measurement sets of the workspace as one, checked for plausibility."""
    rows = [measurements.rows_of(work.workspace, each) for each in sets]
    return joined(cell, rows, [each.name for each in sets], minimum=minimum)


@contextlib.contextmanager
def heard(work: Work) -> Iterator[None]:
    """Keeps what the commands say to the terminal as remarks of the job."""
    try:
        with stderr.capture() as told:
            yield
    finally:  # what was said before a refusal says why
        for line in told.get().splitlines():
            # where the server keeps its files is nobody's business, and gone when the job is over
            work.remark(line.removeprefix("note: ").replace(f"{work.folder}/", ""))


def leave_document(
    work: Work,
    asked: Parameters,
    kind: str,
    about: str,
    files: list[Path],
    links: list[Link],
    detail: Mapping[str, Any],
) -> Publish:
    """Returns what leaves a document of a kind, with its files and its numbers.

    Args:
        work: The job.
        asked: Its parameters, for name and note.
        kind: Of the document.
        about: Name of what it is about, for its own.
        files: Tables, programs, pages.
        links: What it rests on.
        detail: Its numbers, JSON values.
    """

    def publish(into: Transaction) -> Mapping[str, Any]:
        made: Record = documents.add(
            into,
            kind,
            name=asked.text("name", f"{kind} of {about}"),
            note=asked.text("note", ""),
            files=files,
            about=links,
            detail={**detail, "job": work.job.id},
        )
        simulated = provenance_of_record(made).simulated
        return {"document": ref_document(made.ref), "simulated": simulated}

    return publish


def ref_document(ref: Ref) -> dict[str, Any]:
    """Returns a version of an item as JSON values."""
    return {"id": ref.id, "version": ref.version}
