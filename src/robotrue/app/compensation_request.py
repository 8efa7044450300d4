"""Request for a compensation: program, model, force, and limits of the changes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.request import (
    IN_JOBS,
    NOT_IN_FORMS,
    ON_COMMAND_LINE,
    InputFile,
    Item,
    Option,
    Output,
    Reference,
    Request,
)
from robotrue.app.request_fields import ArmTemperature, RailPosition, RunTime
from robotrue.program.compensation_defaults import MAX_SHIFT_MM, MAX_STEP_MM, SPLIT_LIMIT

MAX_STEP: Final = Option(
    names=("--max-step",),
    metavar="MM",
    advanced=True,
    help=(
        "Refuse (exit 2) a larger step between an uncompensated target and its "
        "compensated neighbours on a line, arc or spline."
    ),
)
ALLOW_STEPS: Final = Option(help="Write the program in spite of larger steps.")


class CompensateRequest(Request):
    """Program to compensate, the model and frames to use, and the limits of the changes."""

    model: Annotated[
        Reference | None,
        Item(
            noun="model",
            argument="MODEL|CELL",
            needed_in=ON_COMMAND_LINE,
            help="Model file, or a cell registered with one; another cell.toml changes nothing.",
        ),
    ] = None
    program: Annotated[
        tuple[Reference, ...],
        Item(
            noun="program",
            argument="PROGRAM...",
            single=True,
            help="Program to compensate; several files or a folder: one job.",
        ),
    ]
    output: Annotated[
        Path,
        Output(
            names=("--output", "-o"),
            folder=True,
            saved_as="after",
            help="Program to write; for a job also a folder.",
        ),
    ]
    cell: Annotated[
        Reference | None,
        Item(
            noun="cell",
            advanced=True,
            help="Cell with the part frame or the other frames of the program.",
        ),
    ] = None
    registration: Annotated[
        Reference | None,
        Item(
            noun="registration",
            shells=IN_JOBS,
            help="Registration whose part frame the program runs in.",
        ),
    ] = None
    part: Annotated[str | None, Option(help="Part or side, if the cell has several.")] = None
    wrench: Annotated[
        str | None,
        Option(
            example="0,0,-200",
            help="Process force on the tool, base axes: FX,FY,FZ[,MX,MY,MZ] in N, N m.",
        ),
    ] = None
    force: Annotated[
        Path | None,
        InputFile(
            shells=NOT_IN_FORMS,
            help="Process force along the path: TOML of rules, or CSV by line or path.",
        ),
    ] = None
    temperature_degC: ArmTemperature = None
    time_s: RunTime = None
    e1_mm: RailPosition = None
    cutter: Annotated[
        str | None,
        Option(
            advanced=True,
            example="z",
            help="Axis of the tool from spindle to tip: x, y, z, -x, -y, -z; default z.",
        ),
    ] = None
    start: Annotated[
        str | None,
        Option(
            advanced=True,
            example="0,-90,90,0,0,0",
            help="A1,..,A6 in deg before the first target; default: start_deg of the cell.",
        ),
    ] = None
    free_spin: Annotated[
        bool,
        Option(
            help=(
                "Optimize the rotation about the axis of a rotating tool for stiffness "
                "and joint range."
            )
        ),
    ] = False
    axis_targets: Annotated[
        bool, Option(paired=True, help="Also compensate joint targets (PTP {A1 ..}).")
    ] = False
    max_shift_mm: Annotated[
        float,
        Option(advanced=True, help="Do not compensate a target that would move further than this."),
    ] = MAX_SHIFT_MM
    max_step_mm: Annotated[float, MAX_STEP] = MAX_STEP_MM
    allow_steps: Annotated[bool, ALLOW_STEPS] = False
    workers: Annotated[
        int | None,
        Option(
            shells=ON_COMMAND_LINE,
            help=("Processes for a long program; default: as many as save time; 1: only this one."),
        ),
    ] = None
    dask: Annotated[
        str | None,
        Option(
            shells=ON_COMMAND_LINE,
            help="Dask scheduler whose workers process a long program, tcp://...",
        ),
    ] = None
    split_um: Annotated[
        float | None,
        Option(
            names=("--split",),
            metavar="UM",
            help=("Insert targets into lines and arcs that deviate by more than UM micrometres."),
        ),
    ] = None
    split_limit: Annotated[
        int, Option(shells=NOT_IN_FORMS, help="With --split: maximum number of inserted targets.")
    ] = SPLIT_LIMIT
    deviation: Annotated[
        bool,
        Option(advanced=True, help="Report the deviation of lines and arcs between their targets."),
    ] = False
    verbose: Annotated[
        bool,
        Option(
            names=("--verbose", "-v"),
            shells=ON_COMMAND_LINE,
            help="Of several programs, also report each by itself.",
        ),
    ] = False
