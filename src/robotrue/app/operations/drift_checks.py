"""Drift check: choose poses that show whether the robot has changed, and check them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Facts, Note, Table
from robotrue.app.request import Item, Option, Reference, Request
from robotrue.app.request_fields import CalibratedModel, Columns, table_output
from robotrue.core.provenance import Provenance, marked_document, merge
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.validation.validation_defaults import DRIFT_LEVEL, DRIFT_POSES, FEWEST_DRIFT_POSES

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.core.arrays import Array
    from robotrue.robot.model import RobotModel
    from robotrue.store.workspace import Transaction
    from robotrue.validation.drift_check import Cause, DriftCheck


class DriftPlanRequest(Request):
    """For which model to choose poses."""

    model: CalibratedModel
    output: Annotated[Path, table_output(saved_as="check_poses.csv")]
    """Sheet (CSV) to write."""
    poses: Annotated[int, Option(offered=(FEWEST_DRIFT_POSES, 20))] = DRIFT_POSES
    """Number of poses; at least 4."""
    seed: Annotated[int, Option(advanced=True)] = 0
    """Seed of the candidates."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftPlan:
    """Poses of a drift check.

    Attributes:
        joints: (n, dof) rad, in the order of measuring.
        robot: Whose controller counts its axes.
        sd: Standard deviation of each cause's numbers, mm and deg.
        output: Sheet that was written.
        provenance: Of the model.
    """

    joints: Array
    robot: RobotModel
    sd: Mapping[str, Mapping[str, float]]
    output: Path
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns JSON values."""
        return {"poses_csv": str(self.output), "sd": self.sd}

    def blocks(self) -> Iterable[Block]:
        """Returns the expected uncertainty of each cause."""
        yield Table(
            title="standard deviation of each cause, alone",
            columns=("cause", "known to"),
            rows=tuple((name, _worst(numbers)) for name, numbers in self.sd.items()),
        )


def _worst(numbers: Mapping[str, float]) -> str:
    """The worst known number of a cause, with its unit."""
    term = max(numbers, key=lambda t: numbers[t] * (1.0 if t.endswith("mm") else DEG / MM))
    return f"{numbers[term]:.4f} {term.rpartition('_')[2]}"


@operation("drift_plan")
def plan_check(request: DriftPlanRequest, context: Context) -> DriftPlan:
    """Choose the few poses that best show a moved base or tool, or a slipped joint.

    Raises:
        ConfigurationError: Too few poses, or more than candidates.
        ReachError: Nothing can be measured.
    """
    from robotrue.calibration.model import Query, provenance_of
    from robotrue.cell.cell import tracker_covariance
    from robotrue.planning.discriminating_poses import choose_discriminating, draw_drift_candidates
    from robotrue.planning.plan_sheets import drift_sheet
    from robotrue.robot.forward import forward
    from robotrue.validation.drift_check import cause_columns

    if request.poses < FEWEST_DRIFT_POSES:
        raise ConfigurationError(
            f"{request.poses} poses; a drift check needs {FEWEST_DRIFT_POSES} or more.",
            hint=f"--poses {DRIFT_POSES}",
        )
    context.step("reading", 0, 2)
    stored = context.model(request.model)
    model, cell = stored.model, stored.cell
    context.step("choosing poses", 1, 2)
    drawn = draw_drift_candidates(model, cell, seed=request.seed)
    query = Query(joints=drawn, load=cell.payload)
    place = forward(model.robot.nominal(), drawn)[:, :3, 3]
    noise = model.predict(query).covariance + tracker_covariance(cell, place)
    causes = cause_columns(model, query)
    columns = {name: values for name, (_, values) in causes.items()}
    chosen = choose_discriminating(drawn, noise, columns, request.poses)
    output = context.write(
        request.output,
        drift_sheet(chosen.joints, cell.robot),
        f"{len(chosen.joints)} pose{'' if len(chosen.joints) == 1 else 's'}",
        ": fill in what the tracker reads",
    )
    return DriftPlan(
        joints=chosen.joints,
        robot=cell.robot,
        sd={name: _in_shop_units(terms, chosen.sd[name]) for name, (terms, _) in causes.items()},
        output=output,
        provenance=provenance_of(model),
    )


def _in_shop_units(terms: Iterable[str], sd: Array) -> dict[str, float]:
    """Standard deviations in mm and deg, by the names of their terms."""
    return {
        f"{term}_mm" if term in "xyz" else f"{term}_deg": float(value)
        / (MM if term in "xyz" else DEG)
        for term, value in zip(terms, sd, strict=True)
    }


@plan_check.saves
def save_plan(
    request: DriftPlanRequest, result: DriftPlan, into: Transaction, context: WorkspaceContext
) -> Mapping[str, object]:
    """Leaves a document ``drift-plan`` with the sheet, linked to the model."""
    from robotrue.robot.configuration import controller_axes
    from robotrue.store.nouns import MODEL
    from robotrue.store.records import Link

    record = context.record(MODEL, request.model)
    detail = marked_document(
        {
            "poses": len(result.joints),
            "joints_deg": (result.joints / DEG).tolist(),
            "axes_deg": (controller_axes(result.robot, result.joints) / DEG).tolist(),
            "sd": result.sd,
        },
        result.provenance,
    )
    links = [Link(role="model", to=record.ref)]
    return context.leave_document(into, "drift-plan", record.name, [result.output], links, detail)


VERDICTS: Final = {
    "keep": "no significant change: keep the model",
    "update": "one cause explains the change: update the model by transfer with these poses",
    "recalibrate": "the robot has changed, and no single cause explains it: calibrate again",
    "measure again": "one reading explains it: measure that pose again before anything else",
}
MOST_CAUSES: Final = 6


class DriftRequest(Request):
    """Model to check, and the measured poses."""

    model: CalibratedModel
    measurements: Annotated[
        Reference, Item(noun="measurement", argument="POSES", listed=True, sent=True)
    ]
    """5 to 10 poses measured again."""
    level: Annotated[float, Option(advanced=True)] = DRIFT_LEVEL
    """False-alarm rate."""
    mapping: Columns = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftChecked:
    """A drift check.

    Attributes:
        check: Its numbers and verdict.
        robot: Name of the robot.
        poses: Rows.
        advice: What to type next; empty for nothing.
        provenance: Of the model and the poses.
    """

    check: DriftCheck
    robot: str
    poses: int
    advice: str
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns JSON values; lengths in mm, angles in deg."""
        return _check_document(self.check)

    def blocks(self) -> Iterable[Block]:
        """Returns the verdict and the causes."""
        check = self.check
        facts = [
            ("verdict", check.verdict),
            ("that is", VERDICTS[check.verdict]),
            (
                "chi-square",
                f"{check.chi2:.1f} for {check.degrees} numbers, chance of more {check.p:.2g}",
            ),
            ("residual rms", f"{_rms(check) / MM:.4f} mm"),
            ("level", f"false alarm in {100 * check.level:g} % of checks or fewer"),
        ]
        if check.not_seen:
            facts.append(("not seen by these poses", ", ".join(check.not_seen)))
        yield Facts(title=f"drift check of {self.robot}", rows=tuple(facts))
        if check.changed:
            yield Table(
                title="causes, most likely first",
                columns=("cause", "shift", "chance", "p of the residual", ""),
                rows=tuple(
                    (
                        _place(cause, check),
                        _shift(cause),
                        f"{cause.p:.2g}",
                        f"{cause.p_left:.2g}",
                        "explains it" if cause.explains else "",
                    )
                    for cause in check.causes[:MOST_CAUSES]
                ),
                words=True,
            )
        if self.advice:
            yield Note(self.advice)


