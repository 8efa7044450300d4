"""A program on the screen: its path with predicted errors, its worst targets, GO or NO-GO."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from robotrue.app.force_options import parse_wrench
from robotrue.app.serve_defaults import LARGEST_DRAWN
from robotrue.app.stated_force import force_parameters
from robotrue.app.workbench.arm_body import answer, body_document, choose_posture, pack_floats
from robotrue.app.workbench.errors_along import (
    ExpectedErrors,
    choose_rows,
    describe_errors,
    find_movers,
)
from robotrue.app.workbench.model_views import from_simulation
from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell, frame_table, overlay_cell
from robotrue.cell.config import read_cell
from robotrue.cell.part import PartFrame
from robotrue.compensation.difference import Difference, difference
from robotrue.compensation.stance import start_joints
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.poses import apply
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.program.formats import read_job
from robotrue.program.program import Program
from robotrue.robot.statics import Load
from robotrue.store import cells, items, measurements, models, programs
from robotrue.store.layout import copy_files
from robotrue.store.nouns import CELL, MODEL, PROGRAM, REGISTRATION, ModelRecord, ProgramRecord
from robotrue.store.registrations import REGISTERED
from robotrue.store.workspace import Workspace
from robotrue.validation.conformity import Conformity, all_conform, conformity, to_judge
from robotrue.validation.error_map import radius_95
from robotrue.validation.metrics import error_statistics

WORST: Final = 25


def judge_program(
    workspace: Workspace,
    program: str,
    version: int,
    model: str,
    model_version: int,
    tolerance_mm: float | None,
    strict: bool = False,
) -> bytes:
    """Returns path, predicted errors, worst targets and verdict of a program.

    Args:
        workspace: Of program and model.
        program: As the CAM made it, or compensated; the latter is compared with the former.
        version: Of it.
        model: Model that predicts, for a program as the CAM made it.
        model_version: Of it.
        tolerance_mm: Largest distance of a target from where it should be; None: no verdict.
        strict: Whether axis targets count as targets that are not proven.
    """
    with TemporaryDirectory() as scratch:
        asked = items.get(workspace, PROGRAM, program, version=version)
        judge = items.get(workspace, MODEL, model, version=model_version)
        found = _read_programs(workspace, asked, judge, Path(scratch))
    parts = [
        (
            first,
            difference(
                first,
                second,
                model=found.model,
                load=found.load,
                home=found.home,
            ),
        )
        for first, second in zip(found.first, found.second, strict=True)
    ]
    parts = [(program, one) for program, one in parts if len(one.change)]
    if not parts:
        raise ModelMismatchError("no targets in this program.", hint="drop its main file, too.")
    tolerance = None if tolerance_mm is None else tolerance_mm * MM
    return answer(_document(found, parts, tolerance, strict=strict))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
    first: tuple[Program, ...]
    second: tuple[Program, ...]
    model: ErrorModel
    record: ModelRecord
    cell: Cell
    load: Load
    home: Array
    simulated: bool
    compared: bool
    part: PartFrame | None


def _read_programs(
    workspace: Workspace, after: ProgramRecord, record: ModelRecord, scratch: Path
) -> _Found:
    if after.bytes > LARGEST_DRAWN:
        raise ConfigurationError(
            f"a program of {after.bytes / 1e6:.0f} MB, drawn here up to "
            f"{LARGEST_DRAWN / 1e6:.0f} MB.",
            hint="robotrue diff BEFORE AFTER --model MODEL.",
        )
    used = after.refs("model")
    if used:  # a compensated program is checked with the model that compensated it
        record = items.get(workspace, MODEL, used[0].id, version=used[0].version)
    held = models.model_of(workspace, record)
    stated = force_parameters(workspace, after)
    cell = _cell(workspace, after, held.cell, scratch, stated.part)
    frames = frame_table(cell)
    before = [
        items.get(workspace, PROGRAM, to.id, version=to.version) for to in after.refs("before")
    ]
    jobs_read = []
    for number, each in enumerate([*(before or [after]), after]):
        place = scratch / str(number)
        place.mkdir()
        jobs_read.append(read_job(list(programs.copy_program(workspace, each, place)), frames))
    rows = measurements.read_data(workspace, record)
    return _Found(
        first=jobs_read[0],
        second=jobs_read[1],
        model=held.model,
        record=record,
        cell=cell,
        load=_load(cell.payload, stated.wrench),
        home=start_joints(cell.robot, cell.controller.start, stated.start),
        simulated=from_simulation(held.model, rows)
        or (cell.part is not None and cell.part.provenance.simulated),
        compared=bool(before),
        part=_part(cell, stated.part),
    )


def _cell(
    workspace: Workspace, record: ProgramRecord, held: Cell, scratch: Path, part: object
) -> Cell:
    """The cell of the model with the frames a compensated program uses, as its job did it."""
    place = scratch / "cell"
    place.mkdir()
    for to in record.refs("registration"):
        registered = items.get(workspace, REGISTRATION, to.id, version=to.version)
        (file,) = copy_files(workspace, registered, place, REGISTERED)
        cell = overlay_cell(held, read_cell(file))
        frame = _part(cell, part)
        return cell if frame is None else replace(cell, T_base_frame=frame.T_base_part)
    for to in record.refs("cell"):
        stated = items.get(workspace, CELL, to.id, version=to.version)
        return overlay_cell(held, read_cell(cells.copy_cell(workspace, stated, place)))
    return held


def _part(cell: Cell, named: object) -> PartFrame | None:
    """The part frame of a registered cell; None: the cell is not registered."""
    return None if cell.part is None else cell.part.frame(None if named is None else str(named))


def _load(payload: Load, stated: object) -> Load:
    """The payload, with the process force the program was compensated for."""
    return replace(payload, wrench=parse_wrench(str(stated))[None]) if stated else payload


def _document(
    found: _Found, parts: list[tuple[Program, Difference]], tolerance: float | None, *, strict: bool
) -> dict[str, object]:
    axis = np.concatenate([one.axis_target for _, one in parts])
    kept = np.flatnonzero(to_judge(axis, strict=strict))
    position = np.concatenate([_position(program) for program, _ in parts])[kept]
    lengths = [_lengths(one) for _, one in parts]
    before, after, bound = (np.concatenate(each)[kept] for each in zip(*lengths, strict=True))
    line = np.concatenate([one.line for _, one in parts])[kept]
    shift = np.concatenate([np.linalg.norm(one.shift, axis=1) for _, one in parts])[kept]
    names = [program.name for program, one in parts for _ in range(len(one.change))]
    known = _require_known(np.isfinite(before + after + bound))
    states = None if tolerance is None else conformity(after, bound, tolerance)
    drawn = np.flatnonzero(known & np.isfinite(position).all(axis=1))
    point = np.full(len(kept), -1)
    point[drawn] = np.arange(len(drawn))
    movers = [find_movers(one.joints, found.cell.robot.controller) for _, one in parts]
    errors = ExpectedErrors(
        number=kept + 1,
        line=line,
        before=before + bound,
        after=after + bound,
        mover=np.concatenate(movers)[kept],
        point=point,
    )
    errors = errors.take(known)
    sizes = {"before": before, "after": after, "bound": bound, "shift": shift}
    # What nothing is known of comes first: it is why the program is NO-GO.
    order = np.argsort(-np.where(known, after + bound, np.inf), kind="stable")[:WORST]
    path = {
        **{f"{name}_m": pack_floats(sizes[name][drawn]) for name in ("before", "after", "bound")},
        "position": pack_floats(position[drawn]),
        "tolerance_m": tolerance,
        "line": line[drawn],
        "compared": found.compared,
    }
    marked = np.unique([*errors.point[choose_rows(errors)], *point[order]])
    marked = marked[marked >= 0]
    joints = np.concatenate([one.joints for _, one in parts])[kept][drawn][marked]
    return {
        "scene": _draw_scene(found, path, marked, joints),
        "simulated": found.simulated,
        "model": {"name": found.record.name, "version": found.record.version},
        "part": None if found.part is None else _part_known_to(found.part),
        "targets": len(kept),
        "axis_targets": int(axis.sum()),
        "strict": strict,
        "unknown": int((~known).sum()),
        "before_m": _statistics(before[known]),
        "after_m": _statistics(after[known]),
        "bound_m": float(bound[known].max()),
        "expected_m": float((after + bound)[known].max()),
        "along": describe_errors(errors, names),
        "states": {}
        if states is None
        else {each.name.lower(): int((states == each).sum()) for each in Conformity},
        "go": None if states is None else all_conform(states),
        "worst": [
            {
                "file": names[kept[row]],
                "line": int(line[row]),
                **{f"{name}_m": float(size[row]) for name, size in sizes.items()},
                "state": None if states is None else Conformity(int(states[row])).name.lower(),
                "point": int(point[row]),
            }
            for row in order
        ],
    }


def _part_known_to(frame: PartFrame) -> dict[str, object]:
    """The part frame and the uncertainty of its origin, m, one sigma; no bound includes it."""
    sd = np.sqrt(np.diag(frame.covariance))[:3]
    return {"name": frame.name, "sd_m": float(np.linalg.norm(sd)), "verdict": frame.verdict}


def _require_known(known: BoolArray) -> BoolArray:
    if not known.any():
        raise ModelMismatchError(
            "no target has a predicted error: none is a reachable pose, or the arm configuration "
            "is not stated.",
            hint="check tool, frames, robot and [controller] start_deg of the cell.",
        )
    return known


def _draw_scene(
    found: _Found, path: Mapping[str, object], marked: IntArray, joints: Array
) -> dict[str, object]:
    """The 3-D view; the arm can be shown at the points (m,) of the path whose joints are known."""
    known = np.isfinite(joints).all(axis=1)
    if not known.any():
        start = found.model.training_summary().joint_range
        middle = choose_posture(found.cell.robot) if start is None else start.mean(axis=0)
        marked, joints = marked[:0], middle[None]
    else:
        marked, joints = marked[known], joints[known]
    return {
        "robot": body_document(found.cell, joints),
        "frames": [{"name": "base", "T_base_frame": np.eye(4)}],
        "path": {**path, "posture": marked},
        "simulated": found.simulated,
    }


def _position(program: Program) -> Array:
    return np.asarray(apply(program.T_base_frame[program.frame], program.position))


def _lengths(one: Difference) -> tuple[Array, Array, Array]:
    """Length (n,) m of the error before and after, and the radius that holds 95 % about it."""
    before, after = (np.linalg.norm(e, axis=1) for e in (one.error_before, one.error_after))
    return before, after, radius_95(one.covariance)


def _statistics(lengths: Array) -> dict[str, float]:
    found = error_statistics(lengths[:, None] * np.array([1.0, 0.0, 0.0]))
    return {"mean": found.mean, "p95": found.p95, "max": found.max}
