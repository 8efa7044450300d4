"""Choose the most informative poses to measure, with the expected accuracy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.plan_request import PlanRequest, refuse_other_method
from robotrue.app.presentation import Block, Note, Table
from robotrue.core.provenance import Provenance, marked_document
from robotrue.core.units import MM, UM
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.planning.plan_defaults import INFORMATION

if TYPE_CHECKING:
    from robotrue.app.hierarchy import PlannedHierarchy
    from robotrue.app.workspace_context import WorkspaceContext
    from robotrue.calibration.model import ErrorModel
    from robotrue.cell.cell import Cell
    from robotrue.measurement.formats.measured_files import QueryTable
    from robotrue.planning.pose_plan import PosePlan
    from robotrue.robot.model import RobotModel
    from robotrue.robot.statics import Load
    from robotrue.store.workspace import Transaction

HIERARCHY: Final = "hierarchical plan"
"""Kind of the documents with the poses of a source and of its sub-spaces."""
SHOWN: Final = (4, 6, 8, 10, 15, 20, 25, 30, 40, 50, 60, 80, 100)
"""Numbers of poses in the printed table."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """Chosen poses.

    Attributes:
        plan: The poses and what to expect of them.
        robot: Whose controller counts the axes.
        files: That were written: table, page, KRL program.
        provenance: Of the model they start from; None without one.
    """

    plan: PosePlan
    robot: RobotModel
    files: tuple[Path, ...]
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns JSON values: mm, deg."""
        from robotrue.planning.plan_sheets import plan_document

        return {"poses_csv": str(self.files[0]), **plan_document(self.plan)}

    def blocks(self) -> Iterable[Block]:
        """Returns the expected error against the number of poses."""
        plan, expected = self.plan, self.plan.expected
        shown = sorted({k for k in SHOWN if k < len(plan)} | {len(plan)})
        yield Table(
            title="expected mean error, mm, of an arm of this type "
            f"(floor {expected.floor_mean / MM:.3f})",
            columns=("poses", "planned", "random", "random, quartiles"),
            rows=tuple(
                (
                    str(k),
                    f"{expected.mean[k] / MM:.3f}",
                    f"{expected.random_mean[k] / MM:.3f}",
                    f"{expected.random_low[k] / MM:.3f} to {expected.random_high[k] / MM:.3f}",
                )
                for k in shown
            ),
        )
        lost = ", ".join(f"{reason} {number}" for reason, number in plan.rejected)
        yield Note(
            f"{plan.candidates} candidates from {plan.drawn} postures{': ' + lost if lost else ''}"
        )


@operation()
def run(request: PlanRequest, context: Context) -> Planned | PlannedHierarchy:
    """Chooses the poses and writes them.

    Raises:
        ConfigurationError: An invalid option.
        ReachError: Nothing can be measured, or the program is out of reach.
        ModelMismatchError: A KRL program is wanted of a controller that is no KUKA.
    """
    from robotrue.app.registered import provenance_used
    from robotrue.app.report_pages import plan_page
    from robotrue.planning.plan_sheets import measuring_krl, plan_sheet

    refuse_other_method(request)
    if request.method != INFORMATION:
        from robotrue.app.hierarchy import write_hierarchy

        if request.report is not None:
            context.note("a hierarchical plan has no report page: its poses are in two tables.")
        return write_hierarchy(request, context.cell(request.cell), context)
    model = None if request.model is None else context.model(request.model).model
    cell = context.cell(request.cell)
    plan = _choose_poses(request, context, cell, model)
    origin = provenance_used(None, model)
    krl = request.krl
    program = b"" if krl is None else measuring_krl(cell, plan, krl.stem, request.trigger_output)
    poses = f"{len(plan)} pose{'' if len(plan) == 1 else 's'}"
    sheet = plan_sheet(plan, cell.robot)
    files = [context.write(request.output, sheet, poses, ": fill in what the tracker reads")]
    if request.report is not None:
        files.append(context.write(request.report, plan_page(cell, plan, origin), "report"))
    if krl is not None:
        files.append(context.write(krl, program, "program"))
    for line in plan.notes:
        context.note(line)
    if plan.stopped:
        gain = f"the next pose would gain less than {request.tolerance_um:g} um"
        context.inform(f"stopped at {len(plan)}: {gain}")
    return Planned(plan=plan, robot=cell.robot, files=tuple(files), provenance=origin)


