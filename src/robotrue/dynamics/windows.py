"""Windows of a milling pass: joints of the arm, force on the tool, its error; their checks.

The paper's sample is a window of about a second: mean joints, peak and mean force, the error
predicted from the frequency response and the measured one. The mean force as a vector is added
here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import EMPTY, Column, Columns, concat
from robotrue.core.provenance import MEASURED, Provenance, merge
from robotrue.core.units import DEG, UM
from robotrue.errors import (
    ImplausibleDataError,
    ModelMismatchError,
    ObservabilityError,
    ShapeError,
)

FEWEST: Final = 12
"""Windows below which nothing is learned."""
LARGEST_ERROR: Final = 5e-3
LARGEST_FORCE: Final = 2e4
SMALLEST_PEAK: Final = 1.0
"""N; a cut with less moves no tool by what a sensor sees."""
_OPPOSITE: Final = 0.3
"""Part of the deviation that is left when the sign of the measured error is turned round."""
SMALLEST_TURN: Final = 0.01 * DEG
FORCE_ROOM: Final = 0.5
"""Largest distance of a force outside the training range, over that range."""
SAME_TIME: Final = 1e-6
"""s; windows that share less touch."""
_RADIANS: Final = 0.12
"""rad; joints that never exceed this in degrees would be all within 7 deg of zero."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowSet(Columns):
    """Windows in the order they were cut, pass after pass.

    Attributes:
        passes: Name of the pass of each window.
        joints: (n, 6) rad, mean.
        force: (n, 3) N, mean force on the tool, base axes.
        force_peak: (n,) N, largest force of a turn of the spindle, either way along the direction
            the error is measured in, averaged over turns.
        force_mean: (n,) N, mean force along that direction.
        predicted: (n,) m, error by frequency response and force (eq. 1 of the paper).
        measured: (n,) m; NaN where not measured.
        span: (n, 2) s, start and end in the record of the pass; NaN where nothing states them.
        zero_taken: (n,) whether the zero of the dynamometer was read before and after the cut and
            the line between subtracted, which leaves a small residual. Where false, the zero
            drifts.
        source: File or experiment.
        provenance: Simulated or measured, and the files.
    """

    passes: Annotated[tuple[str, ...], Column("n")]
    joints: Annotated[Array, Column("n dof", unit="rad")]
    force: Annotated[Array, Column("n 3", unit="N")]
    force_peak: Annotated[Array, Column("n", unit="N")]
    force_mean: Annotated[Array, Column("n", unit="N")]
    predicted: Annotated[Array, Column("n", unit="m")]
    measured: Annotated[Array, Column("n", unit="m", nan=True)]
    span: Annotated[Array, Column("n 2", unit="s", nan=True, fill=np.nan)] = EMPTY
    zero_taken: Annotated[BoolArray, Column("n", fill=False)] = EMPTY
    source: str = ""
    provenance: Provenance = MEASURED

    def __len__(self) -> int:
        return len(self.passes)

    @property
    def deviation(self) -> Array:
        """(n,) m, measured less predicted, the e_0 of the paper."""
        return np.asarray(self.measured - self.predicted)

    @property
    def pass_names(self) -> tuple[str, ...]:
        """Passes in the order of their first window."""
        return tuple(dict.fromkeys(self.passes))

    @property
    def pass_index(self) -> IntArray:
        """(n,) which of :attr:`pass_names` each window is of."""
        at = {name: k for k, name in enumerate(self.pass_names)}
        return np.array([at[name] for name in self.passes], dtype=np.int64)


def concatenate_windows(parts: Sequence[WindowSet]) -> WindowSet:
    """Returns several sets as one.

    Raises:
        ShapeError: None, or of arms with different numbers of joints.
    """
    if not parts or len({p.joints.shape[1] for p in parts}) != 1:
        raise ShapeError("window sets to join need to be of one arm, and one at least.")
    return concat(parts, source=parts[0].source, provenance=merge(p.provenance for p in parts))


