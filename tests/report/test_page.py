"""The page: all numbers, no foreign host, equal bytes, honest labels."""

from __future__ import annotations

import html
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from validation_fakes import FakeModel, measured

from robotrue.errors import ShapeError
from robotrue.report.calibration_report import calibration_content
from robotrue.report.content import (
    Conclusion,
    Fact,
    KeyFigure,
    ReportContent,
    ReportTable,
    Section,
    TableColumn,
)
from robotrue.report.curve_plots import TiltPlot
from robotrue.report.figure import Drawing, inline_svg
from robotrue.report.json import report_json
from robotrue.report.page import report_html
from robotrue.report.plots import ErrorDistribution, ErrorMap, HoleContour, PointErrors, thin_rows
from robotrue.validation.selection import select
from robotrue.validation.validate import validate


def wave(joints):
    return 1e-3 * np.stack([np.sin(3 * joints[:, 0]), np.cos(2 * joints[:, 1]), joints[:, 2]], 1)


def fit_nothing(measurements):
    return FakeModel()


def fit_wave(measurements):
    return FakeModel(mean=wave)


@pytest.fixture(scope="module")
def report():
    return validate(FakeModel(mean=wave), measured(60, error=wave))


@pytest.fixture(scope="module")
def content(report):
    selection = select({"rigid": fit_nothing, "wave": fit_wave}, measured(60, error=wave))
    body = calibration_content(
        report,
        title="Arm <7> & tool",
        simulated=True,
        selection=selection,
        unseen=("Compliance of joint 1.",),
        provenance=(Fact(name="data", value="grid.csv sha256:ab12"),),
    )
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    hole = HoleContour(
        radius=0.105,
        angle=angle,
        before=np.full((12, 2), 5e-4),
        after=np.full((12, 2), 1e-4),
        limit=3e-4,
    )
    return replace(body, sections=(*body.sections, Section(title="Hole", blocks=(hole,))))


@pytest.fixture(scope="module")
def page(content):
    return report_html(content)


def test_the_page_needs_no_other_host_and_no_script(page):
    assert not re.findall(r"https?:|//[a-z]|@import|<script|<link|<img|data:", page)


def test_equal_content_gives_equal_bytes(content, page):
    assert report_html(content) == page
    assert report_json(content) == report_json(content)


def test_every_number_of_tiles_and_tables_is_on_the_page(content, page):
    text = html.unescape(re.sub(r"<[^>]+>", " ", page))
    for tile in content.tiles:
        assert f"{tile.value:.{tile.digits}f}" in text
    for section in content.sections:
        for block in section.blocks:
            if not isinstance(block, ReportTable):
                continue
            for row in block.rows:
                for cell, column in zip(row, block.columns, strict=True):
                    shown = (
                        f"{round(cell, column.digits) + 0.0:.{column.digits}f}"
                        if isinstance(cell, float)
                        else cell
                    )
                    assert shown is None or str(shown) in text


def test_the_legend_prints_the_mean_to_a_micrometre(report, page):
    assert f"after: mean {report.after.mean * 1e3:.3f}, max" in page


def test_simulated_is_said_at_the_top_and_only_when_true(content, page):
    assert "SIMULATED DATA" in page[page.index("<body>") : page.index("<h1>")]
    assert "SIMULATED" not in report_html(replace(content, simulated=False))


def test_text_is_escaped(page):
    assert "<title>Arm &lt;7&gt; &amp; tool</title>" in page


def test_ids_are_unique(page):
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) > 50
    assert len(ids) == len(set(ids))


def test_plots_follow_the_page_colours(page):
    assert page.count("<svg") == 5
    assert "var(--before)" in page
    drawn = page[page.index("<body>") :]
    assert not re.findall(r"#(?:c2571a|0f6cab|1a2430)", drawn)


def test_doubts_unseen_and_provenance_are_printed(content, page):
    text = html.unescape(page)
    for sentence in (*content.unseen, *content.doubts):
        assert sentence in text
    assert "grid.csv sha256:ab12" in text


def test_json_holds_the_same_numbers(content, report):
    document = json.loads(report_json(content))
    assert document["simulated"] is True
    rows = document["sections"][0]["blocks"][0]["rows"]
    assert rows[-1]["mean_mm"] == pytest.approx(report.after.mean * 1e3)
    plots = [b for s in document["sections"] for b in s["blocks"] if b["kind"] == "point-errors"]
    assert np.mean(plots[0]["after_mm"]) == pytest.approx(report.after.mean * 1e3, abs=1e-6)


