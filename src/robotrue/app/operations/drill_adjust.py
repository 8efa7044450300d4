"""Compute the one move that squares the spindle to the surface under the foot."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Facts, Note, PlainResult, Text
from robotrue.app.request import Option, Request
from robotrue.app.request_fields import CarryingRobot, DrillModel, FootAngles, ZeroFoot
from robotrue.core.provenance import merge
from robotrue.core.units import DEG, MM
from robotrue.drilling.drill_defaults import FOOT_ABC_DEG, MODEL
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.core.arrays import Array
    from robotrue.drilling.adjust import HoleAdjustment
    from robotrue.drilling.foot_file import FootSetup
    from robotrue.drilling.foot_model import NormalModel
    from robotrue.drilling.robot_adjust import RobotMove


class DrillAdjustRequest(Request):
    """Drilling model, readings of one clamp, and the axes that make the move."""

    model: DrillModel
    reading: str | None = None
    """d1,d2,d3 in mm, minus their zero."""
    raw: str | None = None
    """Instead of --reading: raw1,raw2,raw3 as the sensors show them, in counts if the foot file
    has zero_counts, else in mm; with --foot."""
    foot: ZeroFoot = None
    force: float
    """Clamp force in N."""
    z: float
    """Position of the Z axis in mm."""
    at: str | None = None
    """A,B of the machine now, in deg; default 0,0."""
    xy: str | None = None
    """X,Y of the machine in mm, for a model that uses them."""
    approach: str = ""
    """Approach of the foot; default: the usual one."""
    robot: CarryingRobot = None
    joints_deg: str | None = None
    """With --robot: its present joints, in the model's sense."""
    foot_abc_deg: FootAngles = FOOT_ABC_DEG
    language: Annotated[str | None, Option(names=("--as",))] = None
    """Also print the move: gcode; with --robot krl, rapid, urscript."""
    feed_mm_per_min: float = 500.0
    """Feed of --as gcode."""


@operation()
def run(request: DrillAdjustRequest, context: Context) -> PlainResult:
    """Gives the one move of a clamp.

    Raises:
        ConfigurationError: Values that are not of their form, or do not belong together.
        ImplausibleDataError: Readings, a force or a tilt that the model does not cover.
    """
    from robotrue.app.registered import open_model, provenance_used
    from robotrue.drilling.adjust import move_document, surface_document, targets_document
    from robotrue.drilling.model_archive import read_model
    from robotrue.drilling.robot_adjust import robot_fragment

    (path,) = context.document_files(request.model, MODEL)
    model = read_model(path)
    found = _adjustment(request, model, path)
    origins = [model.provenance]
    if request.robot is None:
        head, targets, notes = move_document(found.move), targets_document(found), _notes(found)
        made: dict[str, object] = {"move": head, "targets": targets}
        rows = _head_rows(head, targets)
        text = _head_program(request, found)
    else:
        move = _robot_move(request, model, found)
        made, notes = {"robot": _robot_document(move)}, [*found.notes]
        rows = _robot_rows(move)
        if not move.rotation_known:
            notes.append("the robot's model has no rotation error: nominal axis.")
        text = robot_fragment(request.language, move.T_base_tool) if request.language else ""
        origins.append(provenance_used(*open_model(request.robot)))
    surface = surface_document(found)
    document = {**surface, **made, "notes": notes}
    return PlainResult(
        values={**document, **({"program": text} if text else {})},
        shown=(
            Facts(title="One move", rows=(_surface_row(surface), *rows)),
            *(Note(f"note: {note}") for note in notes),
            Text(text),
        ),
        provenance=merge(origins),
    )


def _adjustment(request: DrillAdjustRequest, model: NormalModel, path: Path) -> HoleAdjustment:
    import numpy as np

    from robotrue.app.number_options import parse_numbers
    from robotrue.drilling.adjust import adjustment
    from robotrue.drilling.campaign import Clamps
    from robotrue.drilling.campaign_csv import setup_of
    from robotrue.drilling.foot_model import use_zero

    setup = setup_of(model, path, request.foot)
    model = use_zero(model, setup.taken_zero)
    at = None if request.robot is not None else request.at
    clamps = Clamps(
        readings=_readings(request, setup)[None],
        force=np.array([request.force]),
        height=np.array([request.z * MM]),
        approach=(request.approach,),
        place=_pair("--xy", request.xy, "X,Y")[None] * MM,
        axes=_pair("--at", at, "A,B")[None] * DEG,
    )
    axes = parse_numbers("--at", request.at or "0,0", 2, form="A,B") * DEG
    return adjustment(model, clamps, axes)