def force_range(windows: WindowSet) -> tuple[Array, Array]:
    """Returns the least and largest mean force (3,) N, base axes, that is like that of windows."""
    low, high = windows.force.min(axis=0), windows.force.max(axis=0)
    room = FORCE_ROOM * (high - low) + 0.1 * np.abs(windows.force).max()
    return low - room, high + room


def peaks_per_turn(signal: Array, samples_per_turn: float) -> Array:
    """Returns the largest value of each whole turn of the spindle (k,) of a signal (n,).

    Raises:
        ShapeError: Less than one turn.
    """
    turns = int(np.floor(len(signal) / samples_per_turn + 1e-9))
    if turns < 1:
        raise ShapeError(
            f"{len(signal)} samples, less than one turn of {samples_per_turn:.1f} samples."
        )
    edges = np.rint(np.arange(turns) * samples_per_turn).astype(np.int64)
    last = round(turns * samples_per_turn)
    return np.asarray(np.maximum.reduceat(signal[:last], edges))


def first_overlap(span: Array) -> tuple[int, int] | None:
    """Returns the rows of two windows (n, 2) s that share time, or None; NaN shares none."""
    order = np.argsort(span[:, 0], kind="stable")
    for one, two in pairwise(order.tolist()):
        if span[two, 0] < span[one, 1] - SAME_TIME:
            return one, two
    return None


def check_for_fit(windows: WindowSet, outside: BoolArray) -> None:
    """Passes if a deviation can be learned from the windows.

    Args:
        windows: Training windows.
        outside: (n,) of them beyond the joint limits.

    Raises:
        ObservabilityError: Too few windows, or no measured error.
        ModelMismatchError: A joint beyond its limits: another arm, or other units.
        ImplausibleDataError: A column that does not vary, or of another unit.
    """
    n, source = len(windows), windows.source or None
    if n < FEWEST:
        raise ObservabilityError(
            f"{n} windows, {FEWEST} are the least to learn a deviation from.",
            source=source,
            hint="shorter windows, or another pass.",
        )
    unmeasured = np.flatnonzero(~np.isfinite(windows.measured))
    if unmeasured.size:
        raise ObservabilityError(
            f"window {int(unmeasured[0]) + 1} has no measured error; "
            f"{unmeasured.size} of {n} have none.",
            source=source,
            hint="leave them out of the fit.",
        )
    check_units(windows)
    if outside.any():
        k = int(np.flatnonzero(outside)[0])
        shown = ", ".join(f"{v:.1f}" for v in windows.joints[k] / DEG)
        raise ModelMismatchError(
            f"window {k + 1} at joints {shown} deg, beyond the limits of the arm.",
            source=source,
            hint="check the robot, the sense of its joints and their unit.",
        )
    _check_columns(windows)
    _check_repeated(windows)
    if np.ptp(windows.joints, axis=0).max() < SMALLEST_TURN:
        raise ImplausibleDataError(
            "no joint moves by 0.01 deg over all windows: the arm was at rest.", source=source
        )


def _check_columns(windows: WindowSet) -> None:
    """Passes if every column varies that a sensor fills, and the errors count the same way."""
    n, source = len(windows), windows.source or None
    columns: dict[str, Array] = {
        "measured_um": windows.measured / UM,
        "predicted_um": windows.predicted / UM,
        "f_peak_N": windows.force_peak,
        "f_mean_N": windows.force_mean,
    }
    # An absent force is zero; one constant at another value was not measured.
    columns |= {
        f"f{axis}_mean_N": values
        for axis, values in zip("xyz", windows.force.T, strict=True)
        if values.any()
    }
    for name, values in columns.items():
        if np.ptp(values) <= 1e-9 * max(float(np.abs(values).max()), 1e-300):
            raise ImplausibleDataError(
                f"column {name} does not vary: {values[0]:.6g} in all {n} windows.",
                source=source,
                hint="a sensor that is not connected, or a column that was filled in.",
            )
    against = np.sqrt(((windows.measured + windows.predicted) ** 2).mean())
    if against < _OPPOSITE * np.sqrt((windows.deviation**2).mean()):
        raise ImplausibleDataError(
            f"measured_um is the negative of predicted_um to {against / UM:.1f} um rms.",
            source=source,
            hint="count both errors positive along --direction.",
        )


