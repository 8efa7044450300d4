"""Deviation between the targets of a compensated job, and the splitting of moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypedDict

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.compensation.compensate import compensate
from robotrue.compensation.result import Compensation, MeanAndMax, mean_and_max
from robotrue.compensation.settings import CompensationSettings, is_on_table
from robotrue.compensation.split import SplitPlan, plan_split
from robotrue.compensation.split_apply import Reread, compensate_split, split_job
from robotrue.compensation.split_deviation import (
    RESOLUTION,
    MoveDeviations,
    job_deviation,
    measure_moves,
)
from robotrue.compensation.split_shapes import JobMoves, job_moves
from robotrue.compensation.status import Status
from robotrue.core.arrays import IntArray
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import ConfigurationError
from robotrue.program.insertion import Obstacle
from robotrue.program.lang import find_inserter
from robotrue.program.program import Program

_WORST: Final = 10
"""Moves the report names."""
_LINES: Final = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class SplitOptions:
    """Requested splitting.

    Attributes:
        tolerance_um: Split moves with larger deviations; None splits none.
        limit: Largest number of inserted targets.
        deviation: Report the deviation.
    """

    tolerance_um: float | None
    limit: int
    deviation: bool

    @property
    def asked(self) -> bool:
        """True if any of it was requested."""
        return self.deviation or self.tolerance_um is not None

    @property
    def named(self) -> str:
        """The option, for messages."""
        return "--deviation" if self.tolerance_um is None else "--split"


class WorstMove(TypedDict):
    """JSON values of a move that is far off the compensated path."""

    line: int
    kind: str
    length_mm: float
    kept_um: float
    kept_turn_deg: float
    at: float
    place_base_mm: list[float]
    parts: int
    split_um: float | None


class LeftWhole(TypedDict):
    """JSON values of moves that stay whole for one reason."""

    reason: str
    moves: int
    lines: list[int]
    kept_um: float | None


class BelowBound(TypedDict):
    """Moves whose deviation is only known to be below a bound."""

    um: float
    moves: int


class BetweenDocument(TypedDict, total=False):
    """Deviation between targets, as JSON values; with a split also its result."""

    lines: int
    arcs: int
    not_known: int
    surely_below: BelowBound
    kept_um: MeanAndMax | None
    kept_turn_deg: float | None
    worst: list[WorstMove]
    tolerance_um: float | None
    split_moves: int
    inserted_targets: int
    left_whole: list[LeftWhole]
    split_um: MeanAndMax | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Between:
    """Compensated job examined between its targets, split if requested.

    Attributes:
        programs: To be written; the given ones where no move is split.
        results: Compensation of each.
        document: JSON values.
        sentences: For the user.
        left_whole: Warnings about moves that are not split.
        worst: The moves with the largest deviations, as lines of a table.
    """

    programs: tuple[Program, ...]
    results: tuple[Compensation, ...]
    document: BetweenDocument
    sentences: tuple[str, ...]
    left_whole: tuple[str, ...] = ()
    worst: tuple[str, ...] = ()


def require_no_spin(options: SplitOptions, free_spin: bool) -> None:
    """Refuses to check between targets whose spin is still to be chosen.

    Raises:
        ConfigurationError: Both are requested.
    """
    if free_spin:
        raise ConfigurationError(
            f"{options.named} and --free-spin are both given: what lies between targets depends on "
            "the spins that are chosen.",
            hint="leave one of the two away.",
        )


def look_between(
    model: ErrorModel | None,
    job: Sequence[Program],
    settings: Sequence[CompensationSettings],
    options: SplitOptions,
    reread: Reread,
) -> Between:
    """Returns the compensated job with its moves unchanged or split.

    Raises:
        ConfigurationError: No model, a dialect without insertion, too many targets.
        FormatError: The split job does not read as it should.
    """
    model, moves = _require_model(model, options), find_inserter(job[0].dialect).moves(job)
    for program in job:
        if is_on_table(model, program.external):
            raise ConfigurationError(
                f"{options.named}: targets are on a rotary table whose errors the model has; what "
                "lies between them is not known.",
                source=program.name,
                hint=f"leave {options.named} away; the targets themselves are compensated.",
            )
    results = [compensate(model, p, settings=s) for p, s in zip(job, settings, strict=True)]
    whole = job_moves(model, job, moves, results, settings)
    tolerance = None if options.tolerance_um is None else options.tolerance_um * UM
    deviation = job_deviation(whole, tolerance=tolerance)
    document = _document(whole, deviation)
    if tolerance is None:
        document["worst"] = worst = _worst(whole, deviation, None)
        return Between(
            programs=tuple(job),
            results=tuple(results),
            document=document,
            sentences=(_kept_sentence(whole, deviation),),
            worst=_table(worst),
        )
    plan = plan_split(whole, job, deviation, tolerance, limit=options.limit)
    programs, left = tuple(job), _list_left_whole(whole, deviation, plan)
    worst = _worst(whole, deviation, plan)
    document |= {
        "tolerance_um": options.tolerance_um,
        "split_moves": int((plan.parts > 1).sum()),
        "inserted_targets": len(plan.insertion),
        "left_whole": left,
        "worst": worst,
    }
    reached = deviation
    if len(plan.insertion):
        split = split_job(whole, job, plan, reread)
        results, used = compensate_split(model, split, settings)
        programs = split.programs
        after = job_moves(model, programs, split.moves, results, used)
        reached = job_deviation(after, tolerance=tolerance)
    document["split_um"] = mean_and_max(reached.size / UM)
    return Between(
        programs=programs,
        results=tuple(results),
        document=document,
        sentences=(_kept_sentence(whole, deviation), *_split_sentence(document)),
        left_whole=tuple(map(_left_sentence, left)),
        worst=_table(worst) if options.deviation else (),
    )


def _require_model(model: ErrorModel | None, options: SplitOptions) -> ErrorModel:
    if model is None:
        raise ConfigurationError(
            f"{options.named} asks a calibrated model what the arm does between targets; here is "
            "only a cell.",
            hint="robotrue calibrate CELL MEASUREMENTS -o MODEL.",
        )
    return model


def _document(job: JobMoves, deviation: MoveDeviations) -> BetweenDocument:
    arcs = int(job.moves.circular.sum())
    turn = deviation.turn[np.isfinite(deviation.turn)]
    return {
        "lines": len(job.moves) - arcs,
        "arcs": arcs,
        "not_known": int(np.isnan(deviation.size).sum()),
        "surely_below": {
            "um": float(max(deviation.size[deviation.bounded].max(initial=0.0), RESOLUTION) / UM),
            "moves": int(deviation.bounded.sum()),
        },
        "kept_um": mean_and_max(deviation.size / UM),
        "kept_turn_deg": float(turn.max() / DEG) if len(turn) else None,
    }


def _worst(job: JobMoves, deviation: MoveDeviations, plan: SplitPlan | None) -> list[WorstMove]:
    """Returns the moves with the largest deviation: whole, and split as planned or in two."""
    known = np.flatnonzero(np.isfinite(deviation.size) & ~deviation.bounded)
    rows = known[np.argsort(-deviation.size[known], kind="stable")[:_WORST]]
    rows = rows[deviation.size[rows] > 0.0]
    if plan is None:
        parts = np.full(len(rows), 2)
        ordered = np.sort(rows)
        halves = dict(zip(ordered.tolist(), measure_moves(job, ordered, parts).size, strict=True))
        split = np.array([halves[row] for row in rows.tolist()])
    else:
        parts, split = plan.parts[rows], plan.size[rows]
    return [
        {
            "line": int(job.moves.line[row]),
            "kind": "arc" if job.moves.via[row] >= 0 else "line",
            "length_mm": float(deviation.length[row] / MM),
            "kept_um": float(deviation.size[row] / UM),
            "kept_turn_deg": float(deviation.turn[row] / DEG),
            "at": float(deviation.at[row]),
            "place_base_mm": (deviation.place[row] / MM).tolist(),
            "parts": int(number),
            "split_um": float(size / UM) if np.isfinite(size) else None,
        }
        for row, number, size in zip(rows.tolist(), parts.tolist(), split.tolist(), strict=True)
    ]


def _list_left_whole(job: JobMoves, deviation: MoveDeviations, plan: SplitPlan) -> list[LeftWhole]:
    """The moves that stay whole although they may be beyond the tolerance, by reason."""
    out: list[LeftWhole] = []

    def tell(rows: IntArray, why: str) -> None:
        if len(rows):
            size = deviation.size[rows]
            known = size[np.isfinite(size)]
            out.append(
                {
                    "reason": why,
                    "moves": len(rows),
                    "lines": job.moves.line[rows[:_LINES]].tolist(),
                    "kept_um": float(known.max() / UM) if len(known) else None,
                }
            )

    obstacle, unknown = job.moves.obstacle, np.isnan(deviation.size)
    for each in Obstacle:
        if each:
            tell(np.flatnonzero((plan.over | unknown) & (obstacle == each)), each.explanation)
    rest = plan.over & (obstacle == Obstacle.NONE)
    tell(
        np.flatnonzero(rest & plan.stepped),
        "its correction has a step, as at the reversal of a joint, that no number of parts removes",
    )
    tell(
        np.flatnonzero(rest & ~plan.stepped),
        "its configuration words change on the way, and those of this arm are unknown",
    )
    blind = unknown & (obstacle == Obstacle.NONE)
    for status in np.unique(deviation.status[blind]).tolist():
        why = "it starts or ends at a target that is not compensated, or in another frame"
        if status != Status.UNCHANGED_SOURCE:
            why = f"on the way: {Status(status).explanation}"
        tell(np.flatnonzero(blind & (deviation.status == status)), why)
    return out


def _kept_sentence(job: JobMoves, deviation: MoveDeviations) -> str:
    known = np.flatnonzero(np.isfinite(deviation.size))
    if not len(known):
        return "between the targets: no line or arc whose two ends are compensated"
    worst = int(known[np.argmax(deviation.size[known])])
    arcs = int(job.moves.circular[known].sum())
    kind = "arc" if job.moves.via[worst] >= 0 else "line"
    size = deviation.size[known] / UM
    return (
        f"between the targets of {len(known) - arcs} lines and {arcs} arcs, not split: "
        f"{size.mean():.2f} um mean, {size.max():.2f} um max off the compensated path "
        f"(the {kind} to line {job.moves.line[worst]})"
    )


def _split_sentence(document: BetweenDocument) -> list[str]:
    split = document["split_um"]
    if document["split_moves"] and split is not None:
        return [
            f"{document['split_moves']} moves split, {document['inserted_targets']} targets "
            f"inserted; then {split['max']:.2f} um max"
        ]
    if document["left_whole"]:
        return ["no move is split"]
    return [f"no move is split: all are within {document['tolerance_um']:g} um"]


def _left_sentence(left: LeftWhole) -> str:
    lines = ", ".join(map(str, left["lines"]))
    more = f", ... ({left['moves']} in all)" if left["moves"] > len(left["lines"]) else ""
    size = "" if left["kept_um"] is None else f" ({left['kept_um']:.2f} um)"
    several = "s" if left["moves"] > 1 else ""
    return f"line{several} {lines}{more}: not split{size}: {left['reason']}."


def _table(worst: Sequence[WorstMove]) -> tuple[str, ...]:
    if not worst:
        return ()
    out = ["      line  kind   length_mm   kept_um  parts  split_um"]
    for each in worst:
        split = "-" if each["split_um"] is None else f"{each['split_um']:.2f}"
        out.append(
            f"{each['line']:10d}  {each['kind']:4s}  {each['length_mm']:10.3f}  "
            f"{each['kept_um']:8.2f}  {each['parts']:5d}  {split:>8s}"
        )
    return tuple(out)