def _readings(request: DrillAdjustRequest, setup: FootSetup) -> Array:
    """(k,) m, less their zero.

    Raises:
        ConfigurationError: Not one of --reading and --raw, or --raw without a foot file's zero.
    """
    from robotrue.app.number_options import parse_numbers
    from robotrue.drilling.campaign_csv import FORMS, readings_less_zero

    sensors = len(setup.foot.radius)
    if (request.reading is None) == (request.raw is None):
        raise ConfigurationError(
            "give the readings once.", hint="--reading d1,d2,d3, or --raw with --foot FOOT."
        )
    if request.raw is None:
        return parse_numbers("--reading", request.reading or "", sensors, form="d1,d2,d3") * MM
    form = FORMS[1] if not setup.zero_in_counts else FORMS[2]
    raw = parse_numbers("--raw", request.raw, sensors, form="raw1,raw2,raw3")
    readings: Array = readings_less_zero(raw[None], form, setup)[0]
    return readings


def _pair(option: str, stated: str | None, form: str) -> Array:
    """Two numbers; NaN where they are not stated."""
    import numpy as np

    from robotrue.app.number_options import parse_numbers

    missing: Array = np.full(2, np.nan)
    return missing if stated is None else parse_numbers(option, stated, 2, form=form)


def _head_program(request: DrillAdjustRequest, found: HoleAdjustment) -> str:
    from robotrue.drilling.head import gcode

    if request.language is None:
        return ""
    if request.language != "gcode":
        raise ConfigurationError(
            f"--as {request.language} without --robot.",
            hint="--as gcode, or --robot MODEL --joints-deg.",
        )
    return gcode(found.move, feed_mm_per_min=request.feed_mm_per_min)


def _robot_move(
    request: DrillAdjustRequest, model: NormalModel, found: HoleAdjustment
) -> RobotMove:
    from robotrue.app.drilling_robot import carrying_robot
    from robotrue.app.number_options import parse_numbers
    from robotrue.drilling.head import normal_from_tilt
    from robotrue.drilling.robot_adjust import squaring_joints

    if request.robot is None or request.joints_deg is None:
        raise ConfigurationError(
            "--robot without --joints-deg: state the joints of the robot.",
            hint="--joints-deg J1,J2,J3,J4,J5,J6",
        )
    robot, load, seat = carrying_robot(request.robot, request.foot_abc_deg)
    dof, stated = robot.robot.dof, request.joints_deg
    joints = parse_numbers("--joints-deg", stated, dof, form="J1,..,J6") * DEG
    normal = normal_from_tilt(model.head.order, found.tilt)
    return squaring_joints(robot, joints, normal, R_tool_foot=seat, load=load)


def _robot_document(move: RobotMove) -> dict[str, object]:
    from robotrue.core.rotations import abc_from_matrix

    return {
        "joints_deg": (move.joints / DEG).tolist(),
        "xyz_mm": (move.T_base_tool[:3, 3] / MM).tolist(),
        "abc_deg": (abc_from_matrix(move.T_base_tool[:3, :3]) / DEG).tolist(),
        "turn_deg": move.turn / DEG,
        "rotation_error_known": move.rotation_known,
    }


def _notes(found: HoleAdjustment) -> list[str]:
    import numpy as np

    if np.isfinite(found.move.shift).all():
        return list(found.notes)
    return [
        "X, Y and Z are unknown: the foot file of the fit had no [head] with pivot_to_tip_mm.",
        *found.notes,
    ]


def _surface_row(surface: Mapping[str, float]) -> tuple[str, str]:
    a, b, sa, sb = (surface[k] for k in ("a_deg", "b_deg", "a_sigma_deg", "b_sigma_deg"))
    return ("surface", f"a {a:+.4f} +- {sa:.4f} deg, b {b:+.4f} +- {sb:.4f} deg")


def _head_rows(
    head: Mapping[str, float], targets: Mapping[str, float]
) -> tuple[tuple[str, str], ...]:
    shift = ", ".join(f"{head[f'd{axis}_mm']:+.4f} mm" for axis in "XYZ")
    turned = f"{head['A_deg']:.4f}, {head['B_deg']:.4f} deg"
    bare = ", ".join(f"{targets[f'{axis}_theoretical_deg']:.4f}" for axis in "AB")
    added = ", ".join(f"{targets[f'{axis}_compensation_deg']:+.4f}" for axis in "AB")
    return (
        ("A, B to", turned),
        ("of that", f"{bare} deg by the uncorrected readings, {added} deg by the model"),
        ("X, Y, Z by", shift),
    )


def _robot_rows(move: RobotMove) -> tuple[tuple[str, str], ...]:
    joints = ", ".join(f"{v:.4f}" for v in move.joints / DEG)
    return (
        ("joints to", f"{joints} deg"),
        ("turned by", f"{move.turn / DEG:.4f} deg about the tip"),
    )