def _check_repeated(windows: WindowSet) -> None:
    """Checks that no window occurs twice: in training and test it would flatter the result."""
    rows = np.column_stack([windows.joints, windows.force, windows.force_peak, windows.measured])
    _, first, count = np.unique(rows, axis=0, return_index=True, return_counts=True)
    if (count > 1).any():
        k = int(first[count > 1].min())
        again = int(np.flatnonzero((rows == rows[k]).all(axis=1))[1])
        raise ImplausibleDataError(
            f"window {again + 1} is window {k + 1} again; {int((count - 1).sum())} of "
            f"{len(windows)} are repeated.",
            source=windows.source or None,
            hint="keep each window once.",
        )


def check_units(windows: WindowSet) -> None:
    """Passes if sizes are those of a milling arm.

    Raises:
        ImplausibleDataError: Joints in radians, errors in mm or m, force in counts or kN.
    """
    source = windows.source or None

    def wrong(what: str, hint: str) -> ImplausibleDataError:
        return ImplausibleDataError(what, source=source, hint=hint)

    largest = float(np.abs(windows.joints).max(initial=0.0))
    if 0.0 < largest < _RADIANS:
        raise wrong(
            f"all joints lie within {largest / DEG:.2f} deg of zero.",
            "joints in degrees; these look like radians.",
        )
    for name, values in (("predicted_um", windows.predicted), ("measured_um", windows.measured)):
        known = np.abs(values[np.isfinite(values)])
        if known.size and known.max() > LARGEST_ERROR:
            raise wrong(
                f"{name} of up to {known.max() / UM:.0f} um.", "errors in um; are these nm?"
            )
        if known.size and 0.0 < known.max() < 0.1 * UM:
            raise wrong(
                f"{name} of no more than {known.max() / UM:.4f} um.",
                "errors in um; these look like mm or m.",
            )
    size = np.linalg.norm(windows.force, axis=1)
    if size.size and size.max() > LARGEST_FORCE:
        raise wrong(f"a mean force of {size.max():.0f} N.", "forces in N; these look like counts.")
    if size.size and 0.0 < windows.force_peak.max() < SMALLEST_PEAK:
        raise wrong(
            f"f_peak_N of no more than {windows.force_peak.max():.3g} N.",
            "forces in N; these look like kN.",
        )
    mean, peak = np.abs(windows.force_mean), windows.force_peak
    odd = np.flatnonzero(peak < mean)
    if odd.size:
        k = int(odd[0])
        raise wrong(
            f"window {k + 1}: f_peak_N {peak[k]:.3f} is below the size of f_mean_N {mean[k]:.3f}.",
            "f_peak_N is the largest force of a turn, either way, along the same direction.",
        )


def check_direction(windows: WindowSet, direction: Array) -> None:
    """Passes unless ``f_mean_N`` is the mean force along another base axis than the error.

    Args:
        windows: As measured.
        direction: (3,) unit vector in base along which the error counts positive.

    Raises:
        ModelMismatchError: It is.
    """
    axis = int(np.abs(direction).argmax())
    if abs(direction[axis]) < 0.999 or len(windows) < 2:
        return
    if windows.force_mean.any() and not windows.force[:, axis].any():
        raise ModelMismatchError(
            f"f{'xyz'[axis]}_mean_N is zero in all windows and f_mean_N is not, though both are "
            f"along {'xyz'[axis]}.",
            source=windows.source or None,
            hint="a channel that is not connected, or --direction along the measured error.",
        )
    for k, name in enumerate("xyz"):
        same = np.allclose(np.abs(windows.force_mean), np.abs(windows.force[:, k]), atol=1e-6)
        if same and k != axis:
            raise ModelMismatchError(
                f"f_mean_N is the force along {name}, the error is stated along {'xyz'[axis]}.",
                source=windows.source or None,
                hint="--direction along the measured error, e.g. --direction=0,-1,0.",
            )
