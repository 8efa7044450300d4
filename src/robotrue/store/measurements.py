"""Measurement sets in the store: rows in Parquet, the instrument's own files beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.calibration.lineage import data_hash
from robotrue.errors import ImplausibleDataError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.store import items
from robotrue.store.blobs import SAMPLES, require_whole
from robotrue.store.nouns import MEASUREMENT, MeasurementRecord
from robotrue.store.records import Ref, links_to
from robotrue.store.samples import RowPage, RowQuery, read_rows, read_samples, samples_bytes
from robotrue.store.workspace import Transaction, Workspace, transaction

RAW: Final = "raw"


def add(
    where: Workspace | Transaction,
    rows: MeasurementSet,
    *,
    name: str,
    raw: Sequence[Path] = (),
    cell: Ref | None = None,
    note: str = "",
    detail: Mapping[str, Any] | None = None,
    id: str | None = None,
) -> MeasurementRecord:
    """Returns an imported measurement set.

    Args:
        where: Workspace or transaction.
        rows: The poses.
        name: In the workspace.
        raw: The instrument's files they came from.
        cell: They were measured in.
        note: Of the user.
        detail: What else is to be kept, JSON values (the column mapping, remarks on plausibility).
        id: Of the set that gets this as its new version.

    Raises:
        ImplausibleDataError: No rows.
        ConfigurationError: The cell is not in the workspace, or a file's name is none.
        FormatError: A raw file cannot be read.
    """
    if not len(rows):
        raise ImplausibleDataError("a measurement set without rows.", hint="measure some poses.")
    low, high = rows.position.min(axis=0), rows.position.max(axis=0)
    with transaction(where) as into:
        samples = into.keep(samples_bytes(rows), place=SAMPLES)
        return items.add(
            into,
            MEASUREMENT,
            name=name,
            note=note,
            id=id,
            links=links_to(cell=cell),
            files=[(RAW, path.name, path) for path in raw],
            detail={
                "low_m": low.tolist(),
                "high_m": high.tolist(),
                "groups": list(rows.group_names),
                "sources": list(rows.sources),
                "provenance": rows.provenance.to_document(),
                "stations": np.unique(rows.station).tolist(),
                **(detail or {}),
            },
            frame=rows.frame,
            poses=len(rows),
            dof=rows.dof,
            full_poses=int(rows.has_rotation.sum()),
            data=data_hash(rows),
            samples=samples,
        )


def rows_of(workspace: Workspace, record: MeasurementRecord) -> MeasurementSet:
    """Returns the poses of a set, as they were taken in, bit for bit.

    Raises:
        ArchiveError: Their file is missing or was altered.
    """
    path = workspace.path_of(record.samples)
    require_whole(path, record.samples)
    return read_samples(path)


def some_rows(workspace: Workspace, record: MeasurementRecord, query: RowQuery) -> RowPage:
    """Returns a page of the poses of a set, filtered and sorted, for tables and pictures.

    Raises:
        ArchiveError: Their file is damaged.
        ConfigurationError: No such column.
    """
    return read_rows(workspace.path_of(record.samples), query)
