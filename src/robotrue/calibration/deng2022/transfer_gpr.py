"""Tr-GPR, the paper's method whole: align the source to each sub-space, boost, join.

``fit_deng2022`` is eq. 11-32 of Deng et al. 2022 under :class:`DengReadings`; ``fit_pose_gpr`` is
what the paper compares it with, a Gaussian process on poses of one region. Both need positions in
base. They are no entries of :data:`robotrue.calibration.methods.METHODS`: they need domains.

``fit_boosted_poses`` takes source and target poses as they are, in base, and lowers the weight of
rows that do not fit the target (eq. 19-25, with the source not aligned). It is the rival that a
transfer with knowledge of the arm has to beat, for regions of any shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Final

import numpy as np

from robotrue.calibration.deng2022.alignment import (
    Alignment,
    align,
    carry_source,
    measurement_weights,
)
from robotrue.calibration.deng2022.committee import Committee, boost, single
from robotrue.calibration.deng2022.domains import (
    Domains,
    attitude_reference,
    check_overlap,
    mapped_pairs,
    overlap_members,
    pose_features,
)
from robotrue.calibration.deng2022.joined import Expert, PoseModel
from robotrue.calibration.deng2022.readings import DengReadings
from robotrue.calibration.lineage import describe_rows
from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.regions import CylinderRegion
from robotrue.core.units import DEG, MM
from robotrue.errors import ModelMismatchError, ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet, concatenate
from robotrue.robot.forward import forward
from robotrue.robot.model import RobotModel

_FEWEST_POSES = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Labelled(Columns):
    """Poses and their errors: the paper's D = {x, y}.

    Attributes:
        features: (n, 6) m and rad.
        errors: (n, 3) m, measured minus commanded, base.
        covariance: (n, 3, 3) m^2 of the measurement.
    """

    features: Annotated[Array, Column("n 6", unit="m, rad")]
    errors: Annotated[Array, Column("n 3", unit="m")]
    covariance: Annotated[Array, Column("n 3 3", unit="m^2")]


def label_poses(robot: RobotModel, measurements: MeasurementSet, reference: Array) -> Labelled:
    """Returns poses and errors of a set in base.

    Args:
        robot: Nominal arm whose tool is the measured point.
        measurements: In base.
        reference: (3,) rad, A, B, C near which attitudes are read.

    Raises:
        ModelMismatchError: Another number of joints, or a set in a tracker frame.
    """
    if measurements.dof != robot.dof:
        raise ModelMismatchError(
            f"the measurements have {measurements.dof} joints, {robot.name} has {robot.dof}."
        )
    if measurements.frame != "base":
        raise ModelMismatchError(
            "the measurements are in a tracker frame; the paper's method has no registration.",
            hint="register the tracker to the base first.",
        )
    poses = forward(robot.nominal(), measurements.joints)
    return Labelled(
        features=pose_features(poses, reference),
        errors=measurements.position - poses[:, :3, 3],
        covariance=measurements.covariance,
    )


def fit_deng2022(
    robot: RobotModel,
    source: MeasurementSet,
    target: MeasurementSet,
    domains: Domains,
    settings: FitSettings,
    readings: DengReadings | None = None,
) -> PoseModel:
    """Returns the paper's Tr-GPR: eq. 11-26 on a complete source and few target poses.

    Args:
        robot: Nominal arm whose ``T_flange_tool`` is the nominal reflector.
        source: Complete sampling of the source domain, in base.
        target: A few poses in every sub-space, in base; best images of source poses (rule 1), else
            each is paired with the nearest image.
        domains: Source, target and sub-spaces.
        settings: The repeatability is used.
        readings: How ambiguous equations are read.

    Raises:
        ModelMismatchError: Another robot, or sets that are not in base.
        ObservabilityError: Too few source poses, or a sub-space without target poses.
        ConfigurationError: Rule 4, about overlap, is broken.
        ShapeError: The literal reading of eq. 12, which cannot be computed.
    """
    chosen = DengReadings() if readings is None else readings
    _enough(source, "source")
    reference = attitude_reference(robot, source.joints)
    known, few = (label_poses(robot, rows, reference) for rows in (source, target))
    check_overlap(domains, few.features)
    pieces, alignments = transfer_rows(known, few, domains, chosen)
    twice = overlap_members(domains, few.features[:, :3])
    scale = None
    if chosen.boosting_weights:
        scale = measurement_weights(few.errors, few.covariance).mean(axis=0)
    committee = boost(
        (few.features, few.errors),
        pieces,
        chosen,
        target_weight=np.where(twice, chosen.overlap_weight, 1.0),
        output_weights=scale,
    )
    experts = (
        expert_of(domains.target, committee, few, settings),
        expert_of(domains.source, single(known.features, known.errors, chosen), known, settings),
    )
    return PoseModel(
        robot=robot,
        experts=experts,
        reference=reference,
        outside=chosen.outside,
        summary={
            **pose_summary(concatenate([source, target]), "deng2022"),
            "readings": asdict(chosen),
            "sub_spaces": [_describe_alignment(a) for a in alignments],
            "rounds": len(committee.betas),
            "betas": committee.betas.tolist(),
        },
    )


def fit_pose_gpr(
    robot: RobotModel,
    measurements: MeasurementSet,
    region: CylinderRegion,
    settings: FitSettings,
    readings: DengReadings | None = None,
) -> PoseModel:
    """Returns the paper's GPR-n: one Gaussian process on the poses of a region, eq. 27-32.

    Args:
        robot: Nominal arm whose ``T_flange_tool`` is the nominal reflector.
        measurements: In base.
        region: Where the model answers.
        settings: The repeatability is used.
        readings: Kernel, mean, length and what happens outside.

    Raises:
        ModelMismatchError: Another robot, or a set that is not in base.
        ObservabilityError: Too few poses.
    """
    chosen = DengReadings() if readings is None else readings
    _enough(measurements, "training")
    reference = attitude_reference(robot, measurements.joints)
    rows = label_poses(robot, measurements, reference)
    committee = single(rows.features, rows.errors, chosen)
    return PoseModel(
        robot=robot,
        experts=(expert_of(region, committee, rows, settings),),
        reference=reference,
        outside=chosen.outside,
        summary={**pose_summary(measurements, "pose-gpr"), "readings": asdict(chosen)},
    )


def transfer_rows(
    source: Labelled, target: Labelled, domains: Domains, readings: DengReadings
) -> tuple[tuple[Array, Array], tuple[Alignment, ...]]:
    """Returns the source in every sub-space, (k n, 6) and (k n, 3), and the alignments, eq. 11-17.

    Raises:
        ObservabilityError: A sub-space without target poses.
        ShapeError: The literal reading of eq. 12.
    """
    features, errors, alignments = [], [], []
    for j, angle in enumerate(domains.angles):
        pairs = mapped_pairs(domains, j, source.features, target.features, readings.attitude)
        found = align(
            readings,
            float(angle),
            source=source.features,
            source_errors=source.errors,
            mapped=pairs.source,
            target=target.features[pairs.target],
            target_errors=target.errors[pairs.target],
            covariance=target.covariance[pairs.target],
        )
        moved, carried = carry_source(found, readings, source.features, source.errors)
        features.append(moved)
        errors.append(carried)
        alignments.append(found)
    return (np.concatenate(features), np.concatenate(errors)), tuple(alignments)


def expert_of(
    region: CylinderRegion, committee: Committee, rows: Labelled, settings: FitSettings
) -> Expert:
    """Returns the expert of a region; its noise is the learned one without the instrument's.

    That is repeatability and what no pose explains.
    """
    instrument = float(np.mean(np.trace(rows.covariance, axis1=1, axis2=2)) / 3.0)
    left = (committee.noise * MM) ** 2 - instrument
    white = float(np.sqrt(max(left, settings.repeatability_sd**2)))
    return Expert(region=region, committee=committee, white=white)


def _enough(measurements: MeasurementSet, name: str) -> None:
    if len(measurements) < _FEWEST_POSES:
        raise ObservabilityError(
            f"{len(measurements)} {name} poses, expected {_FEWEST_POSES} or more.",
            hint="a complete grid of a small region; the paper takes 126.",
        )


def pose_summary(
    rows: MeasurementSet, method: str, *, inside: str = ", and only inside its domains"
) -> dict[str, object]:
    """Returns the JSON values of a model of poses; lengths are SI like everything in an archive.

    Args:
        rows: All rows it was fitted to.
        method: Its name.
        inside: Where it holds, the end of the doubt.
    """
    return {
        "method": method,
        **describe_rows(rows),
        "screened_rows": [],
        "verdict": "conditional",
        "doubts": [
            "A model of poses: it holds for the payload, the tool point and the arm configuration "
            f"that were measured{inside}."
        ],
    }


def _describe_alignment(alignment: Alignment) -> dict[str, float]:
    return {"angle_deg": alignment.angle / DEG, "ridge": alignment.ridge}


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
        output_weights=None,
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
