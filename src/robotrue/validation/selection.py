"""Choice of the method: the simplest one that no richer one beats on held-out poses.

Candidates come simplest first. Each is fitted on the training part of every split and scored on the
held-out part. A richer one replaces the one chosen so far only if its mean held-out error is lower
by more than the noise: the one-sided 95 % Student interval of the paired differences, over folds,
because rows of one fold share their fit and their place. Any gain replaces ``nominal``.

The choice is one of name. With fewer than :data:`AVERAGED_ROWS` rows the model is the average of
the candidates by their held-out density, whose spread is in its covariance.

Cost is bounded by rule, not by luck: at most :data:`MOST_TRAIN` rows fit a fold and at most
:data:`MOST_TEST` score it, evenly spaced; the winner is refitted on all rows. With more rows than
that, a candidate that another one beats by :data:`LOST` times the noise on the folds so far is not
fitted to the others. From
:data:`AVERAGED_ROWS` rows learned methods are fitted to all rows first and then refitted without
each fold (:mod:`robotrue.calibration.learned_assembly`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from typing import Final, TypeAlias

import numpy as np

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.held_out_blocks import BLOCKS
from robotrue.calibration.learned import LearnedMethod, share_waves
from robotrue.calibration.learned_assembly import LinearFit, WholeFit
from robotrue.calibration.methods import METHODS
from robotrue.calibration.methods import FitFunction as MethodFunction
from robotrue.calibration.model import ErrorModel, with_summary
from robotrue.calibration.settings import FitSettings
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.progress import Progress
from robotrue.core.units import MM
from robotrue.errors import ConvergenceError, RobotrueError, ShapeError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.robot.model import RobotModel
from robotrue.robot.statics import Load
from robotrue.validation.contest import (
    BASELINE,
    CandidateResults,
    CandidateScore,
    Selection,
    StoppedCandidate,
    Trials,
    average_candidates,
    decide,
    find_voters,
    paired_gain,
)
from robotrue.validation.evaluation import evaluate
from robotrue.validation.metrics import coverage, log_density, student_scores
from robotrue.validation.splits import (
    Split,
    contiguous_blocks,
    leave_one_set_out,
    random_folds,
    space_rows,
    spatial_regions,
    without_unseen_targets,
)

FitFunction: TypeAlias = Callable[[MeasurementSet], ErrorModel]
"""Fits a model on the rows it is given."""

MOST_TRAIN: Final = 1000
MOST_TEST: Final = 500
FEW_ROWS: Final = 40
"""Below this rows are held out one by one or a few at a time: blocks leave too little to fit on."""
FEW_FOLDS: Final = 12
"""Most parts of so few rows."""
REGION_ROWS: Final = 120
"""From here on regions of the workspace are held out too."""
MANY_ROWS: Final = 3000
"""From here on fewer, larger parts are held out."""
HOPELESS: Final = 1.0 / 3.0
"""Share of the noise on blocks below which a gain ends the contest for a candidate."""
LOST: Final = 2.0
"""Times the noise on the folds so far by which a loser of a long contest leaves it."""
AVERAGED_ROWS: Final = 200
"""Rows below which the model is an average: so few leave more than one candidate possible."""


def default_splits(measurements: MeasurementSet) -> tuple[Split, ...]:
    """Returns the splits ``select`` uses when none are given.

    Fewer than 40 rows: every row by itself, or :data:`FEW_FOLDS` random parts. From 40: five blocks
    of rows. From 120: also three regions of the workspace. From 3,000: three blocks and two
    regions, to save fits. Several sets: also each set, when every one leaves at least 40 rows to
    fit on.
    """
    n = len(measurements)
    if n < FEW_ROWS:
        return random_folds(n, folds=min(n, FEW_FOLDS))
    many = n >= MANY_ROWS
    splits = contiguous_blocks(n, blocks=3 if many else 5)
    if n >= REGION_ROWS:
        splits += spatial_regions(measurements, count=2 if many else 3)
    # Only where stations are known: a held-out tracker set-up cannot be placed in base.
    if measurements.frame == "base" and len(np.unique(measurements.group)) > 1:
        by_set = leave_one_set_out(measurements)
        if len(by_set) <= 5 and min(len(s.train) for s in by_set) >= FEW_ROWS:
            splits += by_set
    return splits


def select(
    candidates: Mapping[str, FitFunction],
    measurements: MeasurementSet,
    *,
    splits: Sequence[Split] | None = None,
    payload: Load | None = None,
    progress: Progress | None = None,
) -> Selection:
    """Returns the simplest candidate that no richer one beats on held-out poses.

    Args:
        candidates: Fit functions, simplest first.
        measurements: All rows.
        splits: Held-out parts; :func:`default_splits` if None.
        payload: Used where a row does not state its own.
        progress: Called before every fit.

    Raises:
        ShapeError: No candidates or no splits.
        ObservabilityError: No candidate could be fitted; the message carries the first reason.
    """
    return decide(
        hold_out(candidates, measurements, splits=splits, payload=payload, progress=progress)
    )


def hold_out(
    candidates: Mapping[str, FitFunction],
    measurements: MeasurementSet,
    *,
    splits: Sequence[Split] | None = None,
    payload: Load | None = None,
    progress: Progress | None = None,
    refits: Mapping[str, WholeFit] | None = None,
) -> Trials:
    """Returns the held-out results of every candidate; arguments as in :func:`select`.

    Args:
        candidates: As in :func:`select`.
        measurements: As in :func:`select`.
        splits: As in :func:`select`.
        payload: As in :func:`select`.
        progress: As in :func:`select`.
        refits: Candidates' fits of all rows, that are refitted without each fold.

    Raises:
        ShapeError: No candidates or no splits.
    """
    folds = tuple(default_splits(measurements) if splits is None else splits)
    if not candidates or not folds:
        raise ShapeError("nothing to select: no candidates or no splits.")
    known = (without_unseen_targets(measurements, fold) for fold in folds)
    folds = tuple(fold for fold in known if fold is not None)
    if not folds:
        raise ShapeError("no split leaves rows of the reflectors that it holds out.")
    parts = [(space_rows(f.train, MOST_TRAIN), space_rows(f.test, MOST_TEST)) for f in folds]
    contest = [
        _Fold(
            name=fold.name,
            predictions=partial(
                _fold_predictions, candidates, refits or {}, measurements, fold, rows, payload
            ),
        )
        for fold, rows in zip(folds, parts, strict=True)
    ]
    hold = partial(_hold_folds, contest, candidates, _stop_hopeless(refits or {}))
    held, leaders = hold(progress, race=len(measurements) > MOST_TRAIN)
    if any(isinstance(held[leader], RobotrueError) for leader in leaders):
        held, _ = hold(progress, race=False)  # without losses to failed candidates
    return Trials(
        held=held,
        folds=folds,
        fold_of_row=np.repeat(np.arange(len(parts)), [len(test) for _, test in parts]),
        rule=_rule(folds, parts, tuple(refits or {})),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fold:
    """A part that is held out.

    Attributes:
        name: Of the split.
        predictions: Returns how each candidate that was fitted without it predicts its rows.
    """

    name: str
    predictions: Callable[[], Mapping[str, Callable[[], _FoldErrors]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class _FoldErrors:
    """Errors (n, 3) m of a candidate at held-out rows, and their covariance (n, 3, 3) m^2."""

    error: Array
    covariance: Array


def _hold_folds(
    folds: Sequence[_Fold],
    candidates: Collection[str],
    hopeless: Mapping[str, StoppedCandidate],
    progress: Progress | None,
    *,
    race: bool,
) -> tuple[dict[str, CandidateResults | StoppedCandidate | RobotrueError], set[str]]:
    """Results by candidate, and those that others lost to and left the race for."""
    total = len(candidates) * len(folds)
    done: dict[str, list[_FoldErrors]] = {name: [] for name in candidates}
    failed: dict[str, RobotrueError | StoppedCandidate] = {**hopeless}
    leaders: set[str] = set()
    for k, fold in enumerate(folds):
        with share_waves():
            for index, (name, predict) in enumerate(fold.predictions().items()):
                if name in failed:
                    continue
                if progress is not None:
                    progress(f"{name}, {fold.name}", k * len(candidates) + index, total)
                try:
                    done[name].append(predict())
                except RobotrueError as cause:
                    failed[name] = cause
        if race and 0 < k < len(folds) - 1:
            live = {name: results for name, results in done.items() if name not in failed}
            leader, lost = _find_losers(live, len(folds))
            leaders |= {leader} if lost else set()
            failed |= lost
    if progress is not None:
        progress("chosen", total, total)
    return {
        name: failed[name] if name in failed else _join_folds(results)
        for name, results in done.items()
    }, leaders


def _fold_predictions(
    candidates: Mapping[str, FitFunction],
    refits: Mapping[str, WholeFit],
    measurements: MeasurementSet,
    fold: Split,
    used: tuple[IntArray, IntArray],
    payload: Load | None,
) -> dict[str, Callable[[], _FoldErrors]]:
    """Returns the errors of each candidate at rows of a fold that it was fitted without.

    It is a refit, or a fit of the first of the rows ``used``; predicted are the second. Candidates
    whose fits of all rows are one and the same share one refit. A block that a fit of all rows was
    held out of is predicted already.
    """
    rows, unseen = (measurements.subset(part) for part in used)
    left_out = fold.mask_left_out(len(measurements))
    # A refit knows a station that no row of the fold shows from the start of the fit alone.
    placed = np.isin(measurements.station[fold.test], measurements.station[fold.train]).all()
    refit: dict[int, Callable[[], LinearFit]] = {}
    found: dict[int, Callable[[], _FoldErrors]] = {}
    predictions: dict[str, Callable[[], _FoldErrors]] = {}
    for name, fit in candidates.items():
        whole = refits.get(name) if placed else None
        if whole is None:
            predictions[name] = partial(_predict_fold, partial(fit, rows), unseen, payload)
            continue
        base = None if whole.base is None else refit.get(id(whole.base.at))
        key = id(whole.at)
        refit.setdefault(key, cache(partial(_refit, whole, left_out, base)))
        model = partial(_build_refit, whole, left_out, refit[key])
        found.setdefault(key, cache(partial(_predict_fold, model, unseen, payload)))
        predictions[name] = partial(_predict_block, whole, left_out, used[1], found[key])
    return predictions


def _predict_fold(
    fit: Callable[[], ErrorModel], unseen: MeasurementSet, payload: Load | None
) -> _FoldErrors:
    seen = evaluate(fit(), unseen, payload=payload)
    return _FoldErrors(error=seen.after, covariance=seen.covariance)


def _predict_block(
    whole: WholeFit, left_out: BoolArray, test: IntArray, otherwise: Callable[[], _FoldErrors]
) -> _FoldErrors:
    """The prediction of a block by the fit without it; of another part by a fit made for it."""
    found = whole.held_out_block(left_out)
    if found is None:
        return otherwise()
    chosen = np.searchsorted(np.flatnonzero(left_out), test)
    return _FoldErrors(error=found.error[chosen], covariance=found.covariance[chosen])


def _refit(whole: WholeFit, left_out: BoolArray, base: Callable[[], LinearFit] | None) -> LinearFit:
    return whole.refit(left_out, None if base is None else base())


def _build_refit(
    whole: WholeFit, left_out: BoolArray, refit: Callable[[], LinearFit]
) -> ErrorModel:
    return whole.model_of(refit(), left_out)


def _stop_hopeless(refits: Mapping[str, WholeFit]) -> dict[str, StoppedCandidate]:
    """Candidates that add a smooth residual to another's fit and gain next to nothing by it.

    On the held-out blocks both fits have already: a gain below :data:`HOPELESS` of the noise that
    it must exceed.
    """
    names = {id(whole.at): name for name, whole in reversed(list(refits.items()))}
    stopped: dict[str, StoppedCandidate] = {}
    for name, whole in refits.items():
        base = None if whole.base is None else names.get(id(whole.base.at))
        if whole.base is None or base is None:
            continue
        errors = [np.linalg.norm(w.held_out.error, axis=1) for w in (whole.base, whole)]
        block = np.arange(len(errors[0])) * BLOCKS // len(errors[0])
        gain, noise = paired_gain(errors[0] - errors[1], block)
        if gain < HOPELESS * noise:
            stopped[name] = StoppedCandidate(
                reason=f"{name} is not compared further: on {BLOCKS} blocks it gains "
                f"{gain / MM:.4f} mm over {base}, noise {noise / MM:.4f} mm"
            )
    return stopped


def _find_losers(
    done: Mapping[str, Sequence[_FoldErrors]], parts: int
) -> tuple[str, dict[str, StoppedCandidate]]:
    """The best candidate on the folds so far, and those that clearly lose to it."""
    errors = {
        name: np.concatenate([np.linalg.norm(r.error, axis=1) for r in results])
        for name, results in done.items()
    }
    leader = min(errors, key=lambda name: float(errors[name].mean()), default="")
    lost: dict[str, StoppedCandidate] = {}
    for name, error in errors.items():
        sizes = [len(result.error) for result in done[name]]
        fold = np.repeat(np.arange(len(sizes)), sizes)
        gain, noise = paired_gain(error - errors[leader], fold)
        if gain > LOST * noise:
            lost[name] = StoppedCandidate(
                reason=f"{name} is not compared further: on {len(sizes)} of {parts} parts it is "
                f"{gain / MM:.4f} mm behind {leader}, noise {noise / MM:.4f} mm"
            )
    return leader, lost


def _join_folds(results: Sequence[_FoldErrors]) -> CandidateResults:
    """The held-out results of a candidate that was fitted without every fold."""
    residual = np.concatenate([r.error for r in results])
    covariance = np.concatenate([r.covariance for r in results])
    return CandidateResults(
        error=np.linalg.norm(residual, axis=1),
        inside=coverage(residual, covariance).share,
        log_density=float(log_density(residual, covariance).mean()),
        scores=student_scores(residual, covariance),
    )


def _rule(
    folds: Sequence[Split], parts: Sequence[tuple[IntArray, IntArray]], refitted: Sequence[str]
) -> str:
    counts = {
        kind: sum(f.kind == kind for f in folds) for kind in dict.fromkeys(f.kind for f in folds)
    }
    what = " and ".join(f"{count} {kind}" for kind, count in counts.items())
    most_train, most_test = max(len(a) for a, _ in parts), max(len(b) for _, b in parts)
    shared = (
        f"; {' and '.join(refitted)}: fitted to all rows, then scales, noise and parameters again "
        "without each fold, with the linearisation, robust weights, bands and lengths of all rows"
    )
    return (
        f"held out: {what}; up to {most_train} rows fit and {most_test} score each fold, evenly "
        "spaced; a richer method must win by more than the one-sided 95 % interval over folds"
        f"{shared if refitted else ''}"
    )


def fit_auto(
    robot: RobotModel,
    measurements: MeasurementSet,
    settings: FitSettings | None = None,
    *,
    methods: Mapping[str, MethodFunction] = METHODS,
    progress: Progress | None = None,
) -> ErrorModel:
    """Returns the model of the method that wins on held-out poses, fitted on all rows.

    With fewer than :data:`AVERAGED_ROWS` rows it is the average over the methods by their held-out
    density, under the winner's name. The evidence is in its training summary under
    ``"selection"``; read it back with
    :func:`robotrue.validation.contest.selection_from_summary`.

    Args:
        robot: Nominal arm with the measured tool.
        measurements: All rows.
        settings: Given to every method; the default payload is taken from it too.
        methods: Fit functions by name, simplest first.
        progress: Called before every fit.

    Raises:
        ObservabilityError: No method could be fitted.
        ConvergenceError: ``nominal`` is left because a richer method did not converge.
    """
    used = FitSettings() if settings is None else settings
    candidates: dict[str, FitFunction] = {
        name: partial(_fit_rows, method, robot, used) for name, method in methods.items()
    }
    folds = default_splits(measurements)
    refits = _fit_whole(methods, robot, measurements, used, folds, progress)
    trials = hold_out(
        candidates,
        measurements,
        splits=folds,
        payload=used.payload,
        progress=progress,
        refits=refits,
    )
    selection = decide(trials)
    failed = [
        score
        for score in selection.table
        if score.failure and not score.stopped and score.name != BASELINE
    ]
    unsettled = [score for score in failed if score.unsettled]
    if selection.winner == BASELINE and unsettled:
        raise ConvergenceError(
            f"{', '.join(s.name for s in unsettled)} did not converge, {unsettled[0].failure} "
            f"{BASELINE} would be no result of the poses.",
            hint=f"check units, joint signs and the reflector; --method {BASELINE} if you want it.",
        )
    known = refits.get(selection.winner)
    model = candidates[selection.winner](measurements) if known is None else known.model()
    if len(measurements) < AVERAGED_ROWS and isinstance(model, CalibratedModel):
        others = {
            name: partial(candidates[name], measurements)
            for name in find_voters(trials, selection)
            if name != selection.winner
        }
        with share_waves():
            model, selection = average_candidates(model, others, trials, selection)
    model = with_summary(model, {"selection": selection.summary()})
    return _with_failures(model, failed if selection.winner == BASELINE else unsettled)


def _fit_whole(
    methods: Mapping[str, MethodFunction],
    robot: RobotModel,
    measurements: MeasurementSet,
    settings: FitSettings,
    folds: Sequence[Split],
    progress: Progress | None,
) -> dict[str, WholeFit]:
    """Returns the learned methods' fits of all rows; none of few rows, as all choices are repeated.

    A method that cannot be fitted to all rows is left to fit the folds by itself. A smooth residual
    by which the folds gain nothing is not fitted: it could not win.
    """
    if len(measurements) < AVERAGED_ROWS:
        return {}
    learned = {k: method for k, method in methods.items() if isinstance(method, LearnedMethod)}
    fits: dict[str, WholeFit] = {}
    parts = [fold.mask_left_out(len(measurements)) for fold in folds]
    with share_waves():
        for index, (name, method) in enumerate(learned.items()):
            if progress is not None:
                progress(f"{name}, all rows", index, len(learned))
            with suppress(RobotrueError):
                fits[name] = method.fit_whole(robot, measurements, settings, parts)
    return fits


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
