"""Write a URDF of the calibrated arm, and what URDF cannot say as JSON beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.exported_arm import HELP, NAMES, ExportRequest, export_arm
from robotrue.app.operation import Operation
from robotrue.app.request import Output


class ExportUrdfRequest(ExportRequest):
    """Which model to write as a URDF."""

    form = "urdf"
    output: Annotated[
        Path, Output(names=NAMES, what="a robot description", suffixes=(".urdf", ".xml"), help=HELP)
    ]


OPERATION: Final = Operation(request=ExportUrdfRequest, run=export_arm)
