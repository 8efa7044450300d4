"""The report page of a program: what each side asks of the arm, and words not understood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from robotrue.app.toolpath_sides import SideDocument, SidesDocument
from robotrue.cell.cell import Cell
from robotrue.core.units import MM
from robotrue.report.content import (
    Conclusion,
    Fact,
    KeyFigure,
    ReportContent,
    ReportTable,
    Section,
    TableColumn,
)
from robotrue.report.map_plots import SideContour
from robotrue.report.page import report_html


class ProgramDocument(SidesDocument):
    """The JSON document of ``robotrue program``.

    Further keys: the program, the file of its identity, what its compensation came to, notes.
    """

    output: str
    identity: object
    compensation: Mapping[str, object] | None
    notes: list[str]


def program_page(cell: Cell, document: ProgramDocument, *, simulated: bool) -> str:
    """Returns the page (HTML) of the JSON document of ``robotrue program``."""
    sides = document["sides"]
    made = document["compensation"]
    name = Path(document["output"]).name
    sections = [Section(title="Sides", blocks=(_sides(sides),))]
    contours = tuple(
        SideContour(
            title=f"{side['name']}, {side['pass']}",
            caption="The outer boundary of the part's shadow along the tool axis; points that cut "
            "lie inside.",
            outlines=tuple(np.array(each) * MM for each in side["contour"]["outlines_mm"]),
            cuts=np.array(side["contour"]["cuts_mm"]) * MM,
        )
        for side in sides
        if side["contour"] is not None
    )
    if contours:
        sections.append(Section(title="Largest contour of each side", blocks=contours))
    words = [
        (side["source"], w["line"], w["text"]) for side in sides for w in side["unknown_words"]
    ]
    if words:
        table = ReportTable(
            title="Statements whose meaning is not known",
            columns=(
                TableColumn(title="file"),
                TableColumn(title="line"),
                TableColumn(title="statement"),
            ),
            rows=tuple(words),
            caption="They are comments in the program and move nothing.",
        )
        sections.append(Section(title="Words", blocks=(table,)))
    total = sum(side["duration_s"] for side in sides)
    return report_html(
        ReportContent(
            title=f"Program {name}",
            verdict=Conclusion(
                text=f"{document['targets']} targets on {len(sides)} "
                f"side{'' if len(sides) == 1 else 's'}, all within reach.",
                detail="compensated: "
                + (f"{made['compensated']} targets" if made else "not yet; robotrue compensate"),
            ),
            simulated=simulated,
            subtitle=cell.robot.name,
            tiles=(
                KeyFigure(label="cut", value=sum(s["cut_mm"] for s in sides) / 1e3, unit="m"),
                KeyFigure(label="time at the stated feeds", value=total / 60.0, unit="min"),
                KeyFigure(
                    label="nearest to a joint limit",
                    value=min(s["limit_margin_deg"] for s in sides),
                    unit="deg",
                ),
            ),
            sections=tuple(sections),
            doubts=tuple(document["notes"]),
            provenance=(Fact(name="cell", value=f"{cell.source} sha256:{cell.digest}"),),
        )
    )


def _sides(sides: Sequence[SideDocument]) -> ReportTable:
    return ReportTable(
        title="Sides in the order they are cut",
        columns=(
            TableColumn(title="side"),
            TableColumn(title="pass"),
            TableColumn(title="stock", unit="mm", digits=2),
            TableColumn(title="part frame"),
            TableColumn(title="points", digits=0),
            TableColumn(title="cut", unit="mm", digits=0),
            TableColumn(title="time", unit="s", digits=0),
            TableColumn(title="spin from", unit="deg", digits=1),
            TableColumn(title="spin to", unit="deg", digits=1),
            TableColumn(title="to a joint limit", unit="deg", digits=1),
            TableColumn(title="wrist", unit="deg", digits=1),
        ),
        rows=tuple(
            (
                side["name"],
                side["pass"],
                side["stock_mm"],
                side["part"] or "[base]",
                side["points"],
                side["cut_mm"],
                side["duration_s"],
                side["spin_deg"][0],
                side["spin_deg"][1],
                side["limit_margin_deg"],
                side["wrist_angle_deg"],
            )
            for side in sides
        ),
        caption="Spin: rotation about the tool axis, from a frame carried along the path. Wrist: "
        "smallest angle between axes 4 and 6.",
    )
