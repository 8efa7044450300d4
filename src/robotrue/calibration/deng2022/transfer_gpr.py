"""Tr-GPR, the paper's method whole: align the source to each sub-space, boost, join.

``fit_deng2022`` is eq. 11-32 of Deng et al. 2022 under :class:`DengReadings`; ``fit_pose_gpr`` is
what the paper compares it with, a Gaussian process on poses of one region. Both need positions in
base. They are no entries of :data:`robotrue.calibration.methods.METHODS`: they need domains.

``fit_boosted_poses`` takes source and target poses as they are, without alignment and domains, and
lowers the weight of rows that do not fit the target (eq. 19-25). It is the rival that a transfer
with knowledge of the arm has to beat, for regions of any shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from typing import Final

import numpy as np

from robotrue.calibration.deng2022.alignment import (
    Alignment,
    align,
    carry_source,
    measurement_weights,
)
from robotrue.calibration.deng2022.committee import (
    Committee,
    boost,
    held_out_inflation,
    left_out_inflation,
    single,
)
from robotrue.calibration.deng2022.domains import (
    LEVER,
    Domains,
    Labelled,
    attitude_reference,
    check_overlap,
    label_poses,
    mapped_pairs,
    overlap_members,
)
from robotrue.calibration.deng2022.joined import Expert, PoseModel, expert_of, pose_summary
from robotrue.calibration.deng2022.readings import AttitudeReading, DengReadings
from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import Array
from robotrue.core.regions import CylinderRegion, bound_cylinder
from robotrue.core.units import DEG, MM
from robotrue.errors import ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet, concatenate
from robotrue.robot.model import RobotModel

FEWEST_POSES: Final = 8
"""Of the source, or of a region with a separate process."""
FAR_PAIR: Final = 1.0 * MM
"""Mean distance of pairs from which the other convention of attitude is looked at."""


def fit_deng2022(
    robot: RobotModel,
    source: MeasurementSet,
    target: MeasurementSet,
    domains: Domains,
    settings: FitSettings,
    readings: DengReadings | None = None,
    *,
    inflation: float | None = None,
) -> PoseModel:
    """Returns the paper's Tr-GPR: eq. 11-26 on a complete source and few target poses.

    The stated variance is widened by what target rows held out in turn show to be missing.

    Args:
        robot: Nominal arm whose ``T_flange_tool`` is the nominal reflector.
        source: Complete sampling of the source domain, in base.
        target: A few poses in every sub-space, in base; best images of source poses (rule 1), else
            each is paired with the nearest image.
        domains: Source, target and sub-spaces.
        settings: The repeatability is used.
        readings: How ambiguous equations are read.
        inflation: Factor on the variance in the target domain; None learns it on held-out rows.

    Raises:
        ModelMismatchError: Another robot, or sets that are not in base.
        ObservabilityError: Too few source poses, or too few target poses in a sub-space.
        ConfigurationError: Rule 4, about overlap, is broken.
        ShapeError: The literal reading of eq. 12, which cannot be computed.
    """
    chosen = DengReadings() if readings is None else readings
    _enough(source, "source")
    reference = attitude_reference(robot, source.joints)
    known, few = (label_poses(robot, rows, reference) for rows in (source, target))
    check_overlap(domains, few.features)
    committee, alignments = fit_target(known, few, domains, chosen)
    target_expert = expert_of(domains.target, committee, few, settings)
    if inflation is None:
        carry = partial(_carry_errors, known, domains, chosen)
        inflation = held_out_inflation(committee, few, carry, target_expert.white)
    experts = (
        replace(target_expert, inflation=inflation),
        _source_expert(known, domains, chosen, settings),
    )
    doubts = _attitude_doubts(known, few, domains, chosen, alignments)
    summary = pose_summary(concatenate([source, target]), "deng2022", doubts=doubts)
    return PoseModel(
        robot=robot,
        experts=experts,
        reference=reference,
        outside=chosen.outside,
        summary={
            **summary,
            "readings": asdict(chosen),
            "sub_spaces": [_describe_alignment(a) for a in alignments],
            "rounds": len(committee.betas),
            "betas": committee.betas.tolist(),
            "inflation": inflation,
        },
    )


def fit_target(
    source: Labelled,
    target: Labelled,
    domains: Domains,
    readings: DengReadings,
) -> tuple[Committee, tuple[Alignment, ...]]:
    """Returns the boosted processes of the target domain and the alignments, eq. 11-25.

    Args:
        source: All source rows.
        target: Target rows.
        domains: Source, target and sub-spaces.
        readings: Switches.

    Raises:
        ObservabilityError: Too few target poses in a sub-space.
        ShapeError: The literal reading of eq. 12.
    """
    pieces, alignments = transfer_rows(source, target, domains, readings)
    twice = overlap_members(domains, target.features[:, :3])
    once = readings.source_start == "once"
    committee = boost(
        (target.features, target.errors),
        pieces,
        readings,
        target_weight=np.where(twice, readings.overlap_weight, 1.0),
        source_weight=1.0 / len(alignments) if once else 1.0,
        error_weights=_error_weights(source, target, len(alignments), readings),
    )
    return committee, alignments


def _error_weights(
    source: Labelled, target: Labelled, copies: int, readings: DengReadings
) -> tuple[Array, Array] | None:
    """omega_m of eq. 20 for target rows and for the copies of source rows."""
    if readings.boosting_weights == "none":
        return None
    weights = measurement_weights(target.errors, target.covariance)
    if readings.boosting_weights == "mean":
        mean = weights.mean(axis=0)
        return np.tile(mean, (len(weights), 1)), np.tile(mean, (copies * len(source.errors), 1))
    carried = measurement_weights(source.errors, source.covariance)
    return weights, np.tile(carried, (copies, 1))


def _carry_errors(
    source: Labelled, domains: Domains, readings: DengReadings, target: Labelled
) -> Array:
    """Source errors in all sub-spaces, aligned to a part of the target rows."""
    return transfer_rows(source, target, domains, readings)[0][1]


def _attitude_doubts(
    source: Labelled,
    target: Labelled,
    domains: Domains,
    readings: DengReadings,
    alignments: tuple[Alignment, ...],
) -> list[str]:
    """Warns if target poses are images of source poses under the other attitude convention."""
    other: AttitudeReading = "fixed" if readings.attitude == "turning" else "turning"
    there = np.concatenate(
        [
            mapped_pairs(domains, j, source.features, target.features, other).distance
            for j in range(len(domains.sub_spaces))
        ]
    ).mean()
    here = np.concatenate([each.distance for each in alignments]).mean()
    if here <= 2.0 * there or here < FAR_PAIR:
        return []
    return [
        f"target poses lie {here / MM:.3g} mm (mean, {LEVER:g} m a rad of attitude) from the "
        f"turned source poses with attitude {readings.attitude}, {there / MM:.3g} mm with "
        f"{other}: the tool's attitude is {other} in these poses."
    ]


def _source_expert(
    source: Labelled, domains: Domains, readings: DengReadings, settings: FitSettings
) -> Expert:
    """The process of the source alone, eq. 26, its width from rows left out."""
    committee = single(source.features, source.errors, readings)
    expert = expert_of(domains.source, committee, source, settings)
    return replace(expert, inflation=left_out_inflation(committee, source, expert.white))


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
            distance=pairs.distance,
        )
        moved, carried = carry_source(found, readings, source.features, source.errors)
        features.append(moved)
        errors.append(carried)
        alignments.append(found)
    return (np.concatenate(features), np.concatenate(errors)), tuple(alignments)


def _enough(measurements: MeasurementSet, name: str) -> None:
    if len(measurements) < FEWEST_POSES:
        raise ObservabilityError(
            f"{len(measurements)} {name} poses, expected {FEWEST_POSES} or more.",
            hint="a complete grid of a small region; the paper takes 126.",
        )


def _describe_alignment(alignment: Alignment) -> dict[str, float]:
    return {
        "angle_deg": alignment.angle / DEG,
        "ridge": alignment.ridge,
        "poses": len(alignment.distance),
        "largest_pair_distance_m": float(alignment.distance.max()),
    }


BOOSTED_READINGS: Final = DengReadings(rounds=5, outside="nearest")
LEAST_BOOSTED: Final = 3
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
        target: At least :data:`LEAST_BOOSTED` rows in base.
        sources: In base, at least one.
        settings: The repeatability is used.

    Raises:
        ObservabilityError: Too few target rows, or no source.
        ModelMismatchError: Another number of joints, or sets in a tracker frame.
    """
    if len(target) < LEAST_BOOSTED or not sources:
        raise ObservabilityError(
            f"{len(target)} target poses and {len(sources)} measured sources; boosting asks for "
            f"{LEAST_BOOSTED} and 1."
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
        BOOSTED_READINGS,
        target_weight=np.ones(len(target)),
    )
    return PoseModel(
        robot=robot,
        experts=(expert_of(_around(rows.position), committee, few, settings),),
        reference=reference,
        outside=BOOSTED_READINGS.outside,
        summary={
            **pose_summary(rows, "boosted poses", inside=""),
            "target_rows": len(target),
        },
    )


def _around(points: Array) -> CylinderRegion:
    """A full ring about joint 1 that holds all points."""
    return replace(bound_cylinder(points), angle=(-np.pi, np.pi))
