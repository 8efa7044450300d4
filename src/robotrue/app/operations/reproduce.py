"""Print a paper's tables beside those of simulated arms (20 arms: about 5 minutes)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from robotrue.app.context import Context
from robotrue.app.operation import Operation
from robotrue.app.plain_result import PlainResult
from robotrue.app.presentation import Facts, Table
from robotrue.app.request import Option, Request


class ReproduceRequest(Request):
    """Which paper, on how many arms."""

    paper: Annotated[
        str, Option(argument="PAPER", help="deng2022, feng2018, jin2022 or drill-patent.")
    ]
    robots: Annotated[int, Option(help="Simulated arms.")] = 20
    scenario: Annotated[
        str, Option(help="deng2022: S0, S1, S2 or S4 with A or B, how rough the arms are.")
    ] = "S2A"
    quick: Annotated[
        bool, Option(help="A part of the tables, fewer layouts, a shallower hole.")
    ] = False
    output: Annotated[
        Path | None,
        Option(names=("--output", "-o"), help="Folder for JSON and CSV of the figures."),
    ] = None


def run(request: ReproduceRequest, context: Context) -> PlainResult:
    """Runs the reproduction; returns its tables beside the paper's."""
    from robotrue_reproductions.papers import find_paper
    from robotrue_reproductions.reproduction import ReproductionRequest
    from robotrue_reproductions.table_text import text_tables, write_figures

    paper = find_paper(request.paper)
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
            Facts(title="What cannot be met, and why", rows=tuple(result.unmet)),
        ),
    )


OPERATION: Final = Operation(request=ReproduceRequest, run=run)
