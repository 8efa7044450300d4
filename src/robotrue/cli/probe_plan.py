"""``robotrue probe-plan``: which features to touch, and how well the machined points get known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.app.registered import provenance_used
from robotrue.calibration.nominal import NominalModel
from robotrue.calibration.probing import ProbingSettings, before_touching
from robotrue.cli.console import count, emit_json, emit_table, say, say_mark
from robotrue.cli.probe_plan_inputs import (
    opened,
    parse_axis,
    read_machining,
    rough_frames,
)
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.measurement.formats.part_points import read_features
from robotrue.planning.arm_scene import scene_of
from robotrue.planning.information import settings_of
from robotrue.planning.plan_sheets import touch_sheet
from robotrue.planning.probing import ProbingTask, plan_touches
from robotrue.planning.probing_candidates import TouchCandidates, TouchLimits, touch_candidates
from robotrue.planning.probing_frame import plan_frame_touches
from robotrue.planning.probing_plan import Goal, ProbePlan
from robotrue.validation.error_map import radius_95
from robotrue.validation.registration_frame import TOOL
from robotrue.validation.registration_joint import ENOUGH

RUNS: Final = ("compensated", "unchanged")
SHOWN: Final = (3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100)
"""Numbers of touches in the printed table."""
LISTED: Final = 8
"""Features named in a remark."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the command line says besides the files, in its own units."""

    touches: int
    frame: str | None
    goal: str
    run: str
    tolerance_mm: float
    touch_sigma_mm: float
    tool_sigma_mm: float | None
    lean_deg: float
    tip_axis: str
    report: Path | None
    picture: Path | None


def run(
    cell_or_model: Path,
    features_path: Path,
    machined: Sequence[Path],
    output: Path,
    options: Options,
    *,
    as_json: bool,
) -> None:
    """Chooses the touches and writes them; prints what uncertainty to expect of them."""
    inputs = [cell_or_model, features_path, *machined]
    for target in [p for p in (output, options.report, options.picture) if p is not None]:
        check_output(target, inputs)
    goal, limits = _checked(options)
    cell, model = opened(cell_or_model)
    features = read_features(features_path)
    frames = rough_frames(cell, options.frame, features.parts)
    machining = read_machining(cell, machined, frames, features.parts, tip_axis=limits.tip_axis)
    nominal = cell.robot.nominal()
    candidates = touch_candidates(
        nominal,
        features,
        machining,
        frames,
        limits=limits,
        scene=scene_of(cell, clearance=0.0) if cell.obstacles else None,
    )
    arm = NominalModel(robot=nominal) if model is None else model
    known = arm.robot
    own_tool = bool(np.allclose(known.T_flange_tool, nominal.T_flange_tool, atol=1e-9))
    sure = model is not None and own_tool
    tool = (0.0 if sure else TOOL) if options.tool_sigma_mm is None else options.tool_sigma_mm * MM
    settings = ProbingSettings(
        touch_sigma=options.touch_sigma_mm * MM,
        tool_sigma=tool,
        T_flange_tool=None if own_tool else nominal.T_flange_tool,
        payload=cell.payload,
        priors=settings_of(cell),
    )
    task = ProbingTask(
        belief=before_touching(arm, settings),
        T_base_part=frames,
        candidates=candidates.touches,
        machining=machining,
        touch_sigma=settings.touch_sigma,
        touch_load=cell.payload,
    )
    planner = plan_touches if options.run == "compensated" else plan_frame_touches
    plan = planner(task, options.touches, goal=goal, tolerance=options.tolerance_mm * MM)
    origin = provenance_used(cell, model)
    say_mark(origin)
    notes = _notes(candidates, options, calibrated=model is not None, checked=bool(cell.obstacles))
    pages = _pages(plan, task, options, limits, notes, cell_or_model, origin)
    write_atomic(output, touch_sheet(plan.touches, features.parts))
    say(
        f"{count(len(plan.row), 'touch') if len(plan.row) == 1 else f'{len(plan.row)} touches'} "
        f"written to {output}: put the joints at each touch in place of the planned ones, "
        "then delete the first line"
    )
    for path, (what, content) in pages.items():
        write_atomic(path, content)
        say(f"{what} written to {path}")
    for warning in plan.warnings:
        say(f"warning: {warning}")
    for note in notes:
        say(f"note: {note}")
    if plan.stopped:
        say(f"stopped at {len(plan.row)}: below the tolerance of {options.tolerance_mm:g} mm")
    if as_json:
        emit_json({"touches_csv": str(output), **document(plan, task, candidates, notes)}, origin)
    else:
        _show(plan, task, candidates, origin)


