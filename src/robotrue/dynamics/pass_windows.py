"""From the records of one milling pass to its windows.

Force in base axes, joints, and the laser of cut and dry run come with times of one clock. The
steady stage is cut into windows of whole turns of the spindle; of each the table holds what the
fits read: mean joints, mean and peak force, predicted and measured error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.dynamics.dry_run import DryRun, LaserRecord, dry_displacement
from robotrue.dynamics.force import ForceRecord
from robotrue.dynamics.interpolation import ResponseCurve
from robotrue.dynamics.pass_stages import PassStages
from robotrue.dynamics.predict import predict_error
from robotrue.dynamics.windows import WindowSet, peaks_per_turn
from robotrue.errors import ImplausibleDataError, ModelMismatchError, ObservabilityError

WINDOW: Final = 1.0
"""s, default length of a window."""
_STRETCH: Final = 0.1
"""s; a way is counted in stretches of it, longer than the noise of joints counts as a way."""
_ROUND: Final = 1e-6
"""Turns; what rounding of times leaves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PassJoints(Columns):
    """Joints of a pass and their tool poses.

    Attributes:
        time: (m,) s.
        joints: (m, dof) rad, model joints.
        T_base_tool: (m, 4, 4)
        source: File.
    """

    time: Annotated[Array, Column("m", unit="s")]
    joints: Annotated[Array, Column("m dof", unit="rad")]
    T_base_tool: Annotated[Array, Column("m 4 4")]
    source: str

    def at(self, time: Array) -> Array:
        """Returns the joints (n, dof) rad at times (n,) s, interpolated."""
        return np.column_stack([np.interp(time, self.time, q) for q in self.joints.T])

    def attitude(self, time: Array) -> Array:
        """Returns R_base_tool (n, 3, 3) at times (n,) s, interpolated."""
        turns = self.T_base_tool[:, :3, :3].reshape(-1, 9)
        flat = np.column_stack([np.interp(time, self.time, column) for column in turns.T])
        return flat.reshape(-1, 3, 3)

    @property
    def place(self) -> Array:
        """(m, 3) m, tool point."""
        return np.asarray(self.T_base_tool[:, :3, 3])


@dataclass(frozen=True, slots=True, kw_only=True)
class PassRecords:
    """The records of one pass, times of one clock.

    Attributes:
        name: Of the pass.
        force: On the tool, base axes.
        joints: Of the arm.
        laser: Of the cut, or None without a laser.
        dry: The dry run, or None: the laser then shows the error alone.
        spindle: Turns per second.
        direction: (3,) unit vector in base along which the error counts positive.
        zero_taken: The zero of the dynamometer was subtracted, see ``WindowSet.zero_taken``.
        provenance: Of all files.
    """

    name: str
    force: ForceRecord
    joints: PassJoints
    laser: LaserRecord | None
    dry: DryRun | None
    spindle: float
    direction: Array
    zero_taken: bool = False
    provenance: Provenance = MEASURED


def check_clocks(records: PassRecords) -> None:
    """Passes if force, joints and laser have time in common.

    Raises:
        ImplausibleDataError: They do not.
    """
    force = records.force.time
    others = [("joints", records.joints.time, records.joints.source)]
    if records.laser is not None:
        others.append(("laser", records.laser.time, records.laser.source))
    for name, time, source in others:
        if time[0] >= force[-1] or time[-1] <= force[0]:
            raise ImplausibleDataError(
                f"the {name} run from {time[0]:.3f} to {time[-1]:.3f} s, the force from "
                f"{force[0]:.3f} to {force[-1]:.3f} s: no time in common.",
                source=source,
                hint="--joints-shift-s and --laser-shift-s add to their times; `robotrue sense "
                "align` finds the shift from a jog.",
            )


def path_between(joints: PassJoints, start: float, end: float) -> float:
    """Returns the way of the tool point from one time to another, m."""
    steps = max(int((end - start) / _STRETCH), 1)
    time = np.linspace(start, end, steps + 1)
    place = np.column_stack([np.interp(time, joints.time, axis) for axis in joints.place.T])
    return float(np.linalg.norm(np.diff(place, axis=0), axis=1).sum())


