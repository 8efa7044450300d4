"""Curves against poses, slices of a map, page of a transfer: complete, offline, reproducible."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from validation_fakes import FakeModel, arm, measured

from robotrue.calibration.settings import FitSettings
from robotrue.core.regions import CubeRegion
from robotrue.core.units import MM
from robotrue.errors import ObservabilityError, ShapeError
from robotrue.report.content import Conclusion, ReportContent, Section
from robotrue.report.curve_plots import PoseCurves, PoseSeries
from robotrue.report.json import report_document
from robotrue.report.map_plots import MapSlices
from robotrue.report.map_report import map_content
from robotrue.report.page import report_html
from robotrue.report.transfer_report import transfer_content
from robotrue.validation.error_map import build_prior_model, error_map, sector_similarities
from robotrue.validation.guard import select_guarded, verdict_from_summary
from robotrue.validation.learning_curve import learning_curve


def bend(joints):
    return 0.3e-3 * np.stack([np.sin(joints[:, 0]), np.cos(joints[:, 1]), joints[:, 2] * 0], 1)


def knows(rows):
    return FakeModel(mean=bend)


def needs_rows(rows):
    if rows is None:
        raise ObservabilityError("no target row to fit.")
    return FakeModel()


def page_of(*blocks):
    return ReportContent(
        title="t",
        verdict=Conclusion(text="v"),
        simulated=True,
        sections=(Section(title="s", blocks=blocks),),
    )


def curves():
    count = np.array([5.0, 20.0, 206.0])
    ours = PoseSeries(
        label="robotrue",
        count=count,
        median=np.array([0.06, 0.055, 0.05]) * MM,
        low=np.array([0.05, 0.05, 0.045]) * MM,
        high=np.array([0.08, 0.06, 0.055]) * MM,
        role="ours",
    )
    peer = PoseSeries(label="peer", count=count[1:], median=np.array([np.nan, 0.07]) * MM)
    paper = PoseSeries(
        label="paper", count=np.array([206.0]), median=np.array([0.182]) * MM, role="published"
    )
    return PoseCurves(series=(ours, peer, paper), floor=0.04 * MM, title="Accuracy")


def slices():
    values = np.arange(2 * 3 * 4 * 5, dtype=np.float64).reshape(2, 3, 4, 5) * 1e-5 - 2e-4
    values[:, 1, 0, 0] = np.nan
    return MapSlices(
        quantities=("length", "along x"),
        slices=("a", "b", "c"),
        values=values,
        signed=(False, True),
        across=np.arange(5.0),
        up=np.arange(4.0),
        across_label="radius, mm",
        up_label="height, mm",
    )


@pytest.mark.parametrize("block", [curves(), slices()], ids=["curves", "slices"])
def test_page_is_offline_reproducible_and_follows_the_palette(block):
    page = report_html(page_of(block))
    assert page == report_html(page_of(block))
    assert "http" not in page
    assert "SIMULATED" in page
    svg = page[page.index("<svg") : page.index("</svg>")]
    assert "var(--muted)" in svg
    assert not re.search(r"#(1a2430|5a6877|d8dee5)", svg)


def test_json_holds_every_number_and_null_where_there_is_none():
    (curve, grid) = report_document(page_of(curves(), slices()))["sections"][0]["blocks"]
    assert curve["floor_mm"] == pytest.approx(0.04)
    assert [s["role"] for s in curve["series"]] == ["ours", "peer", "published"]
    assert curve["series"][1]["median_mm"] == [None, 0.07]
    assert curve["series"][2]["low_mm"] == []
    assert grid["values_mm"][0][1][0][0] is None
    assert grid["values_mm"][1][2][3][4] == pytest.approx(0.99)
    json.dumps([curve, grid], allow_nan=False)


def test_pictures_are_pictures():
    for picture in (curves().png(), slices().png()):
        assert picture.startswith(b"\x89PNG")


def test_nothing_to_draw_is_refused():
    nothing = PoseSeries(label="x", count=np.array([1.0]), median=np.array([np.nan]))
    with pytest.raises(ShapeError, match="no finite value"):
        PoseCurves(series=(nothing,))
    with pytest.raises(ShapeError, match="half a band"):
        PoseSeries(label="x", count=np.ones(1), median=np.ones(1), low=np.ones(1))


def test_page_of_a_transfer_says_who_is_used_and_what_it_takes():
    target = measured(40, error=bend)
    model = select_guarded({"transfer": knows}, {"target-only": needs_rows}, target)
    verdict, selection = verdict_from_summary(model.training_summary())
    curve = learning_curve({"transfer": knows, "target-only": needs_rows}, target, repeats=3)
    content = transfer_content(
        verdict, selection, curve, title="Transfer", subtitle="", simulated=True
    )
    assert content.verdict.text.startswith("transfer is used: 0.0")
    assert "mm from the target poses alone." in content.verdict.text
    page = report_html(content)
    assert "Source used for the target" in page
    assert "target-only, 0 target poses: no target row to fit." in page
    assert "floor" not in page
    unchecked = select_guarded({"transfer": knows}, {}, None)
    verdict, selection = verdict_from_summary(unchecked.training_summary())
    content = transfer_content(
        verdict, selection, None, title="Transfer", subtitle="", simulated=True
    )
    assert content.verdict.tone == "caution"
    assert "it was not checked against the target" in content.verdict.text


def test_page_of_a_map_counts_what_cannot_be_taken():
    cube = CubeRegion(x=(0.6, 1.9), y=(-0.4, 0.4), z=(0.4, 1.0))
    down = np.array([0.0, np.pi, 0.0])
    found = error_map(
        build_prior_model(arm(), FitSettings()),
        cube,
        (5, 2, 3),
        tool_abc=down,
        attitude="fixed",
        sectors=2,
    )
    lost = int((~found.reachable).sum())
    assert 0 < lost < 30
    content = map_content(
        found, sector_similarities(found), title="Map", subtitle="", simulated=False
    )
    assert f"{30 - lost} of 30 grid poses are in reach" in content.verdict.detail
    page = report_html(content)
    assert f"Crosses: {lost} poses out of reach." in page
    assert "y -400 to -400 mm" in page
