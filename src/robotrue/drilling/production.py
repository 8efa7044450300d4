"""The life of a model in production: refined by outside references, frozen, watched, thawed."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.provenance import MEASURED, Provenance, merge
from robotrue.core.units import DEG
from robotrue.drilling.campaign import Campaign
from robotrue.drilling.campaign_csv import ProductionRecord
from robotrue.drilling.correction import CorrectedReadings, correct_readings
from robotrue.drilling.evaluate import evaluate_test
from robotrue.drilling.foot_model import Frozen, NormalModel, absorb_zero, with_refinement
from robotrue.drilling.production_references import FEWEST, MemoryChoice, choose_memory
from robotrue.drilling.refinement import (
    Remaining,
    Watch,
    forget_constants,
    update_refinement,
    update_watch,
)
from robotrue.errors import ConfigurationError


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordUpdate:
    """Effect of one record on the model.

    Attributes:
        model: After it.
        score: (2,) residual tilt over its predicted deviation, a and b.
        alarm: Whether the watch detects a shift; the watch then restarts.
        shift: (2,) rad, the shift it estimates; 0 without an alarm.
        said: One sentence for the operator, or "".
        hole: Of the record.
    """

    model: NormalModel
    score: Array
    alarm: bool
    shift: Array
    said: str
    hole: str = ""


def update_model(
    model: NormalModel, found: CorrectedReadings, record: Remaining, *, reference: float
) -> RecordUpdate:
    """Returns the model after the residual tilt of one hole.

    A frozen model is watched and stays as it is; an alarm thaws it, so that the records that follow
    refine it. One that is not frozen is refined, and after an alarm learns its zero again.

    Args:
        model: Before the record.
        found: Its corrected readings of this clamp, one row.
        record: The residual tilt, with the reference that measured it.
        reference: rad, deviation of the reference in each of a and b.
    """
    model = replace(model, provenance=merge([model.provenance, record.provenance]))
    deviation = np.sqrt(np.diagonal(found.covariance[0]) + reference**2)
    score = record.tilt / deviation
    state = update_watch(model.monitor, score)
    shift = state.shift * deviation
    if state.alarm:
        return _restart_after_alarm(model, state, score, shift, record, reference)
    if model.frozen is None:
        model = absorb_zero(model)
        refinement = update_refinement(model.refinement, record, reference=reference)
        model = replace(model, refinement=refinement, version=model.version + 1)
    return RecordUpdate(
        model=replace(model, monitor=state),
        score=score,
        alarm=False,
        shift=np.zeros(2),
        said="",
        hole=record.hole,
    )


def _restart_after_alarm(
    model: NormalModel,
    state: Watch,
    score: Array,
    shift: Array,
    record: Remaining,
    reference: float,
) -> RecordUpdate:
    a, b = (shift / DEG).tolist()
    was = "" if model.frozen is None else f"version {model.frozen.version} is thawed; "
    model = absorb_zero(model)
    fresh = Watch(spread=state.spread, allowance=state.allowance, limit=state.limit)
    changed = replace(
        model,
        refinement=update_refinement(
            forget_constants(model.refinement), record, reference=reference
        ),
        monitor=fresh,
        version=model.version + 1,
        frozen=None,
    )
    said = (
        f"hole {record.hole}: the tilt has shifted by about {a:+.3f} deg in a and {b:+.3f} deg in "
        f"b: {was}check the zero on the mandrel. Later holes refine the model."
    )
    return RecordUpdate(
        model=changed, score=score, alarm=True, shift=shift, said=said, hole=record.hole
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchRefinement:
    """Effects of the references in a file.

    Attributes:
        model: After them.
        alarms: Of its watch.
        memory: Which memory held-out references support; None of a frozen model.
        expected: (n, 2) rad, deviation the model and the reference led to expect.
    """

    model: NormalModel
    alarms: tuple[RecordUpdate, ...]
    memory: MemoryChoice | None
    expected: Array


def refine_model(
    before: NormalModel, holes: ProductionRecord, *, truth: str, reference: float
) -> BatchRefinement:
    """Returns the model after holes whose moves it commanded.

    Its memory is the one that held-out references support; without one it stays as it is. After an
    alarm among the last references too few follow to learn the zero again, and it is not
    forgotten.

    Args:
        before: The model that commanded all moves.
        holes: In their order.
        truth: What measured them.
        reference: rad, deviation of the reference in each of a and b.

    Raises:
        ConfigurationError: No outside reference.
    """
    plain = correct_readings(before.foot, before.head.order, before.correction, holes.clamps)
    moved = with_refinement(before, plain)
    deviation = np.sqrt(np.diagonal(moved.covariance, axis1=1, axis2=2) + reference**2)
    memory = None
    model = before
    if before.frozen is None:
        c = plain.conditions
        causes = np.stack([c.a, c.b, c.force], axis=-1)
        start = absorb_zero(before)
        memory = choose_memory(start.refinement, causes, holes.left, reference=reference)
        if memory.start is not None:
            model = replace(start, refinement=memory.start)
    alarms = []
    for i, name in enumerate(holes.hole):
        found = with_refinement(model, plain.take(slice(i, i + 1)))
        record = record_of(name, found, holes.left[i], truth, holes.provenance, moved=moved.tilt[i])
        step = update_model(model, found, record, reference=reference)
        late = step.alarm and model.frozen is None and len(holes.hole) - i < FEWEST
        if late:
            learned = update_refinement(model.refinement, record, reference=reference)
        model = replace(step.model, refinement=learned) if late else step.model
        if step.alarm:
            alarms.append(step)
    if memory is not None and memory.start is None and not alarms:
        model = replace(
            model,
            refinement=before.refinement,
            version=before.version,
            zero=before.zero,
            new_zero=before.new_zero,
        )
    return BatchRefinement(model=model, alarms=tuple(alarms), memory=memory, expected=deviation)


def freeze_model(
    model: NormalModel,
    test: Campaign,
    digest: str,
    *,
    allowed: float,
    before: NormalModel | None = None,
) -> NormalModel:
    """Returns the model frozen, with what it was tested on.

    Args:
        model: To be frozen.
        test: Clamps with known tilts that neither learning nor refining has seen.
        digest: SHA-256 of the test's file.
        allowed: rad, 95th percentile of the tilt left that is good enough.
        before: The model before it was refined; not compared without.

    Raises:
        ConfigurationError: The test is the campaign the model was learned from, or the model is
            not good enough, or leaves more on the test than before it was refined.
    """
    if digest and digest == model.campaign:
        raise ConfigurationError(
            "the test is the campaign of the model.",
            source=test.source or None,
            hint="clamp some twenty times more, with tilts and forces in between.",
        )
    result = evaluate_test(model, test)
    if before is not None:
        _refuse_worse(result.ours.mean, evaluate_test(before, test).ours.mean, test)
    if result.ours.p95 > allowed:
        raise ConfigurationError(
            f"95 % of the holes are within {result.ours.p95 / DEG:.4f} deg, {allowed / DEG:g} deg "
            "are required: the model is not frozen.",
            source=test.source or None,
            hint="refine it, or add clamps to the campaign where the residuals are large.",
        )
    count = 1 if model.frozen is None else model.frozen.version + 1
    return replace(
        model,
        frozen=Frozen(
            version=count,
            tested_on=digest,
            clamps=result.clamps,
            **asdict(result.ours),
        ),
        version=model.version + 1,
        monitor=Watch(),
        provenance=merge([model.provenance, test.provenance]),
    )


def _refuse_worse(mean: float, was: float, test: Campaign) -> None:
    if mean > was:
        raise ConfigurationError(
            f"the refined model leaves {mean / DEG:.4f} deg on average, {was / DEG:.4f} deg before "
            "it was refined: it is not frozen.",
            source=test.source or None,
            hint="holes that the model before moved and the true deviation of the reference, or "
            "freeze that model without the refinement.",
        )


def record_of(
    hole: str,
    found: CorrectedReadings,
    left: Array,
    truth: str,
    provenance: Provenance = MEASURED,
    *,
    moved: Array | None = None,
) -> Remaining:
    """Returns the record of the tilt left after one move.

    The true tilt of the surface is the spindle's move plus the tilt that the reference measured
    after it. The record holds the error of the model that is refined now, whichever model commanded
    the move.

    Args:
        hole: Its number or name.
        found: Corrected readings of the clamp by the model to be refined, one row.
        left: (2,) rad, as the reference measured it after the move.
        truth: What measured it.
        provenance: Of clamp and reference: simulated or measured.
        moved: (2,) rad, tilt by which the spindle moved; that of ``found`` without it.

    Raises:
        ConfigurationError: No outside reference.
    """
    c = found.conditions
    cause = np.array([c.a[0], c.b[0], c.force[0]])
    tilt = left if moved is None else moved + left - found.tilt[0]
    return Remaining(hole=hole, tilt=tilt, cause=cause, truth=truth, provenance=provenance)
