"""Choose the few poses that show a moved base or tool and a slipped joint best."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.presentation import Block, Table
from robotrue.app.request import Option, Request
from robotrue.app.request_fields import CalibratedModel, table_output
from robotrue.core.provenance import Provenance, marked_document
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.validation.validation_defaults import DRIFT_POSES, FEWEST_DRIFT_POSES

if TYPE_CHECKING:
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.core.arrays import Array
    from robotrue.robot.model import RobotModel
    from robotrue.store.workspace import Transaction


class DriftPlanRequest(Request):
    """For which model to choose poses."""

    model: CalibratedModel
    output: Annotated[Path, table_output(saved_as="check_poses.csv", help="Sheet (CSV) to write.")]
    poses: Annotated[
        int, Option(offered=(FEWEST_DRIFT_POSES, 20), help="How many; 4 at least.")
    ] = DRIFT_POSES
    seed: Annotated[int, Option(advanced=True, help="Of the draw of candidates.")] = 0


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
        """Returns how well each cause will be known."""
        yield Table(
            title="standard deviation of each cause, alone",
            columns=("cause", "known to"),
            rows=tuple((name, _worst(numbers)) for name, numbers in self.sd.items()),
        )


def _worst(numbers: Mapping[str, float]) -> str:
    """The worst known number of a cause, with its unit."""
    term = max(numbers, key=lambda t: numbers[t] * (1.0 if t.endswith("mm") else DEG / MM))
    return f"{numbers[term]:.4f} {term.rpartition('_')[2]}"


def run(request: DriftPlanRequest, context: Context) -> DriftPlan:
    """Chooses the poses and writes a sheet to fill in.

    Raises:
        ConfigurationError: Too few poses, or more than candidates.
        ReachError: Nothing can be measured.
    """
    from robotrue.calibration.lineage import provenance_of
    from robotrue.calibration.model import Query
    from robotrue.cell.cell import tracker_covariance
    from robotrue.core.files import write_atomic
    from robotrue.planning.discriminating_poses import (
        choose_discriminating,
        draw_drift_candidates,
    )
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
    output = context.output(request.output)
    write_atomic(output, drift_sheet(chosen.joints, cell.robot))
    poses = f"{len(chosen.joints)} pose{'' if len(chosen.joints) == 1 else 's'}"
    context.wrote(poses, output, ": fill in what the tracker reads")
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


def save(
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


OPERATION: Final = Operation(request=DriftPlanRequest, run=run, save=save)