@operation("drift")
def check_drift(request: DriftRequest, context: Context) -> DriftChecked:
    """Check whether the robot still matches its calibration: keep, update or recalibrate.

    Raises:
        ObservabilityError: Too few poses.
    """
    from robotrue.calibration.model import provenance_of
    from robotrue.validation.drift_check import drift_check

    context.step("reading", 0, 3)
    stored = context.model(request.model)
    rows = context.measurements(
        stored.cell, [request.measurements], request.mapping, minimum=FEWEST_DRIFT_POSES
    )
    context.step("predicting", 1, 3)
    check = drift_check(stored.model, rows, payload=stored.cell.payload, level=request.level)
    poses, model = context.name(request.measurements), context.name(request.model)
    return DriftChecked(
        check=check,
        robot=stored.model.robot.name,
        poses=len(rows),
        advice=f"try: robotrue transfer CELL {poses} --source old={model},campaign -o MODEL_NEW"
        if check.verdict == "update" and isinstance(request.model, Path)
        else "",
        provenance=merge([provenance_of(stored.model), rows.provenance]),
    )


@check_drift.saves
def save_check(
    request: DriftRequest, result: DriftChecked, into: Transaction, context: WorkspaceContext
) -> Mapping[str, object]:
    """Leaves a drift check, linked to the model and the poses."""
    from robotrue.app.workspace_context import ref_document
    from robotrue.store import items
    from robotrue.store.nouns import DRIFT_CHECK, MODEL
    from robotrue.store.records import links_to

    model = context.record(MODEL, request.model)
    cell = next(iter(model.refs("cell")), None)
    data = context.keep_measured(into, [request.measurements], cell, request.mapping)
    poses = context.name(request.measurements)
    document = marked_document(result.document(), result.provenance)
    made = items.add(
        into,
        DRIFT_CHECK,
        name=context.naming.name or f"{model.name}: {poses}",
        note=context.naming.note,
        links=links_to(model=model.ref, data=data),
        poses=result.poses,
        statistic=result.check.chi2,
        p_value=result.check.p,
        verdict=result.check.verdict,
        detail={**document, "job": context.work.job.id},
    )
    return {
        "check": ref_document(made.ref),
        "verdict": result.check.verdict,
        "simulated": result.provenance.simulated,
    }


