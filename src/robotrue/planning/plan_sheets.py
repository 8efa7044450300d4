"""Plans as files: tables to be filled in, a KRL program that measures, JSON values.

A table has the columns that a calibration or a registration reads, those of the measured values
blank: a row that was left blank is refused, not taken for a measurement.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array
from robotrue.core.csv_text import axis_names, csv_text
from robotrue.core.units import DEG, MM
from robotrue.errors import ModelMismatchError
from robotrue.measurement.formats.canonical import canonical_mapping
from robotrue.measurement.formats.part_points import PLANNED, point_columns
from robotrue.measurement.formats.sheet import number_columns, write_six_digits
from robotrue.measurement.probing_set import ProbingSet
from robotrue.planning.pose_plan import PosePlan
from robotrue.program.formats.krl_measure import Trigger, measuring_program
from robotrue.robot.configuration import controller_axes
from robotrue.robot.model import RobotModel

TYPE_AXES: Final = "; type a1_deg.. into the controller, never j1_deg.. (robot model)"


def measuring_krl(cell: Cell, plan: PosePlan, name: str, trigger_output: int) -> bytes:
    """Returns the KRL program ``name`` that measures the poses.

    Raises:
        ModelMismatchError: The controller is no KUKA.
    """
    if cell.robot.maker != "kuka":
        raise ModelMismatchError(
            f"{cell.robot.name} is of maker {cell.robot.maker!r}; programs are written in KRL, for "
            "KUKA controllers.",
            hint="take the joints from the CSV.",
        )
    return measuring_program(
        name,
        controller_axes(cell.robot, plan.joints),
        controller_axes(cell.robot, plan.pre),
        Trigger(output=trigger_output),
    )


def plan_document(plan: PosePlan) -> dict[str, object]:
    """Returns the plan as JSON values: mm, deg."""
    expected = plan.expected
    return {
        "poses": len(plan),
        "criterion": plan.criterion,
        "seed": plan.seed,
        "candidates": plan.candidates,
        "drawn": plan.drawn,
        "rejected": dict(plan.rejected),
        "stopped": plan.stopped,
        "expected_mean_mm": expected.mean / MM,
        "expected_rms_mm": expected.rms / MM,
        "random_mean_mm": expected.random_mean / MM,
        "random_low_mm": expected.random_low / MM,
        "random_high_mm": expected.random_high / MM,
        "floor_mean_mm": expected.floor_mean / MM,
        "joints_deg": plan.joints / DEG,
        "pre_position_deg": plan.pre / DEG,
        "approach": plan.approach.astype(int),
        "load": plan.load,
        "loads": [
            {"mass_kg": float(load.mass[0]), "centre_of_mass_mm": load.com[0] / MM}
            for load in plan.loads
        ],
        "commanded_mm": plan.position / MM,
        "rank": plan.rank,
        "travel_deg": plan.travel / DEG,
        "travel_as_chosen_deg": plan.travel_as_chosen / DEG,
        "notes": list(plan.notes),
    }


def plan_sheet(plan: PosePlan, robot: RobotModel | None = None) -> bytes:
    """Returns the plan as CSV, one row per pose in the order of measuring.

    The columns are those a calibration reads. ``x_mm, y_mm, z_mm`` are blank: the measured points
    go there, and a row that was left blank is refused.

    Args:
        plan: The poses.
        robot: For the axes that its controller displays in each pose; None leaves those columns
            out.
    """
    names = canonical_mapping(plan.joints.shape[1])
    columns = number_columns(names.joints, plan.joints / DEG, write_six_digits)
    columns |= {name: [""] * len(plan) for name in names.position}
    columns |= {
        name: [str(int(sign)) for sign in plan.approach[:, i]]
        for i, name in enumerate(names.approach)
    }
    if len(plan.loads) > 1:
        mass = np.array([load.mass[0] for load in plan.loads])[plan.load]
        centre = np.array([load.com[0] for load in plan.loads])[plan.load]
        wrench = np.array([load.wrench[0] for load in plan.loads])[plan.load]
        columns |= number_columns(names.payload_mass, mass[:, None], write_six_digits)
        columns |= number_columns(names.payload_com, centre / MM, write_six_digits)
        if wrench.any():
            columns |= number_columns(
                names.force, wrench[:, :3], write_six_digits
            ) | number_columns(names.moment, wrench[:, 3:], write_six_digits)
    if robot is not None:
        columns |= _axis_columns(robot, plan.joints)
    head = "# poses to be measured; fill in x_mm, y_mm, z_mm and give the file to calibrate"
    return _write_sheet(f"{head}{'' if robot is None else TYPE_AXES}\n", columns)


def drift_sheet(joints: Array, robot: RobotModel) -> bytes:
    """Returns the poses of a drift check as CSV, one row each in the order of measuring."""
    return pose_sheet(joints, robot, "fill in x_mm, y_mm, z_mm and give the file to drift", {})


def pose_sheet(
    joints: Array, robot: RobotModel, remark: str, further: Mapping[str, Sequence[str]]
) -> bytes:
    """Returns poses as CSV with blank positions and what the controller displays.

    Args:
        joints: (n, dof) rad, in the order of measuring.
        robot: Of the controller.
        remark: Instructions for the sheet.
        further: Columns by their names, between positions and axes.
    """
    names = canonical_mapping(robot.dof)
    columns = {
        **number_columns(names.joints, joints / DEG, write_six_digits),
        **{name: [""] * len(joints) for name in names.position},
        **further,
        **_axis_columns(robot, joints),
    }
    return _write_sheet(f"# poses to be measured; {remark}{TYPE_AXES}\n", columns)


def _axis_columns(robot: RobotModel, joints: Array) -> dict[str, list[str]]:
    axes = controller_axes(robot, joints) / DEG
    return number_columns(axis_names(robot.dof), axes, write_six_digits)


def touch_sheet(touches: ProbingSet, parts: Sequence[str], robot: RobotModel) -> bytes:
    """Returns touches as CSV, one row each in their order: columns of a file of touched points.

    The axes, as the controller displays them, are those planned. At the machine each row gets the
    axes at its touch instead, and the first line goes; until then the file is refused, since
    planned axes fit exactly.

    Args:
        touches: With joints.
        parts: Name of each part by its number; the column is left out for one part alone.
        robot: Of the controller.
    """
    head = f"{PLANNED}: put the axes at each touch in their place, then delete this line\n"
    named = parts if len(parts) > 1 else ()
    axes = controller_axes(robot, touches.joints)
    columns = point_columns(touches, named, write_six_digits, displayed=axes)
    return _write_sheet(head, columns)


def _write_sheet(head: str, columns: Mapping[str, Sequence[str]]) -> bytes:
    return (head + csv_text([columns, *zip(*columns.values(), strict=True)])).encode()
