"""Write the calibrated DH table as CSV, with base and tool."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.exported_arm import HELP, NAMES, ExportRequest, export_arm
from robotrue.app.operation import Operation
from robotrue.app.request import Output


class ExportDhRequest(ExportRequest):
    """Which model to write as a DH table."""

    form = "dh"
    output: Annotated[Path, Output(names=NAMES, what="a CSV table", suffixes=(".csv",), help=HELP)]


OPERATION: Final = Operation(request=ExportDhRequest, run=export_arm)
