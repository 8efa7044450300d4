"""``register-rounds``: a part probed again after each run, until no correction remains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.calibration.machined import tip_columns
from robotrue.calibration.model import ErrorModel, identity_of, provenance_of
from robotrue.cell.registration.rounds import RoundsResult, adjust_in_rounds
from robotrue.core.arrays import Array, IntArray
from robotrue.core.provenance import merge
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ImplausibleDataError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.validation.part_registration import check_rows, check_touches
from robotrue.validation.registered_part import RegisteredPart
from robotrue.validation.registration_frame import (
    CheckedTouches,
    RegistrationSettings,
    arm_belief,
    frame_alone,
    touch_query,
)
from robotrue.validation.registration_methods import fit_by_method
from robotrue.validation.touch_checks import file_of, naming

SAME_POINT: Final = 1e-6
"""m; nominal points further apart are not one point."""


def register_in_rounds(
    arm: ErrorModel,
    rounds: Sequence[ProbingSet],
    T_base_part: Array,
    *,
    name: str = "part",
    settings: RegistrationSettings | None = None,
) -> tuple[RegisteredPart, RoundsResult]:
    """Returns the part after the rounds so far, and what each of them showed.

    Args:
        arm: The model that touched and that runs; :class:`NominalModel` without one.
        rounds: Touches of the same feature points, a set a round.
        T_base_part: (4, 4) the frame that was run in the first round.
        name: Of the part.
        settings: Noise, tool, tolerance; method ``touches`` or ``feng2018``.

    Raises:
        ConfigurationError: No round, surface touches, or another method.
        ObservabilityError: Collinear or too few points.
        ImplausibleDataError: Wrong units, other points than in the first round, points of another
            part, exchanged ones, one touched wrong.
        ModelMismatchError: Joints of another robot.
    """
    settings = RegistrationSettings() if settings is None else settings
    method = settings.method
    if method not in ("touches", "feng2018") or not rounds:
        raise ConfigurationError(
            f"{len(rounds)} rounds by method {method}, expected one or more by touches or feng2018."
        )
    order = [_order_as_first(rounds[0], each) for each in rounds]
    ordered = [each.subset(rows) for each, rows in zip(rounds, order, strict=True)]
    found = [_check_round(arm, name, each, settings) for each in ordered]
    touched = np.stack([each.in_base for each in found])
    with naming(ordered[-1]):
        result = adjust_in_rounds(
            ordered[0].point,
            T_base_part,
            touched,
            sigma=_sigma(arm, ordered, settings),
            names=ordered[0].labels,
            method=method,
        )
        end = result.adjustment
        last = replace(found[-1], in_base=result.touched)
        frame = frame_alone(
            arm, last, settings, placed=end.T_base_part, reasons=_find_reasons(result)
        )
    identity = identity_of(arm)
    part = RegisteredPart(
        route="frame",
        frames=(frame,),
        identity=identity,
        touched_with=identity,
        provenance=merge(
            [
                *(each.provenance for each in rounds),
                *([provenance_of(arm)] if arm.calibrated else []),
            ]
        ),
    )
    return part, result


def _order_as_first(first: ProbingSet, now: ProbingSet) -> IntArray:
    """Rows of a round in the order of the first.

    Raises:
        ConfigurationError: A touch of a surface.
        ImplausibleDataError: Other points, or one of them twice.
    """
    if not now.full.all():
        row = int(np.argmin(now.full))
        raise ConfigurationError(
            f"{now.labels[row]} has a normal; rounds take feature points, of which all three "
            "coordinates are touched.",
            source=file_of(now),
            line=int(now.lines[row]) if len(now.lines) else None,
            hint="robotrue register takes touches of surfaces.",
        )
    if sorted(now.names) != sorted(first.names) or len(set(now.names)) < len(now.names):
        raise ImplausibleDataError(
            f"points {', '.join(now.names)}, the first round has {', '.join(first.names)}.",
            source=file_of(now),
            hint="every round touches each point once, under the same name.",
        )
    rows = np.array([now.names.index(name) for name in first.names])
    apart = np.linalg.norm(now.point[rows] - first.point, axis=1)
    if apart.max() > SAME_POINT:
        worst = int(np.argmax(apart))
        raise ImplausibleDataError(
            f"the nominal point of {first.names[worst]} is {apart[worst] / MM:.3f} mm from that of "
            "the first round.",
            source=file_of(now),
            line=int(now.lines[rows[worst]]) if len(now.lines) else None,
            hint="px_mm, py_mm, pz_mm are those of the drawing and stay the same.",
        )
    return rows


def _check_round(
    arm: ErrorModel, name: str, touches: ProbingSet, settings: RegistrationSettings
) -> CheckedTouches:
    """One round with the checks of a registration, none of its touches wrong."""
    check_rows(arm, touches, (name,))
    with naming(touches):
        found = check_touches(arm, name, touches, settings)
        fit, _ = fit_by_method("touches", touches, found.in_base, noise=found.noise)
        if fit.outliers:
            far = dict(zip(fit.names, fit.distances, strict=True))
            listed = ", ".join(f"{n} ({far[n] / MM:.2f} mm)" for n in fit.outliers)
            raise ImplausibleDataError(
                f"touches that contradict the others of their round: {listed}.",
                hint="probe them again.",
            )
        return found


def _sigma(arm: ErrorModel, rounds: Sequence[ProbingSet], settings: RegistrationSettings) -> float:
    """M per axis, one touch against the same in another round.

    Touch and repeatability, and where joints are known what another lean of the wrist changes of
    arm and tip.
    """
    square = settings.touch**2 + settings.arm.repeatability_sd**2
    belief = arm_belief(arm, settings) if all(each.has_joints for each in rounds) else None
    if belief is not None and len(rounds) > 1:
        roots = np.stack(
            [
                tip_columns(belief, touch_query(each.joints, belief.robot, settings))
                @ belief.root.T
                for each in rounds
            ]
        )
        apart = roots - roots.mean(axis=0)
        freedom = 3 * len(rounds[0]) * (len(rounds) - 1)
        square += belief.inflation * float((apart**2).sum()) / freedom
    return float(np.sqrt(square))


def _find_reasons(result: RoundsResult) -> tuple[str, ...]:
    """Why not to cut after the last round."""
    end = result.adjustment
    last, number = end.passes[-1], len(end.passes)
    size = f"{last.worst / MM:.3f} mm and {last.angle / DEG:.3f} deg"
    if end.verdict == "run again":
        return (f"Round {number} corrected the frame by {size}: run and probe again.",)
    if end.verdict == "not settled":
        return (
            f"Round {number} still moved the frame by {size}, more than the touch uncertainty: "
            "the part is loose, or touches are less accurate than stated (--touch-sigma-mm).",
        )
    return ()
