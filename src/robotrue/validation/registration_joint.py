"""Registration with arm, tool and frames in one estimate; the touches refine the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.calibration.machined import compensated_covariance
from robotrue.calibration.model import ErrorModel, Query, identity_of, provenance_of
from robotrue.calibration.probing import (
    ProbingEstimate,
    ProbingSettings,
    estimate_probing,
    model_of_estimate,
)
from robotrue.cell.registration.fit import Registration
from robotrue.core.arrays import Array
from robotrue.core.units import DEG, MM
from robotrue.errors import ObservabilityError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel
from robotrue.validation.registered_part import FoundFrame, RegisteredPart
from robotrue.validation.registration_frame import (
    TOOL,
    CheckedTouches,
    RegistrationSettings,
    arm_belief,
    finish_frame,
    same_tool,
    tips,
)
from robotrue.validation.touch_checks import file_of, list_names

ENOUGH: Final = 27
"""Numbers (9 feature points) from which a nominal arm is learned with its frames. Machined rms of
100 simulated cells, frame alone and joint estimate: 9 touches of three sides .69 and .20 mm, 10 of
one side .17 and .12 mm there, 1.44 and 1.36 mm on the other (benchmarks/registered_parts.py)."""
SPARE: Final = 3
"""Fewest numbers beyond frames and tool for a joint estimate."""
EXACT: Final = 1e-6
"""m, deviation of a tip stated as exact."""
TILT: Final = 10.0 * DEG
"""Touches whose attitudes differ by less cannot separate the tool from the frame."""
LOUD: Final = 3.0
"""Noise beyond what was stated, as a factor, from which the frame is not to be cut in."""


def numbers_of(touches: ProbingSet) -> int:
    """Returns the count of numbers of the touches: three of a feature point, one of a normal."""
    return 3 * int(touches.full.sum()) + int((~touches.full).sum())


def enough_for_joint(arm: ErrorModel, touches: ProbingSet, settings: RegistrationSettings) -> bool:
    """Returns whether arm, tool and frames should be estimated together by default.

    A model that keeps no covariance of its parameters cannot learn from touches.
    """
    if not touches.has_joints or arm_belief(arm, settings) is None:
        return False
    if not arm.calibrated:
        return numbers_of(touches) >= ENOUGH
    return numbers_of(touches) >= 6 * len(touches.parts)


def require_numbers(touches: ProbingSet) -> None:
    """Passes if the touches are enough for a joint estimate.

    Raises:
        ObservabilityError: No joints, or too few touches; states their number and names.
    """
    source = file_of(touches)
    if not touches.has_joints:
        raise ObservabilityError(
            f"touches {list_names(touches.labels)} have no joints: arm and tool cannot be "
            "estimated from points in base.",
            source=source,
            hint="--fit frame, or give j1_deg, j2_deg, ... of every touch.",
        )
    have, need = numbers_of(touches), 6 * len(touches.parts) + 3 + SPARE
    if have < need:
        raise ObservabilityError(
            f"touches {list_names(touches.labels)} give {have} numbers; {len(touches.parts)} "
            f"frame{'s' if len(touches.parts) > 1 else ''} of 6, 3 of the tool and {SPARE} to "
            f"spare ask for {need}, and the arm for more.",
            source=source,
            hint="touch more points, or --fit frame.",
        )


def joint_registration(
    arm: ErrorModel,
    checked: Sequence[CheckedTouches],
    touches: ProbingSet,
    settings: RegistrationSettings,
) -> RegisteredPart:
    """Returns all frames and the refined arm.

    Args:
        arm: Prior of the arm.
        checked: Part by part.
        touches: Of all parts.
        settings: Noise and tool.

    Raises:
        ObservabilityError: An undetermined motion.
        ImplausibleDataError: Exchanged names, or half the touches against the others.
        ConvergenceError: No convergence.
    """
    robot = arm.robot
    known, doubts = _tool_sigma(arm, robot, touches, settings)
    estimate = estimate_probing(
        arm,
        touches,
        ProbingSettings(
            touch_sigma=settings.touch,
            tool_sigma=known,
            T_flange_tool=None if same_tool(robot, settings) else settings.T_flange_tool,
            payload=settings.arm.payload,
            priors=settings.arm,
        ),
    )
    refined = model_of_estimate(estimate)
    query = Query(joints=touches.joints, load=settings.arm.payload)
    machined = compensated_covariance(
        estimate.belief,
        query,
        T_base_part=estimate.T_base_part,
        part=touches.part,
        layout=estimate.layout,
    )
    in_base = tips(refined, touches.joints, settings)
    return RegisteredPart(
        route="joint",
        frames=tuple(
            _frame(
                estimate,
                k,
                replace(found, in_base=in_base[touches.part == k]),
                machined[touches.part == k],
                settings,
            )
            for k, found in enumerate(checked)
        ),
        identity=identity_of(refined),
        touched_with=identity_of(arm),
        provenance=provenance_of(refined),
        refined=refined,
        moved=_measure_shift(arm, in_base, touches, settings),
        doubts=doubts,
    )


def _frame(
    estimate: ProbingEstimate,
    k: int,
    found: CheckedTouches,
    machined: Array,
    settings: RegistrationSettings,
) -> FoundFrame:
    """The frame of a part, of touches where the refined arm has the tip."""
    mine = estimate.touches.part == k
    labels = np.array(estimate.touches.labels)[mine]
    wrong = np.isin(labels, estimate.outliers)
    own = found.touches.labels
    fit = Registration(
        method="joint",
        T_base_part=estimate.T_base_part[k],
        covariance=estimate.covariance(k),
        names=own,
        residuals=estimate.residuals[mine],
        outliers=tuple(name for name, bad in zip(own, wrong, strict=True) if bad),
        sigma=estimate.sigma,
        sigma_source="stated",
        degrees_of_freedom=numbers_of(found.touches.subset(~wrong)) - 6,
    )
    stated = float(np.hypot(settings.touch, estimate.belief.repeatability))
    reasons: tuple[str, ...] = ()
    if estimate.sigma > LOUD * stated:
        reasons += (
            f"The touches scatter by {estimate.sigma / MM:.3f} mm per axis, stated are "
            f"{stated / MM:.3f} mm: more than {LOUD:g} times.",
        )
    return finish_frame(found, fit, machined, settings.tolerance, reasons)


def _tool_sigma(
    arm: ErrorModel,
    robot: RobotModel,
    touches: ProbingSet,
    settings: RegistrationSettings,
) -> tuple[float, tuple[str, ...]]:
    """Returns the uncertainty of the tip, m per axis, and notes on assumptions about it."""
    doubts: list[str] = []
    known = settings.tool_sigma
    if known is None:
        known = 0.0 if same_tool(robot, settings) and arm.calibrated else TOOL
        if known and arm.calibrated:
            doubts.append(
                "The probing tip is not the point of the model; its place in the flange is "
                f"assumed to be known to {TOOL / MM:g} mm per axis (--tool-sigma-mm)."
            )
    if known and _tilt(robot, touches) < TILT:
        doubts.append(
            f"All touches were made within {TILT / DEG:g} deg of one attitude: an error of the "
            "tip acts like a shift of the part, and appears when the part is machined from "
            "another side."
        )
    # A nominal arm's prior of the tip would replace 0.
    return known if arm.calibrated else max(known, EXACT), tuple(doubts)


def _tilt(robot: RobotModel, touches: ProbingSet) -> float:
    """Largest angle between the tool's attitude at the first touch and any other, rad."""
    R = forward(robot.nominal(), touches.joints)[:, :3, :3]
    cosine = 0.5 * (np.einsum("nij,ij->n", R, R[0]) - 1.0)
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)).max())


def _measure_shift(
    arm: ErrorModel, after: Array, touches: ProbingSet, settings: RegistrationSettings
) -> float:
    """Root mean square distance, m, by which the tip moved at the touches."""
    before = tips(arm, touches.joints, settings)
    return float(np.sqrt(((after - before) ** 2).sum(axis=1).mean()))
