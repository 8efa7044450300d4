"""Data doctor in operations: it warns beside a result, and cures rows on request."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robotrue.app.context import Context
from robotrue.app.file_contents import measurement_document
from robotrue.app.presentation import Facts, Note, PlainResult
from robotrue.app.request import Reference
from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.core.units import MM
from robotrue.errors import ImplausibleDataError, RobotrueError
from robotrue.measurement.measurement_set import MeasurementSet, concatenate
from robotrue.measurement.plausibility import FEWEST_POSES, check_plausible
from robotrue.planning.information import settings_of
from robotrue.robot.forward import forward
from robotrue.validation.doctor import (
    Diagnosis,
    NamedCause,
    cure_rows,
    describe_diagnosis,
    diagnose,
    diagnosis_document,
    with_cure,
    with_findings,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExaminedRows:
    """Rows for a fit, with the findings of the data doctor.

    Attributes:
        rows: To be fitted.
        warnings: A sentence for each cause that was found and not corrected.
        raw: As read.
        cured: Corrected rows; None without ``--cure``.
    """

    rows: MeasurementSet
    warnings: list[str]
    raw: MeasurementSet
    cured: NamedCause | None

    def mark(self, model: ErrorModel) -> ErrorModel:
        """Returns the model with all this in its summary, and a cure in its lineage."""
        marked = with_findings(model, self.warnings)
        return marked if self.cured is None else with_cure(marked, self.cured, self.raw)


def read_examined(
    cell: Cell,
    references: Sequence[Reference],
    mapping: Path | None,
    cure: str | None,
    context: Context,
) -> ExaminedRows:
    """Returns the rows of a fit, corrected if a cure is named.

    Raises:
        ImplausibleDataError: Rows that are impossible for this robot; it names the cause if there
            is one.
        ConfigurationError: A cure that does not fit the rows.
    """
    if cure is None:
        try:
            rows = context.measurements(cell, references, mapping)
        except ImplausibleDataError as cause:
            raise _explain_refusal(cause, cell, references, mapping, context) from cause
        warnings = find_warnings(cell, rows)
        return ExaminedRows(rows=rows, warnings=warnings, raw=rows, cured=None)
    raw = _read_raw(cell, references, mapping, context)
    cured, finding = cure_rows(cell.measured_robot, raw, settings_of(cell), cure)
    robot = cell.measured_robot
    points = forward(robot, cured.joints)[:, :3, 3]
    for remark in check_plausible(cured, points, robot.reach, minimum=FEWEST_POSES):
        context.note(remark)
    context.inform(f"{len(cured)} of {len(raw)} poses after --cure {cure}; the files are untouched")
    return ExaminedRows(rows=cured, warnings=find_warnings(cell, cured), raw=raw, cured=finding)


def find_warnings(cell: Cell, rows: MeasurementSet) -> list[str]:
    """Returns a sentence for each cause that the data doctor finds."""
    diagnosis = examine_rows(cell, rows)
    return [] if diagnosis is None else describe_diagnosis(diagnosis, rows)


def examine_rows(cell: Cell, rows: MeasurementSet) -> Diagnosis | None:
    """Returns the diagnosis of rows; None where they are nothing it can examine."""
    stations = np.unique(rows.station, return_counts=True)[1]
    places = not rows.position.any(axis=1).all()
    if rows.rail is not None:  # its errors would be taken for faults of the rows
        return None
    if rows.dof != cell.robot.dof or places or stations.min(initial=FEWEST_POSES) < FEWEST_POSES:
        return None
    try:
        return diagnose(cell.measured_robot, rows, settings_of(cell))
    except (RobotrueError, np.linalg.LinAlgError):  # a second opinion never stops the first
        return None


def inspect_measurements(
    path: Path, cell_file: Path, mapping: Path | None, context: Context
) -> PlainResult:
    """Returns the content of a measurement file and the faults found in it."""
    cell = context.cell(cell_file)
    rows = context.unchecked_rows(cell, path, mapping)
    diagnosis = examine_rows(cell, rows)
    document = measurement_document(rows)
    if diagnosis is None:
        lines = [
            "data doctor: too few rows of a tracker station, rows along a rail, or other joints "
            "than the cell's."
        ]
        return PlainResult(
            values=document, shown=tuple(map(Note, lines)), provenance=rows.provenance
        )
    lines = describe_diagnosis(diagnosis, rows)
    facts = Facts(
        title=f"{path.name}: data doctor",
        rows=(
            ("rows", f"{diagnosis.rows}, {diagnosis.examined} examined"),
            ("a row predicted from the others", f"{diagnosis.error / MM:.3f} mm on average"),
            ("causes found", str(len(lines)) if lines else "none"),
        ),
    )
    return PlainResult(
        values={**document, "doctor": diagnosis_document(diagnosis, rows)},
        shown=(facts, *map(Note, lines)),
        provenance=rows.provenance,
    )


def _read_raw(
    cell: Cell, references: Sequence[Reference], mapping: Path | None, context: Context
) -> MeasurementSet:
    return concatenate([context.unchecked_rows(cell, each, mapping) for each in references])


def _explain_refusal(
    cause: ImplausibleDataError,
    cell: Cell,
    references: Sequence[Reference],
    mapping: Path | None,
    context: Context,
) -> ImplausibleDataError:
    """The refusal, with the cause if the data doctor knows it."""
    try:
        rows = _read_raw(cell, references, mapping, context)
    except RobotrueError:
        return cause
    lines = find_warnings(cell, rows)
    if not lines:
        return cause
    hint = " ".join([cause.hint or "", *lines]).strip()
    return ImplausibleDataError(cause.message, source=cause.source, line=cause.line, hint=hint)
