"""Sources and target of a transfer: files of a command, items and files of a job."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from robotrue.app.context import Context
from robotrue.app.presentation import count
from robotrue.app.request import Reference
from robotrue.app.transfer_request import TransferRequest
from robotrue.calibration.drift_prior import RELATIONS, Relation
from robotrue.calibration.sources import TransferSource
from robotrue.cell.cell import Cell
from robotrue.core.files import read_bytes
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.measurement.measurement_set import MeasurementSet, concatenate
from robotrue.store.model_file import SUFFIXES, ZIP

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.store.records import Ref
    from robotrue.store.workspace import Transaction

MEASUREMENT: Final = "measurement"
MODEL: Final = "model"


UPDATE: Final[Relation] = "campaign"
"""Relation of a model to poses that update it: the same arm, another time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownSource:
    """A source as it was stated.

    Attributes:
        name: For messages and the summary.
        reference: Measurements or a model.
        noun: Which of them an item is; for a file its content determines it.
        relation: Of the source to the target.
    """

    name: str
    reference: Reference
    noun: str
    relation: Relation

    @property
    def path(self) -> Path | None:
        """Its file; None of an item of a workspace."""
        return self.reference if isinstance(self.reference, Path) else None

    @property
    def is_model(self) -> bool:
        """True for a model, by its noun or by the first bytes of its file."""
        if self.path is None:
            return self.noun == MODEL
        workbook = self.path.suffix.lower().startswith(".xls")
        return read_bytes(self.path).startswith(ZIP) and not workbook


def known_sources(request: TransferRequest, context: Context) -> list[KnownSource]:
    """Returns what is known: the sources of a command, or the model and the items of a job.

    Raises:
        ConfigurationError: A source in another form, or an item that is missing.
    """
    from robotrue.app.workspace_context import require_workspace

    sources = [parse_source(text) for text in request.source]
    sources += [
        KnownSource(name=file.stem, reference=file, noun=MODEL, relation="unit")
        for place in request.fleet
        for file in _find_models(place)
    ]
    if request.model is not None:
        sources.append(_source_of(request.model, MODEL, UPDATE, context))
    stated: dict[Relation, tuple[Reference, ...]] = {
        "region": request.from_region,
        "campaign": request.from_campaign,
        "unit": request.from_unit,
    }
    for relation, references in stated.items():
        for each in references:
            noun = require_workspace(context).noun_of(each, (MEASUREMENT, MODEL))
            sources.append(_source_of(each, noun, relation, context))
    return sources


def _find_models(place: Path) -> list[Path]:
    """The model files of a folder, by name, or the one file.

    Raises:
        ConfigurationError: A folder without a model file.
    """
    if not place.is_dir():
        return [place]
    files = [each for each in sorted(place.iterdir()) if each.suffix in SUFFIXES]
    if not files:
        raise ConfigurationError(
            f"fleet {place}: the folder holds no model file ({', '.join(SUFFIXES)}).",
            hint="--fleet with the folder, or with each file, that calibrate wrote.",
        )
    return files


def _source_of(
    reference: Reference, noun: str, relation: Relation, context: Context
) -> KnownSource:
    from robotrue.app.workspace_context import require_workspace
    from robotrue.store.nouns import NOUNS

    if isinstance(reference, Path):
        return KnownSource(name=reference.stem, reference=reference, noun=noun, relation=relation)
    name = require_workspace(context).record(NOUNS[noun], reference).name
    return KnownSource(name=name, reference=reference, noun=noun, relation=relation)


def parse_source(text: str) -> KnownSource:
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
    return KnownSource(name=name, reference=Path(file), noun=MEASUREMENT, relation=where)


def read_source(
    cell: Cell, stated: KnownSource, mapping: Path | None, context: Context
) -> TransferSource:
    """Returns the content of a source: a model, or its rows."""
    name, relation = stated.name, stated.relation
    if stated.is_model:
        model = context.model(stated.reference).model
        return TransferSource(model=model, relation=relation, name=name)
    rows = context.unchecked_rows(cell, stated.reference, mapping)
    poses = count(len(rows), "pose")
    file = context.name(stated.reference).rpartition("/")[2]
    context.inform(f"source {name}: {poses} from {file}, relation {relation}")
    return TransferSource(measurements=rows, relation=relation, name=name)


def keep_sources(
    into: Transaction,
    known: Sequence[KnownSource],
    cell: Ref | None,
    mapping: Path | None,
    context: WorkspaceContext,
) -> tuple[list[Ref], list[Ref]]:
    """Returns the measurement sets and the models of sources; files that were sent become items."""
    from robotrue.store import models, nouns

    measured = [each.reference for each in known if not each.is_model]
    parents = [
        context.record(nouns.MODEL, each.reference).ref
        if each.path is None
        else models.add(into, each.path, name=each.name, cell=cell).ref
        for each in known
        if each.is_model
    ]
    return context.keep_measured(into, measured, cell, mapping), parents


def read_target(
    cell: Cell, references: Sequence[Reference], mapping: Path | None, context: Context
) -> MeasurementSet | None:
    """Returns the target poses, however few: the contest itself warns of them; None without any.

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
