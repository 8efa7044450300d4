"""Poses to measure on the screen: where the arm stands in each, and how the instrument sees it."""

from __future__ import annotations

import numpy as np

from robotrue.app.workbench.arm_body import answer, body_document, pack_floats
from robotrue.app.workbench.calibration_view import from_simulation
from robotrue.app.workbench.cell_scene import frame_documents, obstacle_documents
from robotrue.app.workbench.file_imports import cell_of
from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.planning.arm_scene import scene_of
from robotrue.robot.configuration import controller_axes
from robotrue.store import items, models
from robotrue.store.nouns import CELL, DOCUMENT, MODEL
from robotrue.store.workspace import Workspace

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
                "frames": frame_documents(cell),
                "obstacles": obstacle_documents(cell),
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
