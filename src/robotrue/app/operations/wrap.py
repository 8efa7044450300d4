"""Write a KRL or RAPID function that corrects targets the program computes at run time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.outputs import check_output
from robotrue.app.presentation import Block, Facts, PlainResult, Table
from robotrue.app.wrap_request import LANGUAGES, WrapRequest
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance, simulation_mark
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.calibration.model import ErrorModel
    from robotrue.compensation.fit_correction_table import FittedTable
    from robotrue.compensation.region_corrections import RegionArm
    from robotrue.program.computed_calls import ComputedCall
    from robotrue.program.program import FrameTable, Program

WORD_EDGE_DEG: Final = 0.5
"""By which a correction may turn an axis, for the note on configuration words."""


@operation()
def run(request: WrapRequest, context: Context) -> PlainResult:
    """Writes the module, and reports its residual and where to call it.

    Raises:
        ConfigurationError: Invalid values, or a configuration that is not stated.
        ReachError: A pose of the region cannot be compensated.
        StepError: No table of that size keeps the tolerance.
    """
    from robotrue.app.registered import open_model, provenance_used
    from robotrue.app.stated_conditions import model_under
    from robotrue.app.wrapped_region import open_arm
    from robotrue.cell.cell import frame_table
    from robotrue.compensation.fit_correction_table import fit_table
    from robotrue.program.correction_table import require_module_name

    output = context.output(request.output)
    require_module_name(request.output.stem)
    language = LANGUAGES[request.output.suffix.lower()]
    path = context.model_file(request.model)
    place = None if request.cell is None else context.cell_file(request.cell)
    cell, model = open_model(path, place)
    if model is None:
        raise ConfigurationError("a cell has no errors to correct.", source=path, hint="a model.")
    stated = (request.temperature_degC, request.time_s, request.e1_mm)
    used = model_under(model, *stated, context) or model
    used.require_axes(cell.controller.external)
    table = frame_table(cell)
    programs = _read_programs(request, table, language)
    arm = open_arm(request, cell, used, table, programs)
    fitted = fit_table(arm, tolerance=request.tolerance_mm * MM, most_numbers=request.max_numbers)
    origin = provenance_used(cell, model)
    files = _print_module(request, arm, fitted, table, language, origin)
    sources = [path.parent / program.name for path in request.program for program in programs]
    for name in files:
        check_output(output.with_name(name), sources)
    calls = _list_calls(request, programs, sources, context)
    for name, data in files.items():
        write_atomic(output.with_name(name), data)
    document = {"output": str(output), "language": language, **_numbers(arm, fitted)}
    document["files"] = list(files)
    document["calls"] = [_call_document(call) for call in calls]
    notes = (*_axis_notes(arm, fitted, language), *_backlash_note(model))
    for note in (*notes, *_condition_notes(request)):
        context.note(note)
    context.wrote(f"{fitted.table.numbers} numbers", output)
    return PlainResult(
        values=document, shown=_blocks(document, calls, request.output.name), provenance=origin
    )


def _read_programs(request: WrapRequest, table: FrameTable, language: str) -> tuple[Program, ...]:
    from robotrue.program.formats import read_job

    if not request.program:
        if request.wrap_computed is not None:
            raise ConfigurationError("--wrap-computed without --program.", hint="--program a.src")
        return ()
    programs = read_job(request.program, table)
    if programs[0].dialect != language:
        raise ConfigurationError(
            f"{programs[0].name} is a program in {programs[0].dialect}, the module is {language}.",
            source=request.output,
            hint="-o rt_fix.src for KRL, -o RtFix.mod for RAPID.",
        )
    return programs


def _print_module(
    request: WrapRequest,
    arm: RegionArm,
    fitted: FittedTable,
    table: FrameTable,
    language: str,
    origin: Provenance,
) -> dict[str, bytes]:
    """The files of the module by name."""
    from robotrue.core.poses import inverse
    from robotrue.program.correction_krl import write_krl_module
    from robotrue.program.correction_rapid import write_rapid_module
    from robotrue.program.correction_table import TableModule

    module = TableModule(
        table=fitted.table,
        name=request.output.stem,
        T_world_base=inverse(table.T_base_world),
        T_flange_tool=arm.T_flange_tool,
        remarks=(*_remarks(arm, fitted, origin), *_condition_notes(request)),
    )
    if language == "krl":
        return write_krl_module(module)
    files = write_rapid_module(module)
    return {request.output.name: next(iter(files.values()))}


def _remarks(arm: RegionArm, fitted: FittedTable, origin: Provenance) -> list[str]:
    """The comment of the module: what it holds for, and what it leaves."""
    values = _numbers(arm, fitted)
    return [
        *(
            ["SIMULATED: the model rests on simulated measurements."]
            if simulation_mark(origin)
            else []
        ),
        "Made by robotrue wrap. Do not combine with absolute accuracy of the controller.",
        f"Box in the work frame, mm: {_join(values['box_mm'], 3)}",
        f"Middle attitude A B C, deg: {_join(values['attitude_deg'], 3)}, "
        f"turned by up to {_join(values['turn_deg'], 2)}",
        f"Arm in the middle, A1 to A6, deg: {_join(values['axes_deg'], 1)}",
        f"Corrections up to {values['correction_max_mm']:.3f} mm; the table leaves "
        f"{values['left_max_mm']:.4f} mm at most, {values['left_95_mm']:.4f} mm at 95 %.",
        "State 1: outside the box, 2: attitude too far off, 3: another tool, 4: part on the robot.",
        "A pose with a state is returned as it came, and the program halts before it.",
    ]


def _join(values: object, digits: int) -> str:
    numbers = values if isinstance(values, list) else []
    return ", ".join(f"{value:.{digits}f}" for value in numbers)


def _numbers(arm: RegionArm, fitted: FittedTable) -> dict[str, Any]:
    """What the table is and what it leaves, JSON values."""
    import numpy as np

    from robotrue.compensation.fit_correction_table import CHECKED
    from robotrue.core.rotations import abc_from_matrix

    region, table = arm.region, fitted.table
    axes = arm.setup.robot.controller.to_controller(arm.middle[None])[0]
    return {
        "numbers": table.numbers,
        "cells": table.cells.tolist(),
        "terms": len(table.powers),
        "box_mm": (np.stack([region.low, region.high], axis=1).ravel() / MM).round(4).tolist(),
        "attitude_deg": (abc_from_matrix(region.R_frame_tool) / DEG).round(5).tolist(),
        "turn_deg": (region.turn / DEG).round(5).tolist(),
        "axes_deg": (axes / DEG).round(3).tolist(),
        "checked_poses": CHECKED,
        "correction_max_mm": float(fitted.before.max() / MM),
        "left_max_mm": float(fitted.left.max() / MM),
        "left_95_mm": float(np.quantile(fitted.left, 0.95) / MM),
        "left_turn_max_deg": float(fitted.turn_left.max() / DEG),
    }


def _list_calls(
    request: WrapRequest, programs: Sequence[Program], sources: Sequence[Path], context: Context
) -> tuple[ComputedCall, ...]:
    """Lists the moves to computed targets; writes the programs with the calls if requested.

    Raises:
        ConfigurationError: The folder is that of the programs, or is none.
    """
    from robotrue.program.computed_calls import list_calls, put_calls

    calls = list_calls(programs, request.output.stem)
    if request.wrap_computed is None:
        return calls
    folder = context.output(request.wrap_computed)
    if not folder.is_dir():
        raise ConfigurationError("no such folder.", source=folder, hint=f"mkdir -p {folder}")
    paths = [folder / program.name for program in programs]
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        check_output(path, sources)
    for path, program in zip(paths, programs, strict=True):
        write_atomic(path, put_calls(program, calls))
    count = sum(not call.why for call in calls)
    context.wrote(f"program with {count} of {len(calls)} calls", folder)
    return calls


def _call_document(call: ComputedCall) -> dict[str, object]:
    return {
        "file": call.file,
        "line": call.line,
        "before": call.before,
        "after": call.after or None,
        "why_not": call.why or None,
    }


def _axis_notes(arm: RegionArm, fitted: FittedTable, language: str) -> list[str]:
    """What joint moves have to look at: axes that pass the edge of a configuration word."""
    import numpy as np

    controller = arm.setup.robot.controller
    ends = np.sort(controller.to_controller(fitted.joint_range.T) / DEG, axis=0)
    edges = np.array([0.0]) if language == "krl" else np.array([-180.0, -90.0, 0.0, 90.0, 180.0])
    near = ends[0][:, None] - WORD_EDGE_DEG < edges
    near &= edges < ends[1][:, None] + WORD_EDGE_DEG
    worded = range(6) if language == "krl" else (0, 3, 5)
    axes = [f"A{k + 1}" for k in worded if near[k].any()]
    if not axes:
        return []
    words = "T" if language == "krl" else "confdata"
    return [
        f"{', '.join(axes)} may pass the edge of a configuration word: {words} of a target stays, "
        "so move there in straight lines, or without it."
    ]


def _backlash_note(model: ErrorModel) -> list[str]:
    tables = model.mean_tables()
    if tables is None or not tables.backlash.any():
        return []
    return ["the model knows a backlash; a function does not know where a joint comes from."]


def _condition_notes(request: WrapRequest) -> list[str]:
    """What the function holds for and does not check."""
    stated = {
        "the arm at {:g} degC": request.temperature_degC,
        "{:g} s on the clock of the calibration": request.time_s,
        "E1 at {:g} mm": request.e1_mm,
    }
    said = [text.format(value) for text, value in stated.items() if value is not None]
    return [f"Made for {', '.join(said)}; the function does not check that."] if said else []


def _blocks(
    document: Mapping[str, Any], calls: Sequence[ComputedCall], name: str
) -> tuple[Block, ...]:
    box = document["box_mm"]
    sides = " x ".join(f"{high - low:.0f}" for low, high in zip(box[::2], box[1::2], strict=True))
    grid = " x ".join(str(count) for count in document["cells"])
    facts = Facts(
        title=f"wrap {name}",
        rows=(
            ("region", f"{sides} mm"),
            (
                "numbers",
                f"{document['numbers']} ({grid} cells)"
                if any(document["cells"])
                else f"{document['numbers']} (polynomial of {document['terms']} terms)",
            ),
            ("correction, max", f"{document['correction_max_mm']:.3f} mm"),
            ("left by the table, max", f"{document['left_max_mm']:.4f} mm"),
            ("left by the table, 95 %", f"{document['left_95_mm']:.4f} mm"),
            ("left of the attitude, max", f"{document['left_turn_max_deg']:.5f} deg"),
        ),
    )
    if not calls:
        return (facts,)
    rows = tuple(
        (f"{call.file}:{call.line}", call.after or call.before, call.why) for call in calls
    )
    table = Table(title="calls", columns=("place", "statement", "look at"), rows=rows, words=True)
    return (facts, table)
