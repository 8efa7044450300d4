"""From a robot and a measurement set to parameters, covariance, identifiability and a verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.calibration.estimator import Posterior, maximise
from robotrue.calibration.identifiability import Identifiability, analyse
from robotrue.calibration.observations import Observation, PointObservation, observations_of
from robotrue.calibration.parameters import ParameterLayout, State, start_state
from robotrue.calibration.settings import FitSettings, build_prior
from robotrue.calibration.training_summary import describe_parameters
from robotrue.core.arrays import Array, IntArray
from robotrue.errors import ModelMismatchError, ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel, parameter_slice

Status: TypeAlias = Literal["determined", "conditional"]
MANY_SCREENED: Final = 0.05
LOOSE_TURN: Final = 0.02
"""rad, posterior sd of a tracker frame's turn from which it counts as not seen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitVerdict:
    """Verdict on a fit, with its warnings.

    Attributes:
        status: ``"determined"``: every direction a prediction depends on was seen by the data.
            ``"conditional"``: some rest on the prior; ``doubts`` names each with its cure.
        doubts: Sentences, also for screened rows. Unseen combinations that no position of the
            measured point depends on are no warnings; ``identifiability`` lists them.
    """

    status: Status
    doubts: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FitResult:
    """Result of one calibration, from points or from lengths.

    Attributes:
        posterior: Parameters, covariance, noise, residuals as the estimator left them.
        identifiability: What the data saw.
        verdict: What may be said.
        screened: (k,) rows of the data with weight zero.
        residual: (n, d) m, measured minus predicted; d is 3 for points, 1 for lengths.
    """

    posterior: Posterior
    identifiability: Identifiability
    verdict: FitVerdict
    screened: IntArray
    residual: Array

    @property
    def rms(self) -> float:
        """Root mean square length of the residual of the rows that counted, m."""
        kept = np.delete(self.residual, self.screened, axis=0)
        return float(np.sqrt((kept**2).sum(axis=1).mean())) if len(kept) else 0.0

    def table(self) -> list[tuple[str, float, float]]:
        """Returns name, value and posterior sd of every robot parameter, SI."""
        layout = self.posterior.layout
        sd = np.sqrt(np.diagonal(self.posterior.covariance))
        values = self.posterior.state.robot.errors
        rows = zip(layout.names, values, sd, strict=False)
        return [(name, float(value), float(spread)) for name, value, spread in rows]

    def describe(self, method: str, rows: Mapping[str, object]) -> dict[str, object]:
        """Returns the training summary of a model: JSON values, SI.

        Args:
            method: Of the fit.
            rows: What the rows were, see :func:`robotrue.calibration.model.describe_rows`.
        """
        posterior, classes = self.posterior, self.identifiability.classes
        names, values, sd = zip(*self.table(), strict=True)
        return {
            "method": method,
            **rows,
            "numbers": posterior.numbers,
            "screened_rows": [int(i) for i in self.screened],
            "verdict": self.verdict.status,
            "doubts": list(self.verdict.doubts),
            "unseen": self.identifiability.document(),
            "parameters": describe_parameters(
                names,
                np.array(values),
                np.array(sd),
                [classes.get(name, "fixed") for name in names],
            ),
            "white_sd_m": float(np.sqrt(posterior.noise[0])),
            "white_sd_rad": float(np.sqrt(posterior.noise[1])),
            "rms_m": self.rms,
            "chi2": posterior.chi2,
            "evidence": posterior.evidence,
            "iterations": posterior.iterations,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate(FitResult):
    """Result of a calibration from points.

    Attributes:
        measurements: The set; the residual has its rows and its frame.
        observations: Points and poses of it.
    """

    measurements: MeasurementSet
    observations: tuple[PointObservation, ...]


def estimate(
    robot: RobotModel,
    measurements: MeasurementSet,
    settings: FitSettings,
    groups: tuple[str, ...],
) -> Estimate:
    """Returns the MAP estimate of the chosen groups.

    Args:
        robot: Nominal arm (errors it carries are the prior mean).
        measurements: In base, or in tracker frames that are then estimated; with an unknown
            tracker frame the base errors are held at zero because the station takes their place.
        settings: Loads, priors, solver.
        groups: From :func:`free_groups`.

    Raises:
        ObservabilityError: Fewer numbers than what they should determine.
        ImplausibleDataError: Points that are impossible for this robot.
        ModelMismatchError: Another number of joints.
        ConvergenceError: The estimator did not settle.
    """
    count, joints = measurements.joints.shape
    if joints != robot.dof:
        raise ModelMismatchError(
            f"measurements have {joints} joints, robot {robot.name} has {robot.dof}."
        )
    robot, layout, start = start_state(robot, measurements, tool_sd=settings.scales.tool, line=True)
    if layout.stations:
        groups = tuple(g for g in groups if g != "base")
    observations = observations_of(
        robot,
        measurements,
        settings.payload,
        repeatability=settings.repeatability_sd,
        rotation_sd=settings.rotation_sd,
    )
    _require_numbers(count, settings)
    posed = bool((measurements.has_rotation & (measurements.target == 0)).any())
    posterior, seen = solve_posterior(
        observations, layout, start, settings, groups, tool_rotation=posed
    )
    _require_determined(posterior, seen, count, settings)
    screened, residual = residuals_by_row(posterior, observations, count, 3)
    return Estimate(
        posterior=posterior,
        identifiability=seen,
        verdict=_verdict(seen, posterior, measurements.source_row[screened], count),
        screened=screened,
        residual=residual,
        measurements=measurements,
        observations=observations,
    )


def solve_posterior(
    observations: tuple[Observation, ...],
    layout: ParameterLayout,
    start: State,
    settings: FitSettings,
    groups: tuple[str, ...],
    *,
    tool_rotation: bool,
) -> tuple[Posterior, Identifiability]:
    """Returns the posterior of the chosen groups, and what the observations saw.

    Args:
        observations: Points, lengths, or both.
        layout: Parameters of arm, stations and reflectors.
        start: Where the estimator starts; the prior mean.
        settings: Loads, priors, solver.
        groups: From :func:`free_groups`.
        tool_rotation: Whether the observations see how the tool is turned.

    Raises:
        ConvergenceError: The estimator did not settle.
    """
    prior = build_prior(
        layout,
        start,
        settings.scales,
        free_groups=groups,
        stiffness=settings.stiffness,
        payload_mass=float(settings.payload.mass[0]),
        tool_rotation=tool_rotation,
    )
    posterior = maximise(observations, prior, layout, settings.solver)
    return posterior, analyse(
        posterior.state.robot,
        layout,
        posterior.information,
        prior.sd,
        settings.payload,
        stiffness_stated=settings.stiffness is not None,
    )


def _require_numbers(poses: int, settings: FitSettings) -> None:
    if poses < 4 and not settings.lean_on_prior:
        raise ObservabilityError(
            f"{poses} measured poses; even base and tool need 4.",
            hint="measure 30 to 60 poses spread over the joint ranges.",
        )


def _require_determined(
    posterior: Posterior, seen: Identifiability, poses: int, settings: FitSettings
) -> None:
    layout = posterior.layout
    wanted = seen.determinable + layout.size - layout.robot_size
    if posterior.numbers < wanted and not settings.lean_on_prior:
        raise ObservabilityError(
            f"{poses} poses give {posterior.numbers} usable numbers; {wanted} parameters are to be "
            "determined.",
            hint=f"measure at least {-(-wanted // 3)} poses, choose a smaller method, or transfer "
            "an earlier calibration of this type of arm.",
        )


def residuals_by_row(
    posterior: Posterior, observations: tuple[Observation, ...], count: int, width: int
) -> tuple[IntArray, Array]:
    """Returns the rows of a set with weight zero, and its residual (count, width) m.

    The posterior is of these observations, and maybe of others after them.
    """
    residual = np.zeros((count, width))
    screened = []
    for o, rest, u in zip(observations, posterior.residuals, posterior.weights, strict=False):
        residual[o.rows] = rest[:, :width]
        screened.append(o.rows[u == 0.0])
    return np.sort(np.concatenate(screened)), residual


def _verdict(
    seen: Identifiability,
    posterior: Posterior,
    screened: IntArray,
    rows: int,
) -> FitVerdict:
    """Returns the verdict on the fit; ``screened`` are lines of the source file."""
    loose = _loose_turns(posterior)
    doubts = [*loose, *(f"not seen by the data: {d}." for d in seen.harmful)]
    short = posterior.numbers < seen.determinable
    if short:
        doubts.append(
            f"{posterior.numbers} numbers for {seen.determinable} parameters: the result depends "
            "on the prior."
        )
    many = len(screened) > MANY_SCREENED * rows
    if len(screened):
        doubts.append(
            f"{len(screened)} of {rows} rows carry no weight (row {int(screened[0])} first): "
            "their residual has a chance below one in a million under the fitted noise."
        )
    place = parameter_slice(posterior.layout.dof, "compliance")
    compliance = posterior.state.robot.error("compliance")
    sd = np.sqrt(np.diagonal(posterior.covariance)[place])
    negative = [f"compliance{i + 1}" for i in np.flatnonzero(compliance < -2.0 * sd)]
    doubts += [
        f"{name} is negative beyond its uncertainty: check masses and loads." for name in negative
    ]
    sound = not (loose or seen.harmful or short or many or negative)
    return FitVerdict(status="determined" if sound else "conditional", doubts=tuple(doubts))


def _loose_turns(posterior: Posterior) -> list[str]:
    """Warns of tracker frames that are free to turn about a line, since all poses lie on one."""
    out = []
    for k in posterior.layout.stations:
        place = posterior.layout.blocks[f"station/{k}"]
        if place.stop - place.start < 6:
            continue
        turn = slice(place.start + 3, place.stop)
        values, axes = np.linalg.eigh(posterior.covariance[turn, turn])
        if values[-1] < LOOSE_TURN**2:
            continue
        x, y, z = posterior.state.T_tracker_base[k][:3, :3].T @ axes[:, -1]
        out.append(
            f"not seen by the data: the turn of tracker station {k} about ({x:+.2f}, {y:+.2f}, "
            f"{z:+.2f}) in base: errors along that line are known; of errors across it, the size "
            "but not the direction in base; add poses off the line, or measure in base."
        )
    return out
