"""The cell in three dimensions: arm, frames, measured errors, predicted error around them."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.cell.config import parse_cell
from robotrue.core.arrays import Array
from robotrue.core.regions import CubeRegion
from robotrue.core.rotations import abc_from_matrix
from robotrue.errors import ReachError
from robotrue.measurement.measurement_set import concatenate
from robotrue.robot.forward import forward
from robotrue.store import items, measurements, models
from robotrue.store.nouns import CELL, MEASUREMENT, MODEL
from robotrue.store.workspace import Workspace
from robotrue.validation.error_map import error_map
from robotrue.validation.evaluation import Evaluation, evaluate
from robotrue.web.questions.body import body_document
from robotrue.web.questions.marks import from_simulation
from robotrue.web.questions.packing import answer, packed

MOST_ARROWS: Final = 2000
"""Poses shown; of more, every so manieth."""
GRID: Final = (10, 8, 6)
"""Points along x, y, z at which the predicted error is asked."""
SLACK: Final = 0.02
"""m that the field goes beyond the measured poses."""


def cell_scene(folder: str, cell_id: str, version: int) -> bytes:
    """Returns a cell without a model: arm and frames."""
    with Workspace.open(folder) as workspace:
        record = items.get(workspace, CELL, cell_id, version=version)
        (file,) = record.files("cell")
        cell = parse_cell(workspace.content(file.sha256), workspace.path_of(file.sha256))
    middle = cell.robot.limits.mean(axis=1) if np.isfinite(cell.robot.limits).all() else None
    joints = np.zeros(cell.robot.dof) if middle is None else middle
    return answer({"robot": body_document(cell, joints[None]), "frames": _frames(cell)})


def model_scene(folder: str, model_id: str, version: int) -> bytes:
    """Returns a model's cell, its measured errors before and after, and the predicted field."""
    with Workspace.open(folder) as workspace:
        record = items.get(workspace, MODEL, model_id, version=version)
        held = models.model_of(workspace, record)
        rows = [
            measurements.rows_of(
                workspace, items.get(workspace, MEASUREMENT, to.id, version=to.version)
            )
            for to in record.linked("data")
        ]
    cell, model = held.cell, held.model
    document: dict[str, Any] = {
        "frames": _frames(cell),
        "model": {"name": record.name, "version": record.version, "method": record.method},
        "simulated": from_simulation(model, rows),
    }
    if not rows:
        joints = _posture(cell, model)
        return answer({**document, "robot": body_document(cell, joints[None])})
    seen = evaluate(model, concatenate(rows), payload=cell.payload)
    shown = np.unique(
        np.linspace(0, len(seen.measured) - 1, min(len(seen.measured), MOST_ARROWS)).astype(int)
    )
    joints = seen.measured.joints[shown]
    return answer(
        {
            **document,
            "robot": body_document(cell, joints),
            "points": {
                "position": packed(seen.measured.position[shown]),
                "before": packed(seen.before[shown]),
                "after": packed(seen.after[shown]),
                "joints_deg": packed(np.degrees(joints)),
                "row": shown + 1,
                "of": len(seen.measured),
            },
            "field": _field(cell, model, seen),
        }
    )


def _frames(cell: Cell) -> list[dict[str, Any]]:
    frames = [("base", np.eye(4))]
    if cell.part is not None:
        frames += [(frame.name, frame.T_base_part) for frame in cell.part.frames]
    elif not np.allclose(cell.T_base_frame, np.eye(4)):
        frames.append(("frame", cell.T_base_frame))
    if cell.tracker_place is not None:
        place = np.eye(4)
        place[:3, 3] = cell.tracker_place
        frames.append(("tracker", place))
    return [{"name": name, "T_base_frame": T} for name, T in frames]


def _posture(cell: Cell, model: ErrorModel) -> Array:
    seen = np.asarray(model.training_summary().get("joint_range_rad", ()), dtype=np.float64)
    return np.asarray(seen.mean(axis=0)) if seen.size else np.zeros(cell.robot.dof)


def _field(cell: Cell, model: ErrorModel, seen: Evaluation) -> dict[str, Any] | None:
    """The predicted error in the box of the measured poses, at the attitude of its middle one."""
    points = seen.measured.position
    low, high = points.min(axis=0) - SLACK, points.max(axis=0) + SLACK
    middle = int(np.argmin(np.linalg.norm(points - np.median(points, axis=0), axis=1)))
    near = seen.measured.joints[middle]
    attitude = abc_from_matrix(forward(model.robot.nominal(), near[None])[0, :3, :3])
    x, y, z = ((float(a), float(b)) for a, b in zip(low, high, strict=True))
    try:
        found = error_map(
            model, CubeRegion(x=x, y=y, z=z), GRID, tool_abc=attitude, attitude="turning",
            sectors=1, near=near, load=cell.payload,
        )  # fmt: skip
    except ReachError:
        return None
    able = found.reachable
    return {
        "position": packed(found.point[able]),
        "error_m": packed(found.norm[able]),
        "bound_m": packed(found.bound[able]),
        "cell_m": [(b - a) / max(k - 1, 1) for (a, b), k in zip((x, y, z), GRID, strict=True)],
    }
