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
from robotrue.app.request_fields import OUTPUT, ArmTemperature, RailPosition, RunTime
from robotrue.program.compensation_defaults import MAX_SHIFT_MM, MAX_STEP_MM, SPLIT_LIMIT

MAX_STEP: Final = Option(
    names=("--max-step",),
    metavar="MM",
    advanced=True,
    help="Refuse (exit 2) a larger step between an uncompensated target and its "
    "compensated neighbours on a line, arc or spline.",
)
ALLOW_STEPS: Final = Option(help="Write the program in spite of larger steps.")


class CompensateRequest(Request):
    """Program to compensate, the model and frames to use, and the limits of the changes."""

    model: Annotated[
        Reference | None, Item(noun="model", argument="MODEL|CELL", needed_in=ON_COMMAND_LINE)
    ] = None
    """Model file, or a cell registered with one; another cell.toml changes nothing."""
    program: Annotated[
        tuple[Reference, ...], Item(noun="program", argument="PROGRAM...", single=True)
    ]
    """Program to compensate; several files or a folder: one job."""
    output: Annotated[Path, Output(names=OUTPUT, folder=True, saved_as="after")]
    """Program to write; for a job also a folder."""
    cell: Annotated[Reference | None, Item(noun="cell", advanced=True)] = None
    """Cell with the part frame or the other frames of the program."""
    registration: Annotated[Reference | None, Item(noun="registration", shells=IN_JOBS)] = None
    """Registration whose part frame the program runs in."""
    part: str | None = None
    """Part or side, if the cell has several."""
    wrench: Annotated[str | None, Option(example="0,0,-200")] = None
    """Process force on the tool, base axes: FX,FY,FZ[,MX,MY,MZ] in N, N m."""
    force: Annotated[Path | None, InputFile(shells=NOT_IN_FORMS)] = None
    """Process force along the path: TOML of rules, or CSV by line or path."""
    temperature_degC: ArmTemperature = None
    time_s: RunTime = None
    e1_mm: RailPosition = None
    cutter: Annotated[str | None, Option(advanced=True, example="z")] = None
    """Axis of the tool from spindle to tip: x, y, z, -x, -y, -z; default z."""
    start: Annotated[str | None, Option(advanced=True, example="0,-90,90,0,0,0")] = None
    """A1,..,A6 in deg before the first target; default: start_deg of the cell."""
    free_spin: bool = False
    """Optimize the rotation about the axis of a rotating tool for stiffness and joint range."""
    axis_targets: Annotated[bool, Option(paired=True)] = False
    """Also compensate joint targets (PTP {A1 ..})."""
    max_shift_mm: Annotated[float, Option(advanced=True)] = MAX_SHIFT_MM
    """Do not compensate a target that would move further than this."""
    max_step_mm: Annotated[float, MAX_STEP] = MAX_STEP_MM
    allow_steps: Annotated[bool, ALLOW_STEPS] = False
    workers: Annotated[int | None, Option(shells=ON_COMMAND_LINE)] = None
    """Processes for a long program; default: as many as save time; 1: only this one."""
    dask: Annotated[str | None, Option(shells=ON_COMMAND_LINE)] = None
    """Dask scheduler whose workers process a long program, tcp://..."""
    split_um: Annotated[float | None, Option(names=("--split",), metavar="UM")] = None
    """Insert targets into lines and arcs that deviate by more than UM micrometres."""
    split_limit: Annotated[int, Option(shells=NOT_IN_FORMS)] = SPLIT_LIMIT
    """With --split: maximum number of inserted targets."""
    deviation: Annotated[bool, Option(advanced=True)] = False
    """Report the deviation of lines and arcs between their targets."""
    verbose: Annotated[bool, Option(names=("--verbose", "-v"), shells=ON_COMMAND_LINE)] = False
    """Of several programs, also report each by itself."""