@pytest.mark.parametrize(
    ("block", "unit"),
    [
        (PointErrors(before=np.array([2e-3, 3e-3]), after=np.array([1e-4, 2e-4])), "mm"),
        (ErrorDistribution(before=np.array([2e-3, 3e-3]), after=np.array([1e-4, 2e-4])), "mm"),
        (
            ErrorMap(
                position=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
                before=np.full((2, 3), 3e-3),
                after=np.full((2, 3), 1e-4),
            ),
            "mm",
        ),
        (
            HoleContour(
                radius=0.1,
                angle=np.array([0.0, 1.0]),
                before=np.full((2, 2), 3e-3),
                after=np.full((2, 2), 1e-4),
            ),
            "mm",
        ),
        (
            TiltPlot(
                before=np.full((2, 2), 0.03),
                after=np.full((2, 2), 2e-3),
                force=np.array([100.0, 200.0]),
                tilt=np.array([0.01, 0.02]),
            ),
            "deg",
        ),
    ],
    ids=lambda value: type(value).__name__,
)
def test_json_keeps_before_and_after_apart(block, unit):
    """Fails when a block of a document names the state before compensation as that after it."""
    content = ReportContent(
        title="t", subtitle="", verdict=Conclusion(text="v", tone="good"), tiles=(),
        sections=(Section(title="s", blocks=(block,)),), simulated=True,
    )  # fmt: skip
    (found,) = json.loads(report_json(content))["sections"][0]["blocks"]
    factor = 1e3 if unit == "mm" else 180.0 / np.pi
    for name in ("before", "after"):
        stated = np.asarray(getattr(block, name)) * factor
        np.testing.assert_allclose(found[f"{name}_{unit}"], stated, atol=1e-6)


def test_the_json_of_a_validation_keeps_its_promise(report):
    document = report.to_json()
    for key in ("n", "mean_mm", "max_mm", "p95_mm", "std_mm"):
        assert key in document
        assert key in document["before"]
    assert document["n"] == 60
    assert document["mean_mm"] == pytest.approx(report.after.mean * 1e3)
    assert document["before"]["mean_mm"] == pytest.approx(report.before.mean * 1e3)
    assert document["coverage_95"] == report.coverage.share
    json.dumps(document, allow_nan=False)


@pytest.mark.parametrize(
    ("tolerance", "tone", "words"),
    [(1e-3, "good", ": conforms to"), (1e-5, "bad", "does NOT conform")],
)
def test_the_verdict_answers_the_tolerance(report, tolerance, tone, words):
    verdict = calibration_content(report, title="t", simulated=False, tolerance=tolerance).verdict
    assert verdict.tone == tone
    assert words in verdict.text


def test_a_model_that_does_not_help_gets_no_praise():
    useless = validate(FakeModel(), measured(60, error=wave))
    verdict = calibration_content(useless, title="t", simulated=False).verdict
    assert verdict.tone == "bad"
    assert "No better than a frame correction" in verdict.text


def test_what_is_unseen_is_not_repeated_as_a_doubt():
    doubts = ["not seen by the data: gear6: turn it.", "compliance2 is negative."]
    result = validate(FakeModel(mean=wave, summary={"doubts": doubts}), measured(60, error=wave))
    content = calibration_content(result, title="t", simulated=False, unseen=["gear6: turn it"])
    assert content.doubts == ("compliance2 is negative.",)
    assert content.verdict.tone == "caution"
    assert "1 warning below" in content.verdict.detail


def test_an_empty_page_is_still_a_page():
    page = report_html(
        ReportContent(
            title="t",
            verdict=Conclusion(text="v"),
            simulated=False,
            tiles=(KeyFigure(label="a", value=float("nan")),),
            sections=(
                Section(
                    title="s",
                    blocks=(
                        ReportTable(title="x", columns=(TableColumn(title="c"),), rows=((None,),)),
                    ),
                ),
            ),
        )
    )
    assert "<td>–</td>" in page


def test_one_held_out_pose_is_a_report():
    one = validate(FakeModel(mean=wave), measured(1, error=wave))
    document = json.loads(report_json(calibration_content(one, title="t", simulated=True)))
    tables = [b for s in document["sections"] for b in s["blocks"] if b["kind"] == "table"]
    assert any(len(t["rows"]) == 1 and len(str(t["rows"][0]).split("'A")) == 7 for t in tables)


def test_wrong_shapes_are_refused():
    with pytest.raises(ShapeError, match=r"after has shape .*, expected"):
        PointErrors(before=np.zeros(3), after=np.zeros(4))
    with pytest.raises(ShapeError, match="row 0 has 2 cells, expected 1"):
        ReportTable(title="x", columns=(TableColumn(title="c"),), rows=((1, 2),))
    with pytest.raises(ShapeError, match="plane"):
        ErrorMap(
            position=np.zeros((2, 3)), before=np.zeros((2, 3)), after=np.zeros((2, 3)), plane="zx"
        )
    with pytest.raises(ShapeError, match=r"before has shape \(4, 2\), expected \(3, 2\)"):
        HoleContour(radius=0.1, angle=np.zeros(3), before=np.zeros((4, 2)), after=np.zeros((4, 2)))


def test_thinning_keeps_the_worst_points():
    values = np.random.default_rng(0).uniform(size=5000)
    shown = thin_rows(values, 300)
    assert len(shown) <= 300
    assert set(np.argsort(-values)[:30]) <= set(shown)


def test_labels_of_axes_keep_their_digits():
    def draw(axes):
        axes[0].set_title("1.2345 mm")

    assert "1.2345 mm" in inline_svg(Drawing(draw=draw), key="k", label="l")
