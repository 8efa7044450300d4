"""Fields that requests about dynamics share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, TypeAlias

from robotrue.app.request import InputFile, Option

DIRECTION: Final = "0,-1,0"

BETWEEN: Final = "auto"
WAYS_BETWEEN: Final = (BETWEEN, "lines", "modes")

Between: TypeAlias = Annotated[
    str,
    Option(help="Between the lines: auto (what rebuilds them best), lines or modes."),
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
    InputFile(help="Response the windows were predicted with, axes of base."),
]
