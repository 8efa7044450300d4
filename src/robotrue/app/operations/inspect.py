"""Show the content of a file: a model, a cell, measurements or a program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import PlainResult
from robotrue.app.request import ON_COMMAND_LINE, InputFile, Request
from robotrue.app.request_fields import Columns


class InspectRequest(Request):
    """File to inspect; its kind is recognised by content, not by name."""

    path: Annotated[Path, InputFile(argument="FILE")]
    """Model, cell, measurements or program."""
    mapping: Columns = None
    doctor: Annotated[Path | None, InputFile(shells=ON_COMMAND_LINE)] = None
    """Cell of the measurements: report faults in them."""


@operation()
def run(request: InspectRequest, context: Context) -> PlainResult:
    """Returns what the file holds.

    Raises:
        FormatError: Nothing that is known here.
    """
    from robotrue.app.file_contents import describe_file

    if request.doctor is not None:
        from robotrue.app.data_doctor import inspect_measurements

        return inspect_measurements(request.path, request.doctor, request.mapping, context)
    return describe_file(request.path, request.mapping)
