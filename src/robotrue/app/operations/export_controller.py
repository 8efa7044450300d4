"""Write joint zeros, tool and base fitted to the model: .json, or text for any other name."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.exported_arm import HELP, NAMES, ExportRequest, export_arm
from robotrue.app.operation import Operation
from robotrue.app.request import Output


class ExportControllerRequest(ExportRequest):
    """Which model to write as numbers of the controller."""

    form = "controller"
    output: Annotated[
        Path,
        Output(
            names=NAMES, what="a sheet of the controller", suffixes=(".txt", ".json"), help=HELP
        ),
    ]


OPERATION: Final = Operation(request=ExportControllerRequest, run=export_arm)
