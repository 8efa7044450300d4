"""Request for a function that corrects computed targets: region, tool, tolerance."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.request import InputFile, Item, Option, Output, Reference, Request
from robotrue.app.request_fields import ArmTemperature, CalibratedModel, RailPosition, RunTime

TOLERANCE_MM: Final = 0.02
MOST_NUMBERS: Final = 10_000
TURN: Final = "5,5,5"
LANGUAGES: Final = {".src": "krl", ".mod": "rapid", ".modx": "rapid", ".prg": "rapid"}
"""What is written to a file of each suffix."""


class WrapRequest(Request):
    """Region and tool of the function, and its tolerance."""

    model: CalibratedModel
    output: Annotated[
        Path,
        Output(
            names=("--output", "-o"),
            what="a controller module",
            suffixes=tuple(LANGUAGES),
            only=True,
            help="Module to write: .src is KRL, with its .dat; .mod RAPID. Its name is the "
            "function's.",
        ),
    ]
    program: Annotated[
        tuple[Path, ...],
        InputFile(
            names=("--program",),
            help="Program that computes targets: the report lists each call; its known targets "
            "give --box-mm and --attitude-deg where those are not stated. Repeatable.",
        ),
    ] = ()
    box_mm: Annotated[
        str | None,
        Option(
            example="0,400,0,300,0,200",
            help="Tool points: X0,X1,Y0,Y1,Z0,Z1 mm in the work frame.",
        ),
    ] = None
    attitude_deg: Annotated[
        str | None,
        Option(example="0,90,180", help="Middle attitude of the tool in it: A,B,C deg, as KUKA."),
    ] = None
    turn_deg: Annotated[
        str,
        Option(help="Range of the attitude about it, either way: deg about z, y, x of the tool."),
    ] = TURN
    base: Annotated[
        str | None,
        Option(help="Work frame by its number or name in the cell; default: of the program."),
    ] = None
    tool: Annotated[
        str | None, Option(help="Tool by its number or name in the cell; default: as for --base.")
    ] = None
    cell: Annotated[
        Reference | None,
        Item(noun="cell", advanced=True, help="Cell with frames, tools and payload."),
    ] = None
    start: Annotated[
        str | None,
        Option(
            advanced=True,
            help="A1,..,A6 in deg that choose the configuration; default: start_deg of the cell.",
        ),
    ] = None
    wrench: Annotated[
        str | None,
        Option(
            advanced=True,
            help="Process force on the tool, base axes: FX,FY,FZ[,MX,MY,MZ] in N, N m.",
        ),
    ] = None
    temperature_degC: ArmTemperature = None
    time_s: RunTime = None
    e1_mm: RailPosition = None
    tolerance_mm: Annotated[
        float, Option(help="Largest difference from the model's own correction.")
    ] = TOLERANCE_MM
    max_numbers: Annotated[
        int, Option(advanced=True, help="Maximum count of numbers (REAL, num) in the table.")
    ] = MOST_NUMBERS
    wrap_computed: Annotated[
        Path | None,
        Output(
            folder=True,
            what="a folder",
            help="Also write the files of --program with the calls inserted, into this folder.",
        ),
    ] = None