def even_windows(stages: PassStages, records: PassRecords, length: float) -> Array:
    """Returns start and end (k, 2) s of windows of whole turns in the steady stage.

    Raises:
        ObservabilityError: The steady stage is shorter than a window, or one than a turn.
    """
    turns = max(round(length * records.spindle), 0)
    step = turns / records.spindle
    begin, end = _find_steady_span(stages, records)
    count = int(np.floor((end - begin) / step + _ROUND)) if turns else 0
    if count < 1:
        raise ObservabilityError(
            f"windows of {length:g} s ({turns} turns) in {end - begin:.3f} s of steady cutting: "
            "not one fits.",
            source=records.force.source,
            hint="--window-s, and joints and laser that last as long as the cut.",
        )
    start = begin + step * np.arange(count)
    return np.column_stack([start, start + step])


def _find_steady_span(stages: PassStages, records: PassRecords) -> tuple[float, float]:
    """Begin and end of the steady stage, as far as joints and laser go."""
    times = [records.joints.time] + ([] if records.laser is None else [records.laser.time])
    begin = max(stages.steady, *(float(time[0]) for time in times))
    end = min(stages.leaving, *(float(time[-1]) for time in times))
    return begin, end


def cut_windows(records: PassRecords, edges: Array, curve: ResponseCurve) -> WindowSet:
    """Returns the windows of a pass.

    Args:
        records: Of the pass.
        edges: (k, 2) s, start and end of each window.
        curve: Receptance, base axes.

    Raises:
        ModelMismatchError: The response has no displacement along the direction, or the dry run is
            of another path.
        ObservabilityError: A window beyond a record, or shorter than a turn.
    """
    force, direction = records.force, records.direction
    time = force.time
    moved = predict_error(curve, force).error
    along = np.flatnonzero(np.abs(direction) > 1e-9)
    if np.isnan(moved[:, along]).any():
        raise ModelMismatchError(
            "the response holds no displacement along the direction of the error.",
            source=curve.frf.source,
            hint="--direction along an axis of the hammer test.",
        )
    bent = moved[:, along] @ direction[along]
    push = np.abs(force.force @ direction)
    turn = force.rate / records.spindle
    joints = records.joints.at(time)
    rows = [_rows_between(time, start, end, force.source) for start, end in edges.tolist()]
    return WindowSet(
        passes=(records.name,) * len(edges),
        joints=np.array([joints[row].mean(axis=0) for row in rows]),
        force=np.array([force.force[row].mean(axis=0) for row in rows]),
        force_peak=np.array([peaks_per_turn(push[row], turn).mean() for row in rows]),
        force_mean=np.array([(force.force[row] @ direction).mean() for row in rows]),
        predicted=np.array([peaks_per_turn(bent[row], turn).mean() for row in rows]),
        measured=_measure_error(records, edges),
        span=edges,
        zero_taken=np.full(len(edges), records.zero_taken),
        source=force.source,
        provenance=records.provenance,
    )


def _measure_error(records: PassRecords, edges: Array) -> Array:
    """Measured error (k,) m: peak of each turn of cut less dry run, averaged over turns."""
    laser, dry = records.laser, records.dry
    if laser is None:
        return np.full(len(edges), np.nan)
    shown = np.array(laser.displacement)
    turn = laser.rate / records.spindle
    first, last = _rows_between(laser.time, edges[0, 0], edges[-1, 1], laser.source).indices(
        len(laser)
    )[:2]
    if dry is not None:
        at = laser.time[first:last]
        joints = records.joints
        shown[first:last] -= dry_displacement(
            dry, joints.time, joints.place, at, dry.laser.rate / records.spindle
        )
    rows = [_rows_between(laser.time, start, end, laser.source) for start, end in edges.tolist()]
    return np.array([peaks_per_turn(shown[row], turn).mean() for row in rows])


def _rows_between(time: Array, start: float, end: float, source: str) -> slice:
    """Samples of even times from a start up to, and without, an end."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    first = int(np.ceil((start - time[0]) / step - _ROUND))
    last = int(np.ceil((end - time[0]) / step - _ROUND))
    if first < 0 or last > len(time) or last <= first:
        raise ObservabilityError(
            f"a window from {start:.3f} to {end:.3f} s in a record from {time[0]:.3f} to "
            f"{time[-1]:.3f} s.",
            source=source,
            hint="windows inside all records, start before end.",
        )
    return slice(first, last)
