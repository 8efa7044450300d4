"""Archives of calibrated arms, back to models: of the error vector alone, or with further terms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.archive import check_pose, robot_from, with_moments
from robotrue.calibration.calibrated_model import (
    LEARNED,
    RIGID_FLEXIBLE,
    SCHEMA,
    CalibratedModel,
    Reflector,
)
from robotrue.calibration.terms.term import Term
from robotrue.calibration.terms.term_registry import STANDARD, term_of
from robotrue.core.archive import Archive, archive_reader
from robotrue.core.arrays import Array
from robotrue.core.document_decoder import decode
from robotrue.errors import ArchiveError
from robotrue.robot.model import RobotModel, moment_slice

HEAVIEST: Final = 1e5
"""kg m, first moment of a link that no arm has."""


@dataclass(frozen=True, slots=True)
class _PhysicsDocument:
    """Geometry and compliance inside the archive of a learned model."""

    schema: int
    document: Mapping[str, object]


@archive_reader
def read_rigid_flexible(archive: Archive) -> CalibratedModel:
    """Returns the model in an archive of geometry and compliance.

    Raises:
        ArchiveError: Another kind, a newer schema, or parts that are missing or cannot be.
    """
    archive.expect(RIGID_FLEXIBLE, SCHEMA)
    document = archive.document
    stations = decode(list[int], document["stations"], key="stations")
    T_tracker_base = archive.array("T_tracker_base")
    if T_tracker_base.ndim != 3:
        raise ArchiveError(f"T_tracker_base has shape {T_tracker_base.shape}.")
    check_pose(T_tracker_base, "T_tracker_base")
    robot = robot_from(archive)
    errors = with_moments(archive.array("errors"), robot.dof)
    covariance = with_moments(archive.array("covariance"), robot.dof)
    if errors.shape != robot.errors.shape or not _are_sizes(errors, robot.dof, 10.0, HEAVIEST):
        raise ArchiveError("errors are not those of an arm.")
    _check_covariance(covariance, robot.dof)
    repeatability = decode(float, document["repeatability"], key="repeatability")
    white = decode(float, document["white"], key="white")
    if not (0.0 <= repeatability < 1.0 and 0.0 <= white < 1.0):
        raise ArchiveError(f"repeatability {repeatability:g} m, white noise {white:g} m.")
    return CalibratedModel(
        robot=robot,
        errors=errors,
        covariance=covariance,
        repeatability=repeatability,
        white=white,
        T_tracker_base=dict(zip(stations, T_tracker_base, strict=True)),
        reflectors={
            k: _reflector(archive, k, robot.dof)
            for k in decode(list[int], document.get("reflectors", ()), key="reflectors")
        },
        summary=decode(dict[str, object], document["summary"], key="summary"),
        inflation=_read_inflation(document.get("inflation", 1.0)),
    )


@archive_reader
def read_learned(archive: Archive) -> CalibratedModel:
    """Returns the model in an archive with further terms.

    Raises:
        ArchiveError: Another kind, a newer schema, or parts that are missing or cannot be.
    """
    archive.expect(LEARNED, SCHEMA)
    document = archive.document
    stated = decode(_PhysicsDocument, document["physics"], key="physics")
    physics = read_rigid_flexible(
        Archive(
            kind=RIGID_FLEXIBLE,
            schema=stated.schema,
            document=stated.document,
            arrays={
                name.removeprefix("physics/"): array
                for name, array in archive.arrays.items()
                if name.startswith("physics/")
            },
        )
    )
    restored = _restore_terms(archive, physics.robot)
    values = np.concatenate([part for _, part in restored])
    columns = archive.array("columns")
    if len(archive.array("physics/errors")) < len(physics.errors):  # from before moments
        first = moment_slice(physics.robot.dof)
        columns = np.where(columns >= first.start, columns + first.stop - first.start, columns)
    count = len(physics.errors) + len(values)
    if not ((columns >= 0.0) & (columns < count) & (columns == np.round(columns))).all():
        raise ArchiveError(f"columns of the learned error are whole numbers below {count}.")
    return replace(
        physics,
        reflectors={
            k: replace(reflector, root=archive.array(f"reflector{k}_root"))
            for k, reflector in physics.reflectors.items()
        },
        summary=decode(dict[str, object], document["summary"], key="summary"),
        terms=tuple(term for term, _ in restored),
        values=values,
        columns=columns,
        root=archive.array("root"),
        inflation=_read_inflation(document["inflation"]),
    )


def _restore_terms(archive: Archive, robot: RobotModel) -> list[tuple[Term, Array]]:
    """The terms of an archive with their parameters, the standard ones first.

    Raises:
        ArchiveError: An unregistered term, or a damaged one.
    """
    for name in archive.arrays:
        archive.array(name)
    restored: list[tuple[Term, Array]] = []
    for name in STANDARD:
        restored.append(term_of(name).restore(robot, archive.document, archive.arrays))
    further = archive.document.get("terms", {})
    for name, document in decode(dict[str, dict[str, object]], further, key="terms").items():
        start = f"terms/{name}/"
        own = {k.removeprefix(start): a for k, a in archive.arrays.items() if k.startswith(start)}
        restored.append(term_of(name).restore(robot, document, own))
    return restored


def _read_inflation(stated: object) -> float:
    """The factor on a covariance."""
    inflation = decode(float, stated, key="inflation")
    if not 0.0 < inflation < 1e6:
        raise ArchiveError("the factor on the covariance of the learned error is damaged.")
    return inflation


def _reflector(archive: Archive, number: int, dof: int) -> Reflector:
    T = archive.array(f"reflector{number}")
    check_pose(T, f"reflector{number}")
    covariance = with_moments(archive.array(f"reflector{number}_covariance"), dof)
    _check_covariance(covariance, dof)
    return Reflector(T_flange_tool=T, covariance=covariance)


def _are_sizes(values: Array, dof: int, largest: float, heaviest: float) -> bool:
    """True if all errors are plausible for an arm; moments are in kg m, the rest in m, rad."""
    bound = np.full(len(values), largest)
    bound[moment_slice(dof)] = heaviest
    return bool((np.abs(values) <= bound).all())


def _check_covariance(covariance: Array, dof: int) -> None:
    """Refuses what is no covariance of an arm's errors."""
    variance = np.diagonal(covariance)
    if not (variance >= 0.0).all() or not _are_sizes(variance, dof, 100.0, HEAVIEST**2):
        raise ArchiveError("variances of the errors are not those of an arm.")
    bound = np.sqrt(np.outer(variance, variance)) * (1.0 + 1e-6)
    if not np.allclose(covariance, covariance.T, rtol=1e-6) or (np.abs(covariance) > bound).any():
        raise ArchiveError("the covariance of the errors is none.")
