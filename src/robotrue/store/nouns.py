"""The nouns of the store: the table and the record of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

from robotrue.errors import ConfigurationError
from robotrue.store import records, schema

R = TypeVar("R", bound=records.Record)


@dataclass(frozen=True, slots=True, kw_only=True)
class Noun(Generic[R]):
    """One noun.

    Attributes:
        name: As commands and links call it.
        table: Where its versions stand.
        record: What they are read as.
    """

    name: str
    table: type[schema.Versioned]
    record: type[R]


ROBOT: Final = Noun(name="robot", table=schema.RobotRow, record=records.RobotRecord)
TOOL: Final = Noun(name="tool", table=schema.ToolRow, record=records.ToolRecord)
CELL: Final = Noun(name="cell", table=schema.CellRow, record=records.CellRecord)
MEASUREMENT: Final = Noun(
    name="measurement", table=schema.MeasurementRow, record=records.MeasurementRecord
)
MODEL: Final = Noun(name="model", table=schema.ModelRow, record=records.ModelRecord)
REGISTRATION: Final = Noun(
    name="registration", table=schema.RegistrationRow, record=records.RegistrationRecord
)
PROGRAM: Final = Noun(name="program", table=schema.ProgramRow, record=records.ProgramRecord)
DOCUMENT: Final = Noun(name="document", table=schema.DocumentRow, record=records.DocumentRecord)
DRIFT_CHECK: Final = Noun(
    name="drift-check", table=schema.DriftCheckRow, record=records.DriftCheckRecord
)
NOUNS: Final[dict[str, Noun[Any]]] = {
    noun.name: noun
    for noun in (
        ROBOT, TOOL, CELL, MEASUREMENT, MODEL, REGISTRATION, PROGRAM, DOCUMENT, DRIFT_CHECK,
    )
}  # fmt: skip


def noun_of(name: str) -> Noun[Any]:
    """Returns the noun of a name.

    Raises:
        ConfigurationError: There is none.
    """
    if name not in NOUNS:
        raise ConfigurationError(f"{name!r} is no noun, expected {', '.join(NOUNS)}.")
    return NOUNS[name]
