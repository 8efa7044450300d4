"""The map of a part: a panel for each group, marked where no touch covers it."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.units import MM
from robotrue.errors import ShapeError
from robotrue.report.content import Conclusion, ReportContent, Section
from robotrue.report.json import report_document
from robotrue.report.map_plots import PartMap
from robotrue.report.page import report_html


def part_map(**changes: object) -> PartMap:
    front = np.array([[x, 0.0, z] for x in (0.0, 0.1, 0.4) for z in (0.0, 0.3)])
    content: dict[str, object] = {
        "groups": ("front", "back & <below>"),
        "group": np.repeat([0.0, 1.0], 6),
        "point": np.vstack([front, np.add(front, [0.0, 0.2, 0.0])]),
        "radius": np.append(np.full(6, 0.2 * MM), np.linspace(1.0, 1.6, 6) * MM),
        "touch": front[:3],
        "touch_group": np.array([0.0, 0.0, -1.0]),
        "uncovered": ("back & <below>",),
    }
    return PartMap(**{**content, **changes})


def content() -> ReportContent:
    section = Section(title="s", blocks=(part_map(),))
    return ReportContent(
        title="t", verdict=Conclusion(text="v"), simulated=False, sections=(section,)
    )


def test_a_page_shows_each_group_and_whom_no_touch_covers() -> None:
    page = report_html(content())
    assert "front: up to 0.20 mm<" in page
    assert "up to 1.60 mm, no touch covers it" in page
    assert "back &amp; &lt;below&gt;" in page
    assert "http" not in page
    assert page == report_html(content())


def test_a_picture() -> None:
    picture = part_map().png()
    assert picture.startswith(b"\x89PNG")
    assert picture == part_map().png()
    alike = part_map(radius=np.full(12, 0.2 * MM), uncovered=())
    assert alike.png() != picture


def test_json_has_the_numbers_in_millimetres() -> None:
    (block,) = report_document(content())["sections"][0]["blocks"]
    assert block["kind"] == "part_map"
    assert block["radius_95_mm"][0] == pytest.approx(0.2)
    assert block["point_mm"][4] == pytest.approx([400.0, 0.0, 0.0])
    assert block["uncovered"] == ["back & <below>"]


def test_what_cannot_be_drawn() -> None:
    with pytest.raises(ShapeError, match="radii above 0"):
        part_map(radius=np.zeros(12))
    with pytest.raises(ShapeError, match="group has shape"):
        part_map(group=np.zeros(3))
