"""The nouns of the store: one record each; its fields are the columns of its table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Final, Generic, TypeVar, get_args, get_type_hints

from sqlalchemy import BigInteger, Float, ForeignKey, Integer
from sqlalchemy.orm import InstrumentedAttribute, MappedColumn, mapped_column

from robotrue.errors import ConfigurationError
from robotrue.store.records import ItemRecord
from robotrue.store.schema import DOCUMENT as JSON_DOCUMENT
from robotrue.store.schema import HASH, NAME, WORD, Versioned

R = TypeVar("R", bound=ItemRecord)
R_co = TypeVar("R_co", bound=ItemRecord, covariant=True)
INDEXED: Final = "indexed"
"""A column that items are looked up by."""
_PLAIN: Final[Mapping[object, Integer | Float[float]]] = {int: Integer(), float: Float()}
Word = Annotated[str, WORD]
Name = Annotated[str, NAME]
Hash = Annotated[str, HASH]
Identity = Annotated[str, HASH, INDEXED]


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotRecord(ItemRecord):
    """An arm as its controller computes it; ``identity`` is that of its nominal geometry."""

    maker: Word
    dof: int
    identity: Identity


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolRecord(ItemRecord):
    """A tool; ``detail["T_flange_tool"]`` is its frame (4, 4), m."""

    identity: Identity


@dataclass(frozen=True, slots=True, kw_only=True)
class CellRecord(ItemRecord):
    """A cell.toml with the files it names; links ``robot``, ``tool``."""

    digest: Hash
    robot: Name
    frame: Word


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementRecord(ItemRecord):
    """A measurement set; link ``cell``, files ``raw``.

    Attributes:
        frame: Of the positions: base or tracker.
        poses: Rows.
        dof: Joints.
        full_poses: Rows with orientation.
        data: SHA-256 of joints and positions, as fits record it.
        samples: SHA-256 of the Parquet file with the rows.
    """

    frame: Word
    poses: int
    dof: int
    full_poses: int
    data: Identity
    samples: Annotated[str, HASH, ForeignKey("blobs.sha256")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelRecord(ItemRecord):
    """An error model; links ``data``, ``cell``, ``parent``, ``job``; file ``model``.

    Attributes:
        kind: Of its archive.
        method: That made it.
        robot: Name of the arm.
        identity: SHA-256 by which programs and registrations know it.
        made_by: Version of robotrue.
        settings: That decided the result.
    """

    kind: Word
    method: Word
    robot: Name
    identity: Identity
    made_by: Word
    settings: Annotated[Mapping[str, object], JSON_DOCUMENT]


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationRecord(ItemRecord):
    """Registered part frames; links ``cell``, ``model``; files ``cell``, ``points``."""

    method: Word
    verdict: Word
    frames: int
    identity: Hash


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramRecord(ItemRecord):
    """The files of one job; links ``before``, ``model``; files ``program``, ``identity``.

    Attributes:
        stage: ``before``: as the CAM made it. ``after``: compensated.
        dialect: The controller's language.
        file_count: How many.
        bytes: Of all files together.
    """

    stage: Word
    dialect: Word
    file_count: int
    bytes: Annotated[int, BigInteger()]


@dataclass(frozen=True, slots=True, kw_only=True)
class DocumentRecord(ItemRecord):
    """Result of a job other than a model or program; ``kind`` is plan, validation, report, ..."""

    kind: Word


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftCheckRecord(ItemRecord):
    """A few poses against a stored model; links ``model``, ``data``.

    Attributes:
        poses: Measured.
        statistic: Chi-square.
        p_value: Of it under the stored model.
        verdict: keep, update or recalibrate.
    """

    poses: int
    statistic: float
    p_value: float
    verdict: Word


@dataclass(frozen=True, slots=True, kw_only=True)
class Noun(Generic[R_co]):
    """One noun.

    Attributes:
        name: As commands and links call it.
        table: Table of its versions.
        record: What they are read as.
    """

    name: str
    table: type[Versioned]
    record: type[R_co]

    def column(self, field: str) -> InstrumentedAttribute[object]:
        """Returns the column of a field of the record."""
        column: InstrumentedAttribute[object] = getattr(self.table, field)
        return column


def _make_noun(name: str, table: str, record: type[R]) -> Noun[R]:
    """Returns the noun of a record, its table made from the fields of the record."""
    common = {field.name for field in fields(ItemRecord)}
    hints = get_type_hints(record, include_extras=True)
    columns = {field: _make_column(hints[field]) for field in hints if field not in common}
    row = type(f"{record.__name__}Row", (Versioned,), {"__tablename__": table, **columns})
    return Noun(name=name, table=row, record=record)


def _make_column(hint: object) -> MappedColumn[object]:
    if hint in _PLAIN:
        return mapped_column(_PLAIN[hint], nullable=False)
    _, kind, *more = get_args(hint)
    keys = [key for key in more if isinstance(key, ForeignKey)]
    return mapped_column(kind, *keys, index=True if INDEXED in more else None, nullable=False)


ROBOT: Final = _make_noun("robot", "robots", RobotRecord)
TOOL: Final = _make_noun("tool", "tools", ToolRecord)
CELL: Final = _make_noun("cell", "cells", CellRecord)
MEASUREMENT: Final = _make_noun("measurement", "measurement_sets", MeasurementRecord)
MODEL: Final = _make_noun("model", "models", ModelRecord)
REGISTRATION: Final = _make_noun("registration", "registrations", RegistrationRecord)
PROGRAM: Final = _make_noun("program", "programs", ProgramRecord)
DOCUMENT: Final = _make_noun("document", "documents", DocumentRecord)
DRIFT_CHECK: Final = _make_noun("drift-check", "drift_checks", DriftCheckRecord)
NOUNS: Final[dict[str, Noun[ItemRecord]]] = {
    noun.name: noun
    for noun in (
        ROBOT, TOOL, CELL, MEASUREMENT, MODEL, REGISTRATION, PROGRAM, DOCUMENT, DRIFT_CHECK,
    )
}  # fmt: skip


def noun_of(name: str) -> Noun[ItemRecord]:
    """Returns the noun of a name.

    Raises:
        ConfigurationError: There is none.
    """
    if name not in NOUNS:
        raise ConfigurationError(f"{name!r} is no noun, expected {', '.join(NOUNS)}.")
    return NOUNS[name]
