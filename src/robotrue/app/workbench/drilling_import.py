"""Imports of the page Drilling: a campaign with its foot, a model, a journal."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from robotrue.core.units import DEG, MM
from robotrue.drilling.campaign_checks import check_campaign
from robotrue.drilling.campaign_csv import read_campaign
from robotrue.drilling.drill_defaults import CAMPAIGN, JOURNAL, MODEL
from robotrue.drilling.evaluate import model_document
from robotrue.drilling.foot_file import read_foot
from robotrue.drilling.journal_lines import whole_lines
from robotrue.drilling.model_archive import read_model
from robotrue.errors import ConfigurationError
from robotrue.store import documents, items
from robotrue.store.model_file import SUFFIXES
from robotrue.store.nouns import DOCUMENT, DocumentRecord
from robotrue.store.records import ItemQuery
from robotrue.store.workspace import Workspace

FOOT: Final = ".toml"
JOURNALS: Final = (".jsonl", ".ndjson")


def import_drilling(workspace: Workspace, paths: Sequence[Path], name: str) -> DocumentRecord:
    """Returns the record of what files turn out to be: a campaign, a model or a journal.

    Raises:
        ConfigurationError: Files that make none of these together.
        FormatError: A file that cannot be read.
        ImplausibleDataError: Readings that are impossible for this foot.
    """
    feet = [path for path in paths if path.suffix.lower() == FOOT]
    others = [path for path in paths if path not in feet]
    if len(others) != 1 or len(feet) > 1:
        raise ConfigurationError(
            f"{len(paths)} files, expected one campaign with its foot.toml, one model or one "
            "journal.",
            hint="drop foot.toml and the campaign together.",
        )
    (main,) = others
    with TemporaryDirectory() as place:
        if main.suffix.lower() in SUFFIXES:
            kind, detail = MODEL, _model(main)
        elif main.suffix.lower() in JOURNALS:
            kind, detail = JOURNAL, _journal(main)
        else:
            feet = feet or _known_foot(workspace, Path(place))
            kind, detail = CAMPAIGN, _campaign(main, feet[0])
        files = [*feet, main] if kind == CAMPAIGN else [main]
        return documents.add(workspace, kind, name=name or main.stem, files=files, detail=detail)


def _known_foot(workspace: Workspace, place: Path) -> list[Path]:
    """The foot file of the newest campaign: a cell has one foot."""
    query = ItemQuery(where={"kind": CAMPAIGN}, limit=1)
    for record in items.search(workspace, DOCUMENT, query).items:
        for each in record.files("file"):
            if each.name.lower().endswith(FOOT):
                return [Path(shutil.copyfile(workspace.path_of(each.sha256), place / each.name))]
    raise ConfigurationError(
        "a campaign without its foot file.",
        hint="drop foot.toml together with it: it states the places of the sensors and the size "
        "of a count.",
    )


def _campaign(path: Path, foot: Path) -> dict[str, object]:
    setup = read_foot(foot)
    order = "AB" if setup.head is None else setup.head.order
    data, digest = read_campaign(path, setup, order)
    check_campaign(setup.foot, data)
    clamps = data.clamps
    return {
        "clamps": len(data),
        "force_N": [float(clamps.force.min()), float(clamps.force.max())],
        "z_mm": [float(clamps.height.min() / MM), float(clamps.height.max() / MM)],
        "tilt_deg": float(np.hypot(*data.tilt.T).max() / DEG),
        "sensors": len(setup.foot.radius),
        "sha256": digest,
        "simulated": data.provenance.simulated,
    }


def _model(path: Path) -> dict[str, object]:
    return {**model_document(read_model(path)), "terms": []}


def _journal(path: Path) -> dict[str, object]:
    entries, _ = whole_lines(path.read_bytes(), source=path.name)
    if not entries:
        raise ConfigurationError("a journal without a line.", source=path.name)
    holes = len({entry.hole for entry in entries})
    simulated = any(entry.document.get("simulated") is True for entry in entries)
    return {"holes": holes, "entries": len(entries), "simulated": simulated}
