"""Certificate, program and registration: what they claim, and only that; HTML, PDF, JSON."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from certificate_fakes import BUDGET, LINES, MODEL, make_facts, wave
from validation_fakes import measured

from robotrue.cell.part import PartFrame, PartTable
from robotrue.compensation.difference import Difference
from robotrue.core.model_identity import ModelIdentity
from robotrue.errors import ConfigurationError, ModelMismatchError, ObservabilityError
from robotrue.report.certificate import certificate_content, check_regions
from robotrue.report.content import Conclusion, Fact, ReportContent, ReportTable
from robotrue.report.json import content_sha256, is_intact, report_json
from robotrue.report.page import report_html
from robotrue.report.pdf import FONT_PACKAGE, font_families, report_pdf
from robotrue.report.program_report import program_content
from robotrue.report.registration_report import registration_content
from robotrue.validation.evaluation import evaluate
from robotrue.validation.iso9283 import repeated_poses


@pytest.fixture(scope="module")
def facts():
    return make_facts()


def table(content: ReportContent, title: str) -> ReportTable:
    return next(
        b
        for s in content.sections
        for b in s.blocks
        if isinstance(b, ReportTable) and b.title == title
    )


def test_the_budget_adds_squares_and_leaves_the_instrument_to_the_check():
    assert BUDGET.combined == pytest.approx(5e-5)
    assert BUDGET.expanded == pytest.approx(1e-4)
    assert BUDGET.combined_check == pytest.approx(1.3e-4)


def test_the_certificate_prints_every_line_of_the_budget(facts):
    content = certificate_content(facts)
    rows = table(content, "Contributions").rows
    assert len(rows) == len(LINES) + 3
    assert [row[6] for row in rows] == pytest.approx([30.0, 40.0, 0.0, 120.0, 50.0, 100.0, 130.0])
    assert rows[3][7] == "check only"
    assert "U = 0.100 mm with k = 2" in content.sections[0].text


def test_what_is_not_in_the_budget_is_said(facts):
    said = " ".join(certificate_content(facts).unseen)
    assert "the budget contains no registration" in said
    assert "100 N along one axis would move the tool by 0.100 mm" in said
    lines = (*LINES, replace(LINES[0], name="registration"))
    with_part = replace(facts, budget=replace(BUDGET, contributions=lines))
    assert "no registration" not in " ".join(certificate_content(with_part).unseen)


def test_without_a_check_the_certificate_says_so_first(facts):
    content = certificate_content(replace(facts, check=None, regions=(), held_out=1e-4))
    assert content.verdict.tone == "caution"
    assert content.verdict.text.startswith("Not checked on separate poses")
    assert content.tiles[0].value == pytest.approx(0.1)


def test_no_symbol_of_the_standard_without_its_cycles(facts):
    page = report_json(certificate_content(facts))
    assert "AP_P" not in page
    assert "are defined by repeated measurements of a pose and are not stated" in page
    for cycles, symbol in ((5, False), (30, True)):
        check = measured(cycles, error=wave)
        joints = np.broadcast_to(check.joints[0], check.joints.shape)
        at = evaluate(MODEL, replace(check, joints=joints)).nominal[:, :3, 3]
        again = replace(check, joints=joints, position=at + 1e-5 * (check.position % 1.0))
        poses = repeated_poses(MODEL.robot, again, np.zeros((cycles, 3)))
        assert len(poses) == 1
        assert poses[0].characteristics.n == cycles
        page = report_json(certificate_content(replace(facts, repeats=poses)))
        assert ("AP_P" in page) is symbol
        assert ("no AP or RP is stated" in page) is not symbol


def test_both_languages_hold_the_same_numbers_under_the_same_names(facts):
    documents = [
        json.loads(report_json(certificate_content(facts, lang=lang))) for lang in ("en", "zh")
    ]
    english, chinese = documents
    assert [t["label"] for t in english["tiles"]] == [t["label"] for t in chinese["tiles"]]
    assert [t["value"] for t in english["tiles"]] == [t["value"] for t in chinese["tiles"]]
    for one, other in zip(english["sections"], chinese["sections"], strict=True):
        for a, b in zip(one["blocks"], other["blocks"], strict=True):
            if a["kind"] == "table":
                assert [list(row) for row in a["rows"]] == [list(row) for row in b["rows"]]
    assert chinese["provenance"]["model file"].startswith("m.rtm")
    assert chinese["title"] != english["title"]


def test_the_chinese_page_has_chinese_figures_and_no_english_sentence(facts):
    page = report_html(certificate_content(facts, lang="zh"))
    assert '<html lang="zh-CN">' in page
    figures = "".join(re.findall(r"<svg.*?</svg>", page, re.DOTALL))
    for word in ("修正前", "误差", "声明概率", "合成"):
        assert word in figures
    assert "ZQ0" not in page
    body = re.sub(r"<style.*?</style>|<[^>]+>", " ", page, flags=re.DOTALL)
    assert not re.search(r"[a-z]{3,} [a-z]{3,} [a-z]{3,} [a-z]{3,}", body)


def test_the_json_twin_tells_whether_it_was_changed(facts):
    content = certificate_content(replace(facts, check=None, regions=()))
    document = json.loads(report_json(content))
    assert is_intact(document)
    assert document["content_sha256"] == content_sha256(content)
    assert content_sha256(content) in report_html(content)
    document["tiles"][0]["value"] += 1e-6
    assert not is_intact(document)
    other = replace(content, provenance=(Fact(name="model file", value="n.rtm"),))
    assert content_sha256(other) != content_sha256(content)


def test_quarters_of_a_check_are_named_by_their_sides():
    """Fails when rows stand under the name of another quarter: y 0.0 to 0.9 m, z 0.0 to 2.9 m."""
    k = np.arange(60)
    position = np.stack([0.0 * k, (k % 10) / 10.0, (k // 2) / 10.0], axis=1)
    found = dict(check_regions(position, np.zeros(60, dtype=np.int64), ("one",)))
    assert list(found) == ["y low, z low", "y low, z high", "y high, z low", "y high, z high"]
    assert sorted(np.concatenate(list(found.values()))) == list(range(60))
    for name, rows in found.items():
        y, z = (part.split()[1] == "high" for part in name.split(", "))
        assert ((position[rows, 1] > 0.45) == y).all()
        assert ((position[rows, 2] > 1.45) == z).all()


def test_several_facts_of_one_name_are_all_in_the_json():
    content = ReportContent(
        title="t", verdict=Conclusion(text="v"), simulated=False,
        provenance=(Fact(name="note", value="a"), Fact(name="note", value="b")),
    )  # fmt: skip
    assert json.loads(report_json(content))["provenance"] == {"note": ["a", "b"]}


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_the_pdf_is_a_pdf_and_equal_each_time(facts, lang):
    typst = pytest.importorskip("typst", reason="pip install 'robotrue[pdf]'")
    try:
        font_families(lang, tuple(typst.Fonts().families()))
    except ConfigurationError:
        pytest.skip(f"no Chinese font: apt-get install {FONT_PACKAGE}")
    small = certificate_content(replace(facts, check=None, regions=()), lang=lang)
    made = report_pdf(small)
    assert made.startswith(b"%PDF-")
    assert report_pdf(small) == made


def test_a_chinese_pdf_without_a_font_is_refused_not_printed_as_boxes():
    with pytest.raises(ConfigurationError, match=f"apt-get install {FONT_PACKAGE}"):
        font_families("zh", ("DejaVu Sans", "Libertinus Serif"))
    assert font_families("en", ("Libertinus Serif",)) == ("Libertinus Serif",)
    both = font_families("zh", ("Libertinus Serif", "Noto Sans CJK SC"))
    assert both == ("Libertinus Serif", "Noto Sans CJK SC")


def found(after_mm: list[float], sd_mm: float = 0.02, shift: float = 1e-3) -> Difference:
    n = len(after_mm)
    error = np.zeros((n, 3))
    error[:, 0] = np.array(after_mm) * 1e-3
    return Difference(
        change=np.ones(n, dtype=np.int64),
        line=np.arange(n),
        line_after=np.arange(n),
        shift=np.full((n, 3), shift),
        turn=np.zeros(n),
        error_before=np.full((n, 3), 1e-3),
        error_after=error,
        covariance=np.broadcast_to((sd_mm * 1e-3) ** 2 * np.eye(3), (n, 3, 3)),
    )


def judged(difference: Difference, tolerance_mm: float = 0.2, **options) -> ReportContent:
    return program_content(
        [("part.src", difference)], robot="Arm 7", before="a.src", after="b.src",
        tolerance=tolerance_mm * 1e-3, simulated=True, **options,
    )  # fmt: skip


def test_go_only_where_the_uncertainty_fits_in_too():
    """|e| + U <= T with U = 2.795 sd of a sphere."""
    assert judged(found([0.05, 0.14])).verdict.tone == "good"
    close = judged(found([0.05, 0.15]))
    assert close.verdict.tone == "bad"
    assert "1 of 2 targets are not proven" in close.verdict.text
    counts = {row[0]: row[2] for row in table(close, "Targets by decision").rows}
    assert counts["conforms"] == 1
    assert counts["not decided"] == 1
    assert counts["does not conform"] == 0
    far = judged(found([0.05, 0.3]))
    assert {r[0]: r[2] for r in table(far, "Targets by decision").rows}["does not conform"] == 1


def test_files_of_a_job_have_a_row_each():
    content = program_content(
        [("one.src", found([0.05, 0.15])), ("two.src", found([0.02]))], robot="Arm 7",
        before="job", after="job", tolerance=0.2e-3, simulated=True,
    )  # fmt: skip
    rows = table(content, "Files").rows
    assert [row[:3] for row in rows] == [("one.src", 2, 1), ("two.src", 1, 1)]
    assert rows[0][5] == pytest.approx(0.1)
    assert rows[0][6] == pytest.approx(0.15 + 2.795 * 0.02, abs=1e-4)


def test_a_target_without_a_prediction_is_no_go_and_an_axis_target_is_not_judged():
    lost = found([0.05, np.nan])
    assert judged(lost).verdict.tone == "bad"
    axis = replace(lost, shift=np.array([[0.0, 0.0, 0.0], [np.nan] * 3]))
    content = judged(axis)
    assert content.verdict.tone == "good"
    assert table(content, "Targets by decision").rows[-1][1:] == (1, 1)
    assert "1 axis targets have no Cartesian position" in content.verdict.detail
    assert "轴目标点 1 个" in judged(axis, lang="zh").verdict.detail
    assert "Axis targets" not in judged(found([0.05])).verdict.detail
    every = judged(axis, strict=True)
    assert every.verdict.tone == "bad"
    assert "1 of 2 targets are not proven" in every.verdict.text


def test_axis_targets_alone_prove_nothing():
    axis = replace(found([np.nan, np.nan]), shift=np.full((2, 3), np.nan))
    with pytest.raises(ObservabilityError, match="all of 2 targets state axes"):
        judged(axis)


def test_a_program_without_predictions_is_refused():
    nothing = replace(
        found([0.1]), error_before=np.empty((0, 3)), error_after=np.empty((0, 3)),
        covariance=np.empty((0, 3, 3)),
    )  # fmt: skip
    with pytest.raises(ModelMismatchError, match="no predicted errors"):
        judged(nothing)
    with pytest.raises(ConfigurationError, match="tolerance 0 mm"):
        judged(found([0.1]), tolerance_mm=0.0)


def test_the_worst_target_stands_first():
    rows = table(judged(found([0.05, 0.12, 0.08])), "Worst targets").rows
    assert [row[1] for row in rows] == [1, 2, 0]
    assert rows[0][7] == pytest.approx(0.12 + 2.7955 * 0.02, abs=1e-4)


def test_the_registration_report_carries_rotations_to_a_distance():
    covariance = np.diag([1e-5, 2e-5, 3e-5, 1e-5, 1e-5, 4e-5]) ** 2
    frame = PartFrame(
        name="plate", T_base_part=np.eye(4), covariance=covariance, touches=9,
        outliers=("p3",), rms=2e-5, verdict="GO",
    )  # fmt: skip
    part = PartTable(
        frames=(frame,),
        identity=ModelIdentity(kind="nominal", robot="Arm 7", sha256="ab" * 32),
        method="weighted",
    )
    content = registration_content(part, name="cell.toml", robot="Arm 7")
    assert content.verdict.tone == "good"
    rows = table(content, "Uncertainty at a distance from the origin").rows
    assert rows[0][1] == pytest.approx(0.06)
    # 1 m along x: y moves by the turn about z, and has its own 20 um.
    assert rows[4][1] == pytest.approx(2e3 * np.hypot(4e-5, 2e-5), rel=0.02)
    assert "p3" in " ".join(content.doubts)
    bad = replace(part, frames=(replace(frame, verdict="NO-GO"),))
    assert registration_content(bad, name="c", robot="r").verdict.tone == "bad"
