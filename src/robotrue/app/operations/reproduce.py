"""Print a paper's tables next to those of simulated arms (20 arms: about 5 minutes)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Facts, PlainResult, Table
from robotrue.app.request import Option, Request
from robotrue.app.request_fields import OUTPUT
from robotrue.core.provenance import Provenance
from robotrue.errors import ConfigurationError


class ReproduceRequest(Request):
    """Paper to reproduce, and the number of arms."""

    paper: Annotated[str, Option(argument="PAPER")]
    """deng2022, feng2018, jin2022 or drill-patent."""
    robots: int = 20
    """Number of simulated arms."""
    scenario: str = "S2A"
    """deng2022: S0, S1, S2 or S4 (scatter of the arms) with A or B."""
    quick: bool = False
    """A part of the tables, fewer layouts, a shallower hole."""
    output: Annotated[Path | None, Option(names=OUTPUT)] = None
    """Folder for JSON and CSV of the figures."""
    data: Path | None = None
    """deng2022: write one arm's cell and measurements to this folder instead."""
    seed: Annotated[int, Option(least=0)] = 1
    """Seed of the arm of --data."""


@operation()
def run(request: ReproduceRequest, context: Context) -> PlainResult:
    """Runs the reproduction; returns its tables next to the paper's."""
    from robotrue_reproductions.papers import find_paper
    from robotrue_reproductions.reproduction import ReproductionRequest
    from robotrue_reproductions.table_text import text_tables, write_figures

    paper = find_paper(request.paper)
    if request.data is not None:
        return _write_data(request, context.output(request.data), context)
    asked = ReproductionRequest(
        robots=request.robots, quick=request.quick, scenario=request.scenario
    )
    result = paper.run(asked, context.step)
    if request.output is not None:
        folder = context.output(request.output)
        write_figures(result, folder, request.paper)
        context.inform(f"figures: {folder}")
    return PlainResult(
        values=result.document(),
        shown=(
            Facts(
                title=f"SIMULATED: {result.robots} {paper.arms} {result.scenario}, "
                f"beside {paper.authors}",
                rows=tuple(("", remark) for remark in result.remarks),
            ),
            *(
                Table(
                    title=table.title,
                    columns=tuple(table.columns),
                    rows=tuple(tuple(row) for row in table.rows),
                )
                for table in text_tables(paper, result)
            ),
            Facts(title="Not reproduced, and why", rows=tuple(result.unmet)),
        ),
    )


def _write_data(request: ReproduceRequest, folder: Path, context: Context) -> PlainResult:
    """Writes the design of one arm as files."""
    from robotrue_reproductions.deng2022.design_files import write_design

    if request.paper != "deng2022":
        raise ConfigurationError(
            f"--data writes the design of deng2022; the paper is {request.paper}.",
            hint="leave --data out.",
        )
    files = write_design(folder, request.scenario, request.seed)
    for path in files:
        context.wrote("file", path)
    values = {"files": [str(path) for path in files]}
    return PlainResult(values=values, provenance=Provenance(simulated=True))