def _choose_poses(
    request: PlanRequest, context: Context, cell: Cell, model: ErrorModel | None
) -> PosePlan:
    """The poses, chosen by the request."""
    from robotrue.planning.pose_plan import PlanSettings, plan_poses
    from robotrue.planning.work_area import parse_region, program_postures

    if request.region is not None and request.program is not None:
        raise ConfigurationError(
            "--region and --program-targets both set where the arm will work.",
            hint="leave one of them out.",
        )
    within, region = request.within, request.region
    settings = PlanSettings(
        criterion=request.criterion,
        candidates=request.candidates,
        within=None if within is None else parse_region("--within", within),
        work=None if region is None else parse_region("--region", region),
        approach="one side" if request.approach == "one-side" else "as it comes",
        enough=request.tolerance_um * UM,
        loads=tuple(_payload(text) for text in request.payloads),
        seed=request.seed,
    )
    work, tool = None, None
    if request.program is not None:
        files = context.program_files((request.program,))
        work, tool = program_postures(cell, files[0]), cell.robot.T_flange_tool
    recorded = None if request.recorded is None else _read_recorded(request.recorded, cell)
    context.step("drawing postures", 0, 1)
    plan = plan_poses(
        cell,
        request.poses,
        settings=settings,
        model=model,
        candidates=None if recorded is None else recorded.joints,
        work=work,
        T_flange_tool=tool,
        progress=context.step,
    )
    if recorded is not None and request.recorded is not None:
        lines = ", ".join(str(line) for line in recorded.source_row[plan.row])
        context.inform(f"chosen lines of {request.recorded.name}, in this order: {lines}")
    return plan


def _read_recorded(path: Path, cell: Cell) -> QueryTable:
    """The poses of a file.

    Raises:
        ModelMismatchError: Another number of joints than the robot's.
    """
    from robotrue.measurement.formats.measured_files import read_queries
    from robotrue.robot.configuration import axis_relation

    robot = cell.measured_robot
    poses = read_queries(path, relation=axis_relation(robot))
    if poses.joints.shape[1] != robot.dof:
        raise ModelMismatchError(
            f"{poses.joints.shape[1]} joint columns, {robot.name} has {robot.dof} joints.",
            source=path,
            hint="one column j1_deg, j2_deg, ... per joint.",
        )
    return poses


def _payload(text: str) -> Load:
    """Returns a load state from ``KG`` or ``KG,X,Y,Z`` (mm in the flange frame)."""
    import numpy as np

    from robotrue.core.arrays import parse_number_list
    from robotrue.robot.statics import Load

    numbers = parse_number_list(text)
    if numbers.size not in (1, 4) or numbers[0] < 0.0:
        raise ConfigurationError(
            f"payload {text!r}, expected KG or KG,X,Y,Z with the centre of mass in mm.",
            hint="--payload 50,0,0,120",
        )
    centre = np.zeros(3) if numbers.size == 1 else numbers[1:] * MM
    return Load(mass=numbers[:1], com=centre[None])


@run.saves
def save(
    request: PlanRequest,
    result: Planned | PlannedHierarchy,
    into: Transaction,
    context: WorkspaceContext,
) -> Mapping[str, object]:
    """Leaves a document ``plan`` with its files, linked to what it was made for."""
    from robotrue.planning.plan_sheets import plan_document
    from robotrue.store.nouns import CELL, MODEL, PROGRAM
    from robotrue.store.records import Link

    cell = context.record(CELL, request.cell)
    links = [Link(role="cell", to=cell.ref)]
    if not isinstance(result, Planned):
        numbers = marked_document(result.document(), result.provenance)
        names = {"poses_csv": result.files[0].name, "target_csv": result.files[1].name}
        detail = {**numbers, **names}
        return context.leave_document(into, HIERARCHY, cell.name, result.files, links, detail)
    if request.model is not None:
        links.append(Link(role="model", to=context.record(MODEL, request.model).ref))
    if request.program is not None:
        links.append(Link(role="before", to=context.record(PROGRAM, request.program).ref))
    detail = marked_document(plan_document(result.plan), result.provenance)
    return context.leave_document(into, "plan", cell.name, result.files, links, detail)
