"""Source and target poses as they are, boosted towards the target; no alignment, no domains.

``fit_boosted_poses`` lowers the weight of rows that do not fit the target (eq. 19-25). It is the
rival that a transfer with knowledge of the arm has to beat, for regions of any shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.calibration.deng2022.committee import boost
from robotrue.calibration.deng2022.domains import attitude_reference
from robotrue.calibration.deng2022.joined import PoseModel
from robotrue.calibration.deng2022.labelled_poses import label_poses
from robotrue.calibration.deng2022.pose_expert import expert_of, pose_summary
from robotrue.calibration.deng2022.readings import DengReadings
from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import Array
from robotrue.core.regions import CylinderRegion
from robotrue.errors import ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet, concatenate
from robotrue.robot.model import RobotModel

READINGS: Final = DengReadings(rounds=5, outside="nearest")
LEAST: Final = 3
"""Target poses below which boosting has nothing to weigh the source by."""


def fit_boosted_poses(
    robot: RobotModel,
    target: MeasurementSet,
    sources: Sequence[MeasurementSet],
    settings: FitSettings,
) -> PoseModel:
    """Returns a model of poses boosted from sources to the target.

    Args:
        robot: Nominal arm whose tool is the measured point.
        target: At least :data:`LEAST` rows in base.
        sources: In base, at least one.
        settings: The repeatability is used.

    Raises:
        ObservabilityError: Too few target rows, or no source.
        ModelMismatchError: Another number of joints, or sets in a tracker frame.
    """
    if len(target) < LEAST or not sources:
        raise ObservabilityError(
            f"{len(target)} target poses and {len(sources)} measured sources; boosting asks for "
            f"{LEAST} and 1."
        )
    rows = concatenate([*sources, target])
    reference = attitude_reference(robot, rows.joints)
    few = label_poses(robot, target, reference)
    known = [label_poses(robot, source, reference) for source in sources]
    committee = boost(
        (few.features, few.errors),
        (
            np.concatenate([k.features for k in known]),
            np.concatenate([k.errors for k in known]),
        ),
        READINGS,
        target_weight=np.ones(len(target)),
    )
    return PoseModel(
        robot=robot,
        experts=(expert_of(_around(rows.position), committee, few, settings),),
        reference=reference,
        outside=READINGS.outside,
        summary={
            **pose_summary(rows, "boosted poses", inside=""),
            "target_rows": len(target),
        },
    )


def _around(points: Array) -> CylinderRegion:
    """A full ring about joint 1 that holds all points."""
    radius, height = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    return CylinderRegion(
        angle=(-np.pi, np.pi),
        radius=(float(radius.min()), float(radius.max())),
        height=(float(height.min()), float(height.max())),
    )
