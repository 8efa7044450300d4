"""The cell in three dimensions: arm, frames, errors measured and predicted, poses of a plan."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.app.workbench.arm_body import answer, body_document, choose_posture, pack_floats
from robotrue.app.workbench.file_imports import cell_of
from robotrue.app.workbench.model_views import evaluate_set, from_simulation
from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.cell.obstacles import Box, Sphere
from robotrue.core.arrays import Array
from robotrue.core.poses import inverse
from robotrue.core.regions import CubeRegion
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ReachError
from robotrue.measurement.measurement_set import concatenate
from robotrue.planning.arm_scene import scene_of
from robotrue.robot.configuration import controller_axes
from robotrue.robot.forward import forward
from robotrue.store import items, measurements, models
from robotrue.store.nouns import CELL, DOCUMENT, MODEL
from robotrue.store.workspace import Workspace
from robotrue.validation.error_map import error_map
from robotrue.validation.evaluation import Evaluation, evaluate

MOST_ARROWS: Final = 2000
"""Poses shown; of more, every so manieth."""
GRID: Final = (10, 8, 6)
"""Points along x, y, z at which the error is predicted."""
SLACK: Final = 0.02
"""m that the field goes beyond the measured poses."""


def draw_cell(workspace: Workspace, cell_id: str, version: int) -> bytes:
    """Returns a cell without a model: arm and frames."""
    cell = cell_of(workspace, items.get(workspace, CELL, cell_id, version=version))
    return answer({
        "robot": body_document(cell, choose_posture(cell.robot)[None]),
        "frames": _frame_documents(cell),
        "trackers": _tracker_places(cell),
        "obstacles": _obstacle_documents(cell),
    })  # fmt: skip


def draw_model(workspace: Workspace, model_id: str, version: int) -> bytes:
    """Returns a model's cell, its measured errors before and after, and the predicted field."""
    record = items.get(workspace, MODEL, model_id, version=version)
    held = models.model_of(workspace, record)
    rows = measurements.read_data(workspace, record)
    document = {
        "frames": _frame_documents(held.cell),
        "trackers": _tracker_places(held.cell, held.model),
        "obstacles": _obstacle_documents(held.cell),
        "simulated": from_simulation(held.model, rows),
    }
    if not rows:
        joints = _posture(held.cell, held.model)
        return answer({**document, "robot": body_document(held.cell, joints[None])})
    seen = evaluate(held.model, concatenate(rows), payload=held.cell.payload)
    field = _field(held.cell, held.model, seen)
    return answer({**document, **_points(held.cell, seen), "field": field})


def draw_measurement(
    workspace: Workspace, set_id: str, version: int, model_id: str, model_version: int
) -> bytes:
    """Returns measured errors of a set before and after, by a model that need not know the set."""
    held = models.model_of(workspace, items.get(workspace, MODEL, model_id, version=model_version))
    rows, seen = evaluate_set(workspace, set_id, version, held)
    simulated = from_simulation(held.model, [rows])
    document = {
        "frames": _frame_documents(held.cell),
        "trackers": _tracker_places(held.cell, held.model),
        "obstacles": _obstacle_documents(held.cell),
        "simulated": simulated,
    }
    return answer({**document, **_points(held.cell, seen)})


def _points(cell: Cell, seen: Evaluation) -> dict[str, object]:
    n = len(seen.measured)
    shown = np.unique(np.linspace(0, n - 1, min(n, MOST_ARROWS)).astype(int))
    joints = seen.measured.joints[shown]
    return {
        "robot": body_document(cell, joints),
        "points": {
            "position": pack_floats(seen.measured.position[shown]),
            "before": pack_floats(seen.before[shown]),
            "after": pack_floats(seen.after[shown]),
            "axes_deg": pack_floats(np.degrees(controller_axes(cell.robot, joints))),
            "row": shown + 1,
            "of": n,
        },
    }


def _frame_documents(cell: Cell) -> list[dict[str, object]]:
    """Returns the frames of a cell by name: base, part frames or work frame."""
    frames = [("base", np.eye(4))]
    if cell.part is not None:
        frames += [(frame.name, frame.T_base_part) for frame in cell.part.frames]
    elif not np.allclose(cell.T_base_frame, np.eye(4)):
        frames.append(("frame", cell.T_base_frame))
    return [{"name": name, "T_base_frame": T} for name, T in frames]


