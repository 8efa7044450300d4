"""``robotrue drill adjust``: from one clamp's readings to one move, of a head or of a robot."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from robotrue.app.registered import opened, provenance_used
from robotrue.calibration.model import ErrorModel
from robotrue.cli.console import emit_facts, emit_json, say, say_mark
from robotrue.core.arrays import Array
from robotrue.core.provenance import Provenance, merge
from robotrue.core.rotations import abc_from_matrix, matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.drilling.adjust import HoleAdjustment, adjustment
from robotrue.drilling.campaign import Clamps
from robotrue.drilling.foot_model import NormalModel
from robotrue.drilling.fragments import gcode, robot_fragment
from robotrue.drilling.head import normal_from_tilt
from robotrue.drilling.model_archive import read_model
from robotrue.drilling.robot_adjust import RobotMove, squaring_joints
from robotrue.errors import ConfigurationError
from robotrue.robot.statics import Load


def run(
    model_path: Path,
    *,
    reading: str,
    force: float,
    z_mm: float,
    at: str | None,
    approach: str,
    robot: Path | None,
    joints_deg: str | None,
    foot_abc_deg: str,
    language: str | None,
    feed_mm_per_min: float,
    as_json: bool,
) -> None:
    """Gives the one move of a clamp."""
    model = read_model(model_path)
    clamps = Clamps(
        readings=numbers(reading, len(model.foot.radius), "--reading", "d1,d2,d3")[None] * MM,
        force=np.array([force]),
        height=np.array([z_mm * MM]),
        approach=(approach,),
    )
    axes = numbers(at or "0,0", 2, "--at", "A,B") * DEG
    found = adjustment(model, clamps, axes)
    if robot is None:
        document = {**_surface(found), "move": _head_move(found), "notes": _notes(found)}
        text = _head_text(language, found, feed_mm_per_min)
    else:
        move = _robot_move(model, found, robot, joints_deg, foot_abc_deg)
        document = {**_surface(found), "robot": _robot_document(move), "notes": [*found.notes]}
        if not move.rotation_known:
            document["notes"].append("the robot's model knows no rotation error: nominal axis.")
        text = robot_fragment(language, move.T_base_tool) if language else ""
    origin = merge(
        [model.provenance, *([] if robot is None else [provenance_used(*opened(robot))])]
    )
    say_mark(origin)
    if as_json:
        emit_json({**document, **({"program": text} if text else {})}, origin)
        return
    _show(document, origin)
    sys.stdout.write(text)


def numbers(text: str, count: int, option: str, form: str) -> Array:
    """Returns the numbers (count,) of a comma separated option.

    Raises:
        ConfigurationError: Another number of them, or one that is not finite.
    """
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.empty(0)
    if len(values) != count or not np.isfinite(values).all():
        raise ConfigurationError(
            f"{option} {text!r}, expected {count} numbers: {form}.", hint=f"{option} {form}"
        )
    return values


def _head_text(language: str | None, found: HoleAdjustment, feed_mm_per_min: float) -> str:
    if language is None:
        return ""
    if language != "gcode":
        raise ConfigurationError(
            f"--as {language} without --robot.", hint="--as gcode, or --robot MODEL --joints-deg."
        )
    return gcode(found.move, feed_mm_per_min=feed_mm_per_min)


def _robot_move(
    model: NormalModel, found: HoleAdjustment, path: Path, joints_deg: str | None, foot_abc_deg: str
) -> RobotMove:
    if joints_deg is None:
        raise ConfigurationError(
            "--robot without --joints-deg: where does the robot stand?",
            hint="--joints-deg J1,J2,J3,J4,J5,J6",
        )
    robot, load, seat = carrying_robot(path, foot_abc_deg)
    joints = numbers(joints_deg, robot.robot.dof, "--joints-deg", "J1,..,J6") * DEG
    normal = normal_from_tilt(model.head.order, found.tilt)
    return squaring_joints(robot, joints, normal, R_tool_foot=seat, load=load)


def carrying_robot(path: Path, foot_abc_deg: str) -> tuple[ErrorModel, Load, Array]:
    """Returns the calibrated robot that carries a foot, its load, and the foot in tool (3, 3).

    Raises:
        ConfigurationError: A cell instead of a calibrated model, or no three angles.
    """
    cell, robot = opened(path, None)
    if robot is None:
        raise ConfigurationError(
            "a cell, not a calibrated model.", source=path, hint="pass a model of `calibrate`."
        )
    seat = matrix_from_abc(numbers(foot_abc_deg, 3, "--foot-abc-deg", "A,B,C") * DEG)
    return robot, cell.payload, seat


def _surface(found: HoleAdjustment) -> dict[str, Any]:
    sigma = np.sqrt(np.diag(found.covariance)) / DEG
    return {
        "a_deg": found.tilt[0] / DEG,
        "b_deg": found.tilt[1] / DEG,
        "a_sigma_deg": sigma[0],
        "b_sigma_deg": sigma[1],
    }


def _head_move(found: HoleAdjustment) -> dict[str, float]:
    move = found.move
    return {
        **{f"{a}_deg": v / DEG for a, v in zip("AB", move.axes.tolist(), strict=True)},
        **{f"d{a}_deg": v / DEG for a, v in zip("AB", move.turn.tolist(), strict=True)},
        **{f"d{a}_mm": v / MM for a, v in zip("XYZ", move.shift.tolist(), strict=True)},
    }


def _robot_document(move: RobotMove) -> dict[str, Any]:
    return {
        "joints_deg": (move.joints / DEG).tolist(),
        "xyz_mm": (move.T_base_tool[:3, 3] / MM).tolist(),
        "abc_deg": (abc_from_matrix(move.T_base_tool[:3, :3]) / DEG).tolist(),
        "turn_deg": move.turn / DEG,
        "rotation_error_known": move.rotation_known,
    }


def _notes(found: HoleAdjustment) -> list[str]:
    if np.isfinite(found.move.shift).all():
        return list(found.notes)
    return [
        *found.notes,
        "X, Y and Z are not known: the foot file of the fit had no [head] with pivot_to_tip_mm.",
    ]


def _show(document: dict[str, Any], origin: Provenance) -> None:
    a, b, sa, sb = (document[k] for k in ("a_deg", "b_deg", "a_sigma_deg", "b_sigma_deg"))
    facts = [("surface", f"a {a:+.4f} +- {sa:.4f} deg, b {b:+.4f} +- {sb:.4f} deg")]
    if "move" in document:
        move = document["move"]
        facts += [
            ("A, B to", f"{move['A_deg']:.4f}, {move['B_deg']:.4f} deg"),
            ("X, Y, Z by", ", ".join(f"{move[f'd{axis}_mm']:+.4f} mm" for axis in "XYZ")),
        ]
    else:
        robot = document["robot"]
        facts += [
            ("joints to", ", ".join(f"{v:.4f}" for v in robot["joints_deg"]) + " deg"),
            ("turned by", f"{robot['turn_deg']:.4f} deg about the tip"),
        ]
    emit_facts("One move", facts, origin)
    for note in document["notes"]:
        say(f"note: {note}")
