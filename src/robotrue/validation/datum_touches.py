"""Datums touched in joints, with what touching the frame and checking it share of the arm."""

from __future__ import annotations

import numpy as np

from robotrue.calibration.machined import unchanged_covariance
from robotrue.calibration.model import ErrorModel
from robotrue.cell.part import PartFrame
from robotrue.cell.registration.fit import Noise
from robotrue.cell.registration.touches import touch_gain
from robotrue.core.arrays import Array
from robotrue.core.poses import propagate_covariance
from robotrue.errors import ConfigurationError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.validation.part_registration import check_rows
from robotrue.validation.registration_frame import (
    RegistrationSettings,
    arm_belief,
    robot_share,
    tips,
    touch_query,
)
from robotrue.validation.slot_test import DatumCheck, judge_datums
from robotrue.validation.touch_checks import check_units, file_of, naming


def check_part(
    arm: ErrorModel,
    frame: PartFrame,
    datums: ProbingSet,
    *,
    used: ProbingSet | None,
    tolerance: float,
    settings: RegistrationSettings,
) -> tuple[DatumCheck, bool]:
    """Returns whether datums agree with a part frame, and whether the arm's share is in it.

    Args:
        arm: The model the frame belongs to.
        frame: Of the part.
        datums: Touched feature points.
        used: The touches the frame was made of; None: not known.
        tolerance: m.
        settings: Noise and tool.

    Raises:
        ConfigurationError: A touch of a surface, a datum that was used, or no tolerance.
        ImplausibleDataError: Wrong units.
        ModelMismatchError: Joints of another robot.
    """
    check_rows(arm, datums, (frame.name,))
    if not datums.full.all():
        raise ConfigurationError(
            f"{datums.labels[int(np.argmin(datums.full))]} has a normal; a datum is a point.",
            source=file_of(datums),
            hint="leave nx, ny, nz out of a file of datums.",
        )
    in_base = tips(arm, datums.joints, settings) if datums.has_joints else datums.position
    with naming(datums):
        if len(datums) > 1:
            check_units(datums, in_base)
        covariance, joint = _covariance(arm, frame, datums, used, settings)
        check = judge_datums(
            frame.T_base_part,
            datums.point,
            in_base,
            covariance=covariance,
            tolerance=tolerance,
            names=datums.labels,
            used=() if used is None else used.names,
        )
    return check, joint


def _covariance(
    arm: ErrorModel,
    frame: PartFrame,
    datums: ProbingSet,
    used: ProbingSet | None,
    settings: RegistrationSettings,
) -> tuple[Array, bool]:
    """(n, 3, 3) m^2 in part, of touched less nominal; whether arm and frame are in it jointly."""
    turn = frame.T_base_part[:3, :3]
    belief = None
    if used is not None and used.has_joints and datums.has_joints:
        belief = arm_belief(arm, settings)
    if belief is None or used is None:
        noise = Noise(touch=settings.touch, robot=robot_share(arm, datums, settings))
        known = propagate_covariance(frame.covariance, datums.point @ turn.T)
        return np.asarray(turn.T @ (known + noise.sigma**2 * np.eye(3)) @ turn), False
    believed = [name not in frame.outliers for name in used.labels]
    at = tips(arm, used.joints, settings)
    covariance = unchanged_covariance(
        belief,
        touch_query(used.joints, belief.robot, settings),
        touch_query(datums.joints, belief.robot, settings),
        points=datums.point,
        T_base_part=frame.T_base_part,
        gain=touch_gain(used, at, frame.T_base_part, believed),
        touch_sigma=settings.touch,
    )
    return covariance + settings.touch**2 * np.eye(3), True
