"""Model files: an error model and the cell it was measured in, in one archive.

A compensated program needs more than the error: the tool, the work frame, the payload. They
travel with the model, so the file alone is enough a year later.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.calibration.archive import check_pose, open_model
from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.core.archive import Archive, archive_reader, read_archive, write_archive
from robotrue.core.files import read_bytes
from robotrue.errors import ArchiveError
from robotrue.measurement.tracker import TrackerSpecification
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load
from robotrue.store.controller_document import controller_document, controller_from_document

CELL_SCHEMA: Final = 1
ZIP: Final = b"PK"
"""First bytes of every model file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelFile:
    """What a model file holds.

    Attributes:
        model: The error model.
        cell: The cell it was measured in.
        archive: The file's content, for whoever wants the raw numbers.
    """

    model: ErrorModel
    cell: Cell
    archive: Archive


def write_model(path: str | Path, model: ErrorModel, cell: Cell) -> None:
    """Writes the model and its cell, whole or not at all.

    Raises:
        FormatError: The file cannot be written.
    """
    archive = model.to_archive()
    document = {**archive.document, "cell": cell_document(cell)}
    write_archive(path, replace(archive, document=document))


def read_model(path: str | Path) -> ModelFile:
    """Returns the model and its cell.

    Raises:
        ArchiveError: Not a model file, damaged, without a cell, or from a newer robotrue.
        FormatError: The file cannot be read.
    """
    if not read_bytes(path).startswith(ZIP):
        raise ArchiveError(
            "not a model file.",
            source=path,
            hint="a model file is what `robotrue calibrate ... -o` writes.",
        )
    archive = read_archive(path)
    model = open_model(archive)
    stated = archive.document.get("cell")
    if not isinstance(stated, Mapping):
        raise ArchiveError(
            "holds a model but no cell.", source=path, hint="calibrate again with a cell.toml."
        )
    return ModelFile(model=model, cell=cell_from_document(stated, model.robot), archive=archive)


def cell_document(cell: Cell) -> dict[str, Any]:
    """Returns the cell without its robot as JSON values, SI."""
    tracker = cell.tracker
    position = cell.tracker_position
    return {
        "schema": CELL_SCHEMA,
        "T_flange_tool": cell.robot.T_flange_tool.tolist(),
        "T_flange_target": cell.T_flange_target.tolist(),
        "target_sigma": cell.target_sigma,
        "T_base_frame": cell.T_base_frame.tolist(),
        "frame": cell.frame,
        "tracker_position": None if position is None else position.tolist(),
        "tracker": {
            "name": tracker.name,
            "range_bound": tracker.range_bound,
            "range_bound_per_m": tracker.range_bound_per_m,
            "angle_bound": tracker.angle_bound,
            "angle_bound_per_m": tracker.angle_bound_per_m,
            "divisor": tracker.divisor,
        },
        "repeatability": cell.repeatability,
        "payload_mass": float(cell.payload.mass[0]),
        "payload_com": cell.payload.com[0].tolist(),
        "compliance_prior": [float(c) if np.isfinite(c) else None for c in cell.compliance_prior],
        "controller": controller_document(cell.controller),
        "doubts": list(cell.doubts),
        "source": Path(cell.source).name,
        "digest": cell.digest,
    }


@archive_reader
def cell_from_document(stated: Mapping[str, Any], robot: RobotModel) -> Cell:
    """Returns the cell from :func:`cell_document` and the nominal robot of the model.

    Raises:
        ArchiveError: The document is incomplete, damaged or of a newer schema.
    """
    if not 1 <= int(stated.get("schema", 0)) <= CELL_SCHEMA:
        raise ArchiveError(
            f"cell schema {stated['schema']}, this robotrue reads up to {CELL_SCHEMA}.",
            hint="update robotrue.",
        )
    position = stated["tracker_position"]
    frames = {n: np.array(stated[n]) for n in ("T_flange_tool", "T_flange_target", "T_base_frame")}
    for name, T in frames.items():
        check_pose(T, name)
    mass, com = float(stated["payload_mass"]), np.array(stated["payload_com"])
    sigma = float(stated["target_sigma"])
    if not (0.0 <= mass < 1e5 and (np.abs(com) < 100.0).all() and 0.0 <= sigma < 10.0):
        raise ArchiveError("payload or target of the cell in this model file cannot be.")
    return Cell(
        robot=robot.nominal().with_tool(frames["T_flange_tool"]),
        T_flange_target=frames["T_flange_target"],
        target_sigma=sigma,
        T_base_frame=frames["T_base_frame"],
        frame=stated["frame"],
        tracker_position=None if position is None else np.array(position),
        tracker=TrackerSpecification(**stated["tracker"]),
        repeatability=stated["repeatability"],
        payload=Load(mass=np.array([mass]), com=com[None]),
        compliance_prior=np.array([np.nan if c is None else c for c in stated["compliance_prior"]]),
        controller=controller_from_document(stated.get("controller", {})),
        doubts=tuple(stated["doubts"]),
        source=stated["source"],
        digest=stated["digest"],
    )
