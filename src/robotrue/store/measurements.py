"""Measurement sets in the store: rows in Parquet, the instrument's own files next to them.

The Parquet file has one row a pose and one column a number, SI; any tool reads it.
"""

from __future__ import annotations

import io
import json
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from robotrue.calibration.model import data_hash
from robotrue.core.arrays import Array
from robotrue.core.conditions import Rail
from robotrue.core.document_decoder import decode
from robotrue.core.provenance import provenance_from
from robotrue.errors import ArchiveError, ConfigurationError, ImplausibleDataError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.store import items
from robotrue.store.blobs import SAMPLES, require_whole
from robotrue.store.nouns import MEASUREMENT, MeasurementRecord, ModelRecord
from robotrue.store.query_defaults import LIMIT
from robotrue.store.records import Ref, links_to
from robotrue.store.workspace import Transaction, Workspace, transaction

RAW: Final = "raw"
FORMAT: Final = "robotrue-measurements"
FORMAT_VERSION: Final = 1
_KEY: Final = b"robotrue"
_IF_KNOWN: Final = ("joint_temperature", "time", "external")
"""Fields whose columns a file has only where some value is known."""
_SHAPES: Final[Mapping[str, tuple[int, ...]]] = {
    "joints": (-1,),
    "position": (3,),
    "covariance": (3, 3),
    "rotation": (3, 3),
    "rotation_covariance": (3, 3),
    "wrench": (6,),
    "payload_mass": (),
    "payload_com": (3,),
    "approach": (-1,),
    "temperature": (),
    "joint_temperature": (-1,),
    "time": (),
    "external": (6,),
    "target": (),
    "station": (),
    "group": (),
    "source_row": (),
}
Comparison = Literal["==", "<", "<=", ">", ">="]
_COMPARE: Final[Mapping[Comparison, Callable[[Array, float], Array]]] = {
    "==": operator.eq,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RowQuery:
    """Query for rows of a measurement set.

    Attributes:
        columns: Wanted; empty: joints and position.
        where: Column, comparison and number that all must hold.
        sort: Column, with ``-`` before it greatest first; empty: as measured.
        offset: Rows left out before the page.
        limit: Rows on the page.
    """

    columns: tuple[str, ...] = ()
    where: tuple[tuple[str, Comparison, float], ...] = ()
    sort: str = ""
    offset: int = 0
    limit: int = LIMIT


@dataclass(frozen=True, slots=True, kw_only=True)
class RowPage:
    """Some rows.

    Attributes:
        index: (n,) zero-based number of each row in the set.
        columns: (n,) per column, SI.
        total: Rows on all pages.
    """

    index: Array
    columns: Mapping[str, Array]
    total: int


def add(
    where: Workspace | Transaction,
    rows: MeasurementSet,
    *,
    name: str,
    raw: Sequence[Path] = (),
    cell: Ref | None = None,
    note: str = "",
    detail: Mapping[str, object] | None = None,
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
    """Returns the poses of a set, bit for bit as imported.

    Raises:
        ArchiveError: Their file is missing, was altered, or is of a newer robotrue.
    """
    path = workspace.path_of(record.samples)
    require_whole(path, record.samples)
    head, table = _open_samples(path, None)
    dof = head.dof
    values: dict[str, Any] = {}
    for each in fields(MeasurementSet):
        if each.name not in _SHAPES:
            continue
        shape = tuple(dof if size == -1 else size for size in _SHAPES[each.name])
        names = column_names(each.name, dof)
        if each.name in _IF_KNOWN and names[0] not in table.column_names:
            continue
        columns = [table.column(name).to_numpy() for name in names]
        values[each.name] = np.stack(columns, axis=1).reshape(table.num_rows, *shape)
    return MeasurementSet(
        frame="base" if head.frame == "base" else "tracker",
        group_names=head.group_names,
        sources=head.sources,
        rail=None if head.rail is None else head.rail.rail(),
        provenance=provenance_from(head.provenance, before=(*head.sources, *head.group_names)),
        **values,
    )


def read_data(workspace: Workspace, model: ModelRecord) -> list[MeasurementSet]:
    """Returns the poses a model rests on, a set each."""
    return [
        rows_of(workspace, items.get(workspace, MEASUREMENT, to.id, version=to.version))
        for to in model.refs("data")
    ]


def column_names(field: str, dof: int) -> list[str]:
    """Returns the columns of a field: ``joints_1`` and on, ``position_x``, ``covariance_xy``."""
    shape = tuple(dof if size == -1 else size for size in _SHAPES[field])
    if shape == ():
        return [field]
    if shape == (3,):
        return [f"{field}_{axis}" for axis in "xyz"]
    if shape == (3, 3):
        return [f"{field}_{row}{column}" for row in "xyz" for column in "xyz"]
    return [f"{field}_{k}" for k in range(1, shape[0] + 1)]


def samples_bytes(rows: MeasurementSet) -> bytes:
    """Returns the content of a Parquet file with every digit of the set."""
    columns: dict[str, Array] = {}
    for field in _SHAPES:
        values = np.asarray(getattr(rows, field)).reshape(len(rows), -1)
        if field in _IF_KNOWN and np.isnan(values).all():
            continue
        names = column_names(field, rows.dof)
        columns |= {name: values[:, k] for k, name in enumerate(names)}
    head = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "units": "SI: m, rad, N, N m, kg, K",
        "dof": rows.dof,
        "frame": rows.frame,
        "group_names": list(rows.group_names),
        "sources": list(rows.sources),
        "provenance": rows.provenance.to_document(),
        **({} if rows.rail is None else {"rail": rows.rail.document()}),
    }
    table = pa.table({name: pa.array(values) for name, values in columns.items()})
    table = table.replace_schema_metadata({_KEY: json.dumps(head).encode()})
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    return buffer.getvalue()


@dataclass(frozen=True, slots=True, kw_only=True)
class _StoredRail:
    """The rail in the head of a file of measurements, SI."""

    number: int
    direction: tuple[float, float, float]
    at: float

    def rail(self) -> Rail:
        return Rail(number=self.number, direction=np.array(self.direction), at=self.at)


@dataclass(frozen=True, slots=True, kw_only=True)
class _SamplesHead:
    """Header of a file of measurements, besides its columns."""

    format_version: int
    dof: int
    frame: str
    group_names: tuple[str, ...]
    sources: tuple[str, ...]
    provenance: object = None
    rail: _StoredRail | None = None


def some_rows(workspace: Workspace, record: MeasurementRecord, query: RowQuery) -> RowPage:
    """Returns a page of the poses of a set, filtered and sorted, for tables and pictures.

    Only the columns in question are read.

    Raises:
        ArchiveError: Their file is damaged, or of a newer robotrue.
        ConfigurationError: No such column.
    """
    path = workspace.path_of(record.samples)
    known = pq.read_schema(path).names
    wanted = list(query.columns) or [n for n in known if n.startswith(("joints_", "position_"))]
    for _, comparison, _ in query.where:
        if comparison not in _COMPARE:
            raise ConfigurationError(f"comparison {comparison!r}, expected {', '.join(_COMPARE)}.")
    field = query.sort.removeprefix("-")
    asked = [*wanted, *(name for name, _, _ in query.where), *([field] if field else [])]
    for name in asked:
        if name not in known:
            raise ConfigurationError(
                f"measurements have no column {name!r}.", hint=f"one of {', '.join(known)}."
            )
    _, table = _open_samples(path, sorted(set(asked)))
    shown = np.ones(table.num_rows, dtype=bool)
    for name, comparison, number in query.where:
        shown &= _COMPARE[comparison](table.column(name).to_numpy(), number)
    index = np.flatnonzero(shown)
    if field:
        order = np.argsort(table.column(field).to_numpy()[index], kind="stable")
        index = index[order[::-1]] if query.sort.startswith("-") else index[order]
    page = index[query.offset : query.offset + query.limit]
    columns = {name: table.column(name).to_numpy()[page] for name in wanted}
    return RowPage(index=page.astype(np.float64), columns=columns, total=len(index))


def _open_samples(path: Path, columns: Sequence[str] | None) -> tuple[_SamplesHead, pa.Table]:
    try:
        table = pq.read_table(path, columns=columns)
        head = decode(_SamplesHead, json.loads(table.schema.metadata[_KEY]))
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError, ArchiveError) as cause:
        raise ArchiveError(
            f"not measurements of robotrue, or damaged ({cause}).",
            source=path,
            hint="fetch the file from its backup.",
        ) from cause
    if head.format_version > FORMAT_VERSION:
        raise ArchiveError(
            f"measurements of format {head.format_version}, this robotrue reads up to "
            f"{FORMAT_VERSION}.",
            source=path,
            hint="update robotrue.",
        )
    return head, table
