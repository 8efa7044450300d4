"""A few poses measured again become a measurement set, in the cell a model belongs to."""

from __future__ import annotations

import json
from pathlib import Path

from robotrue.store import items, measurements, models
from robotrue.store.nouns import MODEL
from robotrue.store.workspace import Workspace
from robotrue.validation.drift_defaults import FEWEST
from robotrue.web.api.documents import record_document
from robotrue.web.questions.intake import read_sets
from robotrue.web.questions.packing import answer


def add_poses(folder: str, paths: str, name: str, model_id: str) -> bytes:
    """Returns the record of check poses taken in; fewer are enough than for a calibration.

    Args:
        folder: Of the workspace.
        paths: JSON list of files.
        name: In the workspace; empty: that of the first file.
        model_id: Whose cell they were measured in.
    """
    found = [Path(each) for each in json.loads(paths)]
    with Workspace.open(folder) as workspace:
        record = items.get(workspace, MODEL, model_id)
        cell = models.model_of(workspace, record).cell
        rows, remarks = read_sets(cell, found, None, minimum=FEWEST)
        cells = record.refs("cell")
        stored = measurements.add(
            workspace,
            rows,
            name=name or found[0].stem,
            raw=found,
            cell=cells[0] if cells else None,
            detail={"remarks": remarks, "mapping": None},
        )
        return answer(record_document(stored, "measurement"))
