"""Transfer under guard: every way to use the sources against the target poses alone.

==================  ==============================================================================
``transfer``        physics: the sources' posterior, widened by drift, moved by the target rows
``pooled``          the sources' posterior moved by the target rows, as if they were one campaign
``source-only``     a source as it is, widened by drift; target rows only place a new tracker frame
``learned``         boosted Gaussian processes on poses, no knowledge of the arm (method ``gp``)
``target-only``     geometry and compliance from the target rows, the others from the prior
``target-only gp``  and ripple and a smooth residual
==================  ==============================================================================

A requested method (:func:`requested_transfer`; ``deng2022`` among them: Tr-GPR, the source aligned
to each sub-space, boosted Gaussian processes) is fitted with the same comparison as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Final

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.deng2022.domains import Domains
from robotrue.calibration.deng2022.readings import DengReadings
from robotrue.calibration.drift_prior import NO_DRIFT, DriftScales
from robotrue.calibration.methods import fit
from robotrue.calibration.model import ErrorModel, with_summary
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.sources import TransferSource, see_at_postures
from robotrue.calibration.transfer import carry_source, fit_transfer
from robotrue.core.progress import Progress
from robotrue.errors import (
    ConfigurationError,
    ModelMismatchError,
    ObservabilityError,
    RobotrueError,
)
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel
from robotrue.validation.guard import Candidate, select_guarded
from robotrue.validation.source_check import (
    admit_sources,
    check_rows,
    drift_doubts,
    fit_doubts,
    prior_doubts,
    target_doubts,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Contestants:
    """The candidates of a transfer and what is known of its sources.

    Attributes:
        transfers: Those that use sources, the one believed first at the head.
        alone: Those that use the target rows alone, simplest first.
        doubts: Sources left out and why, contaminated rows, frames, priors.
    """

    transfers: Mapping[str, Candidate]
    alone: Mapping[str, Candidate]
    doubts: tuple[str, ...]

    @property
    def all(self) -> dict[str, Candidate]:
        """Every candidate, in the order of the contest."""
        return {**self.transfers, **self.alone}


def select_transfer(
    found: Contestants,
    robot: RobotModel,
    target: MeasurementSet | None,
    settings: FitSettings,
    *,
    progress: Progress | None = None,
    requested: str = "",
) -> ErrorModel:
    """Returns the winner of the contest, with the contest in its summary.

    A ``requested`` candidate is used regardless of the winner.

    Raises:
        ObservabilityError: Nothing could be fitted.
    """
    model = select_guarded(
        found.transfers,
        found.alone,
        target,
        payload=settings.payload,
        reach=robot.reach,
        doubts=found.doubts,
        progress=progress,
        requested=requested,
    )
    if isinstance(model, CalibratedModel):
        model = model.compact()
    summary = model.training_summary()
    more = drift_doubts(summary)
    return with_summary(model, {"doubts": [*summary.warnings, *more]}) if more else model


def contestants(
    robot: RobotModel,
    target: MeasurementSet | None,
    sources: Sequence[TransferSource],
    settings: FitSettings,
    *,
    drift: DriftScales | None = None,
    method: str = "gp",
) -> Contestants:
    """Returns the candidates of a transfer; every source is fitted once, here.

    Args:
        robot: Nominal arm of the target with the measured tool.
        target: Target rows: checked, and compared with every source.
        sources: Measurements or models from elsewhere.
        settings: Of every fit.
        drift: Where the drift scales start; the defaults of the relation if None.
        method: Richest method of any fit.

    Raises:
        ImplausibleDataError: Target rows that are impossible for this robot.
        ModelMismatchError: Target rows of another number of joints.
    """
    if target is not None and len(target):
        check_rows(robot, target)
    kept, left_out = admit_sources(robot, sources)
    doubts, known = list(left_out), []
    for source in kept:
        try:
            model = _model_of(robot, source, settings, method)
        except RobotrueError as cause:
            doubts.append(f"source {source.name} could not be fitted and is left out: {cause}")
            continue
        known.append((source, model))
        if source.measurements is not None:
            doubts += fit_doubts(source.name, model, source.measurements, settings)
        else:
            doubts += prior_doubts(model.training_summary(), settings)
        if target is not None and not _elsewhere(source, target):
            doubts += target_doubts(source.name, model, target, settings.payload)
    return Contestants(
        transfers=_transfers(robot, known, settings, drift, method, target),
        alone=_alone(robot, settings, method),
        doubts=tuple(dict.fromkeys(doubts)),
    )


def _model_of(
    robot: RobotModel, source: TransferSource, settings: FitSettings, method: str
) -> ErrorModel:
    if source.model is not None:
        return source.model
    if source.measurements is None:
        raise ObservabilityError(f"source {source.name} is empty.")
    return _richest(robot, source.measurements, settings, method)


def _richest(
    robot: RobotModel, rows: MeasurementSet, settings: FitSettings, method: str
) -> ErrorModel:
    """The model of the rows by a method, or the physical one where they are too few for it."""
    leaning = replace(settings, lean_on_prior=True)
    try:
        return fit(robot, rows, method=method, settings=leaning)
    except RobotrueError:
        return fit(robot, rows, method="elastic", settings=leaning)


def _elsewhere(source: TransferSource, target: MeasurementSet) -> bool:
    """True if the source cannot know the target's tracker set-up."""
    return target.frame == "tracker" and source.relation != "region"