def _checked(options: Options) -> tuple[Goal, TouchLimits]:
    if options.run not in RUNS:
        raise ConfigurationError(
            f"--run {options.run!r}, expected {' or '.join(RUNS)}.", hint="--run compensated"
        )
    for name, value in (
        ("--tolerance-mm", options.tolerance_mm),
        ("--touch-sigma-mm", options.touch_sigma_mm),
        ("--tool-sigma-mm", options.tool_sigma_mm or 0.0),
        ("--lean-deg", options.lean_deg),
    ):
        if not 0.0 <= value < 100.0:
            raise ConfigurationError(f"{name} {value:g}, expected 0 to 100.")
    if options.goal not in ("mean", "worst"):
        raise ConfigurationError(f"--goal {options.goal!r}, expected mean or worst.")
    return (
        "mean" if options.goal == "mean" else "worst",
        TouchLimits(lean=options.lean_deg * DEG, tip_axis=parse_axis(options.tip_axis)),
    )


def _notes(
    candidates: TouchCandidates, options: Options, *, calibrated: bool, checked: bool
) -> tuple[str, ...]:
    notes = []
    lost = candidates.untouchable
    if lost:
        named = ", ".join(lost[:LISTED]) + (", ..." if len(lost) > LISTED else "")
        notes.append(f"{count(len(lost), 'feature')} cannot be touched as the part is machined: "
                     f"{named}.")  # fmt: skip
    if not checked:
        notes.append(
            "No obstacles are stated, not even the floor, and the part itself is never one: drive "
            "to the first touch of each posture by hand."
        )
    if options.run == "compensated":
        notes.append(
            "The program is taken to be compensated by the model that registering these touches "
            "gives; for a controller's own model plan with --run unchanged."
        )
    if not calibrated:
        notes.append(
            "The arm is believed to be one of its type (priors); with a calibrated model the plan "
            "and its numbers are sharper."
        )
        if options.run == "compensated" and options.touches < ENOUGH // 3:
            notes.append(
                f"With fewer than {ENOUGH // 3} touches registering leaves a nominal arm as it is, "
                "unless it is told --fit joint."
            )
    return tuple(notes)


def document(
    plan: ProbePlan, task: ProbingTask, candidates: TouchCandidates, notes: Sequence[str]
) -> dict[str, Any]:
    """Returns the plan as JSON values: mm, deg; keys as in the reference."""
    radius = radius_95(plan.covariance)
    machining = task.machining
    return {
        "touches": len(plan.row),
        "goal": plan.goal,
        "candidates": len(candidates.touches),
        "tried": candidates.tried,
        "rejected": dict(candidates.rejected),
        "untouchable": list(candidates.untouchable),
        "names": list(plan.touches.names),
        "joints_deg": plan.touches.joints / DEG,
        "expected_rms_mm": plan.mean / MM,
        "expected_worst_mm": plan.worst / MM,
        "spread_rms_mm": plan.spread_mean / MM,
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
            for group in plan.groups
        ],
        "machined": [
            {"group": name, "point_mm": p / MM, "radius_95_mm": float(r / MM)}
            for name, p, r in zip(machining.group, machining.point, radius, strict=True)
        ],
        "stopped": plan.stopped,
        "warnings": list(plan.warnings),
        "notes": list(notes),
    }


def _show(
    plan: ProbePlan, task: ProbingTask, candidates: TouchCandidates, origin: Provenance
) -> None:
    n = len(plan.row)
    shown = sorted({k for k in SHOWN if k < n} | {n})
    emit_table(
        "expected uncertainty of the machined points (3-D, one sigma), mm",
        ("touches", "rms", "worst point", "rms, spread touches"),
        [
            [str(k), *(_mm(v[k]) for v in (plan.mean, plan.worst, plan.spread_mean))]
            for k in shown
            if np.isfinite(plan.mean[k])
        ],
        provenance=origin,
    )
    radius = radius_95(plan.covariance)
    emit_table(
        f"after {n} touches, mm",
        ("machined", "points", "rms, one sigma", "95 % within, worst point", "covered"),
        [
            [
                group.name,
                str(group.postures),
                _mm(group.uncertainty),
                _mm(float(radius[task.machining.groups[group.name]].max())),
                "yes" if group.covered else "NO",
            ]
            for group in plan.groups
        ],
        provenance=origin,
    )
    lost = ", ".join(f"{reason} {number}" for reason, number in candidates.rejected)
    say(
        f"{len(candidates.touches)} candidates from {candidates.tried} combinations of feature and "
        f"attitude{': ' + lost if lost else ''}"
    )


def _mm(value: float) -> str:
    return f"{value / MM:.3f}" if np.isfinite(value) else "-"


def _pages(
    plan: ProbePlan,
    task: ProbingTask,
    options: Options,
    limits: TouchLimits,
    notes: tuple[str, ...],
    source: Path,
    origin: Provenance,
) -> dict[Path, tuple[str, bytes]]:
    """What else is written: path, what it is, and its bytes."""
    from robotrue.cli.probe_plan_page import part_map, probe_plan_page

    out = {}
    if options.report is not None:
        page = probe_plan_page(
            plan,
            task,
            tip_axis=limits.tip_axis,
            notes=notes,
            source=source.name,
            robot=task.belief.robot.name,
            origin=origin,
        )
        out[options.report] = "report", page.encode()
    if options.picture is not None:
        picture = part_map(plan, task, limits.tip_axis).png()
        out[options.picture] = "picture", picture
    return out
