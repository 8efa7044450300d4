"""Request for a function that corrects computed targets: region, tool, tolerance."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.request import InputFile, Item, Option, Output, Reference, Request
from robotrue.app.request_fields import (
    OUTPUT,
    ArmTemperature,
    CalibratedModel,
    RailPosition,
    RunTime,
)

TOLERANCE_MM: Final = 0.02
MOST_NUMBERS: Final = 10_000
TURN: Final = "5,5,5"
LANGUAGES: Final = {".src": "krl", ".mod": "rapid", ".modx": "rapid", ".prg": "rapid"}
"""What is written to a file of each suffix."""


class WrapRequest(Request):
    """Region and tool of the function, and its tolerance."""

    model: CalibratedModel
    output: Annotated[
        Path, Output(names=OUTPUT, what="a controller module", suffixes=tuple(LANGUAGES), only=True)
    ]
    """Module to write: .src is KRL, with its .dat; .mod RAPID. Its name is the function's."""
    program: Annotated[tuple[Path, ...], InputFile()] = ()
    """Program that computes targets: the report lists each call; its known targets give --box-mm
    and --attitude-deg where those are not stated. Repeatable."""
    box_mm: Annotated[str | None, Option(example="0,400,0,300,0,200")] = None
    """Tool points: X0,X1,Y0,Y1,Z0,Z1 mm in the work frame."""
    attitude_deg: Annotated[str | None, Option(example="0,90,180")] = None
    """Middle attitude of the tool in it: A,B,C deg, as KUKA."""
    turn_deg: str = TURN
    """Range of the attitude about it, either way: deg about z, y, x of the tool."""
    base: str | None = None
    """Work frame by its number or name in the cell; default: of the program."""
    tool: str | None = None
    """Tool by its number or name in the cell; default: as for --base."""
    cell: Annotated[Reference | None, Item(noun="cell", advanced=True)] = None
    """Cell with frames, tools and payload."""
    start: Annotated[str | None, Option(advanced=True)] = None
    """A1,..,A6 in deg that choose the configuration; default: start_deg of the cell."""
    wrench: Annotated[str | None, Option(advanced=True)] = None
    """Process force on the tool, base axes: FX,FY,FZ[,MX,MY,MZ] in N, N m."""
    temperature_degC: ArmTemperature = None
    time_s: RunTime = None
    e1_mm: RailPosition = None
    tolerance_mm: float = TOLERANCE_MM
    """Largest difference from the model's own correction."""
    max_numbers: Annotated[int, Option(advanced=True)] = MOST_NUMBERS
    """Maximum count of numbers (REAL, num) in the table."""
    wrap_computed: Annotated[Path | None, Output(folder=True, what="a folder")] = None
    """Also write the files of --program with the calls inserted, into this folder."""