def _transfers(
    robot: RobotModel,
    known: Sequence[tuple[TransferSource, ErrorModel]],
    settings: FitSettings,
    drift: DriftScales | None,
    method: str,
    target: MeasurementSet | None,
) -> dict[str, Candidate]:
    if not known:
        return {}
    ready = [TransferSource(model=m, relation=s.relation, name=s.name) for s, m in known]
    seen = cache(partial(_see_at_target, ready, target))
    sets = [s.measurements for s, _ in known if s.measurements is not None]

    def sources(rows: MeasurementSet | None) -> list[TransferSource]:
        """What is held out are rows of the target: a part of it is predicted at its rows alone."""
        part = target is not None and rows is not None and len(rows) < len(target)
        return seen() if part else ready

    def transfer(rows: MeasurementSet | None) -> ErrorModel:
        return fit_transfer(robot, rows, sources(rows), settings, scales=drift)

    def pool(rows: MeasurementSet | None) -> ErrorModel:
        for source, model in known:
            _require_frame(source, model, rows)
        return fit_transfer(robot, rows, sources(rows), settings, scales=NO_DRIFT, learn=False)

    def carry(index: int, rows: MeasurementSet | None) -> ErrorModel:
        return _carry_as_it_is(robot, sources(rows)[index], settings, rows)

    def learn(rows: MeasurementSet | None) -> ErrorModel:
        if rows is None:
            raise ObservabilityError("no target pose to learn from.")
        from robotrue.calibration.deng2022.transfer_gpr import fit_boosted_poses  # slow to import

        return fit_boosted_poses(robot, rows, sets, settings)

    out: dict[str, Candidate] = {"transfer": transfer, "pooled": pool}
    if sets and method == "gp":
        out["learned"] = learn
    for index, source in enumerate(ready):
        name = "source-only" if len(known) == 1 else f"source-only {source.name}"
        out[name] = partial(carry, index)
    return out


def _see_at_target(
    sources: Sequence[TransferSource], target: MeasurementSet | None
) -> list[TransferSource]:
    """The sources as the target's postures see them, where that is exact and leaves out much.

    Several sources, and other units, are combined over the cycles of their ripple.
    """
    alone = len(sources) == 1 and sources[0].relation != "unit"
    model = sources[0].model
    if not alone or target is None or not isinstance(model, CalibratedModel):
        return list(sources)
    return [replace(sources[0], model=see_at_postures(model, target.joints))]


def _carry_as_it_is(
    robot: RobotModel, source: TransferSource, settings: FitSettings, rows: MeasurementSet | None
) -> ErrorModel:
    model = source.model
    if isinstance(model, CalibratedModel):
        return carry_source(robot, rows, source, settings)
    if model is None or (rows is not None and _elsewhere(source, rows)):
        raise ObservabilityError(
            f"source {source.name} has no place for the tracker of the target."
        )
    return model


def _require_frame(source: TransferSource, model: ErrorModel, rows: MeasurementSet | None) -> None:
    """Refuses to pool positions in base with those of a tracker at an unknown station.

    Raises:
        ModelMismatchError: They are.
    """
    stations = getattr(model, "T_tracker_base", {})
    measured = "tracker" if stations else "base"
    if rows is not None and rows.frame != measured:
        raise ModelMismatchError(
            f"source {source.name} and the target differ in number of joints or in frame: "
            f"{measured} and {rows.frame}."
        )


def _alone(robot: RobotModel, settings: FitSettings, richest: str) -> dict[str, Candidate]:
    leaning = replace(settings, lean_on_prior=True)  # one for all: they share the elastic estimate
    out: dict[str, Candidate] = {"target-only": partial(_fit_alone, robot, leaning, "elastic")}
    if richest != "elastic":
        out[f"target-only {richest}"] = partial(_fit_alone, robot, leaning, richest)
    return out


def _fit_alone(
    robot: RobotModel, settings: FitSettings, method: str, rows: MeasurementSet | None
) -> ErrorModel:
    if rows is None or not len(rows):
        raise ObservabilityError("no target row to fit.")
    return fit(robot, rows, method=method, settings=settings)


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
        ImplausibleDataError: Rows that are impossible for this robot: another unit, frame or robot.
        ModelMismatchError: Another number of joints, or positions in a tracker frame.
        ObservabilityError: Too few rows.
    """
    from robotrue.calibration.deng2022.transfer_gpr import fit_deng2022  # slow to import

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
