"""Faults of a source, reported before and after it is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.sources import TransferSource, require_same_type
from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.arrays import Array
from robotrue.core.poses import apply, fit_rigid
from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ImplausibleDataError, ModelMismatchError, RobotrueError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.plausibility import check_plausible
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load
from robotrue.validation.evaluation import aligned_rows, evaluate
from robotrue.validation.validate import physical_floor

FEWEST_PLAUSIBLE: Final = 6
"""Fewest rows from which a rigid motion shows whether joints and positions belong together."""
MANY_SCREENED: Final = 0.05
"""Share of rows without weight from which a source is called contaminated."""
USELESS: Final = 0.9
"""A fit that leaves more than this part of the aligned error has found nothing."""
MOVED: Final = 0.5 * MM
"""rms from which a frame that explains most of the disagreement is named."""
EXPLAINED: Final = 0.25
"""Part of the disagreement that may be left once the frame is moved."""
TIGHT: Final = 2.0
LOOSE: Final = 0.05
"""Root mean square of the geometric errors found, in prior standard deviations: above the first
the prior was too tight (an honest one gives it to less than one arm in a million), below the
second more than twenty times too wide."""
DRIFTED: Final = 5.0
"""A learned drift scale this many times its default is named."""


def admit_sources(
    robot: RobotModel, sources: Sequence[TransferSource]
) -> tuple[tuple[TransferSource, ...], tuple[str, ...]]:
    """Returns the sources that fit this robot, and the reasons why the others are excluded."""
    kept, doubts = [], []
    for source in sources:
        try:
            if source.model is not None:
                require_same_type(robot, source.model.robot, source.name)
            if source.measurements is not None:
                check_rows(robot, source.measurements)
            kept.append(source)
        except (ModelMismatchError, ImplausibleDataError) as cause:
            doubts.append(f"source {source.name} is left out: {cause}")
    return tuple(kept), tuple(doubts)


def check_rows(robot: RobotModel, rows: MeasurementSet) -> None:
    """Refuses rows that are impossible for this robot.

    Fewer than :data:`FEWEST_PLAUSIBLE` rows fit any frame; in base they are only compared with the
    commanded poses.

    Raises:
        ModelMismatchError: Another number of joints.
        ImplausibleDataError: Another unit, frame, robot, or rows that do not belong together.
    """
    if rows.dof != robot.dof:
        raise ModelMismatchError(
            f"{rows.dof} joints in the measurements, {robot.dof} in {robot.name}.",
            hint="check which robot was measured.",
        )

    def command_points(joints: Array) -> Array:
        return forward(robot.nominal(), joints)[:, :3, 3]

    points = command_points(rows.joints)
    if len(rows) >= FEWEST_PLAUSIBLE:
        check_plausible(rows, points, robot.reach, forward=command_points, minimum=FEWEST_PLAUSIBLE)
        return
    gap = float(np.median(np.linalg.norm(rows.position - points, axis=1)))
    if rows.frame == "base" and gap > 0.1 * robot.reach:
        raise ImplausibleDataError(
            f"{len(rows)} positions lie {gap / MM:.4g} mm (median) from the commanded ones, for a "
            f"reach of {robot.reach / MM:.4g} mm: another unit, frame or robot.",
            hint="check units, frame and robot; six or more rows decide which.",
        )


def fit_doubts(
    name: str, model: ErrorModel, rows: MeasurementSet, settings: FitSettings
) -> list[str]:
    """Returns the objections of the fit of a source to the source or the prior."""
    summary = model.training_summary()
    found = _find_contamination(name, summary, rows)
    held = summary.held_out_mean
    if rows.frame == "base" and held is not None and not found:
        aligned = aligned_rows(model, rows)
        if aligned is not None:
            before = float(np.median(np.linalg.norm(aligned, axis=1)))
            if held > USELESS * before and before > 3.0 * physical_floor(rows.covariance):
                found.append(
                    f"source {name}: a fit has no effect, {held / MM:.3f} mm held out against "
                    f"{before / MM:.3f} mm with base and tool aligned; joints and positions may "
                    "not belong together (rows shuffled?)."
                )
    return found + prior_doubts(summary, settings)


def _find_contamination(name: str, summary: TrainingSummary, rows: MeasurementSet) -> list[str]:
    screened = summary.screened_rows
    if len(screened) <= MANY_SCREENED * len(rows):
        return []
    line = int(rows.source_row[int(screened[0])])
    return [
        f"source {name}: {len(screened)} of {len(rows)} rows carry no weight (line {line} first): "
        "gross errors; check these rows."
    ]


def prior_doubts(summary: TrainingSummary, settings: FitSettings) -> list[str]:
    """Returns whether the geometric errors found fit the stated prior scales."""
    ratios = [
        parameter.value / getattr(settings.scales, group)
        for group in ("theta", "d", "a", "alpha")
        for name, parameter in (summary.parameters or {}).items()
        if name.rstrip("0123456789") == group and parameter.kind not in ("fixed", "unseen")
    ]
    if len(ratios) < 8:
        return []
    size = float(np.sqrt(np.mean(np.square(ratios))))
    if size > TIGHT:
        return [
            f"the errors found are {size:.1f} standard deviations of the prior (rms): the prior is "
            "too tight; its scales were estimated, but with few poses it pulls to zero."
        ]
    if size < LOOSE:
        return [
            f"the errors found are {size:.3f} standard deviations of the prior (rms): the prior is "
            "too loose; its scales were estimated, but few poses determine less than they could."
        ]
    return []


def target_doubts(
    name: str, model: ErrorModel, target: MeasurementSet, payload: Load | None
) -> list[str]:
    """Returns whether a frame explains how a source disagrees with the target rows."""
    if len(target) < FEWEST_PLAUSIBLE:
        return []
    try:
        seen = evaluate(model, target, payload=payload)
    except RobotrueError:
        return []
    measured = seen.measured.position
    predicted = measured - seen.after
    motion = fit_rigid(predicted, measured)
    left = apply(motion, predicted) - measured
    free = 3 * len(left) - 6
    before = float(np.sqrt((seen.after**2).sum() / len(left)))
    after = float(np.sqrt((left**2).sum() * 3.0 / free))
    if before < MOVED or after > EXPLAINED * before:
        return []
    middle = predicted.mean(axis=0)
    shift = float(np.linalg.norm(apply(motion, middle[None])[0] - middle))
    turn = float(np.linalg.norm(rotation_vector_from_matrix(motion[:3, :3])))
    return [
        f"source {name} and the target are in different frames: they agree to {after / MM:.3f} mm "
        f"rms after a shift of {shift / MM:.3g} mm and a rotation of {turn / DEG:.3g} deg, to "
        f"{before / MM:.3f} mm without."
    ]


def drift_doubts(summary: TrainingSummary) -> list[str]:
    """Returns which things changed far more than the stated relation lets expect."""
    learned, usual = summary.drift_scales, summary.drift_defaults
    found = [
        f"{name} {learned[name] / usual[name]:.0f} times"
        for name in learned
        if name in usual and usual[name] > 0.0 and learned[name] > DRIFTED * usual[name]
    ]
    if not found:
        return []
    return [
        "the change between source and target is larger than expected of a "
        f"{summary.relation or 'source'}: drift beyond its usual scale in {', '.join(found)}."
    ]