def _check_document(check: DriftCheck) -> dict[str, object]:
    """The check as JSON values; lengths in mm, angles in deg."""
    return {
        "verdict": check.verdict,
        "meaning": VERDICTS[check.verdict],
        "chi2": check.chi2,
        "degrees_of_freedom": check.degrees,
        "p": check.p,
        "level": check.level,
        "residual_rms_mm": _rms(check) / MM,
        "causes": [
            {
                "name": c.name,
                "explains": c.explains,
                "p": c.p,
                "p_left": c.p_left,
                "chi2_gain": c.gain,
                "shift": {
                    _name_term(term): float(v) / _size(term)
                    for term, v in zip(c.terms, c.shift, strict=True)
                },
                "sd": {
                    _name_term(term): float(v) / _size(term)
                    for term, v in zip(c.terms, c.sd, strict=True)
                },
            }
            for c in check.causes
        ],
        "not_seen": list(check.not_seen),
        "poses": [
            {
                "line": int(line),
                "residual_mm": (residual / MM).tolist(),
                "sigmas": float(sigmas),
            }
            for line, residual, sigmas in zip(
                check.source_row, check.residual, check.sigmas, strict=True
            )
        ],
    }


def _rms(check: DriftCheck) -> float:
    import numpy as np

    return float(np.sqrt(np.mean(np.sum(check.residual**2, axis=1))))


def _place(cause: Cause, check: DriftCheck) -> str:
    if cause.kind != "reading":
        return cause.name
    row = int(cause.name.removeprefix("reading ")) - 1
    return f"reading of line {int(check.source_row[row])}"


def _shift(cause: Cause) -> str:
    return ", ".join(
        f"{term} {v / _size(term):+.4f}({s / _size(term):.4f}) {_unit(term)}"
        for term, v, s in zip(cause.terms, cause.shift, cause.sd, strict=True)
    )


def _unit(term: str) -> str:
    return "mm" if term in ("x", "y", "z") else "deg"


def _size(term: str) -> float:
    return MM if _unit(term) == "mm" else DEG


def _name_term(term: str) -> str:
    return f"{term}_{_unit(term)}"
