"""Take the zero of a foot on its calibration tool: a foot file with it, and its uncertainty."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Note, Table
from robotrue.app.request import InputFile, Output, Request
from robotrue.core.units import DEG, MM, UM


class DrillZeroRequest(Request):
    """Which foot, and what its sensors showed on the tool."""

    foot: Annotated[Path, InputFile(argument="FOOT", help="Foot file (TOML).")]
    readings: Annotated[
        Path,
        InputFile(
            argument="READINGS",
            help="raw1_mm, ... or raw1_counts, ... on the tool (CSV or workbook); seat names each "
            "time it was put on.",
        ),
    ]
    output: Annotated[
        Path,
        Output(
            names=("--output", "-o"),
            what="a foot file",
            suffixes=(".toml",),
            renews="foot",
            help="Foot file to write: FOOT with this zero.",
        ),
    ]


def run(request: DrillZeroRequest, context: Context) -> PlainResult:
    """Writes a foot file with the mean readings on the calibration tool as its zero."""
    from robotrue.core.files import write_atomic
    from robotrue.drilling.foot_file import read_foot
    from robotrue.drilling.foot_zero import (
        check_exchange,
        read_zero,
        with_zero,
        zero_residual,
    )

    setup = read_foot(request.foot)
    found = read_zero(request.readings, setup)
    check_exchange(found, setup)
    output = context.output(request.output)
    text = with_zero(request.foot.read_text(encoding="utf-8"), found, setup)
    write_atomic(output, text.encode())
    if setup.zero is not None:
        moved = (found.zero - setup.zero) / UM
        context.note(f"the zero moved by {', '.join(f'{v:+.1f}' for v in moved)} um")
    a, b = (found.tilt_sigma / DEG).tolist()
    rows = zip(found.zero / MM, found.sigma / UM, found.scatter / UM, strict=True)
    return PlainResult(
        values={
            "output": str(output),
            "zero_mm": (found.zero / MM).tolist(),
            "zero_sigma_um": (found.sigma / UM).tolist(),
            "scatter_um": (found.scatter / UM).tolist(),
            "tilt_sigma_deg": [a, b],
            "off_plane_um": zero_residual(found, setup) / UM,
            "rows": found.rows,
            "seats": found.seats,
        },
        shown=(
            Table(
                title=f"Zero of {found.rows} readings, {found.seats or 'unnamed'} seats",
                columns=("sensor", "zero mm", "sigma um", "scatter um"),
                rows=tuple(
                    (str(k), f"{zero:.4f}", f"{sigma:.2f}", f"{scatter:.2f}")
                    for k, (zero, sigma, scatter) in enumerate(rows, start=1)
                ),
            ),
            Note(f"the zero leaves {a:.4f} deg in a and {b:.4f} deg in b uncertain (one sigma)"),
            Note(f"written to {output}"),
        ),
        provenance=found.provenance,
    )


OPERATION: Final = Operation(request=DrillZeroRequest, run=run)
