"""A transfer by a method that was requested, with the guard's contest beside it.

==================  ==============================================================================
``transfer``        ours: the source's posterior, widened by drift, moved by the target rows
``source-only``     the geometry of the source carried to the target as it is
``deng2022``        Tr-GPR: the source aligned to each sub-space, boosted Gaussian processes
``target-only``     geometry and compliance from the target rows, the rest from the prior
==================  ==============================================================================
"""

from __future__ import annotations

from typing import Final

from robotrue.calibration.deng2022.domains import Domains
from robotrue.calibration.deng2022.readings import DengReadings
from robotrue.calibration.deng2022.transfer_gpr import fit_deng2022
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.sources import TransferSource
from robotrue.errors import ConfigurationError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel
from robotrue.validation.guard import Candidate
from robotrue.validation.guarded_transfer import Contestants, contestants
from robotrue.validation.source_check import check_rows

METHOD: Final = "deng2022"
BESIDE: Final = ("transfer", "source-only")
"""Candidates with the source that the requested method is compared with."""
ALONE: Final = "target-only"
"""The candidate without the source."""


def deng2022_contestants(
    robot: RobotModel,
    target: MeasurementSet,
    source: TransferSource,
    settings: FitSettings,
    domains: Domains,
    readings: DengReadings,
) -> Contestants:
    """Returns Tr-GPR and what it is compared with on held-out target poses.

    Tr-GPR is fitted once here, so data that it cannot take are refused before the contest. Its
    width is learned on all target rows and held in the contest.

    Args:
        robot: Nominal arm of the target with the measured tool.
        target: Target rows.
        source: Measurements of the source region.
        settings: Of every fit.
        domains: Source, target and sub-spaces.
        readings: Of the paper's equations.

    Raises:
        ConfigurationError: A source without measurements.
        ImplausibleDataError: Rows that cannot be this robot's: another unit, frame or robot.
        ModelMismatchError: Another number of joints, or positions in a tracker frame.
        ObservabilityError: Too few rows.
    """
    known = source.measurements
    if known is None:
        raise ConfigurationError(
            f"source {source.name} is a model; {METHOD} aligns measured poses.",
            hint="the measurement file of the source region, --source NAME=FILE.csv",
        )
    for rows in (known, target):
        check_rows(robot, rows)
    model = fit_deng2022(robot, known, target, domains, settings, readings)
    inflation = model.experts[0].inflation

    def transfer_poses(rows: MeasurementSet | None) -> ErrorModel:
        if rows is None or len(rows) == len(target):
            return model
        return fit_deng2022(robot, known, rows, domains, settings, readings, inflation=inflation)

    found = contestants(robot, target, [source], settings)
    beside: dict[str, Candidate] = {
        name: found.transfers[name] for name in BESIDE if name in found.transfers
    }
    return Contestants(
        transfers={**beside, METHOD: transfer_poses},
        alone={ALONE: found.alone[ALONE]},
        doubts=found.doubts,
    )
