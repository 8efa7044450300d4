"""Fields that several requests have, word for word."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, TypeAlias

from robotrue.app.request import NOT_IN_FORMS, InputFile, Item, Option, Output, Reference

PAGE_FILE: Final = "report.html"
MODEL_FILE: Final = "model.rtm"
OUTPUT: Final = ("--output", "-o")


def table_output(*, saved_as: str = "") -> Output:
    """Returns ``--output`` of a CSV table."""
    return Output(names=OUTPUT, what="a CSV table", suffixes=(".csv",), saved_as=saved_as)


def model_output(help: str = "", *, saved_as: str = "", renews: str = "") -> Output:
    """Returns ``--output`` of a robotrue file."""
    return Output(
        names=OUTPUT,
        what="a robotrue file",
        suffixes=(".robotrue",),
        saved_as=saved_as,
        renews=renews,
        help=help,
    )


def cell_output(*, renews: str = "") -> Output:
    """Returns ``--output`` of a cell file."""
    return Output(names=OUTPUT, what="a cell", suffixes=(".toml",), renews=renews)


CellFile: TypeAlias = Annotated[Reference, Item(noun="cell", argument="CELL", help="cell.toml")]
CalibratedModel: TypeAlias = Annotated[
    Reference, Item(noun="model", argument="MODEL", help="Model file of `calibrate`.")
]
ModelOutput: TypeAlias = Annotated[
    Path, model_output(saved_as=MODEL_FILE, help="Model file to write.")
]
SavedPage: TypeAlias = Annotated[
    Path | None,
    Output(
        what="a page",
        suffixes=(".html", ".htm"),
        saved_as=PAGE_FILE,
        help="Also write a report page (HTML).",
    ),
]
"""A page that jobs always write."""
Columns: TypeAlias = Annotated[
    Path | None, InputFile(shells=NOT_IN_FORMS, help="Column mapping (TOML).")
]
ForeignColumns: TypeAlias = Annotated[
    Path | None,
    InputFile(shells=NOT_IN_FORMS, help="Column mapping (TOML) for files of another layout."),
]
CertificateDetails: TypeAlias = Annotated[
    tuple[str, ...],
    Option(
        metavar="KEY=VALUE",
        example="customer=Shop 4",
        help=("Field of the certificate's head: number, customer, robot_serial, ...; repeatable."),
    ),
]
Page: TypeAlias = Annotated[
    Path | None,
    Output(what="a page", suffixes=(".html", ".htm"), help="Also write a report page (HTML)."),
]
"""A page that jobs do not write."""
CellOrModel: TypeAlias = Annotated[
    Reference,
    Item(
        noun="cell",
        also=("model", "registration"),
        argument="CELL|MODEL",
        help="cell.toml (nominal arm) or model file.",
    ),
]
FrameFormats: TypeAlias = Annotated[
    tuple[str, ...],
    Option(help="Also print the frame: krl, rapid, fanuc, yaskawa, ur, g54, val3; repeatable."),
]
FrameNumber: TypeAlias = Annotated[int, Option(help="Entry of the controller's frame table.")]
ToolFormats: TypeAlias = Annotated[
    tuple[str, ...],
    Option(help="Also print the tool: krl, rapid, fanuc, yaskawa, ur, val3; repeatable."),
]
ToolNumber: TypeAlias = Annotated[int, Option(help="Entry of the controller's tool table.")]
TouchSigma: TypeAlias = Annotated[float, Option(help="Standard deviation of one touch per axis.")]
ToolSigma: TypeAlias = Annotated[
    float | None,
    Option(
        help=("Standard deviation of the tip in the flange; 0: unchanged since the model was made.")
    ),
]
PartTolerance: TypeAlias = Annotated[
    float | None, Option(help="Tolerance of machined points, for the verdict.")
]
AT_TARGET: Final = "target"
"""The measured point, not the tool of programs."""
HERE: Final = Path()
WorkspaceFolder: TypeAlias = Annotated[
    Path,
    Option(
        names=("--workspace", "-w"),
        variable="ROBOTRUE_WORKSPACE",
        help="Folder of the workspace; ROBOTRUE_DB sets another database.",
    ),
]


DrillModel: TypeAlias = Annotated[
    Reference, Item(noun="document", argument="MODEL", help="Model file of `drill fit`.")
]
FootModelOutput: TypeAlias = Annotated[
    Path, model_output(saved_as="drill.robotrue", help="Model file to write.")
]
ZeroFoot: TypeAlias = Annotated[
    Path | None,
    InputFile(
        shells=NOT_IN_FORMS, help="Foot file, if the zero is not subtracted from the readings."
    ),
]
ReferenceSigma: TypeAlias = Annotated[
    float, Option(help="Standard deviation of that reference in deg.")
]
CarryingRobot: TypeAlias = Annotated[
    Path | None, InputFile(help="Calibrated model of the robot that carries the foot.")
]
FootAngles: TypeAlias = Annotated[
    str, Option(help="With --robot: A,B,C of the foot in the tool; default z against z.")
]


DIRECTION: Final = "0,-1,0"

BETWEEN: Final = "auto"
WAYS_BETWEEN: Final = (BETWEEN, "lines", "modes")

Between: TypeAlias = Annotated[
    str,
    Option(help=("Interpolation between the lines: auto (the smaller error), lines or modes.")),
]
StaticTest: TypeAlias = Annotated[
    str | None,
    Option(
        names=("--static-um-per-n",),
        help="Static load test: xx=1.1,yy=0.9,yx=0.1 (response first).",
    ),
]
WindowsFile: TypeAlias = Annotated[
    Path, InputFile(argument="WINDOWS", help="Measured windows (CSV).")
]
Direction: TypeAlias = Annotated[
    str,
    Option(help="Base direction in which the error counts positive; write --direction=X,Y,Z."),
]
PredictedWith: TypeAlias = Annotated[
    Path | None,
    InputFile(help="Frequency response of the predictions in the windows, axes of base."),
]
ArmTemperature: TypeAlias = Annotated[
    float | None,
    Option(
        names=("--temperature",),
        metavar="DEGC",
        advanced=True,
        help="Temperature of the arm when the program runs; default: the calibration mean.",
    ),
]
RunTime: TypeAlias = Annotated[
    float | None,
    Option(
        names=("--time",),
        metavar="S",
        advanced=True,
        help="Time of the run on the clock of the calibration's time_s, if no temperature was "
        "measured.",
    ),
]
RailPosition: TypeAlias = Annotated[
    float | None,
    Option(
        names=("--e1-mm",),
        metavar="MM",
        advanced=True,
        help="Position of the arm on its rail, for a program that does not state it.",
    ),
]