def _tracker_places(cell: Cell, model: ErrorModel | None = None) -> list[Array]:
    """Returns where instruments stand, (3,) m in base: as a model estimated, else as stated."""
    belief = None if model is None else model.belief()
    estimated = [] if belief is None else list(belief.T_tracker_base.values())
    if estimated:
        return [inverse(T)[:3, 3] for T in estimated]
    return [] if cell.tracker_place is None else [cell.tracker_place]


def _obstacle_documents(cell: Cell) -> list[dict[str, object]]:
    """Returns the obstacles of a cell as its 3-D view draws them: m, robot base."""
    documents: list[dict[str, object]] = []
    for body in cell.obstacles:
        if isinstance(body, Box):
            shape: dict[str, object] = {"low": body.low, "high": body.high}
        elif isinstance(body, Sphere):
            shape = {"centre": body.centre, "radius": body.radius}
        else:
            shape = {"point": body.point, "normal": body.normal}
        documents.append({"name": body.name, **shape})
    return documents


def _posture(cell: Cell, model: ErrorModel) -> Array:
    seen = model.training_summary().joint_range
    return choose_posture(cell.robot) if seen is None else np.asarray(seen.mean(axis=0))


def _field(cell: Cell, model: ErrorModel, seen: Evaluation) -> dict[str, object] | None:
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
        "position": pack_floats(found.point[able]),
        "error_m": pack_floats(found.norm[able]),
        "bound_m": pack_floats(found.bound[able]),
        "cell_m": [(b - a) / max(k - 1, 1) for (a, b), k in zip((x, y, z), GRID, strict=True)],
    }


KIND = "plan"


def show_plan(workspace: Workspace, plan_id: str, version: int) -> bytes:
    """Returns a plan as it was made, its scene, and how the instrument sees each pose."""
    record = items.get(workspace, DOCUMENT, plan_id, version=version)
    if record.kind != KIND:
        raise ConfigurationError(f"{record.name!r} is a {record.kind}, not a plan.")
    (to,) = record.refs("cell")
    cell = cell_of(workspace, items.get(workspace, CELL, to.id, version=to.version))
    used = [
        items.get(workspace, MODEL, each.id, version=each.version) for each in record.refs("model")
    ]
    simulated = any(from_simulation(models.model_of(workspace, each).model) for each in used)
    detail = dict(record.detail)
    joints = np.asarray(detail["joints_deg"], dtype=np.float64) * DEG
    axes = controller_axes(cell.robot, joints) / DEG
    return answer(
        {
            **detail,
            "simulated": simulated,
            "model": used[0].name if used else "",
            "cell": cell.robot.name,
            "axes_deg": axes,
            "visibility": _visibility(cell, joints),
            "scene": {
                "robot": body_document(cell, joints),
                "frames": _frame_documents(cell),
                "trackers": _tracker_places(cell),
                "obstacles": _obstacle_documents(cell),
                "simulated": simulated,
                "points": {
                    "position": pack_floats(np.asarray(detail["commanded_mm"]) * MM),
                    "axes_deg": pack_floats(axes),
                    "row": np.arange(1, len(joints) + 1),
                    "of": len(joints),
                    "seen_from": cell.tracker_place,
                },
            },
        }
    )


def _visibility(cell: Cell, joints: Array) -> dict[str, object]:
    """Distance (m) and angle (deg) off the reflector's axis of each pose, where they are known."""
    place, axis = cell.tracker_place, cell.target_axis
    out: dict[str, object] = {
        "tracker": place is not None,
        "axis": axis is not None,
        "acceptance_deg": cell.acceptance / DEG if axis is not None else None,
        "obstacles": len(cell.obstacles),
        "links": cell.link_radius is not None,
        "distance_m": None,
        "angle_deg": None,
    }
    if place is None:
        return out
    _, reflector, turn = scene_of(cell, clearance=0.0).tubes(joints)
    ray = place - reflector
    distance = np.linalg.norm(ray, axis=1)
    out["distance_m"] = distance
    if axis is not None:
        cosine = np.einsum("ni,ni->n", turn @ axis, ray / distance[:, None])
        out["angle_deg"] = np.arccos(np.clip(cosine, -1.0, 1.0)) / DEG
    return out
