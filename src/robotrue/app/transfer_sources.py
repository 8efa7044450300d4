"""Sources and target of a transfer on the command line, read from their files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from robotrue.app.context import Context
from robotrue.app.request import Reference
from robotrue.calibration.drift_prior import RELATIONS, Relation
from robotrue.calibration.sources import TransferSource
from robotrue.cell.cell import Cell
from robotrue.core.files import read_bytes
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet, concatenate
from robotrue.store.model_file import ZIP


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedSource:
    """A source as it was stated.

    Attributes:
        name: For messages and the summary.
        path: Measurements or a model.
        relation: Of the source to the target.
    """

    name: str
    path: Path
    relation: Relation


def parse_source(text: str) -> StatedSource:
    """Returns the source of ``NAME=FILE[,relation]``; the relation is ``campaign``.

    Raises:
        ConfigurationError: Another form, or an unknown relation.
    """
    name, equals, rest = text.partition("=")
    file, comma, relation = rest.rpartition(",")
    if not comma or relation not in RELATIONS:
        if comma and relation.isalpha():
            raise ConfigurationError(
                f"relation {relation!r} of source {name!r}, expected {', '.join(RELATIONS)}.",
                hint=f"--source {name}={file},campaign",
            )
        file, relation = rest, "campaign"
    if not (name and equals and file):
        raise ConfigurationError(
            f"source {text!r}, expected NAME=FILE or NAME=FILE,relation.",
            hint="--source march=march.csv,campaign",
        )
    where = next(each for each in RELATIONS if each == relation)
    return StatedSource(name=name, path=Path(file), relation=where)


def read_source(
    cell: Cell, stated: StatedSource, mapping: Path | None, context: Context
) -> TransferSource:
    """Returns what a file says: the model in it, or its rows."""
    name, path, relation = stated.name, stated.path, stated.relation
    workbook = path.suffix.lower().startswith(".xls")
    if read_bytes(path).startswith(ZIP) and not workbook:
        return TransferSource(model=context.model(path).model, relation=relation, name=name)
    rows = context.unchecked_rows(cell, path, mapping)
    poses = count(len(rows), "pose")
    context.inform(f"source {name}: {poses} from {path.name}, relation {relation}")
    return TransferSource(measurements=rows, relation=relation, name=name)


def read_target(
    cell: Cell, references: Sequence[Reference], mapping: Path | None, context: Context
) -> MeasurementSet | None:
    """Returns the target poses, however few: the contest itself doubts them; None without any.

    Raises:
        ModelMismatchError: Files of another number of joints, or in another frame.
    """
    if not references:
        return None
    sets = [context.unchecked_rows(cell, each, mapping) for each in references]
    for reference, rows in zip(references, sets, strict=True):
        if (rows.frame, rows.dof) != (sets[0].frame, sets[0].dof):
            raise ModelMismatchError(
                f"{rows.dof} joints and positions in the {rows.frame} frame, those of "
                f"{context.name(references[0])} {sets[0].dof} and in the "
                f"{sets[0].frame} frame.",
                source=context.name(reference),
                hint="target files of one robot and one frame.",
            )
    joined = concatenate(sets)
    context.inform(f"target: {count(len(joined), 'pose')} from {count(len(sets), 'file')}")
    return joined


def count(number: int, noun: str) -> str:
    """Returns e.g. ``"1 file"`` or ``"2 files"``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"
