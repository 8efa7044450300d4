"""Calibration methods by name: from a robot and measurements to an error model."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final, TypeAlias

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel, Reflector
from robotrue.calibration.estimate import Estimate, estimate
from robotrue.calibration.held_out_blocks import HeldOutRows
from robotrue.calibration.learned import (
    LearnedMethod,
    LearnedParts,
    estimate_elastic,
    hold_out_physical,
)
from robotrue.calibration.learned_assembly import describe_width, warn_of_width
from robotrue.calibration.model import ErrorModel, describe_rows
from robotrue.calibration.parameters import station_as_base, target_as_tool
from robotrue.calibration.settings import FitSettings, free_groups
from robotrue.errors import ConfigurationError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel, parameter_slice

__all__ = ["METHODS", "FitFunction", "FitSettings", "fit", "fit_rigid_flexible"]

FitFunction: TypeAlias = Callable[[RobotModel, MeasurementSet, FitSettings], ErrorModel]


def fit(
    robot: RobotModel,
    measurements: MeasurementSet,
    *,
    method: str = "elastic",
    settings: FitSettings | None = None,
) -> ErrorModel:
    """Returns the error model fitted to the measurements by ``method``.

    Args:
        robot: Nominal arm whose ``T_flange_tool`` is the nominal reflector.
        measurements: In base or in an unknown tracker frame.
        method: A key of :data:`METHODS`.
        settings: See :class:`FitSettings`.

    Raises:
        ConfigurationError: No such method.
        ObservabilityError: Too few measurements for the request.
        ImplausibleDataError: The measurements cannot belong to this robot.
        ModelMismatchError: Another number of joints.
        ConvergenceError: The estimator did not settle.
    """
    if method not in METHODS:
        raise ConfigurationError(f"no calibration method {method!r}; methods are {list(METHODS)}.")
    return METHODS[method](robot, measurements, FitSettings() if settings is None else settings)


def fit_rigid_flexible(
    robot: RobotModel, measurements: MeasurementSet, settings: FitSettings, *, method: str
) -> CalibratedModel:
    """Returns the rigid-flexible model of one of the three parameter sets.

    Raises:
        ConfigurationError: A method that is not ``nominal``, ``geometric`` or ``elastic``.
    """
    if method == "elastic":
        result = estimate_elastic(robot, measurements, settings)
    else:
        result = estimate(robot, measurements, settings, free_groups(method))
    return model_of(result, hold_out_physical(result, measurements, settings), settings, method)


METHODS: Final[dict[str, FitFunction]] = {
    "nominal": partial(fit_rigid_flexible, method="nominal"),
    "geometric": partial(fit_rigid_flexible, method="geometric"),
    "elastic": partial(fit_rigid_flexible, method="elastic"),
    "ripple": LearnedMethod(name="ripple", parts=LearnedParts(smooth=False)),
    "gp": LearnedMethod(name="gp", parts=LearnedParts()),
}
"""Fit function of every method; richer methods add themselves here.

``nominal``: base and tool alone, the baseline. ``geometric``: all geometric errors too.
``elastic``: joint compliance too. ``ripple``: joint ripple and backlash too. ``gp``: also the
smooth residual, where it earns its place.
"""


def model_of(
    result: Estimate, held_out: HeldOutRows, settings: FitSettings, method: str
) -> CalibratedModel:
    """Returns the error model of an estimate, with the width of its held-out rows."""
    layout, state = result.posterior.layout, result.posterior.state
    summary = result.describe(method, describe_rows(result.measurements))
    summary["doubts"] = [*result.verdict.doubts, *warn_of_width(held_out)]
    carry = np.eye(layout.size)[: layout.robot_size]
    gauge = station_as_base(layout, state)
    if gauge is not None:
        carry[parameter_slice(layout.dof, "base"), gauge[0]] = gauge[1]
    covariance = result.posterior.covariance
    reflectors = {}
    for k, T in state.T_flange_target.items():
        seen = carry.copy()
        seen[parameter_slice(layout.dof, "tool")] = target_as_tool(layout, k, T)
        reflectors[k] = Reflector(T_flange_tool=T, covariance=seen @ covariance @ seen.T)
    return CalibratedModel(
        robot=state.robot.nominal(),
        errors=state.robot.errors,
        covariance=carry @ covariance @ carry.T,
        repeatability=settings.repeatability_sd,
        white=float(np.sqrt(result.posterior.noise[0])),
        T_tracker_base=state.T_tracker_base,
        reflectors=reflectors,
        summary={**summary, **describe_width(held_out)},
        inflation=held_out.inflation,
        held_out=held_out,
    )
