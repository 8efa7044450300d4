"""Inputs of the dynamics operations: arms, load tests, a milling pass."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.app.context import Context
from robotrue.app.number_options import parse_numbers
from robotrue.cell.config import read_cell
from robotrue.core.arrays import Array
from robotrue.core.provenance import Provenance, merge
from robotrue.core.units import DEG, MM, UM
from robotrue.dynamics.deviation_physics import CompliantArm, StaticCompliance, compliance_of
from robotrue.dynamics.dry_run import DryRun, LaserRecord
from robotrue.dynamics.dynamometer import Dynamometer, force_in_base, unwrap_angle
from robotrue.dynamics.force import ForceRecord
from robotrue.dynamics.formats.column_table import even_rate
from robotrue.dynamics.formats.frf_table import read_frf
from robotrue.dynamics.formats.signal_table import read_force, read_signals
from robotrue.dynamics.frf import AXES
from robotrue.dynamics.interpolation import fit_curve
from robotrue.dynamics.pass_stages import PassStages, find_stages, zero_at_both_ends
from robotrue.dynamics.pass_windows import PassJoints
from robotrue.dynamics.windows import SMALLEST_PEAK, SMALLEST_TURN, WindowSet
from robotrue.errors import ConfigurationError, ImplausibleDataError, ModelMismatchError
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel


def parse_static(text: str | None) -> dict[str, float]:
    """Returns pair of axes to m/N from ``xx=1.1,yx=0.1`` in um/N.

    Raises:
        ConfigurationError: Not of that form.
    """
    found: dict[str, float] = {}
    for item in [] if text is None else text.split(","):
        pair, _, number = item.strip().partition("=")
        try:
            value = float(number)
        except ValueError:
            value = np.nan
        if len(pair) != 2 or not set(pair) <= set(AXES) or not np.isfinite(value) or pair in found:
            raise ConfigurationError(
                f"static deflection {item.strip()!r}, expected pair=um/N.",
                hint="--static-um-per-n xx=1.1,yy=0.9",
            )
        found[pair] = value * UM
    return found


def parse_direction(text: str) -> Array:
    """Returns the unit vector (3,) of ``X,Y,Z``.

    Raises:
        ConfigurationError: No three numbers, or all of them zero.
    """
    value = parse_numbers("--direction", text, 3, hint="--direction=0,-1,0")
    size = float(np.linalg.norm(value))
    if size == 0.0:
        raise ConfigurationError(
            f"--direction {text!r}, expected three numbers.", hint="--direction=0,-1,0"
        )
    return np.asarray(value / size)


def read_arm(cell_path: Path, direction: str) -> CompliantArm:
    """Returns the compliant arm a cell file states.

    Args:
        cell_path: The cell.
        direction: ``X,Y,Z`` in base, along which the error counts positive.

    Raises:
        ConfigurationError: No stiffness in the cell, or no direction.
    """
    cell = read_cell(cell_path)
    prior = np.asarray(cell.compliance_prior)
    if not np.isfinite(prior).any():
        raise ConfigurationError(
            "the cell states no joint stiffness: nothing deflects.",
            source=cell_path,
            hint="[robot] stiffness_Nm_per_rad, from the data sheet or an earlier test.",
        )
    stiffness = np.where(np.isfinite(prior), 1.0 / np.where(prior > 0.0, prior, np.inf), np.inf)
    return CompliantArm(robot=cell.robot, stiffness=stiffness, direction=parse_direction(direction))


def read_static_row(
    frf: Path | None, arm: CompliantArm, context: Context
) -> StaticCompliance | None:
    """Returns the static row of the response the windows were predicted with, if it is given."""
    if frf is None:
        context.note(
            "without --frf the static row of the response is estimated from the windows only"
        )
        return None
    return compliance_of(fit_curve(read_frf(frf), "auto"), arm.direction)


def windows_origin(windows: WindowSet, frf: Path | None) -> Provenance:
    """Returns where windows come from, and the response they were predicted with."""
    return merge([windows.provenance, *([] if frf is None else [read_frf(frf).provenance])])


LASER: Final = {"d_um": UM, "d_mm": MM}
_SLACK: Final = 0.1 * DEG
"""A joint may be read so far beyond its limit."""
_RADIANS: Final = 2.0 * np.pi
"""A column in deg that holds no more than this, of an arm that moves, looks like rad."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadForce:
    """The force of a pass before it is cut into windows.

    Attributes:
        force: On the tool, base axes, zero subtracted.
        stages: Of the pass.
        zeros: (2, 3) N, sensor axes, before and after the cut; zero where not subtracted.
        remarks: Harmless oddities.
    """

    force: ForceRecord
    stages: PassStages
    zeros: Array
    remarks: tuple[str, ...]


