"""Method ``auto``: choose on held-out poses, then fit the winner on all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from robotrue.calibration.methods import METHODS
from robotrue.calibration.methods import FitFunction as MethodFunction
from robotrue.calibration.model import ErrorModel
from robotrue.calibration.settings import FitSettings
from robotrue.core.progress import Progress
from robotrue.errors import ConvergenceError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel
from robotrue.validation.contest import BASELINE, CandidateScore
from robotrue.validation.selection import FitFunction, select, with_evidence, with_summary
from robotrue.validation.splits import Split


def fit_auto(
    robot: RobotModel,
    measurements: MeasurementSet,
    settings: FitSettings | None = None,
    *,
    methods: Mapping[str, MethodFunction] = METHODS,
    splits: Sequence[Split] | None = None,
    progress: Progress | None = None,
) -> ErrorModel:
    """Returns the model of the method that wins on held-out poses, fitted on all rows.

    The evidence is in its training summary under ``"selection"``; read it back with
    :func:`robotrue.validation.contest.selection_from_summary`.

    Args:
        robot: Nominal arm with the measured tool.
        measurements: All rows.
        settings: Given to every method; the default payload is taken from it too.
        methods: Fit functions by name, simplest first.
        splits: What to hold out; chosen by the number of rows if None.
        progress: Told before every fit.

    Raises:
        ObservabilityError: No method could be fitted.
        ConvergenceError: ``nominal`` is left because a richer method did not converge.
    """
    used = FitSettings() if settings is None else settings
    candidates: dict[str, FitFunction] = {
        name: partial(_fit_rows, method, robot, used) for name, method in methods.items()
    }
    selection = select(
        candidates, measurements, splits=splits, payload=used.payload, progress=progress
    )
    failed = [score for score in selection.table if score.failure and score.name != BASELINE]
    unsettled = [score for score in failed if score.unsettled]
    if selection.winner == BASELINE and unsettled:
        raise ConvergenceError(
            f"{', '.join(s.name for s in unsettled)} did not converge, {unsettled[0].failure} "
            f"{BASELINE} would be no result of the poses.",
            hint=f"check units, joint signs and the reflector; --method {BASELINE} if you want it.",
        )
    model = with_evidence(candidates[selection.winner](measurements), selection)
    return _with_failures(model, failed if selection.winner == BASELINE else unsettled)


def _with_failures(model: ErrorModel, failed: Sequence[CandidateScore]) -> ErrorModel:
    """The model, conditional where richer methods could not be compared with it."""
    if not failed:
        return model
    doubts = [
        f"{score.name} {'did not converge' if score.unsettled else 'could not be fitted'} and was "
        f"not compared: {score.failure}"
        for score in failed
    ]
    stated = model.training_summary().warnings
    return with_summary(model, {"verdict": "conditional", "doubts": [*doubts, *stated]})


def _fit_rows(
    method: MethodFunction, robot: RobotModel, settings: FitSettings, rows: MeasurementSet
) -> ErrorModel:
    return method(robot, rows, settings)
