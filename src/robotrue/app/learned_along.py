"""A learned deviation along a force record: window by window, added to the predicted error."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robotrue.app.dynamics_inputs import read_pass_joints
from robotrue.app.presentation import Facts, count
from robotrue.core.arrays import Array
from robotrue.core.provenance import Provenance, merge
from robotrue.core.units import UM
from robotrue.dynamics.force import ForceRecord
from robotrue.dynamics.interpolation import ResponseCurve
from robotrue.dynamics.learned_deviation import DeviationPrediction, LearnedDeviation, WindowTrust
from robotrue.dynamics.pass_windows import WINDOW, PassRecords, check_clocks, cut_windows
from robotrue.dynamics.windows import WindowSet
from robotrue.errors import ConfigurationError, ObservabilityError


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedAlong:
    """Learned deviation in the windows of a record.

    Attributes:
        time: (n,) s of the record's samples.
        windows: Cut from it, one after the other.
        found: Error, deviation and standard deviation of each.
        direction: (3,) unit vector in base along which they count.
        provenance: Of model and joints.
    """

    time: Array
    windows: WindowSet
    found: DeviationPrediction
    direction: Array
    provenance: Provenance

    def beside(self, columns: Array) -> Array:
        """Returns a table t_s, ex, ey, ez um (n, 4) with error and its sd along the direction, um.

        The error is that of the sample plus the deviation of its window; NaN outside all windows.
        """
        at = np.searchsorted(self.windows.span[:, 0], self.time, side="right") - 1
        inside = (at >= 0) & (self.time < self.windows.span[-1, 1])
        along = np.abs(self.direction) > 1e-9
        error = columns[:, 1:4][:, along] @ self.direction[along]
        error = error + self.found.deviation[at] / UM
        sd = self.found.sd[at] / UM
        return np.column_stack(
            [columns, np.where(inside, error, np.nan), np.where(inside, sd, np.nan)]
        )

    def document(self) -> dict[str, object]:
        """Returns JSON values: one number a window, um."""
        standing = [WindowTrust(int(each)).name.lower() for each in self.found.standing]
        return {
            "start_s": self.windows.span[:, 0].tolist(),
            "predicted_um": (self.windows.predicted / UM).tolist(),
            "deviation_um": [None if np.isnan(v) else v / UM for v in self.found.deviation],
            "error_um": [None if np.isnan(v) else v / UM for v in self.found.error],
            "sd_um": [None if np.isnan(v) else v / UM for v in self.found.sd],
            "standing": standing,
        }

    def facts(self) -> Facts:
        """Returns means over the windows."""
        standing = np.bincount(self.found.standing, minlength=len(WindowTrust))
        rows = [(s.name.lower(), count(int(standing[s]), "window")) for s in WindowTrust]
        known = self.found.standing != WindowTrust.INVALID
        if known.any():
            means = (self.windows.predicted, self.found.deviation, self.found.error, self.found.sd)
            names = ("predicted", "learned deviation", "error", "its standard deviation")
            rows += [
                (f"{name}, mean um", f"{values[known].mean() / UM:.2f}")
                for name, values in zip(names, means, strict=True)
            ]
        return Facts(title="with the fitted deviation", rows=tuple(rows))


def learned_along(
    model: LearnedDeviation,
    curve: ResponseCurve,
    record: ForceRecord,
    joints: Path,
    spindle: float,
) -> LearnedAlong:
    """Returns the estimate of a deviation for a force record.

    Args:
        model: As fitted.
        curve: Receptance, base axes.
        record: Force on the tool, base axes.
        joints: File of the joints, clock of the force.
        spindle: Turns per second.

    Raises:
        ConfigurationError: A spindle that does not turn.
        ImplausibleDataError: Records without time in common.
        ObservabilityError: Less than a window of both.
    """
    if not spindle > 0.0:
        raise ConfigurationError(f"{60.0 * spindle:g} rpm, expected above zero.")
    moved, origin = read_pass_joints(joints, model.arm.robot, 0.0)
    records = PassRecords(
        name="record", force=record, joints=moved, laser=None, dry=None, spindle=spindle,
        direction=model.arm.direction,
    )  # fmt: skip
    check_clocks(records)
    step = max(round(WINDOW * spindle), 1) / spindle
    begin = max(record.start, float(moved.time[0]))
    end = min(record.start + len(record) / record.rate, float(moved.time[-1]))
    whole = int((end - begin) / step + 1e-9)
    if whole < 1:
        raise ObservabilityError(
            f"{end - begin:.3f} s of force and joints, windows are {step:.3f} s.",
            source=record.source,
            hint="record for longer.",
        )
    start = begin + step * np.arange(whole)
    windows = cut_windows(records, np.column_stack([start, start + step]), curve)
    return LearnedAlong(
        time=record.time,
        windows=windows,
        found=model.predict(windows),
        direction=model.arm.direction,
        provenance=merge([model.windows.provenance, origin]),
    )
