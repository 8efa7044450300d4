"""A session at the part on the screen: the next feature, its expected reading, the progress."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.app.touch_settings import settings_for_touches
from robotrue.app.workbench.arm_body import answer, controller_angles
from robotrue.app.workbench.probing_entry import worst_place
from robotrue.app.workbench.probing_state import (
    Opened,
    belief_after,
    fit_readings,
    open_session,
    places,
    select_trusted,
    touches_of,
)
from robotrue.calibration.probing import before_touching
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.poses import pose
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.measurement.touch_session import TouchReading
from robotrue.planning.expectation import NextTouch, next_touch
from robotrue.planning.probing import Machining, ProbingTask
from robotrue.robot.forward import forward
from robotrue.robot.inverse_numeric import solve
from robotrue.store.registrations import result_of
from robotrue.store.workspace import Workspace
from robotrue.validation.registered_part import FoundFrame, RegisteredPart
from robotrue.validation.registration_frame import tips
from robotrue.validation.touch_expectation import TouchBelief, expected_readings

PROPOSED: Final = -1
"""Returns the feature with the highest information gain."""


def show_probing(workspace: Workspace, id: str, version: int, feature: int) -> bytes:
    """Returns the whole page of a session.

    Args:
        workspace: Of the session.
        id: Of the session.
        version: Of it.
        feature: Next feature chosen by the user; -1: the proposed one.
    """
    at = open_session(workspace, id, version)
    session = at.session
    found, waiting = fit_readings(at, session.kept)
    believed = select_trusted(at, session.kept, found)
    known = belief_after(at, believed)
    worst, radius, radii = worst_place(at, known)
    wanted = session.held.feature if session.held is not None else feature
    if not PROPOSED <= wanted < len(session.features):
        raise ConfigurationError(f"feature {wanted + 1} of {len(session.features)}.")
    return answer(
        {
            "id": at.record.id,
            "version": at.record.version,
            "name": at.record.name,
            "note": at.record.note,
            "deleted": at.record.deleted,
            "result": result_of(at.record),
            "reads": session.reads,
            "axes": _axis_names(at),
            "settings": dict(session.settings),
            "simulated": session.simulated,
            "cell": at.cell_record.name,
            "robot": at.cell.robot.name,
            "model": None if at.model_record is None else at.model_record.name,
            "parts": list(session.parts),
            "features": _features(at, found, radii),
            "readings": [_describe_reading(each) for each in session.readings],
            "kept": len(session.kept),
            "next": _next(at, known, believed, wanted),
            "held": None if session.held is None else _describe_reading(session.held),
            "known": {"radius_mm": radius, "feature": worst},
            "curve_mm": [each.radius_mm for each in session.kept],
            "fit": None if found is None else _fit(found),
            "waiting": None if waiting is None else _error(waiting),
        }
    )


def _axis_names(at: Opened) -> list[str]:
    if not at.joints:
        return ["X", "Y", "Z"]
    letter = "A" if at.session.settings["axes"] == "controller" else "J"
    return [f"{letter}{k + 1}" for k in range(at.cell.robot.dof)]


def _describe_reading(each: TouchReading) -> dict[str, object]:
    return {
        "feature": each.feature,
        "state": each.state,
        "values": each.values,
        "text": each.text,
        "at": each.at,
        "sigmas": each.sigmas,
        "off_mm": each.off_mm,
        "suspicions": [dict(why) for why in each.suspicions],
    }


def _features(
    at: Opened, found: RegisteredPart | None, radii: dict[int, float]
) -> list[dict[str, object]]:
    session = at.session
    state = dict.fromkeys(range(len(session.features)), "open")
    for each in session.readings:
        if each.state in ("kept", "held", "skipped"):
            state[each.feature] = each.state
    left = {} if found is None else _residuals(at, found)
    return [
        {
            "name": each.name,
            "part": each.part,
            "point_mm": each.point_mm,
            "surface": each.normal is not None,
            "reachable": bool(each.postures_deg),
            "state": state[k],
            "radius_mm": radii.get(k),
            "residual_mm": left.get(k, (None, True))[0],
            "believed": left.get(k, (None, True))[1],
        }
        for k, each in enumerate(session.features)
    ]


def _residuals(at: Opened, found: RegisteredPart) -> dict[int, tuple[float, bool]]:
    """Returns the residual, mm, and whether the reading was accepted, by feature."""
    rows = {frame.name: 0 for frame in found.frames}
    frames = {frame.name: frame for frame in found.frames}
    out = {}
    for each in at.session.kept:
        part = at.session.parts[at.session.features[each.feature].part]
        fit, n = frames[part].registration, rows[part]
        out[each.feature] = (float(fit.distances[n] / MM), bool(fit.believed[n]))
        rows[part] += 1
    return out


def _next(
    at: Opened, known: TouchBelief, believed: tuple[TouchReading, ...], wanted: int
) -> dict[str, object] | None:
    session = at.session
    rows = [
        (k, which)
        for k, each in enumerate(session.features)
        for which in range(len(each.postures_deg))
    ]
    able = np.asarray([(k == wanted) if wanted >= 0 else k in session.open for k, _ in rows])
    brings: NextTouch | None = None
    if not able.any():
        if wanted < 0:
            left = [k for k in session.open if not at.joints]
            if not left:
                return None
            wanted = left[0]
        chosen = (wanted, 0)
    else:
        brings = _best(at, rows, able, believed)
        chosen = rows[brings.index]
    return _describe_touch(at, known, chosen, brings)


def _best(
    at: Opened, rows: list[tuple[int, int]], able: BoolArray, believed: tuple[TouchReading, ...]
) -> NextTouch:
    words = at.words
    settings = settings_for_touches(at.cell, at.arm, words.touch_sigma_mm, words.tool_sigma_mm)
    work = places(at, [(k, 0) for k, each in enumerate(at.session.features) if each.postures_deg])
    touched = touches_of(at, believed) if at.joints else _as_planned(at, believed)
    task = ProbingTask(
        belief=before_touching(at.arm, settings),
        T_base_part=at.rough,
        candidates=places(at, rows),
        machining=Machining(
            group=("part",) * len(work), point=work.point, joints=work.joints, part=work.part,
            load=at.cell.payload,
        ),
        touch_sigma=settings.touch_sigma,
        touch_load=at.cell.payload,
    )  # fmt: skip
    return next_touch(task, touched, allowed=able)


def _as_planned(at: Opened, readings: tuple[TouchReading, ...]) -> ProbingSet | None:
    """Touches in the postures planned for them, where only positions were read."""
    able = [each.feature for each in readings if at.session.features[each.feature].postures_deg]
    return places(at, [(k, 0) for k in able]) if able else None


def _describe_touch(
    at: Opened, known: TouchBelief, chosen: tuple[int, int], brings: NextTouch | None
) -> dict[str, object]:
    k, _ = chosen
    feature = at.session.features[k]
    touch = places(at, [chosen])
    if at.joints and not touch.has_joints:
        return {"feature": k, "unreachable": True}
    expected = expected_readings(known, touch)
    out: dict[str, object] = {
        "feature": k,
        "unreachable": not feature.postures_deg,
        "expected": {
            "xyz_mm": expected.position[0] / MM,
            "band_mm": float(expected.band[0] / MM),
        },
        "gain": None
        if brings is None
        else {"now_mm": brings.now / MM, "then_mm": brings.then / MM},
    }
    if touch.has_joints:
        out |= _find_joints(at, known, touch.joints[0], expected.position[0], feature.part)
    return out


def _find_joints(
    at: Opened, known: TouchBelief, planned: Array, tip: Array, part: int
) -> dict[str, object]:
    """Joints at which the tip should meet the feature, in the planned attitude, and the pose."""
    robot = at.cell.robot.nominal()
    there = forward(robot, planned[None])[0]
    shown = tips(at.arm, planned[None], at.settings)[0] - there[:3, 3]  # what the model adds
    target = pose(there[:3, :3], tip - shown)
    found = solve(robot, target[None], planned[None])
    joints = found.joints[0] if found.converged[0] else planned
    axes = joints
    if at.session.settings["axes"] == "controller":
        axes = robot.controller.to_controller(joints)
    now = forward(robot, joints[None])[0]
    printed = controller_angles(now[None, :3, :3])
    towards = known.T_base_part[part][:3, :3].T @ now[:3, :3] @ at.tip_axis
    main = int(np.argmax(np.abs(towards)))
    return {
        "joints_deg": axes / DEG,
        "reached": bool(found.converged[0]),
        "pose": {
            "xyz_mm": now[:3, 3] / MM,
            "orientation": {name: rows[0] for name, rows in printed.items()},
        },
        "approach": {
            "axis": f"{'+' if towards[main] > 0 else '-'}{'xyz'[main]}",
            "off_deg": float(np.arccos(min(1.0, abs(float(towards[main])))) / DEG),
        },
    }


def _fit(found: RegisteredPart) -> dict[str, object]:
    return {
        "route": found.route,
        "verdict": found.verdict,
        "moved_mm": found.moved / MM,
        "warnings": list(found.doubts),
        "frames": [_frame(frame) for frame in found.frames],
    }


def _frame(frame: FoundFrame) -> dict[str, object]:
    fit = frame.registration
    T, sd = fit.T_base_part, np.sqrt(np.diag(fit.covariance))
    worst = int(np.argmax(frame.region))
    return {
        "name": frame.name,
        "xyz_mm": T[:3, 3] / MM,
        "abc_deg": abc_from_matrix(T[:3, :3]) / DEG,
        "sd_mm": sd[:3] / MM,
        "sd_deg": sd[3:] / DEG,
        "rms_mm": fit.rms / MM,
        "touches": len(fit.names),
        "outliers": list(fit.outliers),
        "verdict": frame.verdict,
        "reasons": list(frame.reasons),
        "warnings": list(frame.doubts),
        "region_mm": float(frame.region[worst] / MM),
        "region_at": fit.names[worst],
        "with_arm": frame.with_arm,
    }


def _error(error: RobotrueError) -> dict[str, object]:
    return {"message": error.message, "hint": error.hint}