def read_pass_joints(path: Path, robot: RobotModel, shift: float) -> tuple[PassJoints, Provenance]:
    """Returns the joints of a record and where it comes from.

    Args:
        path: CSV, TDMS, MAT or UFF with ``j1_deg..`` (as the model counts) or ``a1_deg..``
            (displayed).
        robot: The arm with its tool.
        shift: s, added to its times.

    Raises:
        FormatError: It cannot be read.
        ModelMismatchError: Joints beyond the limits of the arm.
        ImplausibleDataError: Joints at rest, or in radians.
    """
    own = [f"j{k + 1}_deg" for k in range(robot.dof)]
    shown = [f"a{k + 1}_deg" for k in range(robot.dof)]
    signals = read_signals(path, [own, shown])
    joints = signals.values * DEG
    largest = float(np.abs(signals.values).max())
    if largest <= _RADIANS:
        raise ImplausibleDataError(
            f"joints of no more than {largest:.3f} deg, all of them.",
            source=path,
            hint="joints in degrees; these look like radians.",
        )
    if list(signals.names) == shown:
        joints = np.asarray(robot.controller.to_model(joints))
    low, high = robot.limits.T
    beyond = np.flatnonzero(((joints < low - _SLACK) | (joints > high + _SLACK)).any(axis=1))
    if beyond.size:
        k = int(beyond[0])
        text = ", ".join(f"{v:.1f}" for v in joints[k] / DEG)
        raise ModelMismatchError(
            f"sample {k}: joints {text} deg, beyond the limits of {robot.name}.",
            source=path,
            hint="a1_deg.. are joints as the controller displays them, j1_deg.. as the model does.",
        )
    if np.ptp(joints, axis=0).max() < SMALLEST_TURN:
        raise ImplausibleDataError("no joint moves by 0.01 deg: the arm was at rest.", source=path)
    found = PassJoints(
        time=signals.time + shift,
        joints=joints,
        T_base_tool=forward(robot.nominal(), joints),
        source=str(path),
    )
    return found, signals.provenance


def read_pass_force(
    path: Path,
    sensor: Dynamometer,
    joints: PassJoints,
    spindle: float,
    *,
    angle_file: Path | None,
    keep_zero: bool,
) -> ReadForce:
    """Returns the force on the tool in base axes, zero subtracted, and the stages of the pass.

    Args:
        path: CSV, TDMS, MAT or UFF.
        sensor: How the dynamometer is mounted.
        joints: Of the pass.
        spindle: Turns per second.
        angle_file: ``t_s,angle_deg`` of the spindle, clock of the force.
        keep_zero: The zero was subtracted before.

    Raises:
        FormatError: It cannot be read.
        ImplausibleDataError: An implausible sensor, or no single cut in the record.
    """
    record, remarks = read_force(path)
    turn = record.rate / spindle
    stages = find_stages(record.time, record.force, turn, record.source)
    if stages.level < SMALLEST_PEAK:
        raise ImplausibleDataError(
            f"a force of {stages.level:.3g} N rms in the cut, expected {SMALLEST_PEAK:g} or more.",
            source=path,
            hint="forces in N; these look like kN.",
        )
    zeros = np.zeros((2, 3))
    if not keep_zero:
        record, zeros = zero_at_both_ends(record, stages, turn)
    angle = None if angle_file is None else _angle_at(angle_file, record)
    turned = force_in_base(record.force, sensor, angle, joints.attitude(record.time))
    return ReadForce(
        force=replace(record, force=turned), stages=stages, zeros=zeros, remarks=remarks
    )


def read_laser(path: Path, shift: float) -> tuple[LaserRecord, Provenance]:
    """Returns the displacement of a record ``t_s,d_um`` or ``t_s,d_mm``, and where it comes from.

    Raises:
        FormatError: It cannot be read.
        ImplausibleDataError: An uneven clock.
    """
    signals = read_signals(path, [[name] for name in LASER])
    start, rate = even_rate(signals.time, path)
    record = LaserRecord(
        time=start + shift + np.arange(len(signals)) / rate,
        displacement=signals.values[:, 0] * LASER[signals.names[0]],
        source=str(path),
    )
    return record, signals.provenance


def read_dry_run(laser: Path, joints: Path, robot: RobotModel) -> tuple[DryRun, Provenance]:
    """Returns the dry run of two records on one clock, and where they come from."""
    read, one = read_laser(laser, 0.0)
    moved, two = read_pass_joints(joints, robot, 0.0)
    return DryRun(time=moved.time, place=moved.place, laser=read), merge([one, two])


def _angle_at(path: Path, record: ForceRecord) -> Array:
    """Angle (n,) rad of the spindle at the samples of the force."""
    signals = read_signals(path, [["angle_deg"]])
    angle = unwrap_angle(signals.values[:, 0] * DEG, str(path))
    time = record.time
    if signals.time[0] > time[0] + 1.0 / record.rate or (
        signals.time[-1] < time[-1] - 1.0 / record.rate
    ):
        raise ImplausibleDataError(
            f"the angle of the spindle is known from {signals.time[0]:.3f} to "
            f"{signals.time[-1]:.3f} s, the force from {time[0]:.3f} to {time[-1]:.3f} s.",
            source=path,
            hint="record both in one task.",
        )
    return np.asarray(np.interp(time, signals.time, angle))
