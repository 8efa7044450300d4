"""Plan probing points for the smallest uncertainty at the machined points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Note, Table, count
from robotrue.app.request import InputFile, Option, Output, Request
from robotrue.app.request_fields import CellOrModel, Page, ToolSigma, TouchSigma, table_output
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.planning.plan_defaults import GOAL, LEAN_DEG, TIP_AXIS
from robotrue.validation.validation_defaults import TOUCH_MM

if TYPE_CHECKING:
    from robotrue.calibration.model import ErrorModel
    from robotrue.cell.cell import Cell
    from robotrue.core.arrays import Array
    from robotrue.planning.probing import Machining, ProbingTask
    from robotrue.planning.probing_candidates import TouchCandidates
    from robotrue.planning.probing_plan import ProbePlan

SHOWN: Final = (3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100)
"""Numbers of touches in the printed table."""
LISTED: Final = 8
"""Features named in a remark."""


class ProbePlanRequest(Request):
    """Features to probe, machined points, and the goal of the choice."""

    cell: CellOrModel
    part: Annotated[Path, InputFile()]
    """CSV of the candidate features."""
    machined: Annotated[tuple[Path, ...], InputFile()]
    """Postures (CSV with joints), tool path or program; may be repeated."""
    output: Annotated[Path, table_output()]
    """CSV of the touches to write."""
    touches: Annotated[int, Option(names=("--touches", "-n"))] = 20
    """Maximum number of touches."""
    frame: str | None = None
    """X,Y,Z,A,B,C: approximate part frame; default: from CELL."""
    run: Literal["compensated", "unchanged"] = "compensated"
    """compensated, or unchanged: with the controller's own model."""
    goal: Literal["mean", "worst"] = GOAL
    """mean: smallest RMS uncertainty. worst: smallest uncertainty of the worst point."""
    tolerance_mm: float = 0.0
    """Stop when that uncertainty (3-D, one sigma) is below this."""
    touch_sigma_mm: TouchSigma = TOUCH_MM
    tool_sigma_mm: ToolSigma = None
    lean_deg: float = LEAN_DEG
    """Lean of the touches from the machined attitudes."""
    tip_axis: str = TIP_AXIS
    """Direction to the tip in the tool frame: +z, or +x on many KUKA."""
    report: Page = None
    picture: Annotated[Path | None, Output(what="a picture", suffixes=(".png",))] = None
    """Also write a plot of the uncertainty over the part (PNG)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedTouches:
    """Chosen touches.

    Attributes:
        plan: The touches, in the order of their information gain, and the expected uncertainty.
        task: Candidates and machined postures.
        candidates: Features that can be touched, and those that cannot.
        notes: Assumptions of the plan.
        output: The table that was written.
        provenance: Of the model and the part frame.
    """

    plan: ProbePlan
    task: ProbingTask
    candidates: TouchCandidates
    notes: tuple[str, ...]
    output: Path
    provenance: Provenance

    def document(self) -> Mapping[str, object]:
        """Returns JSON values: mm, deg; keys as in the reference."""
        return {"touches_csv": str(self.output), **self._numbers()}

    def _numbers(self) -> dict[str, object]:
        from robotrue.validation.error_map import radius_95

        radius = radius_95(self.plan.covariance)
        machining = self.task.machining
        return {
            "touches": len(self.plan.row),
            "goal": self.plan.goal,
            "candidates": len(self.candidates.touches),
            "tried": self.candidates.tried,
            "rejected": dict(self.candidates.rejected),
            "untouchable": list(self.candidates.untouchable),
            "names": list(self.plan.touches.names),
            "joints_deg": self.plan.touches.joints / DEG,
            "expected_rms_mm": self.plan.mean / MM,
            "expected_worst_mm": self.plan.worst / MM,
            "spread_rms_mm": self.plan.spread_mean / MM,
            "groups": [
                {
                    "name": group.name,
                    "postures": group.postures,
                    "rms_mm": group.uncertainty / MM,
                    "worst_mm": group.worst / MM,
                    "best_mm": group.best / MM,
                    "at_touches_mm": group.at_touches / MM,
                    "radius_95_mm": float(radius[machining.groups[group.name]].max() / MM),
                    "covered": group.covered,
                }
                for group in self.plan.groups
            ],
            "machined": [
                {"group": name, "point_mm": p / MM, "radius_95_mm": float(r / MM)}
                for name, p, r in zip(machining.group, machining.point, radius, strict=True)
            ],
            "stopped": self.plan.stopped,
            "warnings": list(self.plan.warnings),
            "notes": list(self.notes),
        }

    def blocks(self) -> Iterable[Block]:
        """Returns the uncertainty against the number of touches and by group, and what was lost."""
        import numpy as np

        from robotrue.validation.error_map import radius_95

        plan, n = self.plan, len(self.plan.row)
        yield Table(
            title="expected uncertainty of the machined points (3-D, one sigma), mm",
            columns=("touches", "rms", "worst point", "rms, spread touches"),
            rows=tuple(
                (str(k), *(_mm(each[k]) for each in (plan.mean, plan.worst, plan.spread_mean)))
                for k in sorted({k for k in SHOWN if k < n} | {n})
                if np.isfinite(plan.mean[k])
            ),
        )
        radius = radius_95(plan.covariance)
        yield Table(
            title=f"after {n} touches, mm",
            columns=("machined", "points", "rms, one sigma", "95 % within, worst point", "covered"),
            rows=tuple(
                (
                    group.name,
                    str(group.postures),
                    _mm(group.uncertainty),
                    _mm(float(radius[self.task.machining.groups[group.name]].max())),
                    "yes" if group.covered else "NO",
                )
                for group in plan.groups
            ),
        )
        lost = ", ".join(f"{reason} {number}" for reason, number in self.candidates.rejected)
        yield Note(
            f"{len(self.candidates.touches)} candidates from {self.candidates.tried} combinations "
            f"of feature and attitude{': ' + lost if lost else ''}"
        )


def _mm(value: float) -> str:
    return f"{value / MM:.3f}" if isfinite(value) else "-"


@operation()
def run(request: ProbePlanRequest, context: Context) -> PlannedTouches:
    """Chooses the probing points and writes them with the requested files.

    Raises:
        ConfigurationError: An invalid frame or axis, or the part's position is not stated.
        ModelMismatchError: A machined file of another arm or part.
        ReachError: No posture of a machined file can be reached.
    """
    from robotrue.app.registered import provenance_used, read_model_or_cell
    from robotrue.measurement.formats.part_points import read_features
    from robotrue.planning.arm_scene import scene_of
    from robotrue.planning.plan_sheets import touch_sheet
    from robotrue.planning.probing import plan_touches
    from robotrue.planning.probing_candidates import TouchLimits, touch_candidates
    from robotrue.planning.probing_frame import plan_frame_touches
    from robotrue.planning.work_area import parse_axis, read_machining, rough_frames

    _require_sizes(request)
    limits = TouchLimits(lean=request.lean_deg * DEG, tip_axis=parse_axis(request.tip_axis))
    path = context.cell_file(request.cell)
    cell, model = read_model_or_cell(path)
    features = read_features(request.part)
    frames = rough_frames(cell, request.frame, features.parts)
    machining, thinned = read_machining(
        cell, request.machined, frames, features.parts, tip_axis=limits.tip_axis
    )
    for text in thinned:
        context.note(text)
    candidates = touch_candidates(
        cell.robot.nominal(),
        features,
        machining,
        frames,
        limits=limits,
        scene=scene_of(cell, clearance=0.0) if cell.obstacles else None,
    )
    task = _task(request, cell, model, frames, candidates, machining)
    planner = plan_touches if request.run == "compensated" else plan_frame_touches
    plan = planner(task, request.touches, goal=request.goal, tolerance=request.tolerance_mm * MM)
    output = context.output(request.output)
    result = PlannedTouches(
        plan=plan,
        task=task,
        candidates=candidates,
        notes=_notes(request, candidates, calibrated=model is not None, cell=cell),
        output=output,
        provenance=provenance_used(cell, model),
    )
    pages = _pages(request, result, limits.tip_axis, path)
    write_atomic(output, touch_sheet(plan.touches, features.parts, cell.robot))
    _tell(request, result, pages, context)
    return result


def _tell(
    request: ProbePlanRequest,
    result: PlannedTouches,
    pages: Mapping[Path, tuple[str, bytes]],
    context: Context,
) -> None:
    """Writes the pages, reports the plan and its warnings."""
    plan, output, number = result.plan, result.output, len(result.plan.row)
    context.inform(
        f"{number} {'touch' if number == 1 else 'touches'} written to {output}: put the joints at "
        "each touch in place of the planned ones, then delete the first line"
    )
    for target, (what, content) in pages.items():
        context.write(target, content, what)
    for warning in plan.warnings:
        context.inform(f"warning: {warning}")
    for text in result.notes:
        context.note(text)
    if plan.stopped:
        context.inform(f"stopped at {number}: below the tolerance of {request.tolerance_mm:g} mm")


def _require_sizes(request: ProbePlanRequest) -> None:
    for name, value in (
        ("--tolerance-mm", request.tolerance_mm),
        ("--touch-sigma-mm", request.touch_sigma_mm),
        ("--tool-sigma-mm", request.tool_sigma_mm or 0.0),
        ("--lean-deg", request.lean_deg),
    ):
        if not 0.0 <= value < 100.0:
            raise ConfigurationError(f"{name} {value:g}, expected 0 to 100.")


def _task(
    request: ProbePlanRequest,
    cell: Cell,
    model: ErrorModel | None,
    frames: Mapping[int, Array],
    candidates: TouchCandidates,
    machining: Machining,
) -> ProbingTask:
    """Returns the prior belief of the arm, the candidate points, and the machined points."""
    from robotrue.app.touch_settings import settings_for_touches
    from robotrue.calibration.nominal import NominalModel
    from robotrue.calibration.probing import before_touching
    from robotrue.planning.probing import ProbingTask

    arm = NominalModel(robot=cell.robot.nominal()) if model is None else model
    settings = settings_for_touches(cell, arm, request.touch_sigma_mm, request.tool_sigma_mm)
    return ProbingTask(
        belief=before_touching(arm, settings),
        T_base_part=frames,
        candidates=candidates.touches,
        machining=machining,
        touch_sigma=settings.touch_sigma,
        touch_load=cell.payload,
    )


def _notes(
    request: ProbePlanRequest, candidates: TouchCandidates, *, calibrated: bool, cell: Cell
) -> tuple[str, ...]:
    from robotrue.validation.registration_joint import ENOUGH

    notes = []
    lost = candidates.untouchable
    if lost:
        named = ", ".join(lost[:LISTED]) + (", ..." if len(lost) > LISTED else "")
        what = count(len(lost), "feature")
        notes.append(f"{what} cannot be probed in the attitude of machining: {named}.")
    if not cell.obstacles:
        notes.append(
            "No obstacles are stated, not even the floor, and the part itself is never one: jog "
            "to the first touch of each posture."
        )
    if request.run == "compensated":
        notes.append(
            "The program is assumed to be compensated by the model from registering these "
            "touches; for a controller's own model plan with --run unchanged."
        )
    if not calibrated:
        notes.append(
            "The arm is assumed to be typical of its type (priors); with a calibrated model the "
            "plan and its numbers are sharper."
        )
        if request.run == "compensated" and request.touches < ENOUGH // 3:
            notes.append(
                f"With fewer than {ENOUGH // 3} touches `register` does not refine a nominal arm, "
                "except with --fit joint."
            )
    return tuple(notes)


def _pages(
    request: ProbePlanRequest, result: PlannedTouches, tip_axis: Array, source: Path
) -> dict[Path, tuple[str, bytes]]:
    """Returns the other files to write: path, description, and bytes."""
    from robotrue.report.page import report_html
    from robotrue.report.probing_report import part_map, probing_content

    pages = {}
    if request.report is not None:
        content = probing_content(
            result.plan,
            result.task,
            tip_axis=tip_axis,
            notes=result.notes,
            source=source.name,
            robot=result.task.belief.robot.name,
            origin=result.provenance,
        )
        pages[request.report] = "report", report_html(content).encode()
    if request.picture is not None:
        pages[request.picture] = "picture", part_map(result.plan, result.task, tip_axis).png()
    return pages
